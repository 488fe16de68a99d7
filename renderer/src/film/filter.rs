//! Pixel reconstruction filters: sampled around a pixel, or spread over the pixels around a splat, with the same density.

use crate::math::{ONE_MINUS_EPSILON, Vec2, cos64, exp64};
use crate::scene::desc::FilterDesc;

/// Most pixels that a splat covers along one axis: filters are at most 8 pixels wide to each side.
pub const MAX_FOOTPRINT: usize = 17;

/// A separable filter.
///
/// Pixel j's weight at raster position x is `h_j(x) = k(x - centre_j)`, a density over the raster: its integral is 1. Where the
/// filter reaches beyond the picture it is cut off there and scaled up to integrate to 1 again, as happens in renderers that divide by
/// the sum of weights.
///
/// The profile `k` is a table, linear in between (exact for box and tent); sampling and weights use the same table, so what is
/// sampled around pixels and what is splatted converge to the same picture.
#[derive(Clone, Debug)]
pub struct Filter {
    radius: f32,
    /// Width of a table cell, and its inverse.
    step: f32,
    per_step: f32,
    /// The profile at the cells' borders, from -radius to radius: per pixel, integral 1.
    density: Vec<f32>,
    /// Integral of the profile up to each of the borders.
    cumulative: Vec<f32>,
    /// Size of the picture.
    size: [u32; 2],
}

/// The pixels that a splat covers, and its weight in each.
#[derive(Clone, Copy, Debug)]
pub struct Footprint {
    origin: [u32; 2],
    count: [usize; 2],
    weights: [[f32; MAX_FOOTPRINT]; 2],
}

impl Footprint {
    /// Whether no pixel is covered.
    #[inline]
    pub fn is_empty(&self) -> bool {
        self.count[0] == 0 || self.count[1] == 0
    }

    /// The rows of pixels: column of the first, row, the row's weight, and the columns' weights to multiply it by.
    #[inline]
    pub fn rows(&self) -> impl Iterator<Item = (u32, u32, f32, &[f32])> + '_ {
        let [x, y] = self.origin;
        let [wx, wy] = &self.weights;
        let columns = &wx[..self.count[0]];
        (y..).zip(&wy[..self.count[1]]).map(move |(y, wy)| (x, y, *wy, columns))
    }

    /// (x, y, weight) of each pixel; weights are per pixel area.
    #[inline]
    pub fn iter(&self) -> impl Iterator<Item = (u32, u32, f32)> + '_ {
        let [wx, wy] = &self.weights;
        (0..self.count[1]).flat_map(move |j| {
            (0..self.count[0]).map(move |i| (self.origin[0] + i as u32, self.origin[1] + j as u32, wx[i] * wy[j]))
        })
    }
}

impl Filter {
    /// The filter for a picture of `width` times `height` pixels. A width out of range (see `FilterDesc::validate`) is brought into it.
    pub fn new(desc: &FilterDesc, width: u32, height: u32) -> Self {
        let (radius, cells) = match *desc {
            FilterDesc::Box { radius } => (radius, 1),
            FilterDesc::Tent { radius } => (radius, 2),
            FilterDesc::Gaussian { stddev } => (4.0 * stddev, 256),
            FilterDesc::BlackmanHarris { radius } => (radius, 256),
        };
        let radius = if radius > 0.0 { radius.clamp(1e-3, 8.0) } else { 0.5 };
        // Tabulate the profile over [-1, 1], and scale it to integral 1.
        let step = 2.0 / cells as f64;
        let profile: Vec<f64> = (0..=cells).map(|i| profile(desc, (step * i as f64 - 1.0).abs())).collect();
        let mut sums = vec![0.0f64];
        for pair in profile.windows(2) {
            sums.push(sums[sums.len() - 1] + 0.5 * step * (pair[0] + pair[1]));
        }
        let total = sums[sums.len() - 1];
        Self {
            radius,
            step: (step * f64::from(radius)) as f32,
            per_step: (1.0 / (step * f64::from(radius))) as f32,
            density: profile.iter().map(|d| (d / (total * f64::from(radius))) as f32).collect(),
            cumulative: sums.iter().map(|s| (s / total) as f32).collect(),
            size: [width, height],
        }
    }

