//! The sphere: intersection and surface points, in double precision around its world-space centre.

use super::Object;
use super::surface::{SurfacePoint, rounding};
use crate::math::{DVec3, Frame, Ray, Vec2, Vec3, atan2, safe_acos, safe_sqrt, sin_cos};
use std::f32::consts::PI;

/// Centre and radius of a sphere object in the world. Everything about the sphere is computed from these two.
#[inline]
pub(super) fn world(object: &Object) -> (Vec3, f32) {
    let m = object.to_world.matrix();
    (m.translation.as_vec3(), m.matrix3.x_axis.length() as f32)
}

/// The smaller positive root of `|o + t d - c| = r` that is at most `t_max`.
///
/// Double precision decides on which side of the surface an f32 origin lies; the discriminant is Hearn and Baker's
/// (Haines et al. 2019, "Precision Improvements for Ray/Sphere Intersection"), which does not cancel for small distant spheres.
#[inline]
pub fn intersect(centre: Vec3, radius: f32, ray: &Ray) -> Option<f32> {
    let d = ray.d.as_dvec3();
    let f = ray.o.as_dvec3() - centre.as_dvec3();
    let r = f64::from(radius);
    let a = d.length_squared();
    let b = -f.dot(d);
    let nearest = f + d * (b / a);
    let disc = r * r - nearest.length_squared();
    if !(disc >= 0.0) {
        return None;
    }
    // Roots without cancellation.
    let c = f.length_squared() - r * r;
    let q = b + (a * disc).sqrt().copysign(b);
    let (t0, t1) = if q == 0.0 { (0.0, 0.0) } else { (c / q, q / a) };
    let (t0, t1) = if t0 <= t1 { (t0, t1) } else { (t1, t0) };
    let t = if t0 > 0.0 { t0 } else { t1 };
    let t32 = t as f32;
    (t > 0.0 && t32 <= ray.t_max && t32.is_finite()).then_some(t32)
}

/// The surface point that a ray meets at about parameter `t`.
pub(super) fn at_hit(object: &Object, ray: &Ray, t: f32) -> SurfacePoint {
    let (centre, _) = world(object);
    at(object, ray.o.as_dvec3() + ray.d.as_dvec3() * f64::from(t) - centre.as_dvec3())
}

/// The surface point in direction `outward` from the centre. Pole +z, u = azimuth / 2 pi, v = angle from the pole / pi
/// (Mitsuba 3, `sphere.cpp`).
pub(super) fn at(object: &Object, outward: DVec3) -> SurfacePoint {
    let (centre, radius) = world(object);
    let n = outward.normalize_or(DVec3::Z);
    let p = (centre.as_dvec3() + n * f64::from(radius)).as_vec3();
    let out = n.as_vec3();
    let ng = if object.flip_normals { -out } else { out };
    // Texture coordinates in object space.
    let local = object.to_world.inverse_vector(out).normalize_or(Vec3::Z);
    let phi = atan2(local.y, local.x);
    let u = phi / (2.0 * PI);
    let uv = Vec2::new(if u < 0.0 { u + 1.0 } else { u }, safe_acos(local.z) / PI);
    // Derivatives; at the poles, where u has none, any frame.
    let across = local.x * local.x + local.y * local.y;
    let (dpdu, dpdv) = if across > 0.0 {
        let inv = 1.0 / across.sqrt();
        let dpdu = Vec3::new(-local.y, local.x, 0.0) * (2.0 * PI);
        let dpdv = Vec3::new(local.z * local.x * inv, local.z * local.y * inv, -across.sqrt()) * PI;
        (object.to_world.vector(dpdu), object.to_world.vector(dpdv))
    } else {
        let frame = Frame::from_normal(ng);
        (frame.s * radius, frame.t * radius)
    };
    let frame = Frame::from_normal_tangent(ng, dpdu);
    SurfacePoint { p, p_error: rounding(p), ng, frame, uv, dpdu, dpdv }
}

/// Direction uniform on the sphere for `u` in the unit square.
pub(super) fn uniform_direction(u: Vec2) -> DVec3 {
    let z = 1.0 - 2.0 * u.x;
    let r = safe_sqrt(1.0 - z * z);
    let (sin, cos) = sin_cos(2.0 * PI * u.y);
    Vec3::new(r * cos, r * sin, z).as_dvec3()
}
