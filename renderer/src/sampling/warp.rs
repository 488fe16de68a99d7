//! Maps from the unit square to the domains of rendering, with their densities.

use crate::math::{INV_2PI, INV_4PI, INV_PI, ONE_MINUS_EPSILON, Vec2, Vec3, atan2, safe_sqrt, sin_cos};
use std::f32::consts::{FRAC_PI_2, FRAC_PI_4, PI};

/// Uniform point of the unit disk; neighbours stay neighbours (Shirley and Chiu 1997).
#[inline]
pub fn concentric_disk(u: Vec2) -> Vec2 {
    let o = 2.0 * u - Vec2::ONE;
    if o == Vec2::ZERO {
        return Vec2::ZERO;
    }
    if o.x.abs() > o.y.abs() {
        let (sin, cos) = sin_cos(FRAC_PI_4 * (o.y / o.x));
        o.x * Vec2::new(cos, sin)
    } else {
        let (sin, cos) = sin_cos(FRAC_PI_4 * (o.x / o.y));
        o.y * Vec2::new(sin, cos)
    }
}

/// The point of the unit square that [`concentric_disk`] maps to `p`.
pub fn concentric_disk_inverse(p: Vec2) -> Vec2 {
    let r = p.length();
    if r == 0.0 {
        return Vec2::splat(0.5);
    }
    let o = if p.x.abs() > p.y.abs() {
        let r = r.copysign(p.x);
        Vec2::new(r, r * atan2(p.y / r, p.x / r) / FRAC_PI_4)
    } else {
        let r = r.copysign(p.y);
        Vec2::new(r * (FRAC_PI_2 - atan2(p.y / r, p.x / r)) / FRAC_PI_4, r)
    };
    (0.5 * (o + Vec2::ONE)).clamp(Vec2::ZERO, Vec2::splat(ONE_MINUS_EPSILON))
}

/// Density of [`concentric_disk`] per area of the unit disk.
pub const UNIFORM_DISK_PDF: f32 = INV_PI;

/// Direction of the upper hemisphere with density `cos / pi`.
#[inline]
pub fn cosine_hemisphere(u: Vec2) -> Vec3 {
    let d = concentric_disk(u);
    d.extend(safe_sqrt(1.0 - d.length_squared()))
}

/// Density of [`cosine_hemisphere`] per solid angle.
#[inline]
pub fn cosine_hemisphere_pdf(cos_theta: f32) -> f32 {
    cos_theta.max(0.0) * INV_PI
}

/// Uniform direction of the upper hemisphere.
#[inline]
pub fn uniform_hemisphere(u: Vec2) -> Vec3 {
    uniform_cone(u, 1.0)
}

/// Density of [`uniform_hemisphere`] per solid angle.
pub const UNIFORM_HEMISPHERE_PDF: f32 = INV_2PI;

/// Uniform direction.
#[inline]
pub fn uniform_sphere(u: Vec2) -> Vec3 {
    uniform_cone(u, 2.0)
}

/// Density of [`uniform_sphere`] per solid angle.
pub const UNIFORM_SPHERE_PDF: f32 = INV_4PI;

/// Uniform direction of the cone around +z whose half angle has the cosine `1 - one_minus_cos_max`.
///
/// It takes `1 - cos`, which f32 can hold for the smallest cones (the cosine itself rounds to one below 2.4e-4 rad);
/// [`one_minus_cos`] finds it from the sine.
#[inline]
pub fn uniform_cone(u: Vec2, one_minus_cos_max: f32) -> Vec3 {
    let one_minus_z = u.x * one_minus_cos_max;
    let r = safe_sqrt(one_minus_z * (2.0 - one_minus_z));
    let (sin, cos) = sin_cos(2.0 * PI * u.y);
    Vec3::new(r * cos, r * sin, 1.0 - one_minus_z)
}

/// Density of [`uniform_cone`] per solid angle.
#[inline]
pub fn uniform_cone_pdf(one_minus_cos_max: f32) -> f32 {
    INV_2PI / one_minus_cos_max
}

/// `1 - cos` of an angle of at most 90 degrees from its squared sine, without cancellation.
#[inline]
pub fn one_minus_cos(sin_squared: f32) -> f32 {
    sin_squared / (1.0 + safe_sqrt(1.0 - sin_squared))
}

/// Barycentric weights of the second and third corner of a uniform point of a triangle (Heitz 2019, "A Low-Distortion Map
/// Between Triangle and Square").
#[inline]
pub fn uniform_triangle(u: Vec2) -> [f32; 2] {
    if u.x < u.y {
        let b = 0.5 * u.x;
        [b, u.y - b]
    } else {
        let b = 0.5 * u.y;
        [u.x - b, b]
    }
}

/// The point of the unit square that [`uniform_triangle`] maps to the weights `b`.
#[inline]
pub fn uniform_triangle_inverse(b: [f32; 2]) -> Vec2 {
    let d = b[0] - b[1];
    let u = if d < 0.0 { Vec2::new(2.0 * b[0], b[0] + b[1]) } else { Vec2::new(b[0] + b[1], 2.0 * b[1]) };
    u.min(Vec2::splat(ONE_MINUS_EPSILON))
}
