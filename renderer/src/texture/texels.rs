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
    Bytes(Samples<u8>),
    /// From 16-bit samples: 2 or 6 bytes each.
    Words(Samples<u16>),
    /// Those of another picture, each replaced by its luminance.
    Luminance(Arc<Image>),
}

/// Integer samples, one or three a texel, and what they stand for.
#[derive(Clone, Debug, PartialEq)]
pub struct Samples<T> {
    data: Vec<T>,
    grey: bool,
    values: &'static [f32],
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

    /// The linear values of some of them.
    #[inline]
    pub fn get<const N: usize>(&self, at: [usize; N]) -> [Rgb; N] {
        match self {
            Self::Float(texels) => at.map(|i| texels[i]),
            Self::Bytes(samples) => samples.get(at),
            Self::Words(samples) => samples.get(at),
            Self::Luminance(image) => image.texels.get(at).map(|t| Rgb::splat(t.luminance())),
        }
    }

    /// The linear values of all.
    pub fn iter(&self) -> impl Iterator<Item = Rgb> {
        (0..self.len()).map(|i| {
            let [texel] = self.get([i]);
            texel
        })
    }
}

impl<T: Copy + Into<usize>> Samples<T> {
    /// Interleaved samples of 1 (grey), 2 (grey, alpha), 3 (RGB) or 4 (RGB, alpha) channels; alpha is dropped. Sample `i` stands for
    /// `values[i]`. `None` where there are other numbers of samples or channels, or samples without a value.
    pub fn new(mut data: Vec<T>, channels: usize, values: &'static [f32]) -> Option<Self> {
        let valued = values.len() >= 1 << (8 * size_of::<T>());
        if !valued || !(1..=4).contains(&channels) || !data.len().is_multiple_of(channels) {
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
    fn get<const N: usize>(&self, at: [usize; N]) -> [Rgb; N] {
        let value = |sample: T| self.values[sample.into()];
        if self.grey {
            return at.map(|i| Rgb::splat(value(self.data[i])));
        }
        at.map(|i| {
            let texel = &self.data[3 * i..3 * i + 3];
            Rgb::new(value(texel[0]), value(texel[1]), value(texel[2]))
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::Vec2;
    use crate::texture::{Filter, Texture, UvTransform, Wrap};

    /// Values of no pattern for 16-bit samples, and the first 256 for 8-bit ones.
    fn values() -> &'static [f32] {
        static VALUES: std::sync::OnceLock<Vec<f32>> = std::sync::OnceLock::new();
        VALUES.get_or_init(|| (0..65_536u32).map(|i| (i.wrapping_mul(2_654_435_761) >> 8) as f32 * 3.1e-8).collect())
    }

    fn kept(texels: Option<Samples<u8>>) -> Texels {
        Texels::Bytes(texels.unwrap())
    }

    #[test]
    fn lookups_have_the_bits_of_single_precision_texels() {
        let (width, height) = (7, 5);
        let data: Vec<u8> = (0..width * height * 4).map(|i| (i * 37 % 256) as u8).collect();
        let words = || data.iter().map(|v| u16::from(*v) * 251).collect::<Vec<u16>>();
        let cut = |channels: u32| data[..(width * height * channels) as usize].to_vec();
        let mut stores: Vec<Texels> =
            (1..=4).map(|n| kept(Samples::new(cut(n), n as usize, &values()[..256]))).collect();
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
    fn samples_without_a_texel_or_a_value_are_refused() {
        assert!(Samples::<u8>::new(vec![0; 6], 3, &values()[..256]).is_some());
        assert!(Samples::<u8>::new(vec![0; 7], 3, &values()[..256]).is_none());
        assert!(Samples::<u8>::new(vec![0; 6], 6, &values()[..256]).is_none());
        assert!(Samples::<u8>::new(vec![0; 6], 0, &values()[..256]).is_none());
        assert!(Samples::<u8>::new(vec![0; 6], 3, &values()[..255]).is_none());
        assert!(Samples::<u16>::new(vec![0; 6], 3, &values()[..65_535]).is_none());
    }
}
