use super::resolve::At;
use super::{BsdfSample, Lobe, Model, Transport};
use crate::math::{INV_PI, Vec2, Vec3};
use crate::sampling::warp;
use crate::spectrum::Rgb;
use crate::texture::RgbParam;

/// Ideal diffuse reflection on the front side, black from behind.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Lambert {
    /// Albedo in [0, 1].
    pub reflectance: Rgb,
}

impl Lambert {
    #[inline]
    pub(super) fn resolve(at: &At, reflectance: RgbParam) -> Self {
        Self { reflectance: at.reflectance(reflectance) }
    }
}

impl Model for Lambert {
    #[inline]
    fn eval_pdf(&self, wo: Vec3, wi: Vec3, _: Transport) -> (Rgb, f32) {
        if wo.z > 0.0 && wi.z > 0.0 {
            (self.reflectance * INV_PI, warp::cosine_hemisphere_pdf(wi.z))
        } else {
            (Rgb::ZERO, 0.0)
        }
    }

    #[inline]
    fn sample(&self, wo: Vec3, _: f32, u: Vec2, mode: Transport) -> Option<BsdfSample> {
        let wi = warp::cosine_hemisphere(u);
        let (f, pdf) = self.eval_pdf(wo, wi, mode);
        (pdf > 0.0).then_some(BsdfSample { wi, f, pdf, lobe: Lobe::DIFFUSE, eta: 1.0 })
    }

    #[inline]
    fn chooses(&self) -> bool {
        false
    }

    #[inline]
    fn even(&self) -> Option<Rgb> {
        Some(self.reflectance * INV_PI)
    }

    fn albedo(&self) -> Rgb {
        self.reflectance
    }

    fn examples() -> Vec<(&'static str, Self)> {
        vec![("white", Self { reflectance: Rgb::ONE }), ("brown", Self { reflectance: Rgb::new(0.5, 0.3, 0.1) })]
    }
}
