//! Evaluation of textures. Any coordinates are fine: huge ones lose their fraction, NaN and infinity count as zero.

use super::{Filter, FloatParam, Image, RgbParam, Texture, Wrap};
use crate::math::Vec2;
use crate::spectrum::Rgb;

impl Texture {
    /// The colour at texture coordinates `uv`.
    pub fn eval(&self, uv: Vec2) -> Rgb {
        match self {
            Self::Image { image, wrap, filter, uv: transform, scale } => {
                let uv = transform.apply(uv);
                *scale
                    * match filter {
                        Filter::Nearest => image.nearest(uv, *wrap),
                        Filter::Linear => image.bilinear(uv, *wrap),
                    }
            }
            Self::Checkerboard { a, b, uv: transform } => {
                let uv = transform.apply(uv);
                if is_odd_square(uv.x) == is_odd_square(uv.y) { *a } else { *b }
            }
        }
    }
}

impl RgbParam {
    /// Its value at texture coordinates `uv`.
    #[inline]
    pub fn eval(&self, textures: &[Texture], uv: Vec2) -> Rgb {
        match *self {
            Self::Const(value) => value,
            Self::Texture(id, factor) => textures[id.0 as usize].eval(uv) * factor,
        }
    }
}

impl FloatParam {
    /// Its value at texture coordinates `uv`.
    #[inline]
    pub fn eval(&self, textures: &[Texture], uv: Vec2) -> f32 {
        match *self {
            Self::Const(value) => value,
            Self::Texture(id, channel, factor) => textures[id.0 as usize].eval(uv)[channel as usize] * factor,
        }
    }
}

impl Image {
    /// The texel in column `x` of row `y`.
    #[inline]
    pub fn texel(&self, x: u32, y: u32) -> Rgb {
        self.texels[y as usize * self.width as usize + x as usize]
    }

    /// The texel whose square holds `uv`.
    fn nearest(&self, uv: Vec2, wrap: [Wrap; 2]) -> Rgb {
        self.texel(nearest_texel(uv.x, self.width, wrap[0]), nearest_texel(uv.y, self.height, wrap[1]))
    }

    /// Bilinear interpolation of the four texels around `uv`; texel centres are at half-integers.
    fn bilinear(&self, uv: Vec2, wrap: [Wrap; 2]) -> Rgb {
        let ([x0, x1], fx) = texel_pair(uv.x, self.width, wrap[0]);
        let ([y0, y1], fy) = texel_pair(uv.y, self.height, wrap[1]);
        let row = |y| self.texel(x0, y) * (1.0 - fx) + self.texel(x1, y) * fx;
        row(y0) * (1.0 - fy) + row(y1) * fy
    }
}

/// Whether `x` lies in an odd interval of length 0.5.
#[inline]
fn is_odd_square(x: f32) -> bool {
    (2.0 * x).floor().rem_euclid(2.0) == 1.0
}

/// Brings a coordinate into one period: [0, 1], for [`Wrap::Mirror`] [0, 2].
#[inline]
fn wrapped(x: f32, wrap: Wrap) -> f32 {
    let x = if x.is_finite() { x } else { 0.0 };
    match wrap {
        Wrap::Repeat => x - x.floor(),
        Wrap::Mirror => x - 2.0 * (0.5 * x).floor(),
        Wrap::Clamp => x.clamp(0.0, 1.0),
    }
}

/// The index in `0..size` that stands for texel `i`, which is off by less than a period.
#[inline]
fn wrapped_texel(i: i64, size: u32, wrap: Wrap) -> u32 {
    let n = i64::from(size);
    let i = match wrap {
        Wrap::Repeat => i.rem_euclid(n),
        Wrap::Mirror => {
            let i = i.rem_euclid(2 * n);
            if i < n { i } else { 2 * n - 1 - i }
        }
        Wrap::Clamp => i.clamp(0, n - 1),
    };
    i as u32
}

#[inline]
fn nearest_texel(x: f32, size: u32, wrap: Wrap) -> u32 {
    wrapped_texel((wrapped(x, wrap) * size as f32) as i64, size, wrap)
}

/// The two texels whose centres enclose `x`, and the weight of the second.
#[inline]
fn texel_pair(x: f32, size: u32, wrap: Wrap) -> ([u32; 2], f32) {
    let x = wrapped(x, wrap) * size as f32 - 0.5;
    let floor = x.floor();
    let i = floor as i64;
    ([wrapped_texel(i, size, wrap), wrapped_texel(i + 1, size, wrap)], x - floor)
}