    /// Half its width in pixels.
    #[inline]
    pub fn radius(&self) -> f32 {
        self.radius
    }

    /// Whether a sample counts for the pixels around its own too. (Samples of a filter that is no wider than a pixel are drawn by
    /// [`Filter::sample`] and count for their own.)
    #[inline]
    pub fn shares(&self) -> bool {
        self.radius > 0.5
    }

    /// How many pixels further than its own a sample counts.
    #[inline]
    pub fn reach(&self) -> u32 {
        if self.shares() { (self.radius + 0.5).floor() as u32 } else { 0 }
    }

    /// Variance of a pixel over that of a sample, at one sample per pixel: the integral of the squared filter where samples are shared.
    pub fn spread(&self) -> f64 {
        const STEPS: u32 = 16;
        if !self.shares() {
            return 1.0;
        }
        let middle = self.size.map(|n| (n / 2) as f32);
        let place = |i: u32| (i as f32 + 0.5) / STEPS as f32;
        let at = |i: u32| Vec2::new(middle[0] + place(i % STEPS), middle[1] + place(i / STEPS));
        let squares = |i: u32| self.weights(at(i)).iter().map(|(_, _, w)| f64::from(w) * f64::from(w)).sum::<f64>();
        (0..STEPS * STEPS).map(squares).sum::<f64>() / f64::from(STEPS * STEPS)
    }

    /// Variance of a pixel over that of a sample, at one sample per pixel, where the samples of blocks of `side` times `side` pixels have
    /// all of their noise in common, wherever the blocks begin. ([`Filter::spread`] is that of blocks of one pixel.)
    pub fn spread_of_blocks(&self, side: u32) -> f64 {
        const STEPS: u32 = 16;
        if !self.shares() {
            return 1.0;
        }
        let axis = |size: u32| {
            // Mean weight of the samples of the pixels around in that in the middle, and what the weights scatter.
            let (middle, reach) = (size / 2, self.reach());
            let pixels = middle.saturating_sub(reach)..(middle + reach + 1).min(size);
            let moments = |i: u32| {
                let weight = |step: u32| {
                    let mut weights = [0.0; MAX_FOOTPRINT];
                    let at = i as f32 + (step as f32 + 0.5) / STEPS as f32;
                    let (first, count) = self.weights_axis(at, size, &mut weights);
                    let found = (first..).zip(&weights[..count]).find(|(p, _)| *p == middle);
                    found.map_or(0.0, |(_, w)| f64::from(*w))
                };
                let (sum, squares) = (0..STEPS).map(weight).fold((0.0, 0.0), |(s, q), w| (s + w, q + w * w));
                (sum / f64::from(STEPS), squares / f64::from(STEPS))
            };
            let moments: Vec<(f64, f64)> = pixels.map(moments).collect();
            let scatter: f64 = moments.iter().map(|(mean, square)| square - mean * mean).sum();
            let joint = |start: usize| {
                let blocks = 0..(moments.len() + start).div_ceil(side as usize);
                let of = |block: usize| {
                    let inside = moments.iter().enumerate().filter(|(i, _)| (i + start) / side as usize == block);
                    inside.map(|(_, (mean, _))| mean).sum::<f64>()
                };
                blocks.map(of).map(|mean| mean * mean).sum::<f64>()
            };
            scatter + (0..side as usize).map(joint).sum::<f64>() / f64::from(side)
        };
        axis(self.size[0]) * axis(self.size[1])
    }

