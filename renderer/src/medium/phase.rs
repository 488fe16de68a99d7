use crate::math::{Frame, INV_4PI, Vec2, Vec3, safe_sqrt, sin_cos};
use crate::sampling::warp;
use std::f32::consts::PI;

/// Distribution of the direction in which a medium scatters. The contract:
///
/// * `wo` points to the previous vertex of the walk, `wi` to the next, as at surfaces; both unit vectors in world space.
/// * The value is a density per solid angle of `wi` (it integrates to 1) and symmetric in the two; it is sampled perfectly, so that
///   value and density are the same number.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Phase {
    /// The same in every direction.
    Isotropic,
    /// Henyey and Greenstein 1941, "Diffuse Radiation in the Galaxy".
    HenyeyGreenstein {
        /// Mean cosine of the deflection, between -1 and 1, both excluded; above 0 light goes on forward.
        g: f32,
    },
}

impl Phase {
    /// Whether its parameters are in range.
    pub fn is_valid(&self) -> bool {
        match *self {
            Self::Isotropic => true,
            // Also false for NaN.
            Self::HenyeyGreenstein { g } => g.abs() < 1.0,
        }
    }

    /// Density per solid angle of `wi`.
    #[inline]
    pub fn pdf(&self, wo: Vec3, wi: Vec3) -> f32 {
        match *self {
            Self::Isotropic => INV_4PI,
            // The distance of the two directions' tips keeps what their cosine rounds away.
            Self::HenyeyGreenstein { g } => hg_density(g.abs(), 0.5 * (wi - peak(g, wo)).length_squared()),
        }
    }

    /// Draws `wi` given `wo`, with its density.
    #[inline]
    pub fn sample(&self, wo: Vec3, u: Vec2) -> (Vec3, f32) {
        match *self {
            Self::Isotropic => (warp::uniform_sphere(u), INV_4PI),
            Self::HenyeyGreenstein { g } => {
                let axis = peak(g, wo);
                let one_minus_cos = hg_one_minus_cos(g.abs(), u.x);
                let sin_theta = safe_sqrt(one_minus_cos * (2.0 - one_minus_cos));
                let (sin, cos) = sin_cos(2.0 * PI * u.y);
                let local = Vec3::new(sin_theta * cos, sin_theta * sin, 1.0 - one_minus_cos);
                let wi = Frame::from_normal(axis).to_world(local).normalize();
                (wi, self.pdf(wo, wi))
            }
        }
    }

    /// Mean cosine of the deflection.
    pub fn mean_cosine(&self) -> f32 {
        match *self {
            Self::Isotropic => 0.0,
            Self::HenyeyGreenstein { g } => g,
        }
    }
}

/// The likeliest direction: on, or for negative `g` back.
#[inline]
fn peak(g: f32, wo: Vec3) -> Vec3 {
    if g < 0.0 { wo } else { -wo }
}

/// Density per solid angle at `1 - cos` from the peak, `0 <= g < 1`:
/// `(1 - g^2) / (4 pi (1 + g^2 - 2 g cos)^(3/2))` with the denominator's cancellation carried out.
#[inline]
fn hg_density(g: f32, one_minus_cos: f32) -> f32 {
    let d = (1.0 - g) * (1.0 - g) + 2.0 * g * one_minus_cos;
    INV_4PI * (1.0 - g) * (1.0 + g) / (d * d.sqrt())
}

/// The inverse of the distribution of `1 - cos`, `0 <= g < 1`. The textbook form finds the cosine as a difference of squares over
/// `2 g`, which cancels for small `g` and, near 1, for all; this is the same with the cancellation carried out:
/// `1 - cos = 2 (1 - g)^2 (1 - u) (1 + g u) / (1 - g + 2 g u)^2`.
#[inline]
fn hg_one_minus_cos(g: f32, u: f32) -> f32 {
    let ratio = (1.0 - g) / (1.0 - g + 2.0 * g * u);
    2.0 * ratio * ratio * (1.0 - u) * (1.0 + g * u)
}

/// A named instance of a phase function, for tests.
#[derive(Clone, Debug)]
pub struct Example {
    /// Kind and parameters in words.
    pub name: String,
    /// The instance.
    pub phase: Phase,
}

/// The instances that the statistical tests examine, extreme parameters among them.
pub fn roster() -> Vec<Example> {
    let mut all = vec![Example { name: "isotropic".into(), phase: Phase::Isotropic }];
    for g in [0.0, 1e-7, -1e-4, 0.3, -0.5, 0.5, 0.9, -0.9, 0.99, 0.999, -0.999, 0.99999] {
        all.push(Example { name: format!("Henyey-Greenstein, g = {g}"), phase: Phase::HenyeyGreenstein { g } });
    }
    all
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn both_forms_hold_in_single_precision() {
        for g in [0.0f32, 1e-7, 1e-4, 1e-2, 0.5, 0.9, 0.99, 0.999, 0.9999, 0.99999, 0.999999] {
            let h = f64::from(g);
            for i in 0..4096 {
                let u = i as f32 / 4096.0;
                let v = f64::from(u);
                let ratio = (1.0 - h) / (1.0 - h + 2.0 * h * v);
                let exact = 2.0 * ratio * ratio * (1.0 - v) * (1.0 + h * v);
                let x = hg_one_minus_cos(g, u);
                assert!((f64::from(x) - exact).abs() <= 1e-6 * exact, "g {g}, u {u}: {x} {exact}");
                // The textbook density; where that cancels in f64, too, the same with the cancellation carried out.
                let y = f64::from(x);
                let textbook = 1.0 + h * h - 2.0 * h * (1.0 - y);
                let d = if g < 0.9999 { textbook } else { (1.0 - h) * (1.0 - h) + 2.0 * h * y };
                let density = (1.0 - h * h) / (4.0 * std::f64::consts::PI * d * d.sqrt());
                assert!((f64::from(hg_density(g, x)) / density - 1.0).abs() < 2e-6, "g {g}, u {u}");
            }
        }
    }

    #[test]
    fn the_end_of_the_range_is_refused() {
        for g in [1.0, -1.0, f32::NAN, f32::INFINITY, 1.5] {
            assert!(!Phase::HenyeyGreenstein { g }.is_valid());
        }
        assert!(Phase::HenyeyGreenstein { g: 1.0f32.next_down() }.is_valid());
    }
}
