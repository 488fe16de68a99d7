//! What pictures are compared with: a reference picture, or the mean of all other renders.

use super::measure::Target;
use renderer::film::exr::{self, Metadata};
use renderer::job::RenderSettings;
use std::borrow::Cow;
use std::path::Path;

/// A picture taken for the truth.
pub struct ReferencePicture {
    /// Width in pixels.
    pub width: u32,
    /// Height in pixels.
    pub height: u32,
    /// Whether it tells its variance.
    pub has_variance: bool,
    /// The picture and its variance.
    pub target: Target,
    metadata: Option<Metadata>,
}

impl ReferencePicture {
    /// Reads an EXR. Its variance is that of the layer `variance`, or the square of the layer `stderror`.
    pub fn read(path: &Path) -> Result<Self, String> {
        let fail = |e: String| format!("{}: {e}", path.display());
        let bytes = std::fs::read(path).map_err(|e| fail(e.to_string()))?;
        let picture = exr::decode(&bytes).map_err(fail)?;
        let mean = picture.triple(["R", "G", "B"]).ok_or_else(|| fail("it has no channels R, G and B".into()))?;
        let layer = |name: &str| {
            let [r, g, b] = ["R", "G", "B"].map(|c| format!("{name}.{c}"));
            picture.triple([&r, &g, &b])
        };
        let wide = |v: Vec<[f32; 3]>| v.into_iter().map(|p| p.map(f64::from)).collect::<Vec<_>>();
        let errors = || layer("stderror").map(|v| wide(v).into_iter().map(|p| p.map(|e| e * e)).collect());
        let variance = layer("variance").map(wide).or_else(errors);
        let (width, height, metadata) = (picture.width, picture.height, picture.metadata.clone());
        let has_variance = variance.is_some();
        let variance = variance.unwrap_or_else(|| vec![[0.0; 3]; mean.len()]);
        Ok(Self { width, height, has_variance, target: Target { mean: wide(mean), variance }, metadata })
    }

    /// What makes pictures of these settings differ from this one, as far as the file tells.
    pub fn differences(&self, settings: &RenderSettings) -> Vec<String> {
        let Some(metadata) = &self.metadata else { return Vec::new() };
        let own = serde_json::to_value(settings).unwrap_or_default();
        let tell =
            |key: &str| format!("the reference was made with {key} {}, not {}", metadata.settings[key], own[key]);
        let differing = ["max_depth", "filter"].into_iter().filter(|key| own[*key] != metadata.settings[*key]);
        differing.map(tell).collect()
    }
}

/// Renders of several variants, each of which is compared with the mean of the others that are in the pool.
pub struct Pool<'a> {
    /// Which of the renders are in, with their variant; those of one variant are as noisy as each other.
    members: Vec<Option<usize>>,
    pictures: &'a [&'a [[f32; 3]]],
    sum: Vec<[f64; 3]>,
    /// Variance of one render of each variant, from the scatter of those in the pool.
    variances: Vec<Vec<[f64; 3]>>,
}

impl<'a> Pool<'a> {
    /// `members` tells of each picture its variant, and `None` of one that is only judged. A variant has no member or at least two.
    pub fn new(pictures: &'a [&'a [[f32; 3]]], members: Vec<Option<usize>>) -> Self {
        let pixels = pictures.first().map_or(0, |p| p.len());
        let variants = members.iter().flatten().max().map_or(0, |v| v + 1);
        let (mut sum, mut variances) = (vec![[0.0; 3]; pixels], Vec::with_capacity(variants));
        for variant in 0..variants {
            let own: Vec<_> = pictures.iter().zip(&members).filter(|(_, m)| **m == Some(variant)).collect();
            let count = own.len() as f64;
            let mut variance = vec![[0.0; 3]; pixels];
            for (i, pixel) in variance.iter_mut().enumerate() {
                for c in 0..3 {
                    let values = || own.iter().map(|(p, _)| f64::from(p[i][c]));
                    let total: f64 = values().sum();
                    let mean = total / count;
                    let scatter: f64 = values().map(|v| (v - mean) * (v - mean)).sum();
                    sum[i][c] += total;
                    pixel[c] = if own.len() > 1 { scatter / (count - 1.0) } else { 0.0 };
                }
            }
            variances.push(variance);
        }
        Self { members, pictures, sum, variances }
    }

    /// The mean of all members but picture `i`, and its variance.
    fn target(&self, i: usize) -> Target {
        let own = self.members[i].map(|_| self.pictures[i]);
        let mut counts = vec![0.0; self.variances.len()];
        let others = self.members.iter().enumerate().filter(|(j, _)| *j != i);
        others.for_each(|(_, m)| m.iter().for_each(|v| counts[*v] += 1.0));
        let n: f64 = counts.iter().sum();
        let mean = |p: usize, c: usize| (self.sum[p][c] - own.map_or(0.0, |o| f64::from(o[p][c]))) / n;
        let variance =
            |p: usize, c: usize| counts.iter().zip(&self.variances).map(|(k, v)| k * v[p][c]).sum::<f64>() / (n * n);
        let image = |f: &dyn Fn(usize, usize) -> f64| {
            (0..self.sum.len()).map(|p| std::array::from_fn(|c| f(p, c))).collect::<Vec<[f64; 3]>>()
        };
        Target { mean: image(&mean), variance: image(&variance) }
    }
}

