//! What the pictures of trials tell: the error that one sample of each pixel would leave.

use crate::film::GroupFilm;
use crate::job::rendering::Rendering;

/// Keeps relative errors from dividing by the darkness of black pixels, as everywhere.
const FLOOR: f64 = 0.01;
/// Side of the blocks that are compared, in pixels of the small film.
const BLOCK: usize = 4;
/// Parts of a picture along each axis, in each of which light may be missing.
const PARTS: usize = 8;
/// How much less than independent samples those of a pixel scatter at most, as they are even; as observed with many lights.
const EVEN: f64 = 4.0;
/// Standard errors by which there must be more: a single bright sample can be all of a second moment.
const SURE: f64 = 2.0;
/// Squared standard errors beyond which a block is darker for a reason: light that was not found.
const CERTAIN: f64 = 16.0;

/// Means and scatter of a trial's groups.
pub struct Sample {
    width: usize,
    height: usize,
    groups: Vec<Vec<[f64; 3]>>,
}

/// What is left of an image when its parts are taken apart.
#[derive(Clone, Copy, PartialEq, Eq)]
pub enum Part {
    /// All of it.
    Whole,
    /// What chains found.
    Splats,
}

impl Sample {
    /// Of a trial that is complete.
    pub fn new(trial: &Rendering, part: Part) -> Self {
        let s = trial.settings();
        let pixels = 0..s.width as usize * s.height as usize;
        let value = |g: &GroupFilm, i: usize| match part {
            Part::Whole => g.pixel(i).0,
            Part::Splats => g.splats(i),
        };
        let groups = trial.groups().iter().map(|g| pixels.clone().map(|i| value(g, i)).collect()).collect();
        Self { width: s.width as usize, height: s.height as usize, groups }
    }

    /// Mean over the groups.
    fn mean(&self, i: usize) -> [f64; 3] {
        let n = self.groups.len().max(1) as f64;
        std::array::from_fn(|c| self.groups.iter().map(|g| g[i][c]).sum::<f64>() / n)
    }

    /// Variance of one group's value.
    fn variance(&self, i: usize) -> [f64; 3] {
        let (mean, n) = (self.mean(i), self.groups.len() as f64);
        let square = |v: f64| v * v;
        std::array::from_fn(|c| self.groups.iter().map(|g| square(g[i][c] - mean[c])).sum::<f64>() / (n - 1.0).max(1.0))
    }

    /// Means of all blocks, row by row.
    fn block_means(&self) -> Vec<[f64; 3]> {
        let across = self.width.div_ceil(BLOCK);
        let mut sums = vec![([0.0; 3], 0.0); across * self.height.div_ceil(BLOCK)];
        for i in 0..self.width * self.height {
            let (sum, pixels) = &mut sums[i / self.width / BLOCK * across + i % self.width / BLOCK];
            sum.iter_mut().zip(self.mean(i)).for_each(|(to, v)| *to += v);
            *pixels += 1.0;
        }
        sums.into_iter().map(|(sum, pixels)| sum.map(|v| v / pixels)).collect()
    }

    /// `1 / (I^2 + 0.01)` of every pixel, I being the mean of two pictures of the same size. All that is compared is weighed alike: what
    /// a pixel that few samples have found bright excuses, it excuses for all.
    pub fn weights(&self, other: &Self) -> Weights {
        let of = |i: usize| {
            let (a, b) = (self.mean(i), other.mean(i));
            std::array::from_fn(|c| 1.0 / (0.25 * (a[c] + b[c]) * (a[c] + b[c]) + FLOOR))
        };
        Weights { width: self.width, height: self.height, pixels: (0..self.width * self.height).map(of).collect() }
    }

    /// Mean relative variance of one group. Where `own` says so, blocks that this picture has brighter than the weights know are weighed
    /// by that: chains find light that few of the samples behind the weights have found.
    pub fn relative_variance(&self, weights: &Weights, own: bool) -> f64 {
        let mut sum = 0.0;
        let bright = if own { self.block_means() } else { Vec::new() };
        let across = self.width.div_ceil(BLOCK);
        for i in 0..self.width * self.height {
            let (x, y) = (i % self.width, i / self.width);
            let weight = weights.pixels[weights.at(x, y, self.width, self.height)];
            let mean = bright.get(y / BLOCK * across + x / BLOCK).copied().unwrap_or_default();
            let v = self.variance(i);
            sum += (0..3).map(|c| v[c] * weight[c].min(1.0 / (mean[c] * mean[c] + FLOOR))).sum::<f64>();
        }
        sum / (3 * self.width * self.height) as f64
    }

