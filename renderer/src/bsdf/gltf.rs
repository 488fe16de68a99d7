use super::dielectric::{Split, radiance_scale};
use super::microfacet::{Microfacet, reflecting_facet, refracting_facet};
use super::resolve::At;
use super::{BsdfSample, Distribution, Lobe, Lobes, Model, Spread, Transport, fresnel};
use crate::math::{INV_PI, Vec2, Vec3, lerp, sqr};
use crate::sampling::warp;
use crate::spectrum::Rgb;
use crate::texture::{FloatParam, RgbParam};

/// An index of refraction kept this far from one, so that refracting facets can be told from the two directions in f32.
const MIN_CONTRAST: f32 = 1e-3;

/// Coats at least as rough as this are broad: at a roughness of a third the coat of a dielectric is about as bright as a white base, at
/// most.
const BROAD_ALPHA: f32 = 0.1;

/// glTF 2.0 metallic-roughness (appendix B of the specification) with KHR_materials_ior and KHR_materials_transmission; both
/// sides scatter.
///
/// `metallic` mixes a metal with a dielectric: a GGX coat over a base that mixes diffuse reflection with transmission. Two
/// departures from the appendix, where it creates energy at grazing angles or has no rule: diffuse light is weighted by
/// `(1 - F(wo)) (1 - F(wi)) / (1 - F_mean)`, which is reciprocal and passes on just what the coat does not reflect (the
/// appendix has `1 - F(wo.wm)`); and where transmission refracts, its share follows the exact Fresnel equations.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Gltf {
    /// Base colour.
    pub base: Rgb,
    /// 0 dielectric, 1 metal.
    pub metallic: f32,
    /// Share of transmission in the dielectric's base.
    pub transmission: f32,
    /// Index inside over index outside.
    pub ior: f32,
    /// Transmission goes straight on.
    pub thin: bool,
    /// `None` = smooth.
    pub facets: Option<Microfacet>,
}

impl Gltf {
    pub(super) fn resolve(
        at: &At,
        base_color: RgbParam,
        metallic: FloatParam,
        roughness: FloatParam,
        ior: f32,
        transmission: FloatParam,
        thin: bool,
    ) -> Self {
        let alpha = sqr(at.unit(roughness));
        Self {
            base: at.reflectance(base_color),
            metallic: at.unit(metallic),
            transmission: at.unit(transmission),
            // 0 asks for a Fresnel term of one (KHR_materials_ior): an index too high to transmit anything does that.
            ior: if !(ior > 0.0) { 1e4 } else { ior.min(1e4) },
            thin,
            facets: Microfacet::new(Distribution::Ggx, alpha, alpha),
        }
    }

    /// Reflectance at normal incidence of the dielectric.
    #[inline]
    fn f0(&self) -> f32 {
        sqr((self.ior - 1.0) / (self.ior + 1.0))
    }

    /// Index on the far side over that on the side of `w`, for light that passes.
    #[inline]
    fn eta_from(&self, w: Vec3) -> f32 {
        if self.thin {
            return 1.0;
        }
        let ior = if (self.ior - 1.0).abs() < MIN_CONTRAST { 1.0 + MIN_CONTRAST } else { self.ior };
        if w.z > 0.0 { ior } else { 1.0 / ior }
    }

    /// What a facet at the cosine `cos` to `wo` reflects and transmits; `eta` from [`Gltf::eta_from`].
    #[inline]
    fn split(&self, cos: f32, eta: f32) -> Option<Split> {
        let refracts = !self.thin && self.transmission > 0.0;
        self.split_with(cos, refracts.then(|| fresnel::dielectric(cos, eta).reflectance))
    }

    /// The same, given the reflectance of the part that refracts; `None` = nothing refracts.
    #[inline]
    fn split_with(&self, cos: f32, glass: Option<f32>) -> Option<Split> {
        let schlick = fresnel::schlick_weight(cos);
        let metal = self.base + (Rgb::ONE - self.base) * schlick;
        let coat = lerp(schlick, self.f0(), 1.0);
        let glass = glass.unwrap_or(coat);
        let dielectric = lerp(self.transmission, coat, glass);
        Split::new(
            metal * self.metallic + Rgb::splat((1.0 - self.metallic) * dielectric),
            self.base * ((1.0 - self.metallic) * self.transmission * (1.0 - glass)),
        )
    }

    /// Share of the light that passes the coat at a cosine to the normal.
    #[inline]
    fn passes_coat(&self, cos: f32) -> f32 {
        (1.0 - self.f0()) * (1.0 - fresnel::schlick_weight(cos.abs()))
    }

    /// Albedo of the diffuse base, without the coat.
    #[inline]
    fn diffuse_albedo(&self) -> Rgb {
        self.base * ((1.0 - self.metallic) * (1.0 - self.transmission))
    }