/// Where the truth comes from.
pub enum Reference<'a> {
    /// A picture.
    Picture(&'a ReferencePicture),
    /// All other renders.
    Pool(Pool<'a>),
}

impl Reference<'_> {
    /// What render `i` is compared with; independent of it.
    pub fn target(&self, i: usize) -> Cow<'_, Target> {
        match self {
            Self::Picture(p) => Cow::Borrowed(&p.target),
            Self::Pool(p) => Cow::Owned(p.target(i)),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::error::measure::{Measure, compare};
    use crate::meshes::Random;

    const PIXELS: usize = 4000;

    /// A picture of the truth (0.2 to 1) with uniform noise of a given variance in each pixel and channel, and with some bias.
    fn noisy(random: &mut Random, variance: f64, bias: f32) -> Vec<[f32; 3]> {
        let width = (12.0 * variance).sqrt() as f32;
        let truth = |i: usize| 0.2 + 0.8 * i as f32 / PIXELS as f32;
        (0..PIXELS).map(|i| [0; 3].map(|_| truth(i) + bias + width * (random.next() - 0.5))).collect()
    }

    /// Mean error of the pictures of each variant, and the largest share that the reference's variance has in it.
    fn errors(pictures: &[Vec<[f32; 3]>], variants: &[usize], members: Vec<Option<usize>>) -> Vec<[f64; 2]> {
        let slices: Vec<&[[f32; 3]]> = pictures.iter().map(Vec::as_slice).collect();
        let reference = Reference::Pool(Pool::new(&slices, members));
        let mut sums = vec![[0.0, 0.0, 0.0]; variants.iter().max().unwrap() + 1];
        for (i, v) in variants.iter().enumerate() {
            let d = compare(slices[i], &reference.target(i)).unwrap();
            sums[*v][0] += d.error(Measure::Mse);
            sums[*v][1] = d.reference[0].max(sums[*v][1]);
            sums[*v][2] += 1.0;
        }
        sums.iter().map(|[e, r, n]| [e / n, r / (e / n)]).collect()
    }

    /// Two variants of known variance, one a hundred times as noisy as the other: both come out, though the noisier one is
    /// most of the reference's variance.
    #[test]
    fn leaving_one_out_recovers_known_variances() {
        let mut random = Random(11);
        let variants: Vec<usize> = (0..12).map(|i| i % 2).collect();
        let pictures: Vec<_> = variants.iter().map(|v| noisy(&mut random, [0.04, 0.0004][*v], 0.0)).collect();
        let found = errors(&pictures, &variants, variants.iter().map(|v| Some(*v)).collect());
        assert!((found[0][0] / 0.04 - 1.0).abs() < 0.02, "{found:?}");
        // Var R = (6 x 0.04 + 5 x 0.0004) / 11^2 is five times the quieter variant's.
        assert!((found[1][0] / 0.0004 - 1.0).abs() < 0.25, "{found:?}");
        assert!((found[1][1] / 5.0 - 1.0).abs() < 0.3 && found[0][1] < 0.1, "{found:?}");
    }

    /// With one of the two as the pool, the bias of the other shows in full.
    #[test]
    fn a_pool_of_one_variant_shows_the_bias_of_another() {
        let mut random = Random(5);
        let variants: Vec<usize> = (0..12).map(|i| i % 2).collect();
        let pictures: Vec<_> =
            variants.iter().map(|v| noisy(&mut random, [0.001, 0.0004][*v], [0.1, 0.0][*v])).collect();
        let found = errors(&pictures, &variants, variants.iter().map(|v| (*v == 1).then_some(*v)).collect());
        assert!((found[0][0] / 0.011 - 1.0).abs() < 0.02, "{found:?}");
        assert!((found[1][0] / 0.0004 - 1.0).abs() < 0.02, "{found:?}");
    }

    /// Against the pool of its own renders alone, an unbiased estimate is exactly their sample variance.
    #[test]
    fn alone_it_is_the_sample_variance() {
        let pictures = vec![vec![[1.0f32, 2.0, 3.0]], vec![[2.0, 2.0, 5.0]], vec![[6.0, 2.0, 1.0]]];
        let found = errors(&pictures, &[0; 3], vec![Some(0); 3]);
        assert!((found[0][0] - (7.0 + 0.0 + 4.0) / 3.0).abs() < 1e-9, "{found:?}");
    }
}
