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

/// Whether `observed` counts agree with `expected` ones of the same, fixed total. Cells are pooled, rare ones first, until every pool
/// expects 5. What is observed where nothing is expected gives a p-value of 0. `None` when fewer than two pools are left: there is
/// nothing to test.
pub fn chi2_test_fixed_total(observed: &[f64], expected: &[f64]) -> Option<Chi2> {
    assert_eq!(observed.len(), expected.len());
    // Order by octaves: were equal cells ordered by the rounding of their expectations, and that rounding depended on what was observed
    // (adaptive quadrature), empty cells would be pooled with empty ones.
    let octave = |i: usize| libm::log2(expected[i].max(f64::MIN_POSITIVE)).floor() as i64;
    let mut order: Vec<usize> = (0..expected.len()).collect();
    order.sort_by_key(|&i| octave(i));
    // Pool the rarest cells.
    let mut pools: Vec<[f64; 2]> = Vec::new();
    let mut pool = [0.0; 2];
    let mut impossible = false;
    for &i in &order {
        impossible |= observed[i] > 0.0 && !(expected[i] > 0.0);
        pool = [pool[0] + observed[i], pool[1] + expected[i]];
        if pool[1] >= 5.0 {
            pools.push(std::mem::take(&mut pool));
        }
    }
    // What is left over joins the last pool, so that the total stays.
    if let Some(last) = pools.last_mut() {
        *last = [last[0] + pool[0], last[1] + pool[1]];
    }
    if pools.len() < 2 && !impossible {
        return None;
    }
    let statistic = pools.iter().map(|[o, e]| (o - e) * (o - e) / e).sum();
    let dof = pools.len().saturating_sub(1) as f64;
    let p = if impossible { 0.0 } else { chi2_p_value(statistic, dof) };
    Some(Chi2 { statistic, dof, p })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_worked_example() {
        // Mendel's peas: 315, 108, 101, 32 against 9 : 3 : 3 : 1 gives 0.470 with 3 degrees of freedom, p = 0.925.
        let expected = [9.0, 3.0, 3.0, 1.0].map(|r| r * 556.0 / 16.0);
        let t = chi2_test_fixed_total(&[315.0, 108.0, 101.0, 32.0], &expected).expect("four cells");
        assert!((t.statistic - 0.470_024).abs() < 1e-6 && t.dof == 3.0 && (t.p - 0.925_426).abs() < 1e-6, "{t:?}");
    }

    #[test]
    fn rare_cells_are_pooled_and_impossible_ones_refused() {
        let t = chi2_test_fixed_total(&[1.0, 3.0, 2.0, 50.0, 44.0], &[2.0, 2.0, 2.0, 47.0, 47.0]).expect("three pools");
        assert_eq!(t.dof, 2.0);
        assert_eq!(chi2_test_fixed_total(&[1.0, 50.0, 49.0], &[0.0, 50.0, 50.0]).map(|t| t.p), Some(0.0));
        assert_eq!(chi2_test_fixed_total(&[100.0], &[100.0]), None);
    }

    /// Under the hypothesis a twentieth of the p-values is below 0.05; under a wrong one they vanish.
    #[test]
    fn fixed_total_rejects_at_its_level_and_has_power() {
        let mut state = 1u64;
        let mut next = || {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (state >> 33) as f64 / (1u64 << 31) as f64
        };
        let mut rejected = 0;
        for _ in 0..2000 {
            let mut observed = [0.0; 10];
            for _ in 0..500 {
                observed[(next() * 10.0) as usize] += 1.0;
            }
            rejected += u64::from(chi2_test_fixed_total(&observed, &[50.0; 10]).is_some_and(|t| t.p < 0.05));
        }
        let (low, high) = crate::clopper_pearson(rejected, 2000, 0.999);
        assert!(low < 0.05 && 0.05 < high, "rejected {rejected} of 2000");

        let mut observed = [0.0; 10];
        for _ in 0..5000 {
            observed[(next().powf(1.2) * 10.0) as usize] += 1.0;
        }
        assert!(chi2_test_fixed_total(&observed, &[500.0; 10]).is_some_and(|t| t.p < 1e-6));
    }

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