    /// Value of the diffuse base under its coat. The mean of Schlick's weight over the hemisphere is 1 / 21.
    #[inline]
    fn diffuse(&self, wo: Vec3, wi: Vec3) -> Rgb {
        let mean = (1.0 - self.f0()) * (20.0 / 21.0);
        if !(mean > 0.0) {
            return Rgb::ZERO;
        }
        self.diffuse_albedo() * (INV_PI * self.passes_coat(wo.z) * self.passes_coat(wi.z) / mean)
    }

    /// Probability of drawing from the diffuse base rather than from a facet.
    #[inline]
    fn p_diffuse(&self, wo: Vec3) -> f32 {
        let diffuse = self.diffuse_albedo().max_component() * self.passes_coat(wo.z);
        if !(diffuse > 0.0) {
            return 0.0;
        }
        let facets = self.split(wo.z.abs(), self.eta_from(wo));
        let facets = facets.map_or(0.0, |s| s.reflected.max_component() + s.transmitted.max_component());
        // Facets tilted against the surface reflect more than it does at `wo`: leave them a share.
        (diffuse / (diffuse + facets)).min(0.9)
    }

    fn sample_smooth(&self, wo: Vec3, uc: f32, p_facets: f32, mode: Transport) -> Option<BsdfSample> {
        let eta = self.eta_from(wo);
        let split = self.split(wo.z.abs(), eta)?;
        if uc < split.p_reflect {
            let wi = Vec3::new(-wo.x, -wo.y, wo.z);
            let (f, pdf) = (split.reflected / wo.z.abs(), p_facets * split.p_reflect);
            return Some(BsdfSample { wi, f, pdf, lobe: Lobe::specular(true, false), eta: 1.0 });
        }
        let wi = fresnel::refract(wo, Vec3::Z.copysign(wo), fresnel::dielectric(wo.z.abs(), eta).cos_t, eta);
        let f = split.transmitted / wi.z.abs() * radiance_scale(eta, mode);
        let pdf = p_facets * (1.0 - split.p_reflect);
        Some(BsdfSample { wi, f, pdf, lobe: Lobe::specular(true, true), eta })
    }

    /// Value and density, given a facet was chosen.
    fn eval_facets(&self, facets: &Microfacet, wo: Vec3, wi: Vec3, mode: Transport) -> Option<(Rgb, f32)> {
        let eta = self.eta_from(wo);
        let transmission = wo.z * wi.z < 0.0;
        // Reflection, or transmission through a thin sheet: reflection whose outgoing side is turned over.
        if !transmission || self.thin {
            let wm = reflecting_facet(wo, if transmission { Vec3::new(wi.x, wi.y, -wi.z) } else { wi })?;
            let split = self.split(wo.dot(wm).abs(), eta)?;
            let visible = 0.25 * facets.d(wm) * facets.g1_over_cos(wo);
            let (share, p) = if transmission {
                (split.transmitted, 1.0 - split.p_reflect)
            } else {
                (split.reflected, split.p_reflect)
            };
            return Some((share * (visible * facets.g1_over_cos(wi)), visible * p));
        }
        // Refraction.
        let (wm, jacobian) = refracting_facet(wo, wi, eta)?;
        let (cos_o, cos_i) = (wo.dot(wm).abs(), wi.dot(wm).abs());
        let split = self.split_with(cos_o, Some(fresnel::dielectric_reflectance(cos_o, cos_i, eta)))?;
        let visible = facets.d(wm) * facets.g1_over_cos(wo) * cos_o * cos_i * jacobian;
        let f = split.transmitted * (visible * facets.g1_over_cos(wi) * radiance_scale(eta, mode));
        Some((f, visible * (1.0 - split.p_reflect)))
    }
}

impl Model for Gltf {
    fn eval_pdf(&self, wo: Vec3, wi: Vec3, mode: Transport) -> (Rgb, f32) {
        if wo.z * wi.z == 0.0 {
            return (Rgb::ZERO, 0.0);
        }
        let p_diffuse = self.p_diffuse(wo);
        let (mut f, mut pdf) = (Rgb::ZERO, 0.0);
        if p_diffuse > 0.0 && wo.z * wi.z > 0.0 {
            f = self.diffuse(wo, wi);
            pdf = p_diffuse * warp::cosine_hemisphere_pdf(wi.z.abs());
        }
        if let Some(facets) = &self.facets
            && let Some((facets_f, facets_pdf)) = self.eval_facets(facets, wo, wi, mode)
        {
            f += facets_f;
            pdf += (1.0 - p_diffuse) * facets_pdf;
        }
        (f, pdf)
    }