    /// How much larger the variance of the mean over `pixels` is than the mean of the pixels' variances over their number, along one
    /// axis (0 = x, 1 = y), where pixels share samples: the integral of the squared sum of their filters, over the sum of the integrals of
    /// their squares. 1 where they share none.
    pub fn inflation(&self, axis: usize, pixels: &std::ops::Range<u32>) -> f64 {
        const STEPS: u32 = 32;
        if !self.shares() {
            return 1.0;
        }
        let reach = self.radius.ceil() as u32;
        let (first, last) = (pixels.start.saturating_sub(reach), pixels.end + reach);
        let (mut joint, mut single) = (0.0, 0.0);
        for i in first * STEPS..last * STEPS {
            let mut weights = [0.0; MAX_FOOTPRINT];
            let (from, count) = self.weights_axis((i as f32 + 0.5) / STEPS as f32, self.size[axis], &mut weights);
            let (mut sum, mut squares) = (0.0, 0.0);
            for (_, w) in (from..).zip(&weights[..count]).filter(|(p, _)| pixels.contains(p)) {
                sum += f64::from(*w);
                squares += f64::from(*w) * f64::from(*w);
            }
            joint += sum * sum;
            single += squares;
        }
        if single > 0.0 { joint / single } else { 1.0 }
    }

    /// A raster position with density `h` of the pixel (x, y) of the picture, by `u` in [0, 1)^2.
    #[inline]
    pub fn sample(&self, u: Vec2, x: u32, y: u32) -> Vec2 {
        Vec2::new(self.sample_axis(u.x, x, self.size[0]), self.sample_axis(u.y, y, self.size[1]))
    }

    /// The pixels whose filter covers the raster position, with their `h` there; none outside the picture.
    #[inline]
    pub fn weights(&self, raster: Vec2) -> Footprint {
        let mut f = Footprint { origin: [0; 2], count: [0; 2], weights: [[0.0; MAX_FOOTPRINT]; 2] };
        for (axis, x) in raster.to_array().into_iter().enumerate() {
            (f.origin[axis], f.count[axis]) = self.weights_axis(x, self.size[axis], &mut f.weights[axis]);
        }
        f
    }

    /// Integral of the profile from -radius to `t`.
    fn cdf(&self, t: f32) -> f32 {
        let (cell, s) = self.cell(t);
        let (d0, d1) = (self.density[cell], self.density[cell + 1]);
        self.cumulative[cell] + self.step * s * (d0 + 0.5 * s * (d1 - d0))
    }

    /// The table cell that holds `t`, and where in it (0 to 1).
    #[inline]
    fn cell(&self, t: f32) -> (usize, f32) {
        let x = ((t + self.radius) * self.per_step).max(0.0);
        let cell = (x as usize).min(self.density.len() - 2);
        (cell, (x - cell as f32).min(1.0))
    }

    #[inline]
    fn density(&self, t: f32) -> f32 {
        let (cell, s) = self.cell(t);
        self.density[cell] + s * (self.density[cell + 1] - self.density[cell])
    }

    /// The share of the filter of pixel `i` that lies inside the picture, as an interval of the profile's integral.
    fn inside(&self, i: u32, size: u32) -> (f32, f32) {
        let centre = i as f32 + 0.5;
        let low = if centre < self.radius { self.cdf(-centre) } else { 0.0 };
        let rest = (size - i) as f32 - 0.5;
        let high = if rest < self.radius { self.cdf(rest) } else { 1.0 };
        (low, high)
    }

    fn sample_axis(&self, u: f32, i: u32, size: u32) -> f32 {
        let (low, high) = self.inside(i, size);
        let target = low + u * (high - low);
        // Find the cell, then invert the integral of its linear density: d0 s + (d1 - d0) s^2 / 2 = rest.
        let cell = self.cumulative.partition_point(|&c| c <= target).clamp(1, self.density.len() - 1) - 1;
        let (d0, d1) = (self.density[cell], self.density[cell + 1]);
        let rest = (target - self.cumulative[cell]) / self.step;
        let root = (d0 * d0 + 2.0 * rest * (d1 - d0)).max(0.0).sqrt();
        let s = if rest > 0.0 { (2.0 * rest / (d0 + root)).min(1.0) } else { 0.0 };
        let t = -self.radius + self.step * (cell as f32 + s);
        (i as f32 + 0.5 + t).clamp(0.0, size as f32 * ONE_MINUS_EPSILON)
    }

