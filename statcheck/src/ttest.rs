use crate::{Mean, bisect, regularized_beta};

/// Cumulative probability of Student's t distribution.
pub fn student_cdf(t: f64, dof: f64) -> f64 {
    let tail = 0.5 * regularized_beta(dof / (dof + t * t), 0.5 * dof, 0.5);
    if t > 0.0 { 1.0 - tail } else { tail }
}

/// Inverse of [`student_cdf`], for `p` in (0, 1).
pub fn student_quantile(p: f64, dof: f64) -> f64 {
    let mut bound = 1.0;
    while bound < 1e300 && student_cdf(bound, dof) < p.max(1.0 - p) {
        bound *= 2.0;
    }
    bisect(-bound, bound, |t| student_cdf(t, dof) - p)
}

/// Two-sided p-value of the hypothesis that the observations have the given mean.
pub fn t_test(sample: &Mean, mean: f64) -> f64 {
    two_sided(sample.mean() - mean, sample.error(), sample.count() as f64 - 1.0)
}

/// Two-sided p-value of the hypothesis that two samples have one mean, whatever their variances (Welch 1947).
pub fn welch_test(a: &Mean, b: &Mean) -> f64 {
    let (va, vb) = (a.variance() / a.count() as f64, b.variance() / b.count() as f64);
    let dof = (va + vb) * (va + vb) / (va * va / (a.count() as f64 - 1.0) + vb * vb / (b.count() as f64 - 1.0));
    two_sided(a.mean() - b.mean(), (va + vb).sqrt(), dof)
}

fn two_sided(difference: f64, standard_error: f64, dof: f64) -> f64 {
    if difference == 0.0 {
        return 1.0;
    }
    if standard_error == 0.0 {
        return 0.0;
    }
    2.0 * student_cdf(-(difference / standard_error).abs(), dof)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn quantiles_agree_with_tables() {
        for (p, dof, t) in [
            (0.975, 10.0, 2.228_138_852),
            (0.995, 15.0, 2.946_712_883),
            (0.995, 7.0, 3.499_483_297),
            (0.95, 1.0, 6.313_751_515),
            (0.025, 2.0, -4.302_652_730),
        ] {
            let q = student_quantile(p, dof);
            assert!((q - t).abs() < 1e-8, "{p}, {dof}: {q}");
        }
        // With many degrees of freedom it is the normal distribution.
        assert!((student_quantile(0.975, 1e7) - crate::normal_quantile(0.975)).abs() < 1e-6);
    }

    #[test]
    fn one_sample() {
        // Mean 5, standard deviation sqrt(32 / 7): t = (5 - 4) / (sd / sqrt 8) = 1.322 876 with 7 degrees of freedom.
        let m: Mean = [2.0, 4.0, 4.0, 4.0, 5.0, 5.0, 7.0, 9.0].into_iter().collect();
        let expected = 2.0 * (1.0 - student_cdf(1.322_875_655_532, 7.0));
        assert!((t_test(&m, 4.0) - expected).abs() < 1e-10);
        assert_eq!(t_test(&m, 5.0), 1.0);
        let constant: Mean = [1.0; 4].into_iter().collect();
        assert_eq!(t_test(&constant, 2.0), 0.0);
    }

    #[test]
    fn welch_with_equal_variances_is_the_pooled_test() {
        let a: Mean = [1.0, 2.0, 3.0, 4.0].into_iter().collect();
        let b: Mean = [3.0, 4.0, 5.0, 6.0].into_iter().collect();
        // Both variances are 5/3: standard error sqrt(5/6), 6 degrees of freedom.
        let expected = 2.0 * student_cdf(-2.0 / (5.0f64 / 6.0).sqrt(), 6.0);
        assert!((welch_test(&a, &b) - expected).abs() < 1e-12);
    }
}
