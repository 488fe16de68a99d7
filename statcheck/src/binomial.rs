use crate::{bisect, regularized_beta};

/// Exact confidence interval of a probability after `successes` of `trials` (Clopper and Pearson 1934).
pub fn clopper_pearson(successes: u64, trials: u64, confidence: f64) -> (f64, f64) {
    let (k, n) = (successes as f64, trials as f64);
    let tail = 0.5 * (1.0 - confidence);
    let low = if successes == 0 { 0.0 } else { bisect(0.0, 1.0, |p| regularized_beta(p, k, n - k + 1.0) - tail) };
    let high = if successes >= trials {
        1.0
    } else {
        bisect(0.0, 1.0, |p| regularized_beta(p, k + 1.0, n - k) - (1.0 - tail))
    };
    (low, high)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn agrees_with_closed_forms_and_tables() {
        let close = |a: (f64, f64), b: (f64, f64)| (a.0 - b.0).abs() < 1e-6 && (a.1 - b.1).abs() < 1e-6;
        assert!(close(clopper_pearson(0, 10, 0.95), (0.0, 1.0 - 0.025f64.powf(0.1))));
        assert!(close(clopper_pearson(10, 10, 0.95), (0.025f64.powf(0.1), 1.0)));
        assert!(close(clopper_pearson(5, 10, 0.95), (0.187_086, 0.812_914)));
    }
}
