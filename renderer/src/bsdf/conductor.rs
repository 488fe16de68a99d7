use super::microfacet::{Microfacet, SMOOTH_ALPHA, reflecting_facet};
use super::resolve::At;
use super::{BsdfSample, Distribution, Lobe, Lobes, Model, Roughness, Transport, fresnel};
use crate::math::{Vec2, Vec3};
use crate::spectrum::Rgb;
use crate::texture::RgbParam;

/// Metal, smooth or rough (Walter et al. 2007, "Microfacet Models for Refraction through Rough Surfaces", eq. 20); black from
/// behind. Light that would bounce between facets is lost.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Conductor {
    /// Real index of refraction, relative to the outside.
    pub eta: Rgb,
    /// Absorption index, relative to the outside.
    pub k: Rgb,
    /// Multiplies the Fresnel reflectance.
    pub reflectance: Rgb,
    /// `None` = a smooth mirror.
    pub facets: Option<Microfacet>,
}

impl Conductor {
    pub(super) fn resolve(at: &At, eta: Rgb, k: Rgb, reflectance: RgbParam, roughness: Option<Roughness>) -> Self {
        // Squares of the indices must fit f32; from 1e4 on every metal is a perfect mirror.
        let index = |c: Rgb| c.map(|x| if x > 0.0 { x.min(1e4) } else { 0.0 });
        Self { eta: index(eta), k: index(k), reflectance: at.reflectance(reflectance), facets: at.facets(roughness) }
    }

    fn fresnel(&self, cos: f32) -> Rgb {
        self.reflectance * fresnel::conductor(cos, self.eta, self.k)
    }
}

impl Model for Conductor {
    #[inline]
    fn eval_pdf(&self, wo: Vec3, wi: Vec3, _: Transport) -> (Rgb, f32) {
        let (Some(facets), true) = (&self.facets, wo.z > 0.0 && wi.z > 0.0) else {
            return (Rgb::ZERO, 0.0);
        };
        let Some(wm) = reflecting_facet(wo, wi) else { return (Rgb::ZERO, 0.0) };
        let pdf = 0.25 * facets.d(wm) * facets.g1_over_cos(wo);
        let g = facets.shadowing_over_cos(wo) * facets.shadowing_over_cos(wi);
        (self.fresnel(wo.dot(wm)) * (0.25 * facets.d(wm) * g), pdf)
    }

    fn sample(&self, wo: Vec3, _: f32, u: Vec2, mode: Transport) -> Option<BsdfSample> {
        if !(wo.z > 0.0) {
            return None;
        }
        let Some(facets) = &self.facets else {
            let wi = Vec3::new(-wo.x, -wo.y, wo.z);
            let f = self.fresnel(wi.z) / wi.z;
            return Some(BsdfSample { wi, f, pdf: 1.0, lobe: Lobe::specular(true, false), eta: 1.0 });
        };
        let wi = fresnel::reflect(wo, facets.sample_visible(wo, u));
        let (f, pdf) = self.eval_pdf(wo, wi, mode);
        (pdf > 0.0).then_some(BsdfSample { wi, f, pdf, lobe: Lobe::specular(false, false), eta: 1.0 })
    }

    fn is_delta_only(&self) -> bool {
        self.facets.is_none()
    }

    #[inline]
    fn chooses(&self) -> bool {
        false
    }

    #[inline]
    fn lobes(&self, _: Vec3) -> Option<Lobes> {
        self.facets.as_ref().map(|facets| Lobes { diffuse: 0.0, specular: 1.0, alpha: facets.most_alpha() })
    }

    fn albedo(&self) -> Rgb {
        self.fresnel(1.0)
    }

    fn examples() -> Vec<(&'static str, Self)> {
        use Distribution::{Beckmann, Ggx};
        let gold = |facets| Self {
            eta: Rgb::new(0.143, 0.375, 1.442),
            k: Rgb::new(3.983, 2.386, 1.603),
            reflectance: Rgb::ONE,
            facets,
        };
        let ideal = |facets| Self { eta: Rgb::ZERO, k: Rgb::ONE, ..gold(facets) };
        vec![
            ("smooth gold", gold(None)),
            ("ideal mirror", ideal(None)),
            ("ggx 0.002", gold(Microfacet::new(Ggx, 2.0 * SMOOTH_ALPHA, 2.0 * SMOOTH_ALPHA))),
            ("ggx 0.1", gold(Microfacet::new(Ggx, 0.1, 0.1))),
            ("ggx 0.5, ideal", ideal(Microfacet::new(Ggx, 0.5, 0.5))),
            ("ggx 1, ideal", ideal(Microfacet::new(Ggx, 1.0, 1.0))),
            ("ggx 0.05 by 0.4", gold(Microfacet::new(Ggx, 0.05, 0.4))),
            ("beckmann 0.1", gold(Microfacet::new(Beckmann, 0.1, 0.1))),
            ("beckmann 0.5, ideal", ideal(Microfacet::new(Beckmann, 0.5, 0.5))),
            ("beckmann 1, ideal", ideal(Microfacet::new(Beckmann, 1.0, 1.0))),
            ("beckmann 0.3 by 0.08", gold(Microfacet::new(Beckmann, 0.3, 0.08))),
        ]
    }
}
