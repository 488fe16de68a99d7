//! The hull of segments that run close together, and what of a tree can lie in it.
//!
//! Haines, Wallace 1994, "Shaft Culling for Efficient Ray-Cast Radiosity": all segments lie in the hull of two boxes, one around their
//! origins, one around their ends. Seen along an axis that is the hull of two rectangles: the rectangle around both, less the corners
//! that the lines between their own corners cut off.

use super::node::{Leaf, Node};
use super::ray::splat3;
use super::simd::Lanes;
use crate::math::{Ray, Vec3};

/// Relative to the largest coordinate: twice what the box test of single rays allows for, whose reasons hold here.
const PAD: f32 = 32.0 * f32::EPSILON;
/// Relative to the largest coordinate: the roundings of what follows.
const SLACK: f32 = 64.0 * f32::EPSILON;
/// Lines that cut corners off: at most four for each of three views.
const MAX_CUTS: usize = 12;

/// The hull of some segments. Nothing that any of them can hit, roundings included, lies outside.
#[derive(Debug)]
pub(super) struct Shaft {
    low: Vec3,
    high: Vec3,
    cuts: [Cut; MAX_CUTS],
    count: usize,
    /// Centre and half extents of the two boxes.
    boxes: [(Vec3, Vec3); 2],
    /// Bound of coordinates and of distances between points.
    span: f32,
}

/// Boxes lie outside whose corner of coordinates `rows` has `n . corner > c`.
#[derive(Clone, Copy, Debug, Default)]
struct Cut {
    rows: [usize; 2],
    n: [f32; 2],
    c: f32,
}

impl Shaft {
    /// Of segments in a tree whose largest coordinate is `reach`; `None` if one of them has no end, or is none.
    pub fn new(rays: &[Ray], reach: f32) -> Option<Self> {
        let nothing = (Vec3::INFINITY, Vec3::NEG_INFINITY);
        let grow = |b: (Vec3, Vec3), p: Vec3| (b.0.min(p), b.1.max(p));
        let (mut from, mut to) = (nothing, nothing);
        let mut sum = Vec3::ZERO;
        for ray in rays {
            let (o, end) = (ray.o, ray.o + ray.d * ray.t_max);
            (from, to) = (grow(from, o), grow(to, end));
            sum += o + end;
        }
        let (low, high) = (from.0.min(to.0), from.1.max(to.1));
        let span = 2.0 * (reach + low.abs().max(high.abs()).max_element());
        // Bounds forget NaN, the sum does not.
        if !(span.is_finite() && sum.is_finite()) {
            return None;
        }
        let pad = Vec3::splat(PAD * span);
        let padded = |b: (Vec3, Vec3)| (b.0 - pad, b.1 + pad);
        let (from, to) = (padded(from), padded(to));
        let centred = |b: (Vec3, Vec3)| ((b.0 + b.1) * 0.5, (b.1 - b.0) * 0.5 + pad);
        let (cuts, count) = ([Cut::default(); MAX_CUTS], 0);
        let (low, high) = (low - pad, high + pad);
        let mut shaft = Self { low, high, cuts, count, boxes: [centred(from), centred(to)], span };
        for (i, j) in [(0, 1), (1, 2), (2, 0)] {
            for corner in 0..4 {
                let sides = [corner & 1, corner >> 1];
                let pick = |b: (Vec3, Vec3)| [[b.0, b.1][sides[0]][i], [b.0, b.1][sides[1]][j]];
                shaft.cut([i, j], sides, pick(from), pick(to));
            }
        }
        Some(shaft)
    }

    /// Adds the line through the corners `p` and `q` of the two rectangles, if it cuts something off. `sides`: of axes `i` and `j`, the
    /// low (0) or the high one (1).
    fn cut(&mut self, axes: [usize; 2], sides: [usize; 2], p: [f32; 2], q: [f32; 2]) {
        let outwards = sides.map(|s| if s == 0 { -1.0f32 } else { 1.0 });
        let d = [q[0] - p[0], q[1] - p[1]];
        // One rectangle reaches farther along one axis, the other along the other.
        if outwards[0] * d[0] * outwards[1] * d[1] >= 0.0 {
            return;
        }
        let scale = 1.0 / d[0].abs().max(d[1].abs());
        let n = [outwards[0] * d[1].abs() * scale, outwards[1] * d[0].abs() * scale];
        let c = n[0] * p[0] + n[1] * p[1] + SLACK * self.span;
        // Of a box the corner that lies farthest inwards.
        let rows = [2 * axes[0] + (1 - sides[0]), 2 * axes[1] + (1 - sides[1])];
        self.cuts[self.count] = Cut { rows, n, c };
        self.count += 1;
    }
}

