use crate::math::Vec2;
use crate::spectrum::Rgb;
use crate::texture::{RgbParam, Texture};

/// Where a material's parameters are looked up; what comes out is in range, whatever the textures hold.
pub(super) struct At<'a> {
    pub textures: &'a [Texture],
    pub uv: Vec2,
}

impl At<'_> {
    /// A reflectance or transmittance in [0, 1].
    pub fn reflectance(&self, param: RgbParam) -> Rgb {
        param.eval(self.textures, self.uv).map(unit)
    }
}

/// Clamped to [0, 1]; NaN becomes 0.
fn unit(x: f32) -> f32 {
    if x > 0.0 { x.min(1.0) } else { 0.0 }
}
