//! What the pilot teaches: probabilities of techniques, and where the picture is dark.

use super::{Metropolis, lengths};
use crate::integrator::mmlt::{ChainConstants, Depth, TARGET_CELL};
use crate::job::settings::RenderSettings;
use crate::math::pow64;

/// Paths of a pool's sample below this share of the mean target are left to chance.
const THRESHOLD_SHARE: f64 = 0.02;

/// Ordinary samples of direct light for each mutation, where there are no chains.
pub(super) const KNOWN_SHARE: f32 = 1.0;
/// The same where direct light and the rest are as bright, as measured on scenes with much and little of it: an ordinary sample is cheaper
/// than a mutation, and noisier or not.
const SHARE_IF_EQUAL: f64 = 1.0;
/// Limits of that number.
pub(in crate::job) const LEAST_SHARE: f64 = 0.05;
/// See [`LEAST_SHARE`].
pub(in crate::job) const MOST_SHARE: f64 = 4.0;

impl Metropolis {
    /// Technique probabilities and the target map from the pilot.
    pub(super) fn learn(&self, settings: &RenderSettings, direct: impl Fn(usize) -> [f64; 3]) -> ChainConstants {
        let depths = lengths(settings).map(|edges| {
            let n = edges as usize + 1;
            let sums = self.techniques.get(&edges).cloned().unwrap_or_default();
            let total: f64 = sums.iter().sum();
            let learned = settings.mmlt.learn && total > 0.0 && sums.len() == n;
            // A fifth for all techniques alike: what the pilot missed keeps its chance.
            let share = |s: usize| (0.2 / n as f64 + 0.8 * sums[s] / total) as f32;
            Depth { edges, techniques: (0..n).map(|s| if learned { share(s) } else { 1.0 }).collect() }
        });
        let depths = depths.collect();
        let cells = self.cells(settings, direct);
        let direct_share = match settings.mmlt.direct_share {
            0.0 => direct_share(&cells),
            share => share,
        };
        let (columns, target) = self.target_map(settings, &cells);
        let b: f64 = self.techniques.values().flatten().sum();
        // The target map's factors are about one for what the picture consists of.
        ChainConstants { depths, columns, target, threshold: (THRESHOLD_SHARE * b) as f32, direct_share }
    }

    /// By cell of the target map, row by row: what chains carry and what ordinary samples do, means of channels and pixels as the pilot saw
    /// them.
    fn cells(&self, settings: &RenderSettings, direct: impl Fn(usize) -> [f64; 3]) -> Vec<[f64; 2]> {
        let (width, height) = (settings.width, settings.height);
        let (columns, rows) = (width.div_ceil(TARGET_CELL), height.div_ceil(TARGET_CELL));
        let mut cells = vec![([0.0f64; 2], 0.0f64); (columns * rows) as usize];
        for (i, v) in self.pilot.iter().enumerate() {
            let (x, y) = (i as u32 % width, i as u32 / width);
            let (sums, count) = &mut cells[(y / TARGET_CELL * columns + x / TARGET_CELL) as usize];
            for (sum, of) in sums.iter_mut().zip([*v, direct(i)]) {
                *sum += of.iter().sum::<f64>() / 3.0;
            }
            *count += 1.0;
        }
        cells.into_iter().map(|(sums, count)| sums.map(|sum| if count > 0.0 { sum / count } else { 0.0 })).collect()
    }

    /// `(I^2 + 0.01)^(-lift / 2)` by cell, I being the mean of what the pilot saw in and around the cell.
    fn target_map(&self, settings: &RenderSettings, cells: &[[f64; 2]]) -> (u32, Vec<f32>) {
        let (width, height) = (settings.width, settings.height);
        let (columns, rows) = (width.div_ceil(TARGET_CELL), height.div_ceil(TARGET_CELL));
        if settings.mmlt.lift == 0.0 || self.pilot.is_empty() {
            return (columns, Vec::new());
        }
        let cells: Vec<f64> = cells.iter().map(|[chains, samples]| chains + samples).collect();
        // Relative to a picture of no ordinary brightness: factors must be about one whatever the unit of light.
        let mean = cells.iter().sum::<f64>() / cells.len() as f64;
        let unit = if mean > 0.0 { mean / mean.clamp(1e-3, 10.0) } else { 1.0 };
        // Cells share with their neighbours: the pilot is noisy.
        let at = |x: i64, y: i64| {
            let inside = x >= 0 && y >= 0 && x < i64::from(columns) && y < i64::from(rows);
            inside.then(|| (y * i64::from(columns) + x) as usize)
        };
        let target = (0..cells.len() as i64).map(|cell| {
            let (x, y) = (cell % i64::from(columns), cell / i64::from(columns));
            let around =
                (-1..=1).flat_map(|dy| (-1..=1).map(move |dx| (dx, dy))).filter_map(|(dx, dy)| at(x + dx, y + dy));
            let (sum, count) = around.fold((0.0, 0.0), |(s, n), i| (s + cells[i], n + 1.0));
            let mean = sum / count / unit;
            pow64(mean * mean + 0.01, -0.5 * f64::from(settings.mmlt.lift)) as f32
        });
        let target = target.collect();
        (columns, target)
    }
}

/// Ordinary samples for each mutation, given [`Metropolis::cells`]: as the noise of both is relative to what they carry, the best ratio is
/// that of their roots of mean squares, each relative to the brightness of its place.
fn direct_share(cells: &[[f64; 2]]) -> f32 {
    let (chains, samples) = cells.iter().fold((0.0, 0.0), |(c, s), [chains, samples]| {
        let whole = chains + samples;
        let unit = if whole > 0.0 { 1.0 / whole } else { 0.0 };
        (c + (chains * unit) * (chains * unit), s + (samples * unit) * (samples * unit))
    });
    let ratio = if chains > 0.0 { (samples / chains).sqrt() } else { MOST_SHARE };
    (SHARE_IF_EQUAL * ratio).clamp(LEAST_SHARE, MOST_SHARE) as f32
}