    fn sample(&self, wo: Vec3, uc: f32, u: Vec2, mode: Transport) -> Option<BsdfSample> {
        if wo.z == 0.0 {
            return None;
        }
        let p_diffuse = self.p_diffuse(wo);
        if uc < p_diffuse {
            let mut wi = warp::cosine_hemisphere(u);
            wi.z = wi.z.copysign(wo.z);
            let (f, pdf) = self.eval_pdf(wo, wi, mode);
            return (pdf > 0.0).then_some(BsdfSample { wi, f, pdf, lobe: Lobe::DIFFUSE, eta: 1.0 });
        }
        let uc = (uc - p_diffuse) / (1.0 - p_diffuse);
        let Some(facets) = &self.facets else { return self.sample_smooth(wo, uc, 1.0 - p_diffuse, mode) };
        // Draw a facet, then what it does.
        let wm = facets.sample_visible(wo, u) * 1.0f32.copysign(wo.z);
        let eta = self.eta_from(wo);
        let cos = wo.dot(wm);
        let transmission = !(uc < self.split(cos, eta)?.p_reflect);
        let wi = if transmission && !self.thin {
            fresnel::refract(wo, wm, fresnel::dielectric(cos, eta).cos_t, eta)
        } else {
            let wi = fresnel::reflect(wo, wm);
            if wo.z * wi.z <= 0.0 {
                return None;
            }
            if transmission { Vec3::new(wi.x, wi.y, -wi.z) } else { wi }
        };
        if (wo.z * wi.z < 0.0) != transmission {
            return None;
        }
        let (f, pdf) = self.eval_pdf(wo, wi, mode);
        let lobe = Lobe::specular(false, transmission);
        (pdf > 0.0).then_some(BsdfSample { wi, f, pdf, lobe, eta: if transmission { eta } else { 1.0 } })
    }

    fn is_delta_only(&self) -> bool {
        self.facets.is_none() && self.diffuse_albedo().is_black()
    }

    fn transmits(&self) -> bool {
        self.metallic < 1.0 && self.transmission > 0.0 && !self.base.is_black()
    }

    #[inline]
    fn spread(&self) -> Spread {
        let rough = self.facets.is_some_and(|f| f.least_alpha() >= BROAD_ALPHA);
        let coated = self.metallic <= 0.5 && self.transmission == 0.0 && self.diffuse_albedo().max_component() > 0.0;
        if rough && coated { Spread::Broad } else { Spread::Narrow }
    }

    #[inline]
    fn lobes(&self, wo: Vec3) -> Option<Lobes> {
        let facets = self.facets.as_ref()?;
        let schlick = fresnel::schlick_weight(wo.z.abs());
        let metal = lerp(schlick, self.base.luminance(), 1.0);
        let coat = lerp(schlick, self.f0(), 1.0);
        let diffuse = self.diffuse_albedo().luminance() * self.passes_coat(wo.z);
        Some(Lobes { diffuse, specular: lerp(self.metallic, coat, metal), alpha: facets.most_alpha() })
    }

    fn albedo(&self) -> Rgb {
        self.base
    }

    fn examples() -> Vec<(&'static str, Self)> {
        let plastic = |roughness: f32| {
            let facets = Microfacet::new(Distribution::Ggx, sqr(roughness), sqr(roughness));
            Self { base: Rgb::ONE, metallic: 0.0, transmission: 0.0, ior: 1.5, thin: false, facets }
        };
        let tan = Rgb::new(0.8, 0.6, 0.2);
        vec![
            ("smooth white plastic", plastic(0.0)),
            ("white plastic 0.3", plastic(0.3)),
            ("white plastic 0.6", plastic(0.6)),
            ("white plastic 1", plastic(1.0)),
            ("tan, half metal 0.5", Self { base: tan, metallic: 0.5, ..plastic(0.5) }),
            ("tan metal 0.4", Self { base: tan, metallic: 1.0, ..plastic(0.4) }),
            ("smooth tan metal", Self { base: tan, metallic: 1.0, ..plastic(0.0) }),
            ("frosted thin 0.5", Self { transmission: 1.0, thin: true, ..plastic(0.5) }),
            ("frosted glass 0.5", Self { transmission: 1.0, ..plastic(0.5) }),
            ("smooth thin", Self { transmission: 1.0, thin: true, ..plastic(0.0) }),
            ("tan half glass 0.6", Self { base: tan, transmission: 0.5, ..plastic(0.6) }),
            ("everything 0.7", Self { base: tan, metallic: 0.3, transmission: 0.6, ior: 1.8, ..plastic(0.7) }),
            ("smooth mixture", Self { base: tan, metallic: 0.3, transmission: 0.6, ..plastic(0.0) }),
            ("index one, 0.5", Self { transmission: 0.7, ior: 1.0, ..plastic(0.5) }),
        ]
    }
}