    fn weights_axis(&self, x: f32, size: u32, weights: &mut [f32; MAX_FOOTPRINT]) -> (u32, usize) {
        if !(x >= 0.0 && x < size as f32) {
            return (0, 0);
        }
        // Pixels with -radius <= x - centre < radius. Exact in f64; in f32 a splat just beside a border counts on both its sides.
        let (at, radius) = (f64::from(x) - 0.5, f64::from(self.radius));
        let first = (floor(at - radius) + 1).max(0);
        let last = floor(at + radius).min(i64::from(size) - 1);
        let count = (last + 1 - first).clamp(0, MAX_FOOTPRINT as i64) as usize;
        let first = first as u32;
        for (i, w) in (first..).zip(&mut weights[..count]) {
            *w = self.density(x - (i as f32 + 0.5));
        }
        // Only near the borders is some of a filter outside.
        if x < 2.0 * self.radius || size as f32 - x < 2.0 * self.radius {
            for (i, w) in (first..).zip(&mut weights[..count]) {
                let (low, high) = self.inside(i, size);
                *w /= high - low;
            }
        }
        (first, count)
    }
}

/// The largest integer that is not above `x`, which lies within some thousands of a picture. std's asks a library where the target has
/// no instruction for it.
#[inline]
fn floor(x: f64) -> i64 {
    let i = x as i64;
    i - i64::from(i as f64 > x)
}

