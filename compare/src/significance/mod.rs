//! Do two estimates of a picture agree? Welch's t-tests of the image mean and of blocks of 16 x 16 pixels, family-wise.
//!
//! A lightfarm file tells the error of each block from the scatter between its replicate groups, whatever its pixels share. A file
//! that gives only each pixel's variance is taken to have pixels that are independent but for its reconstruction filter: where
//! samples are splatted with a filter into several pixels, the error of a mean is larger than the pixels' errors let one think.

mod errors;

pub use errors::{Assumptions, filter_by_name};

use super::pair::Pair;
use errors::Errors;
use renderer::film::ERROR_BLOCK;
use renderer::film::exr::Picture;
use serde::Serialize;
use statcheck::Estimate;
use std::ops::Range;

/// Probability that any of the tests rejects although both pictures estimate the same.
const FAMILY: f64 = 0.01;
/// Renderers sum in single precision: a relative difference of means that is never held against them.
const ROUNDING: f64 = 1e-5;
/// Names of the channels.
const CHANNELS: [&str; 3] = ["R", "G", "B"];

/// One t-test.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Test {
    /// `R`, `G` or `B`.
    pub channel: &'static str,
    /// The block's top left pixel; `None` for the image.
    pub block: Option<[u32; 2]>,
    /// Means.
    pub a: f64,
    /// Means.
    pub b: f64,
    /// Welch's statistic.
    pub t: f64,
    /// Its degrees of freedom.
    pub dof: f64,
    /// Two-sided p-value.
    pub p: f64,
}

/// The outcome of all tests.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Agreement {
    /// Where the error of A comes from.
    pub a: String,
    /// Where the error of B comes from.
    pub b: String,
    /// The image mean of each channel.
    pub image: Vec<Test>,
    /// Tests of blocks.
    pub block_tests: usize,
    /// Blocks left out: pixels that can't be compared, or an unknown error.
    pub blocks_skipped: usize,
    /// Root mean square of the normal deviates that the blocks' p-values stand for: about 1 when the errors are told right.
    pub block_rms_z: f64,
    /// The tests with the smallest p-values, smallest first.
    pub worst: Vec<Test>,
    /// p-value of the whole family (Sidak).
    pub family_p: f64,
    /// Whether the family is not rejected at 99 %.
    pub agree: bool,
}

/// Tests two pictures; `None` when either says nothing of its error.
pub fn test(pair: &Pair, a: &Picture, b: &Picture, assume: &Assumptions) -> Option<Agreement> {
    let (ea, eb) = (Errors::of(a, assume)?, Errors::of(b, assume)?);
    let whole = (0..pair.width, 0..pair.height);
    let image: Vec<Test> = if pair.masked() > 0 {
        Vec::new()
    } else {
        let one = |c: usize| {
            let estimate = |e: &Errors, v: &[[f32; 3]]| {
                let mean = mean(v, pair.width, &whole.0, &whole.1, c);
                e.image(mean, pair.width, pair.height, c)
            };
            welch(c, None, estimate(&ea, &pair.a), estimate(&eb, &pair.b))
        };
        (0..3).filter_map(one).collect()
    };
    let (mut blocks, mut skipped) = (Vec::new(), 0);
    for (x0, y0) in (0..pair.height)
        .step_by(ERROR_BLOCK as usize)
        .flat_map(|y| (0..pair.width).step_by(ERROR_BLOCK as usize).map(move |x| (x, y)))
    {
        let (x, y) = (x0..(x0 + ERROR_BLOCK).min(pair.width), y0..(y0 + ERROR_BLOCK).min(pair.height));
        let comparable = y.clone().all(|y| x.clone().all(|x| pair.valid[(y * pair.width + x) as usize]));
        let one = |c: usize| {
            let estimate = |e: &Errors, v: &[[f32; 3]]| e.block(mean(v, pair.width, &x, &y, c), pair.width, &x, &y, c);
            welch(c, Some([x0, y0]), estimate(&ea, &pair.a), estimate(&eb, &pair.b))
        };
        let tests: Vec<Test> = if comparable { (0..3).filter_map(one).collect() } else { Vec::new() };
        skipped += usize::from(tests.len() < 3);
        blocks.extend(tests);
    }
    Some(conclude([ea.describe(), eb.describe()], image, blocks, skipped))
}

fn mean(pixels: &[[f32; 3]], width: u32, x: &Range<u32>, y: &Range<u32>, c: usize) -> f64 {
    let row = |y: u32| -> f64 { x.clone().map(|x| f64::from(pixels[(y * width + x) as usize][c])).sum() };
    y.clone().map(row).sum::<f64>() / (x.len() * y.len()) as f64
}

/// Welch's test with an allowance for rounding; `None` when an error is not known.
fn welch(c: usize, block: Option<[u32; 2]>, a: Estimate, b: Estimate) -> Option<Test> {
    let w = a.welch(&b, ROUNDING)?;
    Some(Test { channel: CHANNELS[c], block, a: a.mean, b: b.mean, t: w.t, dof: w.dof, p: w.p })
}

fn conclude([a, b]: [String; 2], image: Vec<Test>, blocks: Vec<Test>, blocks_skipped: usize) -> Agreement {
    let count = image.len() + blocks.len();
    let block_rms_z = statcheck::rms_deviate(blocks.iter().map(|t| t.p));
    let mut worst: Vec<Test> = image.iter().chain(&blocks).cloned().collect();
    worst.sort_by(|x, y| x.p.total_cmp(&y.p));
    worst.truncate(8);
    let least = worst.first().map_or(1.0, |t| t.p);
    let agree = least >= statcheck::sidak(FAMILY, count);
    let family_p = statcheck::family_p_value(least, count);
    Agreement { a, b, image, block_tests: blocks.len(), blocks_skipped, block_rms_z, worst, family_p, agree }
}

#[cfg(test)]
mod tests;
