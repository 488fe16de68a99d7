use super::microfacet::{Microfacet, reflecting_facet, refracting_facet};
use super::resolve::At;
use super::{BsdfSample, Distribution, Lobe, Model, Roughness, Transport, fresnel};
use crate::math::{Vec2, Vec3, sqr};
use crate::spectrum::Rgb;
use crate::texture::RgbParam;

/// Indices nearer to one than this refract so little that a rough surface is treated as smooth: the facet normal could not be
/// told from the two directions in f32.
const MATCHED: f32 = 1e-3;

/// Glass, water: reflects and refracts on both sides, smooth or rough (Walter et al. 2007, "Microfacet Models for Refraction
/// through Rough Surfaces", eq. 19 to 21). Light that would bounce between facets is lost.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Dielectric {
    /// Index inside (below the surface) over index outside.
    pub eta: f32,
    /// Multiplies reflection.
    pub reflectance: Rgb,
    /// Multiplies transmission.
    pub transmittance: Rgb,
    /// `None` = smooth.
    pub facets: Option<Microfacet>,
}

/// The shares of light that a facet reflects and transmits, and the probability of following the first.
pub(super) struct Split {
    pub reflected: Rgb,
    pub transmitted: Rgb,
    pub p_reflect: f32,
}

impl Split {
    /// `None` when both are black.
    #[inline]
    pub fn new(reflected: Rgb, transmitted: Rgb) -> Option<Self> {
        let (r, t) = (reflected.max_component(), transmitted.max_component());
        (r + t > 0.0).then(|| Self { reflected, transmitted, p_reflect: r / (r + t) })
    }
}

impl Dielectric {
    pub(super) fn resolve(
        at: &At,
        eta: f32,
        reflectance: RgbParam,
        transmittance: RgbParam,
        roughness: Option<Roughness>,
    ) -> Self {
        let eta = if eta.is_finite() && eta > 0.0 { eta } else { 1.0 };
        let facets = if (eta - 1.0).abs() < MATCHED { None } else { at.facets(roughness) };
        let (reflectance, transmittance) = (at.reflectance(reflectance), at.reflectance(transmittance));
        Self { eta, reflectance, transmittance, facets }
    }

    /// Index on the far side over that on the side of `w`.
    #[inline]
    fn eta_from(&self, w: Vec3) -> f32 {
        if w.z > 0.0 { self.eta } else { 1.0 / self.eta }
    }

    #[inline]
    fn split(&self, reflectance: f32) -> Option<Split> {
        Split::new(self.reflectance * reflectance, self.transmittance * (1.0 - reflectance))
    }

    fn sample_smooth(&self, wo: Vec3, uc: f32, mode: Transport) -> Option<BsdfSample> {
        let eta = self.eta_from(wo);
        let boundary = fresnel::dielectric(wo.z.abs(), eta);
        let split = self.split(boundary.reflectance)?;
        if uc < split.p_reflect {
            let wi = Vec3::new(-wo.x, -wo.y, wo.z);
            let f = split.reflected / wo.z.abs();
            return Some(BsdfSample { wi, f, pdf: split.p_reflect, lobe: Lobe::specular(true, false), eta: 1.0 });
        }
        let wi = fresnel::refract(wo, Vec3::Z.copysign(wo), boundary.cos_t, eta);
        let f = split.transmitted / wi.z.abs() * radiance_scale(eta, mode);
        Some(BsdfSample { wi, f, pdf: 1.0 - split.p_reflect, lobe: Lobe::specular(true, true), eta })
    }
}

/// Radiance is scaled by the squared ratio of the indices where it passes from `wi` to `wo`; importance is not.
#[inline]
pub(super) fn radiance_scale(eta: f32, mode: Transport) -> f32 {
    match mode {
        Transport::Radiance => 1.0 / sqr(eta),
        Transport::Importance => 1.0,
    }
}

