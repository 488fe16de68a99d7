use crate::sampling::{Choice, Discrete};

/// Chooses lights with fixed probabilities.
#[derive(Clone, Debug)]
pub struct LightSelector {
    kind: Kind,
}

#[derive(Clone, Debug)]
enum Kind {
    None,
    /// The only light that can be chosen.
    One(usize),
    Table(Discrete),
}

impl LightSelector {
    /// Probabilities proportional to `weights` (for instance power). Lights whose weight is not positive and finite are never
    /// chosen.
    pub fn new(weights: &[f32]) -> Self {
        let mut usable = (0..weights.len()).filter(|&i| weights[i] > 0.0 && weights[i].is_finite());
        let kind = match (usable.next(), usable.next()) {
            (Some(only), None) => Kind::One(only),
            _ => Discrete::new(weights).map_or(Kind::None, Kind::Table),
        };
        Self { kind }
    }

    /// This selector with probability 1/2, else in proportion to `weights`, which add up to 1. For learned weights, which may have missed a
    /// light: no variance is more than twice what it was.
    pub fn mixed(&self, weights: &[f32]) -> Self {
        let mixed: Vec<f32> = weights.iter().enumerate().map(|(i, w)| 0.5 * (self.pmf(i) + w)).collect();
        Self::new(&mixed)
    }

    /// Whether no light can be chosen.
    #[inline]
    pub fn is_empty(&self) -> bool {
        matches!(self.kind, Kind::None)
    }

    /// Probability of light `i`.
    #[inline]
    pub fn pmf(&self, i: usize) -> f32 {
        match &self.kind {
            Kind::None => 0.0,
            Kind::One(only) => f32::from(u8::from(i == *only)),
            Kind::Table(table) => table.pmf(i),
        }
    }

    /// Chooses a light by `u`; the choice's own `u` is what is left of it, again uniform. `None` when there is none to choose.
    #[inline]
    pub fn sample(&self, u: f32) -> Option<Choice> {
        match &self.kind {
            Kind::None => None,
            Kind::One(only) => Some(Choice { index: *only, pmf: 1.0, u }),
            Kind::Table(table) => Some(table.sample(u)),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sampling::{IndependentSampler, Sampler};

    #[test]
    fn frequencies_are_the_probabilities() {
        let weights = [0.0f32, 3.0, 1e-3, 0.5, f32::NAN, 8.0, -1.0, f32::INFINITY];
        let power = LightSelector::new(&weights);
        for selector in [power.mixed(&[0.1, 0.2, 0.0, 0.3, 0.0, 0.4, 0.0, 0.0]), power] {
            let pmf: Vec<f64> = (0..weights.len()).map(|i| f64::from(selector.pmf(i))).collect();
            assert!((pmf.iter().sum::<f64>() - 1.0).abs() < 1e-6);
            let n = 200_000;
            let (mut counts, mut rest) = (vec![0.0; weights.len()], vec![0.0; 16]);
            let mut s = IndependentSampler::new([16]);
            for _ in 0..n {
                let choice = selector.sample(s.next_1d()).unwrap();
                assert_eq!(choice.pmf, selector.pmf(choice.index));
                counts[choice.index] += 1.0;
                rest[(choice.u * 16.0) as usize] += 1.0;
            }
            let expected: Vec<f64> = pmf.iter().map(|p| p * f64::from(n)).collect();
            assert!(statcheck::chi2_test(&counts, &expected).p > 0.001, "{counts:?} {expected:?}");
            assert!(statcheck::chi2_test(&rest, &[f64::from(n) / 16.0; 16]).p > 0.001, "{rest:?}");
        }
    }

    #[test]
    fn none_one_and_left_out() {
        assert!(LightSelector::new(&[]).sample(0.5).is_none());
        assert!(LightSelector::new(&[0.0, f32::NAN]).is_empty());
        let one = LightSelector::new(&[0.0, 7.0, 0.0]);
        assert_eq!(one.sample(0.3), Some(Choice { index: 1, pmf: 1.0, u: 0.3 }));
        assert_eq!([0, 1, 2].map(|i| one.pmf(i)), [0.0, 1.0, 0.0]);
        // What was learned to be dark keeps half of its share.
        let learned = LightSelector::new(&[2.0, 6.0, 2.0]).mixed(&[0.0, 0.9, 0.1]);
        for (i, pmf) in [0.1, 0.75, 0.15].into_iter().enumerate() {
            assert!((learned.pmf(i) - pmf).abs() < 1e-6);
        }
    }
}
