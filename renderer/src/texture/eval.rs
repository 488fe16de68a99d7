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
        self.texels.at(self.index(x, y))
    }

    /// Where the texel in column `x` of row `y` is.
    #[inline]
    fn index(&self, x: u32, y: u32) -> usize {
        y as usize * self.width as usize + x as usize
    }

    /// The texel whose square holds `uv`.
    fn nearest(&self, uv: Vec2, wrap: [Wrap; 2]) -> Rgb {
        self.texel(nearest_texel(uv.x, self.width, wrap[0]), nearest_texel(uv.y, self.height, wrap[1]))
    }

    /// Bilinear interpolation of the four texels around `uv`; texel centres are at half-integers.
    fn bilinear(&self, uv: Vec2, wrap: [Wrap; 2]) -> Rgb {
        let ([x0, x1], fx) = texel_pair(uv.x, self.width, wrap[0]);
        let ([y0, y1], fy) = texel_pair(uv.y, self.height, wrap[1]);
        let at = [self.index(x0, y0), self.index(x1, y0), self.index(x0, y1), self.index(x1, y1)];
        self.texels.blend(at, [fx, fy])
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::texture::{Texels, TextureId, UvTransform};
    use std::sync::Arc;

    /// A row of grey texels.
    fn row(values: &[f32], wrap: Wrap, filter: Filter) -> Texture {
        let image = Image {
            width: values.len() as u32,
            height: 1,
            texels: Texels::Float(values.iter().map(|v| Rgb::splat(*v)).collect()),
        };
        let (image, wrap) = (Arc::new(image), [wrap; 2]);
        Texture::Image { image, wrap, filter, uv: UvTransform::IDENTITY, scale: Rgb::ONE }
    }

    fn at(texture: &Texture, u: f32) -> f32 {
        texture.eval(Vec2::new(u, 0.3)).r
    }

    #[test]
    fn texels_have_their_centres_at_half_integers() {
        for wrap in [Wrap::Repeat, Wrap::Mirror, Wrap::Clamp] {
            let linear = row(&[0.0, 1.0, 4.0, 9.0], wrap, Filter::Linear);
            for (i, value) in [0.0, 1.0, 4.0, 9.0].into_iter().enumerate() {
                assert_eq!(at(&linear, (i as f32 + 0.5) / 4.0), value, "{wrap:?}");
            }
            assert_eq!(at(&linear, 0.5), 2.5, "{wrap:?}");
        }
    }

    #[test]
    fn wrapping() {
        let values = [0.0, 1.0, 4.0, 9.0];
        // Texel i of the endless row, for i from -5 to 8.
        let expected = [
            (Wrap::Repeat, [9.0, 0.0, 1.0, 4.0, 9.0, 0.0, 1.0, 4.0, 9.0, 0.0, 1.0, 4.0, 9.0, 0.0]),
            (Wrap::Mirror, [9.0, 9.0, 4.0, 1.0, 0.0, 0.0, 1.0, 4.0, 9.0, 9.0, 4.0, 1.0, 0.0, 0.0]),
            (Wrap::Clamp, [0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0, 4.0, 9.0, 9.0, 9.0, 9.0, 9.0, 9.0]),
        ];
        for (wrap, expected) in expected {
            for (i, value) in (-5..).zip(expected) {
                let u = (i as f32 + 0.5) / 4.0;
                assert_eq!(at(&row(&values, wrap, Filter::Nearest), u), value, "{wrap:?}, texel {i}");
                assert_eq!(at(&row(&values, wrap, Filter::Linear), u), value, "{wrap:?}, texel {i}");
            }
            // Half-way between the last texel and the next.
            let next = at(&row(&values, wrap, Filter::Nearest), 4.5 / 4.0);
            assert_eq!(at(&row(&values, wrap, Filter::Linear), 1.0), 0.5 * (9.0 + next), "{wrap:?}");
        }
    }

    #[test]
    fn any_coordinates_give_a_texel() {
        let wild = [0.0, -0.0, 1.0, -1e-9, 0.999_999_94, 1e9, -3e15, f32::MAX, f32::MIN, f32::INFINITY, f32::NAN];
        for wrap in [Wrap::Repeat, Wrap::Mirror, Wrap::Clamp] {
            for filter in [Filter::Nearest, Filter::Linear] {
                for values in [&[3.0][..], &[3.0, 3.0, 3.0]] {
                    let texture = row(values, wrap, filter);
                    assert!(wild.iter().all(|u| (at(&texture, *u) - 3.0).abs() < 1e-6), "{wrap:?} {filter:?}");
                }
            }
        }
        let checks = Texture::Checkerboard { a: Rgb::ZERO, b: Rgb::ONE, uv: UvTransform::IDENTITY };
        assert!(wild.iter().all(|u| checks.eval(Vec2::new(*u, *u)) == Rgb::ZERO));
    }

    #[test]
    fn rows_run_with_v_and_transforms_come_first() {
        let image = Image { width: 1, height: 2, texels: vec![Rgb::ZERO, Rgb::ONE].into() };
        let uv = UvTransform([0.0, 1.0, 0.0, 1.0, 0.0, 0.0]);
        let texture = Texture::Image {
            image: Arc::new(image),
            wrap: [Wrap::Clamp; 2],
            filter: Filter::Nearest,
            uv,
            scale: Rgb::new(1.0, 2.0, 3.0),
        };
        // u and v change places.
        assert_eq!(texture.eval(Vec2::new(0.2, 0.9)), Rgb::ZERO);
        assert_eq!(texture.eval(Vec2::new(0.8, 0.1)), Rgb::new(1.0, 2.0, 3.0));
        let textures = [texture];
        let factor = Rgb::new(0.5, 0.5, 2.0);
        let colour = RgbParam::Texture(TextureId(0), factor).eval(&textures, Vec2::new(0.8, 0.1));
        assert_eq!(colour, Rgb::new(0.5, 1.0, 6.0));
        let number = FloatParam::Texture(TextureId(0), 1, 0.25).eval(&textures, Vec2::new(0.8, 0.1));
        assert_eq!(number, 0.5);
    }

    #[test]
    fn checkerboards_have_squares_of_side_one_half() {
        let checks = Texture::Checkerboard { a: Rgb::ZERO, b: Rgb::ONE, uv: UvTransform::IDENTITY };
        for (u, v, b) in
            [(0.1, 0.1, 0.0), (0.6, 0.1, 1.0), (0.6, 0.6, 0.0), (0.1, 0.6, 1.0), (-0.1, 0.1, 1.0), (-0.1, -0.1, 0.0)]
        {
            assert_eq!(checks.eval(Vec2::new(u, v)), Rgb::splat(b), "{u}, {v}");
        }
    }
}