impl Model for Dielectric {
    fn eval_pdf(&self, wo: Vec3, wi: Vec3, mode: Transport) -> (Rgb, f32) {
        const NONE: (Rgb, f32) = (Rgb::ZERO, 0.0);
        let (Some(facets), true) = (&self.facets, wo.z * wi.z != 0.0) else { return NONE };
        let eta = self.eta_from(wo);
        if wo.z * wi.z > 0.0 {
            // Reflection.
            let Some(wm) = reflecting_facet(wo, wi) else { return NONE };
            let Some(split) = self.split(fresnel::dielectric(wo.dot(wm).abs(), eta).reflectance) else { return NONE };
            let visible = 0.25 * facets.d(wm) * facets.g1_over_cos(wo);
            return (
                split.reflected * (0.25 * facets.d(wm) * facets.shadowing_over_cos(wo) * facets.shadowing_over_cos(wi)),
                visible * split.p_reflect,
            );
        }
        // Transmission.
        let Some((wm, jacobian)) = refracting_facet(wo, wi, eta) else { return NONE };
        let (cos_o, cos_i) = (wo.dot(wm).abs(), wi.dot(wm).abs());
        let Some(split) = self.split(fresnel::dielectric_reflectance(cos_o, cos_i, eta)) else { return NONE };
        let visible = facets.d(wm) * facets.g1_over_cos(wo) * cos_o * cos_i * jacobian;
        let g = facets.shadowing_over_cos(wo) * facets.shadowing_over_cos(wi);
        let f = split.transmitted * (facets.d(wm) * g * cos_o * cos_i * jacobian * radiance_scale(eta, mode));
        (f, visible * (1.0 - split.p_reflect))
    }

    fn sample(&self, wo: Vec3, uc: f32, u: Vec2, mode: Transport) -> Option<BsdfSample> {
        if wo.z == 0.0 {
            return None;
        }
        let Some(facets) = &self.facets else { return self.sample_smooth(wo, uc, mode) };
        // Draw a facet, then what it does.
        let wm = facets.sample_visible(wo, u) * 1.0f32.copysign(wo.z);
        let eta = self.eta_from(wo);
        let boundary = fresnel::dielectric(wo.dot(wm), eta);
        let transmission = !(uc < self.split(boundary.reflectance)?.p_reflect);
        let wi = if transmission { fresnel::refract(wo, wm, boundary.cos_t, eta) } else { fresnel::reflect(wo, wm) };
        if (wo.z * wi.z < 0.0) != transmission {
            return None;
        }
        let (f, pdf) = self.eval_pdf(wo, wi, mode);
        let lobe = Lobe::specular(false, transmission);
        (pdf > 0.0).then_some(BsdfSample { wi, f, pdf, lobe, eta: if transmission { eta } else { 1.0 } })
    }

    fn is_delta_only(&self) -> bool {
        self.facets.is_none()
    }

    fn transmits(&self) -> bool {
        !self.transmittance.is_black()
    }

    fn albedo(&self) -> Rgb {
        let r = fresnel::dielectric(1.0, self.eta).reflectance;
        self.reflectance * r + self.transmittance * (1.0 - r)
    }

    fn examples() -> Vec<(&'static str, Self)> {
        use Distribution::{Beckmann, Ggx};
        let clear = |eta, facets| Self { eta, reflectance: Rgb::ONE, transmittance: Rgb::ONE, facets };
        let tinted = Rgb::new(0.9, 0.5, 0.1);
        vec![
            ("smooth glass", clear(1.5, None)),
            ("smooth, matched", clear(1.0, None)),
            ("smooth, tinted", Self { transmittance: tinted, ..clear(1.33, None) }),
            ("ggx 0.002", clear(1.5, Microfacet::new(Ggx, 2e-3, 2e-3))),
            ("ggx 0.1", clear(1.5, Microfacet::new(Ggx, 0.1, 0.1))),
            ("ggx 0.4, air in water", clear(0.75, Microfacet::new(Ggx, 0.4, 0.4))),
            ("ggx 1", clear(1.5, Microfacet::new(Ggx, 1.0, 1.0))),
            ("ggx 0.3, nearly matched", clear(1.01, Microfacet::new(Ggx, 0.3, 0.3))),
            ("ggx 0.1 by 0.5, tinted", Self { transmittance: tinted, ..clear(2.4, Microfacet::new(Ggx, 0.1, 0.5)) }),
            ("beckmann 0.2", clear(1.5, Microfacet::new(Beckmann, 0.2, 0.2))),
            ("beckmann 0.8", clear(1.5, Microfacet::new(Beckmann, 0.8, 0.8))),
            ("opaque ggx 0.3", Self { transmittance: Rgb::ZERO, ..clear(1.5, Microfacet::new(Ggx, 0.3, 0.3)) }),
        ]
    }
}
