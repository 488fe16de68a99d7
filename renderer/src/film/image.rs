use super::blocks::{BlockErrors, BlockScatter};
use super::{Aov, AovSum, Counters, GroupFilm};
use serde::{Deserialize, Serialize};

/// The error of an image, told by its replicate groups.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ErrorSummary {
    /// `sqrt(mean over pixels and channels of variance / (I^2 + 0.01))`.
    pub relative: f64,
    /// Upper end of its one-sided 95 % interval (Student's t over the groups), or, where that is larger, the error with the intensities
    /// of half of the groups under the variance of the other half. A pixel that few samples have found bright raises its own
    /// intensity as well as its variance, which caps its part of `relative`; halves know nothing of each other.
    pub upper95: f64,
    /// Mean of all pixels and channels.
    pub mean: f64,
    /// Standard error of that mean, from the groups.
    pub mean_se: f64,
    /// Replicate groups behind it.
    pub groups: u32,
}

/// The image that groups merge to.
#[derive(Clone, Debug, PartialEq)]
pub struct MergedImage {
    /// Width in pixels.
    pub width: u32,
    /// Height in pixels.
    pub height: u32,
    /// Radiance, row by row.
    pub mean: Vec<[f32; 3]>,
    /// Standard error of `mean`; NaN where fewer than two groups have samples.
    pub std_error: Vec<[f32; 3]>,
    /// Samples of each pixel over all groups (light tracing: light paths per pixel).
    pub samples: Vec<f32>,
    /// Averages of the auxiliary values (`hits` = the share of samples that hit a surface); empty when the integrator has none.
    pub aovs: Vec<Aov>,
    /// The error of the whole; `None` with fewer than two groups.
    pub error: Option<ErrorSummary>,
    /// The error of blocks of pixels.
    pub blocks: BlockErrors,
    /// Sum over all units.
    pub counters: Counters,
}

impl MergedImage {
    /// Merges groups: the mean weighted by samples; its variance from the scatter between groups,
    /// `sum n_g (I_g - I)^2 / ((G - 1) sum n_g)`, which is unbiased for unequal `n_g` too.
    ///
    /// `aovs` are sums over the samples of group 0, or empty.
    pub fn from_groups(width: u32, height: u32, groups: &[GroupFilm], aovs: &[AovSum], counters: Counters) -> Self {
        let pixels = width as usize * height as usize;
        let samples = |i: usize| groups.first().map_or(0.0, |g| g.samples(i));
        let aovs = aovs.iter().enumerate().map(|(i, sum)| sum.average(samples(i))).collect();
        let mut image = Self {
            width,
            height,
            mean: Vec::with_capacity(pixels),
            std_error: Vec::with_capacity(pixels),
            samples: Vec::with_capacity(pixels),
            aovs,
            error: None,
            blocks: BlockErrors { std_error: Vec::new(), image: None },
            counters,
        };
        let mut scatter = GroupScatter::new(groups.len());
        let mut blocks = BlockScatter::new(width, height, groups.len());
        let mut values = Vec::with_capacity(groups.len());
        for i in 0..pixels {
            values.clear();
            values.extend(groups.iter().enumerate().map(|(g, f)| (g, f.pixel(i))).filter(|(_, (_, n))| *n > 0.0));
            image.samples.push(groups.iter().map(|g| g.samples(i)).sum::<f64>() as f32);
            image.push_pixel(&values, &mut scatter);
            values.iter().for_each(|(g, (v, n))| blocks.add(i, *g, v, *n));
        }
        image.blocks = blocks.finish();
        image.error = scatter.summary(pixels);
        image
    }

    fn push_pixel(&mut self, values: &[(usize, ([f64; 3], f64))], scatter: &mut GroupScatter) {
        let n: f64 = values.iter().map(|v| v.1.1).sum();
        if values.is_empty() {
            self.mean.push([0.0; 3]);
            self.std_error.push([f32::NAN; 3]);
            return;
        }
        let mean: [f64; 3] = std::array::from_fn(|c| values.iter().map(|v| v.1.0[c] * v.1.1).sum::<f64>() / n);
        let var: [f64; 3] = std::array::from_fn(|c| {
            let s: f64 = values.iter().map(|v| v.1.1 * (v.1.0[c] - mean[c]) * (v.1.0[c] - mean[c])).sum();
            s / ((values.len() as f64 - 1.0) * n)
        });
        scatter.add(values, &mean, n);
        self.mean.push(mean.map(|v| v as f32));
        self.std_error.push(var.map(|v| if values.len() < 2 { f32::NAN } else { v.sqrt() as f32 }));
    }
}

