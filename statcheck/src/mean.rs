/// Running mean and variance (Welford 1962).
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Mean {
    count: u64,
    mean: f64,
    m2: f64,
}

impl Mean {
    /// Adds a sample.
    pub fn push(&mut self, x: f64) {
        self.count += 1;
        let delta = x - self.mean;
        self.mean += delta / self.count as f64;
        self.m2 += delta * (x - self.mean);
    }

    /// Number of samples.
    pub fn count(&self) -> u64 {
        self.count
    }

    /// Mean of the samples.
    pub fn mean(&self) -> f64 {
        self.mean
    }

    /// Unbiased variance of one sample; 0 for fewer than two.
    pub fn variance(&self) -> f64 {
        if self.count < 2 { 0.0 } else { self.m2 / (self.count - 1) as f64 }
    }

    /// Standard error of the mean.
    pub fn error(&self) -> f64 {
        (self.variance() / self.count.max(1) as f64).sqrt()
    }

    /// p-value of the hypothesis that the expected value is `x` (normal approximation, for many samples). `rounding` is a relative
    /// error allowed besides, for values that are computed in f32.
    pub fn p_value(&self, x: f64, rounding: f64) -> f64 {
        crate::normal_p_value(excess(self.mean - x, rounding * x.abs()) / self.error().max(f64::MIN_POSITIVE))
    }

    /// p-value of the hypothesis that both expected values are the same.
    pub fn p_value_same(&self, other: &Self, rounding: f64) -> f64 {
        let error = self.error().hypot(other.error()).max(f64::MIN_POSITIVE);
        crate::normal_p_value(excess(self.mean - other.mean, rounding * self.mean.abs()) / error)
    }
}

impl FromIterator<f64> for Mean {
    fn from_iter<T: IntoIterator<Item = f64>>(samples: T) -> Self {
        let mut mean = Self::default();
        samples.into_iter().for_each(|x| mean.push(x));
        mean
    }
}

/// What of `|d|` goes beyond `allowed`.
fn excess(d: f64, allowed: f64) -> f64 {
    (d.abs() - allowed).max(0.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn moments() {
        let mut m = Mean::default();
        for x in [1.0, 2.0, 4.0, 7.0] {
            m.push(x);
        }
        assert_eq!((m.count(), m.mean(), m.variance()), (4, 3.5, 7.0));
        assert_eq!(m.p_value(3.5, 0.0), 1.0);
        assert!((m.p_value(3.5 + 1.959_963_985 * m.error(), 0.0) - 0.05).abs() < 1e-9);
    }
}
