use super::Roughness;
use super::microfacet::Microfacet;
use crate::math::Vec2;
use crate::spectrum::Rgb;
use crate::texture::{FloatParam, RgbParam, Texture};

/// Where a material's parameters are looked up; what comes out is in range, whatever the textures hold.
pub(super) struct At<'a> {
    pub textures: &'a [Texture],
    pub uv: Vec2,
}

impl At<'_> {
    /// A reflectance or transmittance in [0, 1].
    #[inline]
    pub fn reflectance(&self, param: RgbParam) -> Rgb {
        param.eval(self.textures, self.uv).map(unit)
    }

    /// A number in [0, 1].
    pub fn unit(&self, param: FloatParam) -> f32 {
        unit(param.eval(self.textures, self.uv))
    }

    /// The facets of a rough surface; `None` when it is smooth.
    pub fn facets(&self, roughness: Option<Roughness>) -> Option<Microfacet> {
        let Roughness { distribution, alpha_u, alpha_v } = roughness?;
        let alpha = |param: FloatParam| {
            let alpha = param.eval(self.textures, self.uv);
            if alpha > 0.0 { alpha.min(MAX_ALPHA) } else { 0.0 }
        };
        Microfacet::new(distribution, alpha(alpha_u), alpha(alpha_v))
    }
}

/// Rougher surfaces than this differ from it by nothing that can be seen.
const MAX_ALPHA: f32 = 10.0;

/// Clamped to [0, 1]; NaN becomes 0.
#[inline]
fn unit(x: f32) -> f32 {
    if x > 0.0 { x.min(1.0) } else { 0.0 }
}
