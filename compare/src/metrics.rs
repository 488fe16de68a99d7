//! Error measures over the pixels that are finite in both pictures; A is judged by the reference B.

use super::pair::Pair;
use serde::Serialize;

/// Keeps relative measures from dividing by the darkness of black pixels.
const FLOOR: f64 = 0.01;
/// The share of pixels that the trimmed measure leaves out: fireflies.
const TRIM: f64 = 0.001;

/// The measures. Means run over pixels and channels.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Metrics {
    /// `sqrt(mean (A - B)^2)`.
    pub rmse: f64,
    /// `mean (A - B)^2 / (B^2 + 0.01)`.
    pub relmse: f64,
    /// The same without the 0.1 % of pixels where it is largest.
    pub relmse_trimmed: f64,
    /// `mean |A - B| / (|B| + 0.01)`.
    pub mape: f64,
    /// `mean A / mean B` of each channel; `None` where B is black.
    pub mean_ratio: [Option<f64>; 3],
    /// The same over all channels.
    pub mean_ratio_all: Option<f64>,
    /// Largest `|A - B|`.
    pub max_abs: f64,
    /// Its pixel, from the top left.
    pub max_abs_at: [u32; 2],
}

impl Metrics {
    /// Of the pixels that can be compared; `None` when there are none.
    pub fn of(pair: &Pair) -> Option<Self> {
        let (mut squared, mut absolute, mut sums) = (0.0, 0.0, [[0.0; 2]; 3]);
        let (mut max_abs, mut max_at) = (0.0, 0);
        let mut relative = Vec::with_capacity(pair.a.len());
        for (i, a, b) in pair.pixels() {
            let mut pixel = 0.0;
            for c in 0..3 {
                let d = a[c] - b[c];
                squared += d * d;
                pixel += d * d / (b[c] * b[c] + FLOOR);
                absolute += d.abs() / (b[c].abs() + FLOOR);
                sums[c][0] += a[c];
                sums[c][1] += b[c];
                if d.abs() > max_abs {
                    (max_abs, max_at) = (d.abs(), i as u32);
                }
            }
            relative.push(pixel);
        }
        let count = relative.len() as f64;
        if relative.is_empty() {
            return None;
        }
        let relmse = relative.iter().sum::<f64>() / (3.0 * count);
        // Drop the largest terms.
        relative.sort_unstable_by(f64::total_cmp);
        relative.truncate(relative.len() - (TRIM * count) as usize);
        let ratio = |a: f64, b: f64| (b != 0.0).then_some(a / b);
        Some(Self {
            rmse: (squared / (3.0 * count)).sqrt(),
            relmse,
            relmse_trimmed: relative.iter().sum::<f64>() / (3.0 * relative.len() as f64),
            mape: absolute / (3.0 * count),
            mean_ratio: sums.map(|[a, b]| ratio(a, b)),
            mean_ratio_all: ratio(sums.iter().map(|s| s[0]).sum(), sums.iter().map(|s| s[1]).sum()),
            max_abs,
            max_abs_at: [max_at % pair.width, max_at / pair.width],
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn measures_of_a_picture_worked_out_by_hand() {
        let a = vec![[1.0, 2.0, 0.0], [f32::NAN, 0.0, 0.0]];
        let b = vec![[1.0, 1.0, 0.5], [0.0; 3]];
        let pair = Pair::from_pixels(2, 1, a, b);
        assert_eq!(pair.masked(), 1);
        let m = Metrics::of(&pair).unwrap();
        let close = |x: f64, y: f64| assert!((x - y).abs() < 1e-12, "{x} for {y}");
        close(m.rmse, (1.25f64 / 3.0).sqrt());
        close(m.relmse, (1.0 / 1.01 + 0.25 / 0.26) / 3.0);
        close(m.mape, (1.0 / 1.01 + 0.5 / 0.51) / 3.0);
        close(m.mean_ratio_all.unwrap(), 3.0 / 2.5);
        assert_eq!(m.mean_ratio, [Some(1.0), Some(2.0), Some(0.0)]);
        assert_eq!((m.max_abs, m.max_abs_at), (1.0, [0, 0]));
    }

    #[test]
    fn trimming_leaves_out_one_firefly_in_a_thousand() {
        let mut a = vec![[1.1f32; 3]; 1000];
        a[17] = [1e6; 3];
        let m = Metrics::of(&Pair::from_pixels(1000, 1, a, vec![[1.0; 3]; 1000])).unwrap();
        assert!((m.relmse_trimmed - 0.01 / 1.01).abs() < 1e-6, "{}", m.relmse_trimmed);
        assert!(m.relmse > 1e8);
    }

    #[test]
    fn nothing_to_compare_has_no_measures() {
        assert_eq!(Metrics::of(&Pair::from_pixels(1, 1, vec![[f32::INFINITY; 3]], vec![[0.0; 3]])), None);
    }
}
