//! Do two pictures agree? Student's t-tests of the image mean, of blocks and of pixels.

use super::picture::{Area, Picture};
use renderer::film::MergedImage;
use serde::Serialize;

/// Probability that any test of a family rejects although all pictures estimate what they should.
pub const FAMILY: f64 = 0.01;
/// Share of the pixels that must pass, as in the renderings tests of Mitsuba 3: they are tested at the level [`FAMILY`], corrected for
/// their number, and a few may fail, because the error of a pixel that rare paths light up is told by a handful of groups.
pub const PIXEL_SHARE: f64 = 0.9975;
/// Half the 99 % interval of a block's mean, relative, up to which it is tested. Beyond that a few rare bright paths decide, and Student's
/// distribution understates how often they are missed.
const BLOCK_NOISE: f64 = 0.25;
/// Renderers sum in single precision: a relative difference of means that is never held against them.
const ROUNDING: f64 = 1e-5;

/// A test of an area.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Test {
    /// `R`, `G` or `B`.
    pub channel: char,
    /// The block's top left pixel; `None` for the image.
    pub block: Option<[u32; 2]>,
    /// Mean of the picture.
    pub mean: f64,
    /// Mean of what it is compared with.
    pub other: f64,
    /// Welch's statistic.
    pub t: f64,
    /// Its degrees of freedom.
    pub dof: f64,
    /// Two-sided p-value.
    pub p: f64,
}

/// All tests of two pictures.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Comparison {
    /// Tests of the image mean and of blocks.
    pub tests: usize,
    /// Blocks and channels that were too noisy to test.
    pub noisy: usize,
    /// Largest relative difference of the image means, with its sign.
    pub difference: f64,
    /// Least p-value of the image means.
    pub mean_p: f64,
    /// Least p-value of the blocks.
    pub block_p: f64,
    /// Root mean square of the normal deviates that the blocks' p-values stand for: about 1 when the errors are told right.
    pub block_rms_z: f64,
    /// Share of the pixels and channels that pass.
    pub pixels: f64,
    /// The test with the least p-value.
    pub worst: Option<Test>,
}

impl Comparison {
    /// Whether no test rejects, given the least p-value that the whole family allows.
    pub fn agrees(&self, least_p: f64) -> bool {
        self.tests > 0 && self.mean_p >= least_p && self.block_p >= least_p && self.pixels >= PIXEL_SHARE
    }
}

/// Compares `image`, which is `picture`, with another picture of its size.
pub fn compare(image: &MergedImage, picture: &Picture<'_>, other: &Picture<'_>) -> Comparison {
    let test = |area: Area, block: Option<[u32; 2]>, c: usize| {
        let (a, b) = (picture.area(area, c), other.area(area, c));
        let w = a.welch(&b, ROUNDING)?;
        Some(Test { channel: ['R', 'G', 'B'][c], block, mean: a.mean, other: b.mean, t: w.t, dof: w.dof, p: w.p })
    };
    let means: Vec<Test> = (0..3).filter_map(|c| test(Area::whole(image), None, c)).collect();
    let areas = || Area::blocks(image).flat_map(|b| (0..3).map(move |c| (b, c)));
    let quiet = |(b, c): &(Area, usize)| {
        let e = picture.area(*b, *c);
        e.half_width(0.99) <= BLOCK_NOISE * e.mean
    };
    let blocks: Vec<Test> = areas().filter(quiet).filter_map(|(b, c)| test(b, Some(b.from), c)).collect();
    let least = |tests: &[Test]| tests.iter().map(|t| t.p).fold(1.0, f64::min);
    let relative = |t: &Test| if t.other == 0.0 { t.mean } else { t.mean / t.other - 1.0 };
    Comparison {
        tests: means.len() + blocks.len(),
        noisy: areas().count() - blocks.len(),
        difference: means.iter().map(relative).max_by(|a, b| a.abs().total_cmp(&b.abs())).unwrap_or(f64::NAN),
        mean_p: least(&means),
        block_p: least(&blocks),
        block_rms_z: statcheck::rms_deviate(blocks.iter().map(|t| t.p)),
        pixels: pixels_passed(image.mean.len(), picture, other),
        worst: means.into_iter().chain(blocks).min_by(|a, b| a.p.total_cmp(&b.p)),
    }
}

/// Share of pixels and channels whose test does not reject.
fn pixels_passed(pixels: usize, a: &Picture<'_>, b: &Picture<'_>) -> f64 {
    let least = statcheck::sidak(FAMILY, pixels);
    let passes = |i: usize, c: usize| a.pixel(i, c).welch(&b.pixel(i, c), ROUNDING).is_some_and(|w| w.p >= least);
    let passed = (0..pixels).flat_map(|i| (0..3).map(move |c| (i, c))).filter(|&(i, c)| passes(i, c)).count();
    passed as f64 / (3 * pixels) as f64
}
