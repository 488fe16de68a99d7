//! One triangle: the watertight intersection test and what is known at a point of it.
//!
//! Woop, Benthin, Wald 2013, "Watertight Ray/Triangle Intersection". The sign of an edge function depends on the shared corners
//! and the ray only, so two triangles that share an edge never both miss a ray through it. [`Shear::intersect`] is the reference: every
//! SIMD variant in `accel/` gives the same bits.

use crate::math::{DVec3, Vec3};

/// The part of the test that depends on the ray only: a shear that maps the ray to the +z axis. All in permuted axes.
#[derive(Clone, Copy, Debug)]
pub struct Shear {
    /// The permutation: the last axis is that of the direction's largest component.
    pub axes: [usize; 3],
    /// Origin.
    pub o: [f32; 3],
    /// Direction.
    pub d: [f32; 3],
    /// `d.x / d.z`, `d.y / d.z` and `1 / d.z`.
    pub s: [f32; 3],
    /// 1 / d; 0 where `d` is too small to bound the parameter.
    pub inv: [f32; 3],
}

/// Where the ray's line pierces a triangle.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TriangleHit {
    /// Ray parameter, not negative.
    pub t: f32,
    /// Barycentric weights of the second and third corner.
    pub b: [f32; 2],
}

impl Shear {
    /// A direction component this small against the largest moves a ray by less than rounding does within the scene.
    pub const FLAT: f32 = 1e-9;

    /// For a ray whose direction is finite and not zero.
    #[inline(always)]
    pub fn new(o: Vec3, d: Vec3) -> Self {
        let axes = Self::axes(d);
        let (o, d) = (o.to_array(), d.to_array());
        let floor = Self::FLAT * d[axes[2]].abs();
        let inv = d.map(|c| if c.abs() > floor { 1.0 / c } else { 0.0 });
        let d = axes.map(|k| d[k]);
        let inv = axes.map(|k| inv[k]);
        Self { axes, o: axes.map(|k| o[k]), d, s: [d[0] * inv[2], d[1] * inv[2], inv[2]], inv }
    }

    /// The permutation of the axes for a direction. Without jumps, since which component is the largest is as good as random.
    #[inline(always)]
    pub fn axes(d: Vec3) -> [usize; 3] {
        static AXES: [[usize; 3]; 3] = [[1, 2, 0], [2, 0, 1], [0, 1, 2]];
        let a = d.abs();
        let first = usize::from(a.x <= a.y || a.x <= a.z);
        AXES[first * (2 - usize::from(a.y > a.z))]
    }

    /// The triangle's hit at a parameter in (0, `t_max`], `t_max` included, so that ties can be settled. Corners in permuted axes.
    ///
    /// The parameter is never below the ray's entry into the triangle's bounding box (computed here, with its own roundings), so
    /// that a conservative test of any enclosing box may cull by distance without changing which triangle is the nearest.
    #[inline]
    pub fn intersect(&self, a: [f32; 3], b: [f32; 3], c: [f32; 3], t_max: f32) -> Option<TriangleHit> {
        // Corners relative to the origin, then sheared so that the ray is the z axis.
        let relative = |p: [f32; 3]| [p[0] - self.o[0], p[1] - self.o[1], p[2] - self.o[2]];
        let (ra, rb, rc) = (relative(a), relative(b), relative(c));
        let shear = |r: [f32; 3]| (r[0] - self.s[0] * r[2], r[1] - self.s[1] * r[2]);
        let ((ax, ay), (bx, by), (cx, cy)) = (shear(ra), shear(rb), shear(rc));
        // Edge functions; a zero is either exact or lost to underflow or rounding, which double precision tells apart.
        let mut u = cx * by - cy * bx;
        let mut v = ax * cy - ay * cx;
        let mut w = bx * ay - by * ax;
        if u == 0.0 || v == 0.0 || w == 0.0 {
            (u, v, w) = (edge64(cx, by, cy, bx), edge64(ax, cy, ay, cx), edge64(bx, ay, by, ax));
        }
        let inside = (u >= 0.0 && v >= 0.0 && w >= 0.0) || (u <= 0.0 && v <= 0.0 && w <= 0.0);
        let inv_det = 1.0 / (u + v + w);
        if !inside || !inv_det.is_finite() {
            return None;
        }
        // Distance, at least that of the entry into the triangle's box.
        let enter = |k: usize| (ra[k] * self.inv[k]).min(rb[k] * self.inv[k]).min(rc[k] * self.inv[k]);
        let (near_z, far_z) = (enter(2), (ra[2] * self.inv[2]).max(rb[2] * self.inv[2]).max(rc[2] * self.inv[2]));
        let t = if near_z > 0.0 {
            (u * ra[2] + v * rb[2] + w * rc[2]) * self.s[2] * inv_det
        } else if far_z <= 0.0 {
            return None;
        } else {
            // The origin lies between the corners along the ray: rounding must not decide the side.
            self.plane_distance(a, b, c)?
        };
        let t = t.max(near_z).max(enter(0)).max(enter(1)).max(0.0);
        (t <= t_max).then_some(TriangleHit { t, b: [v * inv_det, w * inv_det] })
    }

    /// Ray parameter of the triangle's plane when it is positive, in double precision. Corners in permuted axes.
    #[inline(always)]
    pub fn plane_distance(&self, a: [f32; 3], b: [f32; 3], c: [f32; 3]) -> Option<f32> {
        let wide = |x: [f32; 3]| DVec3::new(f64::from(x[0]), f64::from(x[1]), f64::from(x[2]));
        let o = wide(self.o);
        let (a, b, c) = (wide(a) - o, wide(b) - o, wide(c) - o);
        let n = (b - a).cross(c - a);
        let (over, under) = (n.dot(a), n.dot(wide(self.d)));
        // A ray that leaves a surface asks it first of all; it is behind, and a division is slow.
        if (over > 0.0) != (under > 0.0) {
            return None;
        }
        let t = over / under;
        (t > 0.0 && t.is_finite()).then_some(t as f32)
    }
}

/// `a b - c d` with the right sign.
#[inline]
fn edge64(a: f32, b: f32, c: f32, d: f32) -> f32 {
    (f64::from(a) * f64::from(b) - f64::from(c) * f64::from(d)) as f32
}