/// The unnormalised profile at distance `t` in [0, 1] radii.
fn profile(desc: &FilterDesc, t: f64) -> f64 {
    match desc {
        FilterDesc::Box { .. } => 1.0,
        FilterDesc::Tent { .. } => 1.0 - t,
        // Four standard deviations are one radius.
        FilterDesc::Gaussian { .. } => exp64(-8.0 * t * t) - exp64(-8.0),
        // Harris 1978, "On the Use of Windows for Harmonic Analysis", four terms, minimum side lobes.
        FilterDesc::BlackmanHarris { .. } => {
            let a = std::f64::consts::PI * (1.0 - t);
            (0.35875 - 0.48829 * cos64(a) + 0.14128 * cos64(2.0 * a) - 0.01168 * cos64(3.0 * a)).max(0.0)
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sampling::{IndependentSampler, Sampler};
    use statcheck::{chi2_test, sidak};

    const SIZE: [u32; 2] = [7, 5];

    fn roster() -> Vec<(FilterDesc, Filter)> {
        [
            FilterDesc::Box { radius: 0.5 },
            FilterDesc::Box { radius: 0.25 },
            FilterDesc::Box { radius: 1.375 },
            FilterDesc::Tent { radius: 1.0 },
            FilterDesc::Tent { radius: 8.0 },
            FilterDesc::Gaussian { stddev: 0.5 },
            FilterDesc::Gaussian { stddev: 1.7 },
            FilterDesc::BlackmanHarris { radius: 1.5 },
        ]
        .map(|desc| (desc, Filter::new(&desc, SIZE[0], SIZE[1])))
        .to_vec()
    }

    /// `h` of a pixel at a raster position, by way of the splat weights.
    fn h(filter: &Filter, at: Vec2, x: u32, y: u32) -> f64 {
        filter.weights(at).iter().find(|&(i, j, _)| (i, j) == (x, y)).map_or(0.0, |(.., w)| f64::from(w))
    }

    /// Positions sampled for a pixel are distributed as the weight that they would splat into it: inside, at a border, in corners.
    #[test]
    fn samples_have_the_density_of_the_weights() {
        // Histogram in quarters of a pixel; the density's integrals by the midpoint rule.
        const FINE: u32 = 16;
        let roster = roster();
        let pixels = [(3, 2), (0, 2), (6, 4), (1, 0)];
        let significance = sidak(0.01, roster.len() * pixels.len());
        for (desc, filter) in &roster {
            let (columns, rows) = (SIZE[0] as usize * 4, SIZE[1] as usize * 4);
            let n = 40_000;
            let mut expected = vec![vec![0.0; columns * rows]; pixels.len()];
            for fy in 0..SIZE[1] * 4 * FINE {
                for fx in 0..SIZE[0] * 4 * FINE {
                    let at = Vec2::new(fx as f32 + 0.5, fy as f32 + 0.5) / (4 * FINE) as f32;
                    let bin = (fy / FINE) as usize * columns + (fx / FINE) as usize;
                    for (x, y, w) in filter.weights(at).iter() {
                        if let Some(k) = pixels.iter().position(|p| *p == (x, y)) {
                            expected[k][bin] += f64::from(w) * f64::from(n) / f64::from(16 * FINE * FINE);
                        }
                    }
                }
            }
            for ((x, y), expected) in pixels.into_iter().zip(expected) {
                let total: f64 = expected.iter().sum();
                assert!((total / f64::from(n) - 1.0).abs() < 1e-3, "{desc:?}, pixel {x} {y}: {total}");
                let mut observed = vec![0.0; columns * rows];
                let mut s = IndependentSampler::new([30, u64::from(x)]);
                for _ in 0..n {
                    let at = filter.sample(s.next_2d(), x, y);
                    assert!(at.x >= 0.0 && at.x < SIZE[0] as f32 && at.y >= 0.0 && at.y < SIZE[1] as f32);
                    observed[(at.y * 4.0) as usize * columns + (at.x * 4.0) as usize] += 1.0;
                }
                let chi2 = chi2_test(&observed, &expected);
                assert!(chi2.p > significance, "{desc:?}, pixel {x} {y}: {chi2:?}");
            }
        }
    }

    /// Along one axis, with a fine midpoint rule: every pixel's weight integrates to one over the picture.
    #[test]
    fn weights_integrate_to_one() {
        const STEPS: u32 = 20_000;
        for (desc, filter) in roster() {
            let mut sums = vec![0.0; SIZE[0] as usize];
            for i in 0..STEPS {
                let x = SIZE[0] as f32 * (i as f32 + 0.5) / STEPS as f32;
                let mut weights = [0.0; MAX_FOOTPRINT];
                let (first, count) = filter.weights_axis(x, SIZE[0], &mut weights);
                for (k, w) in weights[..count].iter().enumerate() {
                    sums[first as usize + k] += f64::from(*w) * f64::from(SIZE[0]) / f64::from(STEPS);
                }
            }
            // Only the jumps of a box keep the rule from more digits.
            let tolerance = if matches!(desc, FilterDesc::Box { .. }) { 2e-3 } else { 1e-5 };
            for (x, sum) in sums.iter().enumerate() {
                assert!((sum - 1.0).abs() < tolerance, "{desc:?}, column {x}: {sum}");
            }
        }
    }

    /// Box and tent tile the raster: the weights of all pixels sum to one everywhere.
    #[test]
    fn partitions_of_unity() {
        let size = [20, 20];
        for desc in [FilterDesc::Box { radius: 0.5 }, FilterDesc::Box { radius: 1.0 }, FilterDesc::Tent { radius: 1.0 }]
        {
            let filter = Filter::new(&desc, size[0], size[1]);
            let mut s = IndependentSampler::new([31]);
            for i in 0..2000 {
                // Pixel borders and centres too.
                let at = if i % 2 == 0 { s.next_2d() * 10.0 + 5.0 } else { (s.next_2d() * 20.0).floor() * 0.5 + 5.0 };
                let sum: f32 = filter.weights(at).iter().map(|(.., w)| w).sum();
                assert!((sum - 1.0).abs() < 1e-5, "{desc:?} at {at}: {sum}");
            }
        }
        assert_eq!(
            Filter::new(&FilterDesc::Box { radius: 0.5 }, 3, 3).weights(Vec2::new(2.0, 0.0)).iter().collect::<Vec<_>>(),
            [(2, 0, 1.0)]
        );
    }

    /// Just beside a pixel's border a splat counts on its side only, however the sums round.
    #[test]
    fn splats_beside_a_border_count_once() {
        let filter = Filter::new(&FilterDesc::Box { radius: 0.5 }, 64, 64);
        for border in 1..64u16 {
            let at = f32::from(border);
            for (x, column) in [(at.next_down(), border - 1), (at, border), (at.next_up(), border)] {
                let counted: Vec<_> = filter.weights(Vec2::new(x, 10.5)).iter().collect();
                assert_eq!(counted, [(u32::from(column), 10, 1.0)], "{x}");
            }
        }
    }

    #[test]
    fn blocks_gain_less_from_wide_filters() {
        let filter = |desc| Filter::new(&desc, 64, 48);
        assert_eq!(filter(FilterDesc::Box { radius: 0.5 }).spread_of_blocks(4), 1.0);
        for desc in [FilterDesc::Tent { radius: 1.0 }, FilterDesc::Gaussian { stddev: 0.5 }] {
            let f = filter(desc);
            assert!((f.spread_of_blocks(1) / f.spread() - 1.0).abs() < 0.01, "{desc:?}");
            let spreads = [1, 2, 4, 8, 1000].map(|side| f.spread_of_blocks(side));
            assert!(spreads.windows(2).all(|w| w[0] < w[1]), "{desc:?}: {spreads:?}");
            // Very large ones share all of their noise, and the weights' own remains: each axis a sum of 1 and what they scatter.
            assert!(spreads[4] > 0.99, "{desc:?}: {spreads:?}");
        }
        // Of a tent the weights of a pixel's own samples and of those beside it are 3/4 and 1/8 in the mean, and scatter by
        // (7/12 - 9/16) + 2 (1/24 - 1/64).
        let scatter = 7.0 / 12.0 - 9.0 / 16.0 + 2.0 * (1.0 / 24.0 - 1.0 / 64.0);
        let two_thirds_apart: f64 = scatter + (2.0 * (49.0 + 1.0) / 64.0 + 1.0) / 3.0;
        let found = filter(FilterDesc::Tent { radius: 1.0 }).spread_of_blocks(3);
        assert!((found / (two_thirds_apart * two_thirds_apart) - 1.0).abs() < 0.01, "{found}");
    }

    /// The profiles are what they are called, to the accuracy of the table.
    #[test]
    fn profiles() {
        let at_centre = Vec2::splat(10.5);
        let ratio = |desc, dx: f32| {
            let filter = Filter::new(&desc, 21, 21);
            h(&filter, at_centre + Vec2::X * dx, 10, 10) / h(&filter, at_centre, 10, 10)
        };
        for dx in [0.1f32, 0.3, 0.77, 1.4, 1.99] {
            let x = f64::from(dx);
            let end = libm::exp(-8.0);
            let gaussian = (libm::exp(-2.0 * x * x) - end) / (1.0 - end);
            assert!((ratio(FilterDesc::Gaussian { stddev: 0.5 }, dx) - gaussian).abs() < 2e-4);
            assert!((ratio(FilterDesc::Tent { radius: 2.0 }, dx) - (1.0 - 0.5 * x)).abs() < 1e-5);
            let a = std::f64::consts::PI * x / 2.0;
            let window = 0.35875 + 0.48829 * libm::cos(a) + 0.14128 * libm::cos(2.0 * a) + 0.01168 * libm::cos(3.0 * a);
            assert!((ratio(FilterDesc::BlackmanHarris { radius: 2.0 }, dx) - window).abs() < 2e-4);
        }
    }

    /// Sampling keeps order, so that stratified numbers give stratified positions.
    #[test]
    fn monotone() {
        for (desc, filter) in roster() {
            for x in [0, 3, 6] {
                let mut last = 0.0;
                for i in 0..4096 {
                    let at = filter.sample(Vec2::splat(i as f32 / 4096.0), x, 2).x;
                    assert!(at >= last, "{desc:?}: {last} {at}");
                    last = at;
                }
            }
        }
    }

    #[test]
    fn nothing_outside() {
        for (_, filter) in roster() {
            for at in [Vec2::new(-0.01, 2.0), Vec2::new(7.0, 2.0), Vec2::new(1.0, f32::NAN), Vec2::new(1e30, 1.0)] {
                assert_eq!(filter.weights(at).iter().count(), 0);
            }
        }
    }
}
