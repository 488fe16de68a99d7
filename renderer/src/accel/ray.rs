//! A ray prepared for boxes and triangles, and the test of eight boxes.

use super::node::Node;
use super::simd::Lanes;
use crate::geometry::triangle::Shear;
use crate::math::Vec3;

/// Relative to the largest coordinate: covers the roundings of the box test (four operations on numbers of that size, fused or
/// not) and those of the sheared corners of the triangle test (three), twice over.
const PAD: f32 = 16.0 * f32::EPSILON;

/// A ray prepared for box tests: `t = plane * inv + offset`, with padded offsets.
///
/// Conservative (after Ize 2013, "Robust BVH Ray Traversal"): a box that holds a triangle which [`Shear`]'s test hits is never
/// missed, and its entry never lies behind the hit. The padding is absolute, so that negative zeros, planes through the origin
/// and distances near zero need no cases of their own.
#[derive(Clone, Copy, Debug)]
pub(super) struct BoxRay {
    inv: [f32; 3],
    near: [f32; 3],
    far: [f32; 3],
    /// 1 where the direction is negative.
    negative: [usize; 3],
}

/// Both forms of a ray. Without jumps, since which axis is the largest is as good as random.
#[inline(always)]
pub(super) fn prepare(o: Vec3, d: Vec3, reach: f32) -> (BoxRay, Shear) {
    let axes = Shear::axes(d);
    let (o, d) = (o.to_array(), d.to_array());
    let a = [d[0].abs(), d[1].abs(), d[2].abs()];
    let floor = Shear::FLAT * a[axes[2]];
    let steep = [a[0] > floor, a[1] > floor, a[2] > floor];
    let pick = |k: usize| if steep[k] { d[k] } else { floor.copysign(d[k]) };
    let inv = [1.0 / pick(0), 1.0 / pick(1), 1.0 / pick(2)];
    let tri =
        [if steep[0] { inv[0] } else { 0.0 }, if steep[1] { inv[1] } else { 0.0 }, if steep[2] { inv[2] } else { 0.0 }];
    let pad = PAD * (larger(larger(o[0].abs(), o[1].abs()), o[2].abs()) + reach);
    let p = [pad * inv[0].abs(), pad * inv[1].abs(), pad * inv[2].abs()];
    let q = [o[0] * inv[0], o[1] * inv[1], o[2] * inv[2]];
    let boxes = BoxRay {
        inv,
        near: [-q[0] - p[0], -q[1] - p[1], -q[2] - p[2]],
        far: [p[0] - q[0], p[1] - q[1], p[2] - q[2]],
        negative: [(d[0].to_bits() >> 31) as usize, (d[1].to_bits() >> 31) as usize, (d[2].to_bits() >> 31) as usize],
    };
    let [kx, ky, kz] = axes;
    let (dx, dy, iz) = (d[kx], d[ky], inv[kz]);
    let shear = Shear {
        axes,
        o: [o[kx], o[ky], o[kz]],
        d: [dx, dy, d[kz]],
        s: [dx * iz, dy * iz, iz],
        inv: [tri[kx], tri[ky], iz],
    };
    (boxes, shear)
}

/// The larger of two numbers that are not NaN, in one instruction.
#[inline(always)]
fn larger(a: f32, b: f32) -> f32 {
    if a > b { a } else { b }
}

#[inline(always)]
pub(super) fn splat3<L: Lanes>(x: [f32; 3]) -> [L::F; 3] {
    [L::splat(x[0]), L::splat(x[1]), L::splat(x[2])]
}

/// The same, in lanes.
pub(super) struct BoxLanes<L: Lanes> {
    inv: [L::F; 3],
    near: [L::F; 3],
    far: [L::F; 3],
    near_rows: [Row<6>; 3],
    far_rows: [Row<6>; 3],
}

/// A row of eight numbers among those that a node or leaf begins with, as its distance in bytes.
#[derive(Clone, Copy)]
pub(super) struct Row<const ROWS: usize>(usize);

impl<const ROWS: usize> Row<ROWS> {
    #[inline(always)]
    pub fn new(row: usize) -> Self {
        assert!(row < ROWS);
        Self(32 * row)
    }

    #[inline(always)]
    pub fn of(self, rows: &[[f32; 8]; ROWS]) -> &[f32; 8] {
        // SAFETY: 32 bytes times a number below `ROWS`.
        #[allow(unsafe_code, reason = "a row chosen by the ray's signs, without jumps, for every box")]
        unsafe {
            &*std::ptr::from_ref(rows).cast::<u8>().add(self.0).cast()
        }
    }
}

impl<L: Lanes> BoxLanes<L> {
    #[inline(always)]
    pub fn new(r: &BoxRay) -> Self {
        let n = [r.negative[0] & 1, 2 + (r.negative[1] & 1), 4 + (r.negative[2] & 1)];
        Self {
            inv: splat3::<L>(r.inv),
            near: splat3::<L>(r.near),
            far: splat3::<L>(r.far),
            near_rows: [Row::new(n[0]), Row::new(n[1]), Row::new(n[2])],
            far_rows: [Row::new(n[0] ^ 1), Row::new(n[1] ^ 1), Row::new(n[2] ^ 1)],
        }
    }

    /// Which boxes the ray meets in [0, `t_max`], and where it enters them.
    #[inline(always)]
    pub fn test(&self, node: &Node, t_max: L::F) -> (L::M, u32, L::F) {
        let enter_x = L::mul_add(L::load(self.near_rows[0].of(&node.planes)), self.inv[0], self.near[0]);
        let enter_y = L::mul_add(L::load(self.near_rows[1].of(&node.planes)), self.inv[1], self.near[1]);
        let enter_z = L::mul_add(L::load(self.near_rows[2].of(&node.planes)), self.inv[2], self.near[2]);
        let leave_x = L::mul_add(L::load(self.far_rows[0].of(&node.planes)), self.inv[0], self.far[0]);
        let leave_y = L::mul_add(L::load(self.far_rows[1].of(&node.planes)), self.inv[1], self.far[1]);
        let leave_z = L::mul_add(L::load(self.far_rows[2].of(&node.planes)), self.inv[2], self.far[2]);
        let enter = L::max(L::max(enter_x, enter_y), L::max(enter_z, L::splat(0.0)));
        let leave = L::min(L::min(leave_x, leave_y), L::min(leave_z, t_max));
        let (hit, bits) = L::le_lanes(enter, leave);
        (hit, bits, enter)
    }
}
