use crate::bisect;
use std::f64::consts::FRAC_1_SQRT_2;

/// Cumulative probability of the standard normal distribution.
pub fn normal_cdf(z: f64) -> f64 {
    0.5 * libm::erfc(-z * FRAC_1_SQRT_2)
}

/// Inverse of [`normal_cdf`], for `p` in (0, 1).
pub fn normal_quantile(p: f64) -> f64 {
    bisect(-40.0, 40.0, |z| normal_cdf(z) - p)
}

/// Two-sided p-value of a standard normal deviate.
pub fn normal_p_value(z: f64) -> f64 {
    libm::erfc(z.abs() * FRAC_1_SQRT_2)
}

/// Two-sided p-value of `value` under a normal distribution.
pub fn z_test(value: f64, mean: f64, standard_deviation: f64) -> f64 {
    normal_p_value((value - mean) / standard_deviation)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn agrees_with_tables() {
        for (p, z) in [(0.975, 1.959_963_984_540), (0.995, 2.575_829_303_549), (0.5, 0.0), (1e-6, -4.753_424_308_823)] {
            assert!((normal_quantile(p) - z).abs() < 1e-9, "quantile of {p}");
            assert!((normal_cdf(z) - p).abs() < 1e-12, "cdf of {z}");
        }
        assert!((z_test(5.0 + 2.0 * 1.959_963_984_540, 5.0, 2.0) - 0.05).abs() < 1e-12);
    }
}
