//! Hypothesis tests for the statistical tests of the other crates. Everything is f64 and itself tested.

#![allow(clippy::disallowed_methods, reason = "the last bits of a p-value may differ between machines")]

mod beta;
mod binomial;
mod chi2;
mod estimate;
mod gamma;
mod mean;
mod normal;
mod ttest;

pub use beta::regularized_beta;
pub use binomial::clopper_pearson;
pub use chi2::{Chi2, chi2_test, chi2_test_fixed_total, chi2_test_with_errors};
pub use estimate::{Estimate, Welch, family_p_value, rms_deviate};
pub use gamma::upper_gamma;
pub use mean::Mean;
pub use normal::{normal_cdf, normal_p_value, normal_quantile, z_test};
pub use ttest::{student_cdf, student_quantile, t_test, welch_test};

/// p-value of a chi-squared statistic with `dof` degrees of freedom: the probability of a larger one by chance.
pub fn chi2_p_value(statistic: f64, dof: f64) -> f64 {
    upper_gamma(0.5 * dof, 0.5 * statistic)
}

/// Significance for each of `n` independent tests such that all together falsely reject with probability `family` (Sidak 1967).
pub fn sidak(family: f64, n: usize) -> f64 {
    -libm::expm1(libm::log1p(-family) / n as f64)
}

/// The root in `[low, high]` of an increasing function.
fn bisect(mut low: f64, mut high: f64, f: impl Fn(f64) -> f64) -> f64 {
    for _ in 0..200 {
        let middle = 0.5 * (low + high);
        if f(middle) < 0.0 { low = middle } else { high = middle }
    }
    0.5 * (low + high)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Values of the usual tables.
    #[test]
    fn quantiles() {
        for (z, p) in [(1.959_963_985, 0.05), (2.575_829_304, 0.01), (3.290_526_731, 0.001)] {
            assert!((normal_p_value(z) / p - 1.0).abs() < 1e-8);
        }
        for (x, dof, p) in [(3.841_458_8, 1.0, 0.05), (18.307_038, 10.0, 0.05), (135.806_72, 100.0, 0.01)] {
            assert!((chi2_p_value(x, dof) / p - 1.0).abs() < 1e-6, "{x} {dof}: {}", chi2_p_value(x, dof));
        }
        assert!((1.0 - libm::pow(1.0 - sidak(0.01, 7), 7.0) - 0.01).abs() < 1e-12);
    }
}
