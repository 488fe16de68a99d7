//! Fresnel reflectances and the directions of mirror reflection and refraction.

use crate::math::{Vec3, safe_sqrt, sqr};
use crate::spectrum::Rgb;

/// What happens at a smooth boundary of two dielectrics.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Boundary {
    /// Unpolarised reflectance.
    pub reflectance: f32,
    /// Cosine of the refracted direction; 0 under total reflection.
    pub cos_t: f32,
}

/// Reflectance and refraction for the cosine `cos_i` in [0, 1] on the near side; `eta` = index on the far side over the near one.
#[inline]
pub fn dielectric(cos_i: f32, eta: f32) -> Boundary {
    if eta == 1.0 {
        return Boundary { reflectance: 0.0, cos_t: cos_i };
    }
    let cos_i = cos_i.clamp(0.0, 1.0);
    // Snell's law.
    let sin2_t = (1.0 - cos_i) * (1.0 + cos_i) / sqr(eta);
    if sin2_t >= 1.0 {
        return Boundary { reflectance: 1.0, cos_t: 0.0 };
    }
    let cos_t = safe_sqrt(1.0 - sin2_t);
    Boundary { reflectance: dielectric_reflectance(cos_i, cos_t, eta), cos_t }
}

/// Reflectance of a boundary that light crosses with the cosines `cos_i` and `cos_t`, which fulfil Snell's law. Where both are known it
/// is more precise than [`dielectric`] near total reflection.
#[inline]
pub fn dielectric_reflectance(cos_i: f32, cos_t: f32, eta: f32) -> f32 {
    let parallel = (eta * cos_i - cos_t) / (eta * cos_i + cos_t);
    let perpendicular = (cos_i - eta * cos_t) / (cos_i + eta * cos_t);
    0.5 * (sqr(parallel) + sqr(perpendicular))
}

/// Reflectance of a conductor with complex index `eta + i k` relative to the near side (Born and Wolf, "Principles of Optics",
/// section 14.2, in the real form of Lagarde 2013, "Memo on Fresnel equations").
#[inline]
pub fn conductor(cos_i: f32, eta: Rgb, k: Rgb) -> Rgb {
    let cos_i = cos_i.clamp(0.0, 1.0);
    let channel = |eta: f32, k: f32| {
        let (cos2, sin2) = (sqr(cos_i), (1.0 - cos_i) * (1.0 + cos_i));
        let real = sqr(eta) - sqr(k) - sin2;
        let a2_plus_b2 = (sqr(real) + 4.0 * sqr(eta) * sqr(k)).sqrt();
        let a = safe_sqrt(0.5 * (a2_plus_b2 + real));
        // Perpendicular polarisation.
        let (even, odd) = (a2_plus_b2 + cos2, 2.0 * a * cos_i);
        let perpendicular = ratio(even - odd, even + odd);
        // Parallel polarisation, relative to the perpendicular one.
        let (even, odd) = (a2_plus_b2 * cos2 + sqr(sin2), odd * sin2);
        let parallel = perpendicular * ratio(even - odd, even + odd);
        0.5 * (perpendicular + parallel)
    };
    Rgb::new(channel(eta.r, k.r), channel(eta.g, k.g), channel(eta.b, k.b))
}

/// `a / b` clamped to [0, 1]; 1 where both vanish (an index of zero reflects everything).
#[inline]
fn ratio(a: f32, b: f32) -> f32 {
    if b > 0.0 { (a / b).clamp(0.0, 1.0) } else { 1.0 }
}

/// Schlick's weight `(1 - cos)^5`.
#[inline]
pub fn schlick_weight(cos: f32) -> f32 {
    let m = (1.0 - cos).clamp(0.0, 1.0);
    sqr(sqr(m)) * m
}

/// `w` mirrored about the axis `m`.
#[inline]
pub fn reflect(w: Vec3, m: Vec3) -> Vec3 {
    (m * (2.0 * w.dot(m)) - w).normalize()
}

/// The direction into which light that leaves along `w` is bent at a facet with normal `m` on the side of `w`; `cos_t` and
/// `eta` as in [`dielectric`].
#[inline]
pub fn refract(w: Vec3, m: Vec3, cos_t: f32, eta: f32) -> Vec3 {
    ((m * w.dot(m) - w) / eta - m * cos_t).normalize()
}