/// Per group: its share of the relative squared error, and how far it moves the image mean.
struct GroupScatter {
    squared: Vec<f64>,
    moves: Vec<f64>,
    present: Vec<bool>,
    mean: f64,
    /// Sum of variances over the intensities of other groups.
    held_out: f64,
    /// Pixels with at least two groups, times three channels.
    terms: f64,
}

impl GroupScatter {
    fn new(groups: usize) -> Self {
        Self {
            squared: vec![0.0; groups],
            moves: vec![0.0; groups],
            present: vec![false; groups],
            mean: 0.0,
            held_out: 0.0,
            terms: 0.0,
        }
    }

    fn add(&mut self, values: &[(usize, ([f64; 3], f64))], mean: &[f64; 3], n: f64) {
        let count = values.len() as f64;
        self.mean += mean.iter().sum::<f64>();
        if values.len() < 2 {
            return;
        }
        self.terms += 3.0;
        self.held_out += held_out(values, n);
        for (group, (v, n_g)) in values {
            self.present[*group] = true;
            for c in 0..3 {
                let d = v[c] - mean[c];
                self.squared[*group] += n_g * d * d / ((count - 1.0) * n * (mean[c] * mean[c] + 0.01));
                self.moves[*group] += n_g * d / n;
            }
        }
    }

    /// Both errors are sums over groups; the spread of the summands tells how well the first is known, and is the second.
    fn summary(&self, pixels: usize) -> Option<ErrorSummary> {
        let used: Vec<usize> = (0..self.present.len()).filter(|&g| self.present[g]).collect();
        if self.terms == 0.0 {
            return None;
        }
        let all = 3.0 * pixels as f64;
        let count = used.len() as f64;
        let sum_of_squares =
            |f: &dyn Fn(usize) -> f64| used.iter().map(|&g| f(g) * f(g)).sum::<f64>() * count / (count - 1.0);
        let squared = self.squared.iter().sum::<f64>() / self.terms;
        let squared_se = sum_of_squares(&|g| self.squared[g] / self.terms - squared / count).sqrt();
        let mean_se = sum_of_squares(&|g| self.moves[g] / all).sqrt();
        let upper = squared + t95_one_sided(count as usize - 1) * squared_se;
        Some(ErrorSummary {
            relative: squared.sqrt(),
            upper95: upper.max(self.held_out / self.terms).sqrt(),
            mean: self.mean / all,
            mean_se,
            groups: count as u32,
        })
    }
}

/// Sum over channels of a pixel's variance over `I^2 + 0.01`: each half of the groups gives its part of the variance, the other half I.
/// 0 with fewer than four groups.
fn held_out(values: &[(usize, ([f64; 3], f64))], n: f64) -> f64 {
    if values.len() < 4 {
        return 0.0;
    }
    let half = |odd: bool, c: usize| {
        let of = || values.iter().filter(move |v| (v.0 % 2 == 1) == odd).map(move |v| (v.1.0[c], v.1.1));
        let (count, weight) = of().fold((0.0f64, 0.0f64), |(k, w), v| (k + 1.0, w + v.1));
        if count < 2.0 {
            return (0.0, 0.0);
        }
        let mean = of().map(|v| v.0 * v.1).sum::<f64>() / weight;
        let scatter: f64 = of().map(|v| v.1 * (v.0 - mean) * (v.0 - mean)).sum();
        // Its part of the variance of the mean over all groups.
        (mean, weight * scatter / ((count - 1.0) * n * n))
    };
    let of_channel = |c: usize| {
        let ((mean_a, var_a), (mean_b, var_b)) = (half(false, c), half(true, c));
        let part = |var: f64, other: f64| if var > 0.0 { var / (other * other + 0.01) } else { 0.0 };
        part(var_a, mean_b) + part(var_b, mean_a)
    };
    (0..3).map(of_channel).sum()
}

/// 95 % quantile of Student's t distribution.
fn t95_one_sided(dof: usize) -> f64 {
    const TABLE: [f64; 15] =
        [6.314, 2.920, 2.353, 2.132, 2.015, 1.943, 1.895, 1.860, 1.833, 1.812, 1.796, 1.782, 1.771, 1.761, 1.753];
    TABLE.get(dof.saturating_sub(1)).copied().unwrap_or(1.645 + 1.5 / dof as f64)
}
