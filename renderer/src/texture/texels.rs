//! How texels are kept: integers as they are in the file, decoded by a table when they are looked up.

use super::Image;
use crate::spectrum::Rgb;
use std::sync::Arc;

/// The texels of a picture, row-major, in the form that takes the least memory and loses nothing.
#[derive(Clone, Debug, PartialEq)]
pub enum Texels {
    /// Single precision, from float formats: 12 bytes each.
    Float(Vec<Rgb>),
    /// From 8-bit samples: 1 or 3 bytes each.
    Bytes(Samples<u8, 256>),
    /// From 16-bit samples: 2 or 6 bytes each.
    Words(Samples<u16, 65_536>),
    /// Those of another picture, each replaced by its luminance.
    Luminance(Arc<Image>),
}

/// Integer samples, one or three a texel, and what they stand for: `LEVELS` values, as many as `T` has.
#[derive(Clone, Debug, PartialEq)]
pub struct Samples<T, const LEVELS: usize> {
    data: Vec<T>,
    grey: bool,
    values: &'static [f32; LEVELS],
}

impl From<Vec<Rgb>> for Texels {
    fn from(texels: Vec<Rgb>) -> Self {
        Self::Float(texels)
    }
}

impl Texels {
    /// How many.
    pub fn len(&self) -> usize {
        match self {
            Self::Float(texels) => texels.len(),
            Self::Bytes(samples) => samples.len(),
            Self::Words(samples) => samples.len(),
            Self::Luminance(image) => image.texels.len(),
        }
    }

    /// Whether there are none.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Bytes that they take; those of a picture that is shared count nothing.
    pub fn bytes(&self) -> usize {
        match self {
            Self::Float(texels) => size_of_val(texels.as_slice()),
            Self::Bytes(samples) => size_of_val(samples.data.as_slice()),
            Self::Words(samples) => size_of_val(samples.data.as_slice()),
            Self::Luminance(_) => 0,
        }
    }

    /// The linear value of one.
    #[inline]
    pub fn at(&self, i: usize) -> Rgb {
        match self {
            Self::Float(texels) => texels[i],
            Self::Bytes(samples) => samples.at(i),
            Self::Words(samples) => samples.at(i),
            Self::Luminance(image) => grey_of(image, i),
        }
    }

    /// The linear values of all.
    pub fn iter(&self) -> impl Iterator<Item = Rgb> {
        (0..self.len()).map(|i| self.at(i))
    }

    /// Bilinear interpolation of two texels of a row and two of the next; `f` are the weights of the second column and row.
    #[inline]
    pub(super) fn blend(&self, at: [usize; 4], f: [f32; 2]) -> Rgb {
        // How texels are kept is told once for all four.
        match self {
            Self::Float(texels) => blend(|i| texels[i], at, f),
            Self::Bytes(samples) if samples.grey => blend(|i| samples.grey(i), at, f),
            Self::Bytes(samples) => blend(|i| samples.colour(i), at, f),
            other => blend(|i| other.at(i), at, f),
        }
    }
}

/// Apart, so that lookups, which it calls again, stay small enough to be inlined.
#[inline(never)]
fn grey_of(image: &Image, i: usize) -> Rgb {
    Rgb::splat(image.texels.at(i).luminance())
}

#[inline]
fn blend(texel: impl Fn(usize) -> Rgb, at: [usize; 4], f: [f32; 2]) -> Rgb {
    let row = |left, right| texel(left) * (1.0 - f[0]) + texel(right) * f[0];
    row(at[0], at[1]) * (1.0 - f[1]) + row(at[2], at[3]) * f[1]
}

impl<T: Copy + Into<usize>, const LEVELS: usize> Samples<T, LEVELS> {
    /// Interleaved samples of 1 (grey), 2 (grey, alpha), 3 (RGB) or 4 (RGB, alpha) channels; alpha is dropped. Sample `i` stands for
    /// `values[i]`. `None` where there are other numbers of samples or channels.
    pub fn new(mut data: Vec<T>, channels: usize, values: &'static [f32; LEVELS]) -> Option<Self> {
        if !(1..=4).contains(&channels) || !data.len().is_multiple_of(channels) {
            return None;
        }
        if channels.is_multiple_of(2) {
            // In place: a second copy of a large picture may not fit.
            let kept = channels - 1;
            let count = data.len() / channels;
            (0..count).for_each(|i| data.copy_within(i * channels..i * channels + kept, i * kept));
            data.truncate(count * kept);
            data.shrink_to_fit();
        }
        Some(Self { data, grey: channels < 3, values })
    }

