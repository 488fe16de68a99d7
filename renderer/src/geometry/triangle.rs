//! One triangle: the watertight intersection test and what is known at a point of it.
//!
//! Woop, Benthin, Wald 2013, "Watertight Ray/Triangle Intersection". The sign of an edge function depends on the shared corners
//! and the ray only, so two triangles that share an edge never both miss a ray through it. [`intersect`] is the reference: every
//! SIMD variant in `accel/` gives the same bits.

use crate::math::Vec3;

/// The part of the test that depends on the ray only: a shear that maps the ray to the +z axis.
#[derive(Clone, Copy, Debug)]
pub struct Shear {
    /// Origin.
    pub o: Vec3,
    /// Direction.
    pub d: Vec3,
    /// Axis of the largest component of the direction, last of the cyclic triple (x, y, z).
    pub axes: [usize; 3],
    /// `d.x / d.z`, `d.y / d.z` and `1 / d.z` in permuted axes.
    pub s: [f32; 3],
    /// 1 / d, in permuted axes; 0 where `d` is too small to have an inverse.
    pub inv: [f32; 3],
}

impl Shear {
    /// For a ray whose direction is finite and not zero.
    #[inline(always)]
    pub fn new(o: Vec3, d: Vec3) -> Self {
        let a = d.abs();
        let kz = if a.x > a.y {
            if a.x > a.z { 0 } else { 2 }
        } else if a.y > a.z {
            1
        } else {
            2
        };
        let axes = [[1, 2, 0], [2, 0, 1], [0, 1, 2]][kz];
        let d = d.to_array();
        let [x, y, z] = [d[axes[0]], d[axes[1]], d[axes[2]]];
        // An axis along which the ray hardly moves can't bound its parameter.
        let inverse = |c: f32| if c.abs() > 1e-12 * z.abs() { 1.0 / c } else { 0.0 };
        let sz = 1.0 / z;
        Self { o, d: Vec3::from_array(d), axes, s: [x * sz, y * sz, sz], inv: [inverse(x), inverse(y), sz] }
    }
}

/// Where the ray's line pierces a triangle.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TriangleHit {
    /// Ray parameter, not negative.
    pub t: f32,
    /// Barycentric weights of the second and third corner.
    pub b: [f32; 2],
}

/// The nearest point of the triangle `p` on the ray, at a parameter in (0, `t_max`] (inclusive, so that ties can be settled).
///
/// The parameter is never below the ray's entry into the triangle's bounding box, computed with the same roundings, so that a
/// conservative test of any enclosing box may cull by distance without changing which triangle is the nearest.
#[inline]
pub fn intersect(ray: &Shear, p: &[Vec3; 3], t_max: f32) -> Option<TriangleHit> {
    let [kx, ky, kz] = ray.axes;
    let [sx, sy, sz] = ray.s;
    // Corners relative to the origin, sheared so that the ray is the z axis.
    let v = p.map(|p| (p - ray.o).to_array());
    let [(ax, ay, az), (bx, by, bz), (cx, cy, cz)] = v.map(|v| (v[kx] - sx * v[kz], v[ky] - sy * v[kz], v[kz]));
    // Edge functions; a zero is either exact or lost to underflow or rounding, which double precision tells apart.
    let mut u = cx * by - cy * bx;
    let mut v_ = ax * cy - ay * cx;
    let mut w = bx * ay - by * ax;
    if u == 0.0 || v_ == 0.0 || w == 0.0 {
        u = edge64(cx, by, cy, bx);
        v_ = edge64(ax, cy, ay, cx);
        w = edge64(bx, ay, by, ax);
    }
    let inside = (u >= 0.0 && v_ >= 0.0 && w >= 0.0) || (u <= 0.0 && v_ <= 0.0 && w <= 0.0);
    let det = u + v_ + w;
    if !inside || det == 0.0 {
        return None;
    }
    // Distance, at least that of the entry into the triangle's box.
    let inv_det = 1.0 / det;
    let enter = |k: usize| {
        let i = ray.inv[k];
        let k = ray.axes[k];
        min3(v[0][k] * i, v[1][k] * i, v[2][k] * i)
    };
    let (near_z, far_z) = (enter(2), max3(az * sz, bz * sz, cz * sz));
    let near = enter(0).max(enter(1)).max(near_z);
    let t = (((u * az + v_ * bz + w * cz) * sz) * inv_det).max(near);
    let t = if near_z > 0.0 {
        t
    } else if far_z <= 0.0 {
        return None;
    } else {
        // The origin lies between the corners along the ray: rounding must not decide the side.
        exact_t(ray, p)?.max(near)
    };
    (t <= t_max && inv_det.is_finite()).then_some(TriangleHit { t, b: [v_ * inv_det, w * inv_det] })
}

/// Ray parameter of the triangle's plane when it is positive, from the corners in double precision.
#[inline(never)]
pub fn exact_t(ray: &Shear, p: &[Vec3; 3]) -> Option<f32> {
    let o = ray.o.as_dvec3();
    let [a, b, c] = p.map(|p| p.as_dvec3() - o);
    let n = (b - a).cross(c - a);
    let t = n.dot(a) / n.dot(ray.d.as_dvec3());
    (t > 0.0 && t.is_finite()).then_some(t as f32)
}

/// `a b - c d` with the right sign.
#[inline]
fn edge64(a: f32, b: f32, c: f32, d: f32) -> f32 {
    (f64::from(a) * f64::from(b) - f64::from(c) * f64::from(d)) as f32
}

#[inline]
fn min3(a: f32, b: f32, c: f32) -> f32 {
    a.min(b).min(c)
}

#[inline]
fn max3(a: f32, b: f32, c: f32) -> f32 {
    a.max(b).max(c)
}
