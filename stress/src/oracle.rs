//! The renderer's functions in double precision, written anew from their formulas.

use renderer::math::{DVec3, Vec3};
use std::f64::consts::PI;

/// Henyey and Greenstein's density for two directions, `wo` to the previous vertex and `wi` to the next.
pub fn henyey_greenstein(g: f64, wo: Vec3, wi: Vec3) -> f64 {
    let (wo, wi) = (wo.as_dvec3(), wi.as_dvec3());
    let peak = if g < 0.0 { wo } else { -wo };
    let g = g.abs();
    let one_minus_cos = 0.5 * (wi - peak).length_squared();
    let d = (1.0 - g) * (1.0 - g) + 2.0 * g * one_minus_cos;
    (1.0 - g) * (1.0 + g) / (4.0 * PI * d * d.sqrt())
}

/// Unpolarised reflectance of a boundary with relative index `eta`, and the cosine on its far side; `None` under total reflection.
pub fn dielectric(cos_i: f64, eta: f64) -> (f64, Option<f64>) {
    let sin2_t = (1.0 - cos_i) * (1.0 + cos_i) / (eta * eta);
    if sin2_t >= 1.0 {
        return (1.0, None);
    }
    let cos_t = (1.0 - sin2_t).sqrt();
    let s = (cos_i - eta * cos_t) / (cos_i + eta * cos_t);
    let p = (eta * cos_i - cos_t) / (eta * cos_i + cos_t);
    (0.5 * (s * s + p * p), Some(cos_t))
}

/// Facets of a rough surface.
#[derive(Clone, Copy, Debug)]
pub struct Facets {
    /// GGX, else Beckmann.
    pub ggx: bool,
    /// Along x and y.
    pub alpha: [f64; 2],
}

impl Facets {
    /// Density of the facet normal `m`.
    pub fn d(&self, m: DVec3) -> f64 {
        let slope2 = (m.x / self.alpha[0]).powi(2) + (m.y / self.alpha[1]).powi(2);
        let scale = PI * self.alpha[0] * self.alpha[1];
        if self.ggx {
            1.0 / (scale * (slope2 + m.z * m.z).powi(2))
        } else {
            (-slope2 / (m.z * m.z)).exp() / (scale * m.z.powi(4))
        }
    }

    /// Smith's masking over the cosine, for GGX.
    pub fn ggx_g1_over_cos(&self, w: DVec3) -> f64 {
        let s2 = (w.x * self.alpha[0]).powi(2) + (w.y * self.alpha[1]).powi(2);
        let z = w.z.abs();
        2.0 / (z + (z * z + s2).sqrt())
    }

    /// Value and density of a GGX mirror of reflectance 1, both directions above it.
    pub fn mirror(&self, wo: Vec3, wi: Vec3) -> (f64, f64) {
        let (wo, wi) = (wo.as_dvec3(), wi.as_dvec3());
        let m = (wo + wi).normalize();
        let visible = 0.25 * self.d(m) * self.ggx_g1_over_cos(wo);
        (visible * self.ggx_g1_over_cos(wi), visible)
    }

    /// Value (radiance) and density of GGX glass of index `eta` below over above, for directions on two sides (Walter et al. 2007,
    /// equation 21).
    pub fn glass(&self, wo: Vec3, wi: Vec3, eta: f64) -> (f64, f64) {
        let (wo, wi) = (wo.as_dvec3(), wi.as_dvec3());
        let eta = if wo.z > 0.0 { eta } else { 1.0 / eta };
        let h = wi * eta + wo;
        let m = h.normalize() * h.z.signum();
        let (co, ci) = (wo.dot(m), wi.dot(m));
        if co * wo.z <= 0.0 || ci * wi.z <= 0.0 {
            return (0.0, 0.0);
        }
        // With the cosines as they are: the two directions are rounded, and Snell's law holds for them only nearly.
        let (co, ci) = (co.abs(), ci.abs());
        let s = (co - eta * ci) / (co + eta * ci);
        let p = (eta * co - ci) / (eta * co + ci);
        let through = 1.0 - 0.5 * (s * s + p * p);
        let visible = self.d(m) * self.ggx_g1_over_cos(wo) * co * ci * eta * eta / h.length_squared() * through;
        (visible * self.ggx_g1_over_cos(wi) / (eta * eta), visible)
    }
}
