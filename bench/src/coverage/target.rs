//! Whether renders that a target error ended have met it.

use super::count::{Areas, CERTAINTY, CONFIDENCE, truth};
use super::render::Telling;
use serde::Serialize;

/// How often the true error was below the target.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Met {
    /// Independent renders.
    pub renders: u64,
    /// Those whose true relative error was below the target.
    pub met: u64,
    /// Upper end of the one-sided 99.9 % interval of the probability of that.
    pub high: f64,
    /// Root mean square of the true errors over the target.
    pub error: f64,
    /// The largest of them over the target.
    pub worst: f64,
    /// Root mean square of the errors that were told over the target.
    pub told: f64,
    /// Samples (mutations) per pixel, on average.
    pub samples: f64,
}

impl Met {
    /// Compares renders with others that are independent of them. What variance the reference has is held against the renders.
    pub fn new(renders: &[Telling], reference: &[Telling], target: f64) -> Self {
        let truth: Vec<f64> =
            truth(&reference.iter().map(|t| Areas::Pixels.of(t)).collect::<Vec<_>>()).iter().map(|e| e.mean).collect();
        let errors: Vec<f64> = renders.iter().map(|t| relative_error(t, &truth) / target).collect();
        let count = renders.len() as u64;
        let met = errors.iter().filter(|e| **e < 1.0).count() as u64;
        let mean = |f: &dyn Fn(usize) -> f64| (0..renders.len()).map(f).sum::<f64>() / count as f64;
        let told = |i: usize| renders[i].image.error.map_or(f64::NAN, |e| e.relative / target);
        Self {
            renders: count,
            met,
            // The interval has two sides; a target must not be missed too often, and that is one.
            high: statcheck::clopper_pearson(met, count, 2.0 * CERTAINTY - 1.0).1,
            error: mean(&|i| errors[i] * errors[i]).sqrt(),
            worst: errors.iter().copied().fold(0.0, f64::max),
            told: mean(&|i| told(i) * told(i)).sqrt(),
            samples: mean(&|i| f64::from(renders[i].samples)),
        }
    }

    /// Whether at least 95 % may meet the target.
    pub fn holds(&self) -> bool {
        self.high >= CONFIDENCE
    }
}

/// The root mean square over pixels and channels of what `lightfarm render` tells as relative error.
fn relative_error(t: &Telling, truth: &[f64]) -> f64 {
    let term = |(own, r): (&f32, &f64)| (f64::from(*own) - r) * (f64::from(*own) - r) / (r * r + 0.01);
    (t.image.mean.iter().flatten().zip(truth).map(term).sum::<f64>() / truth.len() as f64).sqrt()
}