/// A shaft prepared for eight boxes or triangles at a time.
pub(super) struct ShaftLanes<'a, L: Lanes> {
    shaft: &'a Shaft,
    low: [L::F; 3],
    high: [L::F; 3],
}

impl<'a, L: Lanes> ShaftLanes<'a, L> {
    #[inline(always)]
    pub fn new(shaft: &'a Shaft) -> Self {
        Self { shaft, low: splat3::<L>(shaft.low.to_array()), high: splat3::<L>(shaft.high.to_array()) }
    }

    /// The children of a node that may lie inside, a bit for each.
    #[inline(always)]
    pub fn children(&self, node: &Node) -> u32 {
        !self.outside(&node.planes) & 0xff
    }

    /// Boxes that lie outside.
    #[inline(always)]
    fn outside(&self, planes: &[[f32; 8]; 6]) -> u32 {
        let mut outside = 0;
        for k in 0..3 {
            outside |= L::lt(self.high[k], L::load(&planes[2 * k])) | L::lt(L::load(&planes[2 * k + 1]), self.low[k]);
        }
        for cut in &self.shaft.cuts[..self.shaft.count] {
            let (x, y) = (L::load(&planes[cut.rows[0] % 6]), L::load(&planes[cut.rows[1] % 6]));
            let over = L::mul_add(y, L::splat(cut.n[1]), L::mul(x, L::splat(cut.n[0])));
            outside |= L::lt(L::splat(cut.c), over);
        }
        outside
    }

    /// The triangles of a leaf that may lie inside, and cross the way from one box to the other.
    #[inline(always)]
    pub fn triangles(&self, leaf: &Leaf) -> u32 {
        let (ia, ib, ic) = (L::lanes(&leaf.corners[0]), L::lanes(&leaf.corners[1]), L::lanes(&leaf.corners[2]));
        let zero = L::splat(0.0);
        let (mut planes, mut a, mut e, mut f) = ([[0.0; 8]; 6], [zero; 3], [zero; 3], [zero; 3]);
        for k in 0..3 {
            let v = L::load(&leaf.vertices[k]);
            let (b, c) = (L::permute(v, ib), L::permute(v, ic));
            a[k] = L::permute(v, ia);
            planes[2 * k] = L::store(L::min(L::min(a[k], b), c));
            planes[2 * k + 1] = L::store(L::max(L::max(a[k], b), c));
            (e[k], f[k]) = (L::sub(b, a[k]), L::sub(c, a[k]));
        }
        let inside = leaf.used & !self.outside(&planes);
        if inside == 0 { 0 } else { inside & !self.aside(&a, &e, &f) }
    }

    /// Triangles with both boxes on the same side of their planes: `a` is a corner, `e` and `f` the edges from there.
    #[inline(always)]
    fn aside(&self, a: &[L::F; 3], e: &[L::F; 3], f: &[L::F; 3]) -> u32 {
        let zero = L::splat(0.0);
        let n = [minor::<L>(e, f, 1, 2), minor::<L>(e, f, 2, 0), minor::<L>(e, f, 0, 1)];
        let margin = L::mul(L::mul(size::<L>(e), size::<L>(f)), L::splat(SLACK * self.shaft.span));
        let (mut over, mut under) = (0xff, 0xff);
        for (centre, half) in &self.shaft.boxes {
            let (mut height, mut extent) = (zero, margin);
            for k in 0..3 {
                height = L::add(height, L::mul(n[k], L::sub(L::splat(centre[k]), a[k])));
                extent = L::add(extent, L::mul(abs::<L>(n[k]), L::splat(half[k])));
            }
            over &= L::lt(extent, height);
            under &= L::lt(extent, L::sub(zero, height));
        }
        over | under
    }
}

#[inline(always)]
pub(super) fn abs<L: Lanes>(x: L::F) -> L::F {
    L::max(x, L::sub(L::splat(0.0), x))
}

/// The largest absolute coordinate.
#[inline(always)]
fn size<L: Lanes>(v: &[L::F; 3]) -> L::F {
    L::max(L::max(abs::<L>(v[0]), abs::<L>(v[1])), abs::<L>(v[2]))
}

/// A coordinate of the cross product of `e` and `f`.
#[inline(always)]
fn minor<L: Lanes>(e: &[L::F; 3], f: &[L::F; 3], j: usize, k: usize) -> L::F {
    L::sub(L::mul(e[j], f[k]), L::mul(e[k], f[j]))
}
