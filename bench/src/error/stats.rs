//! Confidence intervals over rounds of renders.

use renderer::math::{exp64, ln64};
use serde::{Deserialize, Deserializer, Serialize};
use statcheck::student_quantile;

/// A figure with its 95 % confidence interval; the ends are not finite where the rounds can't tell them.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Interval {
    /// The estimate.
    #[serde(deserialize_with = "or_nan")]
    pub value: f64,
    /// Lower end.
    #[serde(deserialize_with = "or_nan")]
    pub low: f64,
    /// Upper end.
    #[serde(deserialize_with = "or_nan")]
    pub high: f64,
}

/// JSON has no NaN: it is written as null.
pub fn or_nan<'de, D: Deserializer<'de>>(from: D) -> Result<f64, D::Error> {
    Ok(Option::deserialize(from)?.unwrap_or(f64::NAN))
}

/// The mean over rounds, with Student's interval.
pub fn mean(values: &[f64]) -> Interval {
    let estimate = |left_out: Option<usize>| mean_without(values, left_out);
    let value = estimate(None);
    let half = half_width(values.len(), estimate);
    Interval { value, low: value - half, high: value + half }
}

/// A positive function of means, such as a product or a quotient: its interval is that of its logarithm, by the jackknife
/// (Tukey 1958). `estimate(Some(j))` leaves out round `j` wherever it occurs, so that what two figures share within a round, such as
/// the speed of the machine, cancels as it should.
pub fn positive(rounds: usize, estimate: impl Fn(Option<usize>) -> f64) -> Interval {
    // NaN for a negative estimate, and then for all that follows from it.
    let half = half_width(rounds, |left_out| ln64(estimate(left_out)));
    let value = estimate(None);
    Interval { value, low: value * exp64(-half), high: value * exp64(half) }
}

/// Mean of all values but one.
pub fn mean_without(values: &[f64], left_out: Option<usize>) -> f64 {
    let kept = values.iter().enumerate().filter(|(i, _)| Some(*i) != left_out);
    let (count, sum) = kept.fold((0.0, 0.0), |(n, s), (_, v)| (n + 1.0, s + v));
    sum / count
}

/// Student's quantile times the jackknife's standard error.
fn half_width(rounds: usize, estimate: impl Fn(Option<usize>) -> f64) -> f64 {
    if rounds < 2 {
        return f64::NAN;
    }
    let n = rounds as f64;
    let replicates: Vec<f64> = (0..rounds).map(|j| estimate(Some(j))).collect();
    let centre = replicates.iter().sum::<f64>() / n;
    let scatter: f64 = replicates.iter().map(|r| (r - centre) * (r - centre)).sum();
    student_quantile(0.975, n - 1.0) * ((n - 1.0) / n * scatter).sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::meshes::Random;

    #[test]
    fn the_interval_of_a_mean_is_students() {
        // Mean 5, standard deviation sqrt(32 / 7), t = 2.364 624 with 7 degrees of freedom.
        let i = mean(&[2.0, 4.0, 4.0, 4.0, 5.0, 5.0, 7.0, 9.0]);
        let half = 2.364_624_252 * (32.0f64 / 7.0 / 8.0).sqrt();
        assert_eq!(i.value, 5.0);
        assert!((i.high - 5.0 - half).abs() < 1e-6 && (5.0 - i.low - half).abs() < 1e-6, "{i:?}");
        assert!(mean(&[1.0]).low.is_nan());
    }

    /// Whatever all of a round share cancels in a quotient.
    #[test]
    fn drift_cancels_in_ratios() {
        let speed = [1.0, 1.3, 0.8, 2.0];
        let (a, b): (Vec<f64>, Vec<f64>) = speed.iter().map(|s| (3.0 * s, 2.0 * s)).unzip();
        let i = positive(4, |j| mean_without(&a, j) / mean_without(&b, j));
        assert!((i.value - 1.5).abs() < 1e-12 && i.high - i.low < 1e-9, "{i:?}");
    }

    /// 95 % of the intervals of a quotient of products hold the true value.
    #[test]
    fn intervals_of_ratios_cover() {
        let mut random = Random(3);
        let mut about = |mean: f64| mean * (0.7 + 0.6 * f64::from(random.next()));
        let mut covered = 0;
        for _ in 0..1000 {
            let [errors_a, seconds_a, errors_b, seconds_b] =
                [0.01, 2.0, 0.04, 3.0].map(|m| (0..8).map(|_| about(m)).collect::<Vec<_>>());
            let product = |e: &[f64], s: &[f64], j| mean_without(e, j) * mean_without(s, j);
            let i = positive(8, |j| product(&errors_b, &seconds_b, j) / product(&errors_a, &seconds_a, j));
            covered += u32::from(i.low <= 6.0 && 6.0 <= i.high);
        }
        // Five standard deviations of a binomial count on either side.
        assert!((915..=985).contains(&covered), "{covered}");
    }

    #[test]
    fn what_is_not_positive_has_no_ends() {
        let values = [-1.0, 2.0, -3.0];
        let i = positive(3, |j| mean_without(&values, j));
        assert!(i.value < 0.0 && i.low.is_nan() && i.high.is_nan());
    }
}
