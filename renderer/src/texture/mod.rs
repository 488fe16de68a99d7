//! Textures: anything that gives a colour or a number at texture coordinates.

mod eval;
mod texels;

use crate::math::Vec2;
use crate::spectrum::Rgb;
use std::sync::Arc;

pub use texels::{Samples, Texels};

/// Index of a texture in the scene.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct TextureId(pub u32);

/// A decoded picture in linear Rec.709 (or raw data), row 0 at the top of the file.
#[derive(Clone, Debug, PartialEq)]
pub struct Image {
    /// Width in texels, > 0.
    pub width: u32,
    /// Height in texels, > 0.
    pub height: u32,
    /// `width * height` texels, row-major.
    pub texels: Texels,
}

/// What lies outside [0, 1).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Wrap {
    /// Tiles.
    Repeat,
    /// Tiles, every other one mirrored.
    Mirror,
    /// The border texel goes on.
    Clamp,
}

/// How texels are interpolated.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Filter {
    /// The nearest texel.
    Nearest,
    /// Bilinear.
    Linear,
}

/// `uv' = (m[0] u + m[1] v + m[2], m[3] u + m[4] v + m[5])`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct UvTransform(pub [f32; 6]);

impl UvTransform {
    /// No change.
    pub const IDENTITY: Self = Self([1.0, 0.0, 0.0, 0.0, 1.0, 0.0]);

    /// Applies it.
    #[inline]
    pub fn apply(&self, uv: Vec2) -> Vec2 {
        let m = &self.0;
        Vec2::new(m[0] * uv.x + m[1] * uv.y + m[2], m[3] * uv.x + m[4] * uv.y + m[5])
    }
}

/// A texture. `v = 0` is row 0 of an image; importers flip where their format says otherwise.
#[derive(Clone, Debug, PartialEq)]
pub enum Texture {
    /// A picture.
    Image {
        /// Texels.
        image: Arc<Image>,
        /// Outside [0, 1), along u and v.
        wrap: [Wrap; 2],
        /// Interpolation.
        filter: Filter,
        /// Applied to the coordinates first.
        uv: UvTransform,
        /// Multiplies the texels.
        scale: Rgb,
    },
    /// Two colours in squares of side 0.5 (after `uv`): `a` where floor(2u) + floor(2v) is even.
    Checkerboard {
        /// At the origin.
        a: Rgb,
        /// Beside it.
        b: Rgb,
        /// Applied to the coordinates first.
        uv: UvTransform,
    },
}

/// A colour parameter of a material or light.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum RgbParam {
    /// The same everywhere.
    Const(Rgb),
    /// From a texture, times a factor.
    Texture(TextureId, Rgb),
}

/// A number parameter of a material.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum FloatParam {
    /// The same everywhere.
    Const(f32),
    /// From a channel (0 red, 1 green, 2 blue) of a texture, times a factor.
    Texture(TextureId, u8, f32),
}