    fn len(&self) -> usize {
        if self.grey { self.data.len() } else { self.data.len() / 3 }
    }

    #[inline]
    fn at(&self, i: usize) -> Rgb {
        if self.grey { self.grey(i) } else { self.colour(i) }
    }

    #[inline]
    fn grey(&self, i: usize) -> Rgb {
        Rgb::splat(self.values[self.data[i].into()])
    }

    #[inline]
    fn colour(&self, i: usize) -> Rgb {
        let texel = &self.data[3 * i..3 * i + 3];
        Rgb::new(self.values[texel[0].into()], self.values[texel[1].into()], self.values[texel[2].into()])
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::Vec2;
    use crate::texture::{Filter, Texture, UvTransform, Wrap};

    /// Values of no pattern for 16-bit samples, and the first 256 for 8-bit ones.
    fn values<const LEVELS: usize>() -> &'static [f32; LEVELS] {
        static VALUES: std::sync::OnceLock<Vec<f32>> = std::sync::OnceLock::new();
        let value = |i: u32| (i.wrapping_mul(2_654_435_761) >> 8) as f32 * 3.1e-8;
        VALUES.get_or_init(|| (0..65_536).map(value).collect()).first_chunk().unwrap()
    }

    #[test]
    fn lookups_have_the_bits_of_single_precision_texels() {
        let (width, height) = (7, 5);
        let data: Vec<u8> = (0..width * height * 4).map(|i| (i * 37 % 256) as u8).collect();
        let words = || data.iter().map(|v| u16::from(*v) * 251).collect::<Vec<u16>>();
        let cut = |channels: u32| data[..(width * height * channels) as usize].to_vec();
        let mut stores: Vec<Texels> =
            (1..=4).map(|n| Texels::Bytes(Samples::new(cut(n), n as usize, values()).unwrap())).collect();
        stores.push(Texels::Words(Samples::new(words(), 4, values()).unwrap()));
        let coloured = Image { width, height, texels: stores[2].clone() };
        stores.push(Texels::Luminance(Arc::new(coloured)));
        for texels in stores {
            let float: Vec<Rgb> = texels.iter().collect();
            assert_eq!(float.len(), 35);
            for (wrap, filter) in [(Wrap::Repeat, Filter::Nearest), (Wrap::Mirror, Filter::Linear)] {
                let texture = |texels| {
                    let image = Arc::new(Image { width, height, texels });
                    Texture::Image { image, wrap: [wrap; 2], filter, uv: UvTransform::IDENTITY, scale: Rgb::ONE }
                };
                let (a, b) = (texture(texels.clone()), texture(float.clone().into()));
                for i in 0..1000u16 {
                    let uv = Vec2::new(f32::from(i) * 0.0173 - 3.0, f32::from(i) * 0.0071 - 2.0);
                    assert_eq!(
                        a.eval(uv).to_array().map(f32::to_bits),
                        b.eval(uv).to_array().map(f32::to_bits),
                        "{uv}"
                    );
                }
            }
        }
    }

    #[test]
    fn luminance_is_that_of_each_texel_and_takes_nothing() {
        let texels = vec![Rgb::new(0.1, 0.5, 0.9), Rgb::splat(0.3)];
        let grey = Texels::Luminance(Arc::new(Image { width: 2, height: 1, texels: texels.clone().into() }));
        assert!(grey.iter().eq(texels.iter().map(|t| Rgb::splat(t.luminance()))));
        assert_eq!((grey.len(), grey.bytes()), (2, 0));
    }

    #[test]
    fn samples_without_a_texel_are_refused() {
        let fits = |count, channels| Samples::new(vec![0u8; count], channels, values::<256>()).is_some();
        assert!(fits(6, 3) && fits(6, 2) && fits(0, 1));
        assert!(!fits(7, 3) && !fits(6, 6) && !fits(6, 0));
    }
}
