//! The test of a leaf's triangles, eight at once. The hits are those of [`Shear::intersect`], bit for bit.

use super::node::Leaf;
use super::ray::{Row, splat3};
use super::simd::Lanes;
use crate::geometry::triangle::{Shear, TriangleHit};

/// A ray prepared for eight triangles at a time.
pub(super) struct ShearLanes<'a, L: Lanes> {
    shear: &'a Shear,
    axes: [Row<3>; 3],
    o: [L::F; 3],
    s: [L::F; 3],
    inv: [L::F; 2],
}

/// What the ray hits in a leaf.
pub(super) struct LeafHits<L: Lanes> {
    /// Lanes with a hit, complete.
    pub easy: u32,
    /// Lanes that lack the distance: the origin lies between their corners along the ray.
    pub around: u32,
    /// Lanes that only the reference test can decide.
    pub hard: u32,
    /// The distance.
    pub t: L::F,
    /// The least distance that a lane can have.
    pub least_t: L::F,
    /// The weights of the second and third corner.
    pub b: [L::F; 2],
}

impl<'a, L: Lanes> ShearLanes<'a, L> {
    #[inline(always)]
    pub fn new(shear: &'a Shear) -> Self {
        Self {
            shear,
            axes: [Row::new(shear.axes[0]), Row::new(shear.axes[1]), Row::new(shear.axes[2])],
            o: splat3::<L>(shear.o),
            s: splat3::<L>(shear.s),
            inv: [L::splat(shear.inv[0]), L::splat(shear.inv[1])],
        }
    }

    /// Eight triangles at once.
    #[inline(always)]
    pub fn test(&self, leaf: &Leaf, t_max: f32) -> Option<LeafHits<L>> {
        let [kx, ky, kz] = self.axes;
        let [sx, sy, sz] = self.s;
        let rz = L::sub(L::load(kz.of(&leaf.vertices)), self.o[2]);
        let rx = L::sub(L::load(kx.of(&leaf.vertices)), self.o[0]);
        let ry = L::sub(L::load(ky.of(&leaf.vertices)), self.o[1]);
        let x = L::sub(rx, L::mul(sx, rz));
        let y = L::sub(ry, L::mul(sy, rz));
        let (ia, ib, ic) = (L::lanes(&leaf.corners[0]), L::lanes(&leaf.corners[1]), L::lanes(&leaf.corners[2]));
        let (ax, ay) = (L::permute(x, ia), L::permute(y, ia));
        let (bx, by) = (L::permute(x, ib), L::permute(y, ib));
        let (cx, cy) = (L::permute(x, ic), L::permute(y, ic));
        let edges = Edges::<L>::new([ax, bx, cx], [ay, by, cy], leaf.used)?;
        let z = [L::permute(rz, ia), L::permute(rz, ib), L::permute(rz, ic)];
        let (ex, ey) = (L::mul(rx, self.inv[0]), L::mul(ry, self.inv[1]));
        let near_x = L::min(L::min(L::permute(ex, ia), L::permute(ex, ib)), L::permute(ex, ic));
        let near_y = L::min(L::min(L::permute(ey, ia), L::permute(ey, ib)), L::permute(ey, ic));
        Some(edges.hits(z, sz, L::max(near_x, near_y), L::splat(t_max)))
    }

    /// The distance of a lane around the origin, as the reference test has it.
    #[inline(always)]
    pub fn distance(&self, leaf: &Leaf, lane: usize, least: f32) -> Option<f32> {
        let [a, b, c] = corners(&self.axes, leaf, lane);
        Some(self.shear.plane_distance(a, b, c)?.max(least))
    }

    /// The reference test on one lane.
    #[inline(never)]
    pub fn reference(&self, leaf: &Leaf, lane: usize, t_max: f32) -> Option<TriangleHit> {
        let [a, b, c] = corners(&self.axes, leaf, lane);
        self.shear.intersect(a, b, c, t_max)
    }
}

/// The edge functions of triangles that surround the ray's line, on at least one lane.
pub(super) struct Edges<L: Lanes> {
    u: L::F,
    v: L::F,
    w: L::F,
    inside: u32,
    strictly: u32,
}

impl<L: Lanes> Edges<L> {
    /// Of sheared corners; `None` if no lane of those in `used` surrounds the line.
    #[inline(always)]
    pub fn new([ax, bx, cx]: [L::F; 3], [ay, by, cy]: [L::F; 3], used: u32) -> Option<Self> {
        let u = L::sub(L::mul(cx, by), L::mul(cy, bx));
        let v = L::sub(L::mul(ax, cy), L::mul(ay, cx));
        let w = L::sub(L::mul(bx, ay), L::mul(by, ax));
        let zero = L::splat(0.0);
        let (least, most) = (L::min(L::min(u, v), w), L::max(L::max(u, v), w));
        let inside = (L::le(zero, least) | L::le(most, zero)) & used;
        if inside == 0 {
            return None;
        }
        let strictly = L::lt(zero, least) | L::lt(most, zero);
        Some(Self { u, v, w, inside, strictly })
    }

    /// Where they are hit: `z` are the corners along the ray relative to its origin, `sz` what makes distances of them, `near` the entry
    /// into the triangles' extents along the other axes.
    #[inline(always)]
    pub fn hits(&self, [az, bz, cz]: [L::F; 3], sz: L::F, near: L::F, t_max: L::F) -> LeafHits<L> {
        let Self { u, v, w, inside, strictly } = *self;
        let zero = L::splat(0.0);
        let (ez_a, ez_b, ez_c) = (L::mul(az, sz), L::mul(bz, sz), L::mul(cz, sz));
        let near_z = L::min(L::min(ez_a, ez_b), ez_c);
        let far_z = L::max(L::max(ez_a, ez_b), ez_c);
        let in_front = L::lt(zero, near_z);
        let not_behind = L::lt(zero, far_z);
        let inv_det = L::div(L::splat(1.0), L::add(L::add(u, v), w));
        let t = L::mul(L::mul(L::add(L::add(L::mul(u, az), L::mul(v, bz)), L::mul(w, cz)), sz), inv_det);
        let least_t = L::max(L::max(near_z, near), zero);
        let finite = L::le(t, L::splat(f32::MAX));
        let t = L::max(t, least_t);
        let easy = inside & strictly & in_front & finite & L::le(t, t_max);
        let solid = L::le(L::splat(-f32::MAX), inv_det) & L::le(inv_det, L::splat(f32::MAX));
        let around = inside & strictly & not_behind & solid & !in_front;
        let hard = inside & not_behind & !strictly;
        let b = [L::mul(v, inv_det), L::mul(w, inv_det)];
        LeafHits { easy, around, hard, t, least_t, b }
    }
}

/// The corners of a leaf's triangle in permuted axes.
#[inline(always)]
fn corners(axes: &[Row<3>; 3], leaf: &Leaf, lane: usize) -> [[f32; 3]; 3] {
    let [x, y, z] = [axes[0].of(&leaf.vertices), axes[1].of(&leaf.vertices), axes[2].of(&leaf.vertices)];
    let lane = lane & 7;
    let [a, b, c] = [&leaf.corners[0], &leaf.corners[1], &leaf.corners[2]];
    let [a, b, c] = [usize::from(a[lane] & 7), usize::from(b[lane] & 7), usize::from(c[lane] & 7)];
    [[x[a], y[a], z[a]], [x[b], y[b], z[b]], [x[c], y[c], z[c]]]
}
