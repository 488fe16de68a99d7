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
    // Snell's law: eta^2 cos_t^2 = eta^2 - 1 + cos_i^2. In f64, as the sum cancels near total reflection.
    let (index, cos) = (f64::from(eta), f64::from(cos_i));
    let index2_minus_one = (index - 1.0) * (index + 1.0);
    let scaled_cos2_t = index2_minus_one + cos * cos;
    if scaled_cos2_t <= 0.0 {
        return Boundary { reflectance: 1.0, cos_t: 0.0 };
    }
    let scaled_cos_t = scaled_cos2_t.sqrt() as f32;
    // Fresnel's amplitudes, with the differences of near numbers taken out by Snell's law: the perpendicular one is
    // (cos_i^2 - eta^2 cos_t^2) / (cos_i + eta cos_t)^2, the parallel one to it as cos(i + t) to cos(i - t).
    let perpendicular = index2_minus_one as f32 / sqr(cos_i + scaled_cos_t);
    let (product, sin2_i) = (cos_i * scaled_cos_t, (1.0 - cos_i) * (1.0 + cos_i));
    let parallel = perpendicular * ((product - sin2_i) / (product + sin2_i));
    let reflectance = (0.5 * (sqr(perpendicular) + sqr(parallel))).min(1.0);
    Boundary { reflectance, cos_t: (scaled_cos_t / eta).min(1.0) }
}

/// Reflectance of a boundary that light crosses with the cosines `cos_i` and `cos_t`, which fulfil Snell's law. Where both are known it
/// is more precise than [`dielectric`] near total reflection; but not for indices near 1.
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::{cos, sin};

    #[test]
    fn glass_at_the_usual_angles() {
        let r = |degrees: f32, eta| dielectric(cos(degrees.to_radians()), eta).reflectance;
        assert!((r(0.0, 1.5) - 0.04).abs() < 1e-6);
        // At Brewster's angle only the perpendicular half is reflected.
        let brewster = sqr(1.25f32 / 3.25);
        assert!((r(56.309_93, 1.5) - 0.5 * brewster).abs() < 1e-5);
        assert!(r(90.0, 1.5) > 0.999_99 && r(42.0, 1.0 / 1.5) == 1.0 && r(41.0, 1.0 / 1.5) < 0.5);
        // Nothing changes where nothing differs.
        assert_eq!(dielectric(0.3, 1.0), Boundary { reflectance: 0.0, cos_t: 0.3 });
    }

    /// Indices near 1 too, down to grazing directions: against the same equations in f64.
    #[test]
    fn all_digits_count() {
        for eta in [0.999f32, 0.9999, 1.0001, 1.001, 1.5, 2.4] {
            for i in 0..=1000 {
                let c = crate::math::exp64(f64::from(i) * -0.007) as f32;
                let (near, n) = (f64::from(c), f64::from(eta));
                let far = (1.0 - (1.0 - near * near) / (n * n)).max(0.0).sqrt();
                if far < 0.05 {
                    continue;
                }
                let s = (near - n * far) / (near + n * far);
                let p = (n * near - far) / (n * near + far);
                let (found, expected) = (dielectric(c, eta), 0.5 * (s * s + p * p));
                assert!(
                    (f64::from(found.reflectance) / expected - 1.0).abs() < 1e-4,
                    "{eta} {c}: {found:?}, {expected}"
                );
                assert!((f64::from(found.cos_t) / far - 1.0).abs() < 1e-5, "{eta} {c}: {found:?}, {far}");
            }
        }
    }

    /// Stokes: the same from both sides of the boundary.
    #[test]
    fn both_sides_agree() {
        for eta in [1.01, 1.33, 2.4, 0.6] {
            // Where neither side grazes: beyond, what rounding does to the far side's cosine is magnified on the way back.
            for i in 5..100 {
                let there = dielectric(i as f32 / 100.0, eta);
                if there.cos_t > 0.05 {
                    let back = dielectric(there.cos_t, 1.0 / eta);
                    assert!((there.reflectance - back.reflectance).abs() < 1e-4, "{eta} {i}");
                    assert!((back.cos_t - i as f32 / 100.0).abs() < 1e-4);
                }
            }
        }
    }

    /// Against the Fresnel equations in complex numbers, in f64.
    #[test]
    fn metals_follow_the_complex_equations() {
        type C = (f64, f64);
        let mul = |a: C, b: C| (a.0 * b.0 - a.1 * b.1, a.0 * b.1 + a.1 * b.0);
        let ratio2 = |a: C, b: C| (a.0 * a.0 + a.1 * a.1) / (b.0 * b.0 + b.1 * b.1);
        for (eta, k) in [(0.143, 3.983), (1.442, 1.603), (2.0, 0.0), (0.05, 0.1), (3.0, 9.0)] {
            for i in 0..=50 {
                let c = f64::from(i) / 50.0;
                let (n, n2) = ((eta, k), mul((eta, k), (eta, k)));
                // n cos_t = sqrt(n^2 - sin^2)
                let (re, im) = (n2.0 - (1.0 - c * c), n2.1);
                let modulus = (re * re + im * im).sqrt();
                let q = ((0.5 * (modulus + re)).max(0.0).sqrt(), (0.5 * (modulus - re)).max(0.0).sqrt());
                let perpendicular = ratio2((c - q.0, -q.1), (c + q.0, q.1));
                let nnc = mul(n, (n.0 * c, n.1 * c));
                let parallel = ratio2((nnc.0 - q.0, nnc.1 - q.1), (nnc.0 + q.0, nnc.1 + q.1));
                let expected = 0.5 * (perpendicular + parallel);
                let r = f64::from(conductor(c as f32, Rgb::splat(eta as f32), Rgb::splat(k as f32)).r);
                assert!((r - expected).abs() < 2e-5, "{eta} + {k} i, cos {c}: {r}, expected {expected}");
            }
        }
    }

    #[test]
    fn extreme_indices_stay_in_range() {
        for index in [0.0, 1e-20, 1.0, 1e4] {
            for k in [0.0, 1e-20, 1.0, 1e4] {
                for c in [0.0, 1e-7, 0.5, 1.0] {
                    let r = conductor(c, Rgb::splat(index), Rgb::splat(k)).r;
                    assert!((0.0..=1.0).contains(&r), "{index} {k} {c}: {r}");
                }
            }
        }
        assert_eq!(conductor(0.4, Rgb::ZERO, Rgb::ONE), Rgb::ONE);
    }

    #[test]
    fn refraction_obeys_snell() {
        for degrees in [0.0f32, 10.0, 45.0, 80.0, 89.9] {
            for eta in [1.5, 1.0, 0.9] {
                let a = degrees.to_radians();
                let (m, w) = (Vec3::new(0.6, 0.0, 0.8), Vec3::new(0.6 * cos(a), sin(a), 0.8 * cos(a)));
                let boundary = dielectric(w.dot(m), eta);
                if boundary.cos_t > 0.0 {
                    let t = refract(w, m, boundary.cos_t, eta);
                    // In the plane of incidence, on the other side, sin_t = sin_i / eta.
                    assert!((t.length() - 1.0).abs() < 1e-6 && (t.dot(m) + boundary.cos_t).abs() < 1e-6);
                    assert!((t.cross(m).length() * eta - w.cross(m).length()).abs() < 1e-5, "{degrees} {eta}");
                    assert!(t.cross(m).dot(w).abs() < 1e-5 && t.dot(w) < 0.0);
                }
                assert!((reflect(w, m) + w - m * (2.0 * w.dot(m))).length() < 1e-6);
            }
        }
    }
}
