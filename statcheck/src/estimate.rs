use crate::{normal_quantile, student_cdf, student_quantile};

/// A mean that was estimated, with what is known of its error.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Estimate {
    /// The mean.
    pub mean: f64,
    /// Its variance.
    pub variance: f64,
    /// Degrees of freedom behind the variance.
    pub dof: f64,
}

/// Welch's t-test of two estimates.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Welch {
    /// The statistic.
    pub t: f64,
    /// Its degrees of freedom.
    pub dof: f64,
    /// Two-sided p-value.
    pub p: f64,
}

impl Estimate {
    /// A mean that is known.
    pub fn exact(mean: f64) -> Self {
        Self { mean, variance: 0.0, dof: f64::INFINITY }
    }

    /// The mean of several estimates, given the `variances` of each with `dof` degrees of freedom (Welch-Satterthwaite).
    ///
    /// They are independent when `inflation` is 1. It tells how much larger the variance of the mean is than that of independent ones;
    /// as many estimates as share a sample then count once.
    pub fn pooled(mean: f64, variances: impl Iterator<Item = f64>, dof: f64, inflation: f64) -> Self {
        let (mut n, mut sum, mut squares) = (0.0, 0.0, 0.0);
        for v in variances {
            n += 1.0;
            sum += v;
            squares += v * v;
        }
        let dof = if squares > 0.0 { (sum * sum / squares * dof / inflation).max(dof) } else { dof };
        Self { mean, variance: sum * inflation / (n * n), dof }
    }

    /// With the error of another estimate of the same mean, if that is larger.
    pub fn at_least(self, other: Option<Self>) -> Self {
        other.filter(|o| o.variance > self.variance).unwrap_or(self)
    }

    /// Half the width of the two-sided interval that holds the true mean with this probability.
    pub fn half_width(&self, confidence: f64) -> f64 {
        student_quantile(0.5 + 0.5 * confidence, self.dof) * self.variance.sqrt()
    }

    /// Tests whether both estimate the same (Welch 1947). `rounding` is a relative difference that is never held against them; `None`
    /// when an error is not known.
    pub fn welch(&self, other: &Self, rounding: f64) -> Option<Welch> {
        let rounding = rounding * self.mean.abs().max(other.mean.abs());
        let difference = self.mean - other.mean;
        let sum = self.variance + other.variance;
        if !(sum.is_finite() && difference.is_finite()) {
            return None;
        }
        let square = |e: &Self| e.variance * e.variance / e.dof;
        let dof = if sum > 0.0 { sum * sum / (square(self) + square(other)) } else { self.dof.min(other.dof) };
        if difference.abs() <= rounding {
            return Some(Welch { t: 0.0, dof, p: 1.0 });
        }
        let t = difference / (sum + rounding * rounding).sqrt();
        Some(Welch { t, dof, p: 2.0 * student_cdf(-t.abs(), dof) })
    }
}

/// p-value of a family of `count` independent tests whose least p-value is `least` (Sidak 1967).
pub fn family_p_value(least: f64, count: usize) -> f64 {
    -libm::expm1(count as f64 * libm::log1p(-least.min(1.0 - 1e-16)))
}

/// Root mean square of the normal deviates that two-sided p-values stand for: about 1 when the errors are told right.
pub fn rms_deviate(p_values: impl Iterator<Item = f64>) -> f64 {
    let (mut count, mut sum) = (0usize, 0.0);
    for p in p_values {
        let z = normal_quantile((0.5 * p).max(1e-300));
        sum += z * z;
        count += 1;
    }
    (sum / count.max(1) as f64).sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Mean, sidak, t_test, welch_test};

    fn estimate(m: &Mean) -> Estimate {
        Estimate { mean: m.mean(), variance: m.error() * m.error(), dof: m.count() as f64 - 1.0 }
    }

    #[test]
    fn estimates_of_samples_give_the_usual_tests() {
        let a: Mean = [1.0, 2.0, 3.0, 4.5].into_iter().collect();
        let b: Mean = [3.0, 4.0, 7.0, 6.0, 5.0].into_iter().collect();
        let both = estimate(&a).welch(&estimate(&b), 0.0).unwrap();
        assert!((both.p - welch_test(&a, &b)).abs() < 1e-12);
        let known = estimate(&a).welch(&Estimate::exact(2.0), 0.0).unwrap();
        assert!((known.p - t_test(&a, 2.0)).abs() < 1e-12 && known.dof == 3.0);
        // The interval ends where the test begins to reject.
        let end = Estimate::exact(a.mean() + estimate(&a).half_width(0.99));
        assert!((estimate(&a).welch(&end, 0.0).unwrap().p - 0.01).abs() < 1e-9);
    }

    #[test]
    fn the_larger_error_counts() {
        let with = |variance| Estimate { mean: 1.0, variance, dof: 7.0 };
        assert_eq!(with(2.0).at_least(None), with(2.0));
        assert_eq!(with(2.0).at_least(Some(with(1.0))), with(2.0));
        assert_eq!(with(2.0).at_least(Some(with(3.0))), with(3.0));
    }

    #[test]
    fn rounding_is_not_held_against_anybody() {
        let exact = |mean| Estimate { dof: 7.0, ..Estimate::exact(mean) };
        assert_eq!(exact(1.0).welch(&exact(1.000_009), 1e-5).unwrap().p, 1.0);
        assert!(exact(1.0).welch(&exact(1.001), 1e-5).unwrap().p < 1e-9);
        assert!(exact(1.0).welch(&Estimate { variance: f64::NAN, ..exact(1.0) }, 1e-5).is_none());
    }

    #[test]
    fn equal_independent_parts_add_their_degrees_of_freedom() {
        let whole = Estimate::pooled(2.0, [4.0; 10].into_iter(), 7.0, 1.0);
        assert_eq!((whole.variance, whole.dof), (0.4, 70.0));
        let shared = Estimate::pooled(2.0, [4.0; 10].into_iter(), 7.0, 2.0);
        assert_eq!((shared.variance, shared.dof), (0.8, 35.0));
        assert_eq!(Estimate::pooled(2.0, [0.0; 10].into_iter(), 7.0, 1.0).dof, 7.0);
    }

    #[test]
    fn families() {
        assert!((family_p_value(sidak(0.01, 40), 40) - 0.01).abs() < 1e-12);
        assert_eq!(family_p_value(1.0, 3), 1.0);
        let p = [0.317_310_508, 0.045_500_264]; // deviates 1 and 2
        assert!((rms_deviate(p.into_iter()) - 2.5f64.sqrt()).abs() < 1e-6);
    }
}