    /// Relative variance of one sample that `alone`, a trial of `samples` in each pixel of a group, does not show: of what this picture tells
    /// the second moment of, beyond the square of the mean that both `mean` tell, times the filter's `spread`, what is more in a part of the
    /// picture than even samples explain. Samples that are even over a pixel scatter less than independent ones, which the moment is that of.
    pub fn relative_excess(&self, weights: &Weights, mean: [&Self; 2], spread: f64, alone: &Self, samples: f64) -> f64 {
        let relative = |i: usize, of: [f64; 3]| (0..3).map(|c| weights.pixels[i][c] * of[c]).sum::<f64>() / 3.0;
        let square = |i: usize| {
            let (a, b) = (mean[0].mean(i), mean[1].mean(i));
            std::array::from_fn(|c| 0.25 * (a[c] + b[c]) * (a[c] + b[c]))
        };
        let part_of = |i: usize| i / self.width * PARTS / self.height * PARTS + i % self.width * PARTS / self.width;
        // What is known but for what even samples explain, as each group tells it.
        let told: Vec<[f64; PARTS * PARTS]> = (self.groups.iter())
            .map(|group| {
                let mut parts = [0.0; PARTS * PARTS];
                for (i, moment) in group.iter().enumerate() {
                    let at = weights.at(i % self.width, i / self.width, self.width, self.height);
                    let known = spread * (relative(i, *moment) - relative(i, square(i)));
                    parts[part_of(i)] += known - EVEN * samples * relative(at, alone.variance(at));
                }
                parts
            })
            .collect();
        let excess = |part: usize| {
            let n = told.len().max(1) as f64;
            let mean = told.iter().map(|parts| parts[part]).sum::<f64>() / n;
            let squares: f64 = told.iter().map(|parts| (parts[part] - mean) * (parts[part] - mean)).sum();
            (mean - SURE * (squares / (n * (n - 1.0).max(1.0))).sqrt()).max(0.0)
        };
        (0..PARTS * PARTS).map(excess).sum::<f64>() / (self.width * self.height) as f64
    }

    /// Relative variance of one sample for each of `samples` in a pixel that light must at least have which `full` shows and this trial
    /// did not find: what n samples have missed has a probability of about 1 / n at most, and so a variance of n times its square.
    pub fn unseen(&self, full: &Self, samples: f64) -> f64 {
        let (across, down) = (full.width.div_ceil(BLOCK), full.height.div_ceil(BLOCK));
        let blocks = |of: &Self| Block::steadied((0..across * down).map(|i| of.block(i, across, full)).collect());
        let mut sum = 0.0;
        for (own, theirs) in blocks(self).iter().zip(&blocks(full)) {
            let (Some(own), Some(theirs)) = (own, theirs) else { continue };
            let lack = theirs.mean - own.mean;
            let noise = own.variance + theirs.variance;
            if lack > 0.0 {
                let excess = (lack * lack - CERTAIN * noise).max(0.0);
                // Of the block, not of one of its pixels.
                sum += excess / (theirs.mean * theirs.mean + FLOOR) * samples * own.pixels;
            }
        }
        sum / (across * down) as f64
    }

    /// A block of the film `of`, here.
    fn block(&self, block: usize, across: usize, of: &Self) -> Option<Block> {
        let scale = |v: usize, to: usize, from: usize| (v.min(from) * to).div_ceil(from);
        let (x, y) = (block % across * BLOCK, block / across * BLOCK);
        let (x0, x1) = (scale(x, self.width, of.width), scale(x + BLOCK, self.width, of.width));
        let (y0, y1) = (scale(y, self.height, of.height), scale(y + BLOCK, self.height, of.height));
        let pixels = ((x1 - x0) * (y1 - y0)) as f64;
        let value = |g: &Vec<[f64; 3]>| {
            let rows = (y0..y1).flat_map(|y| &g[y * self.width + x0..y * self.width + x1]);
            rows.map(|v| v.iter().sum::<f64>() / 3.0).sum::<f64>() / pixels
        };
        let values: Vec<f64> = self.groups.iter().map(value).collect();
        let n = values.len() as f64;
        let mean = values.iter().sum::<f64>() / n;
        let scatter: f64 = values.iter().map(|v| (v - mean) * (v - mean)).sum();
        (pixels > 0.0).then(|| Block { mean, variance: scatter / ((n - 1.0).max(1.0) * n), pixels })
    }
}

/// A block of pixels.
struct Block {
    mean: f64,
    /// Variance of the mean.
    variance: f64,
    pixels: f64,
}

impl Block {
    /// With no less variance than is usual: few groups show too little of it now and then, and then chance looks like certainty.
    fn steadied(mut blocks: Vec<Option<Self>>) -> Vec<Option<Self>> {
        let relative = |b: &Self| b.variance / (b.mean * b.mean);
        let mut all: Vec<f64> = blocks.iter().flatten().map(relative).filter(|v| v.is_finite()).collect();
        all.sort_by(f64::total_cmp);
        let usual = all.get(all.len() / 2).copied().unwrap_or(0.0);
        for block in blocks.iter_mut().flatten() {
            block.variance = block.variance.max(usual * block.mean * block.mean);
        }
        blocks
    }
}

/// `1 / (I^2 + 0.01)` by pixel.
pub struct Weights {
    width: usize,
    height: usize,
    pixels: Vec<[f64; 3]>,
}

impl Weights {
    /// The place of a pixel of a film of another size.
    fn at(&self, x: usize, y: usize, width: usize, height: usize) -> usize {
        y * self.height / height * self.width + x * self.width / width
    }
}

#[cfg(test)]
mod tests {
    use super::Block;

    #[test]
    fn blocks_without_scatter_get_what_is_usual() {
        let block = |mean: f64, variance: f64| Some(Block { mean, variance, pixels: 16.0 });
        let blocks = vec![block(1.0, 0.01), block(2.0, 1e-9), None, block(1.0, 0.5), block(0.0, 0.0), block(1.0, 0.02)];
        let steadied = Block::steadied(blocks);
        let variances: Vec<f64> = steadied.iter().flatten().map(|b| b.variance).collect();
        // The usual relative variance is the median, 0.02; a black block has none.
        assert_eq!(variances, [0.02, 0.08, 0.5, 0.0, 0.02]);
        assert!(steadied[2].is_none() && Block::steadied(Vec::new()).is_empty());
    }
}
