use crate::chi2_p_value;

/// Outcome of a chi-squared test.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Chi2 {
    /// Sum of squared, normalised differences.
    pub statistic: f64,
    /// Degrees of freedom.
    pub dof: f64,
    /// Probability of a larger statistic by chance.
    pub p: f64,
}

/// Whether `observed` counts agree with `expected` ones (Poisson: their total is free). Cells that expect less than 5 are pooled.
pub fn chi2_test(observed: &[f64], expected: &[f64]) -> Chi2 {
    chi2_test_with_errors(observed, expected, &vec![0.0; expected.len()])
}

/// [`chi2_test`] for expected counts that are themselves estimates with the given variances.
pub fn chi2_test_with_errors(observed: &[f64], expected: &[f64], variance: &[f64]) -> Chi2 {
    assert!(observed.len() == expected.len() && observed.len() == variance.len());
    let (mut statistic, mut dof) = (0.0, 0.0f64);
    let mut add = |o: f64, e: f64, v: f64| {
        statistic += (o - e) * (o - e) / (e + v);
        dof += 1.0;
    };
    // Pool small cells.
    let mut pool = [0.0; 3];
    for ((&o, &e), &v) in observed.iter().zip(expected).zip(variance) {
        if e >= 5.0 {
            add(o, e, v);
            continue;
        }
        pool = [pool[0] + o, pool[1] + e, pool[2] + v];
        if pool[1] >= 5.0 {
            let [o, e, v] = std::mem::take(&mut pool);
            add(o, e, v);
        }
    }
    // What is left is too little for a chi-squared cell, but samples where none are expected must not go unseen.
    if pool[0] > 0.0 || pool[1] > 0.0 {
        let [o, e, v] = pool;
        add(o, e.max(1.0), v);
    }
    let p = if statistic.is_finite() { chi2_p_value(statistic, dof.max(1.0)) } else { 0.0 };
    Chi2 { statistic, dof, p }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Counts drawn as expected give uniform p-values; counts off by 10 % are found out.
    #[test]
    fn power_and_size() {
        let mut state = 1u64;
        let mut uniform = || {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (state >> 11) as f64 / (1u64 << 53) as f64
        };
        let (cells, n, runs) = (40, 20_000, 200);
        let expected = vec![n as f64 / cells as f64; cells];
        let mut small = 0;
        for _ in 0..runs {
            let mut observed = vec![0.0; cells];
            for _ in 0..n {
                observed[(uniform() * cells as f64) as usize] += 1.0;
            }
            small += u32::from(chi2_test(&observed, &expected).p < 0.1);
            // Every other cell is 10 % off.
            let wrong: Vec<f64> = expected.iter().enumerate().map(|(i, e)| e * (0.9 + 0.2 * (i % 2) as f64)).collect();
            assert!(chi2_test(&observed, &wrong).p < 1e-4);
        }
        // Binomial(200, 0.1): mean 20, standard deviation 4.2.
        assert!((5..=37).contains(&small), "{small}");
    }

    #[test]
    fn samples_where_none_are_expected() {
        assert!(chi2_test(&[100.0, 20.0], &[100.0, 0.0]).p < 1e-6);
        assert!(chi2_test(&[100.0, 0.0], &[100.0, 0.0]).p > 0.5);
    }
}
