//! Exponents of growth.

use crate::error::stats::Interval;
use renderer::math::ln64;
use statcheck::student_quantile;

/// The exponent k of y = c x^k by least squares of the logarithms, with Student's 95 % interval; `None` below three points or when all
/// x are the same.
pub fn exponent(points: &[(f64, f64)]) -> Option<Interval> {
    let n = points.len() as f64;
    if points.len() < 3 || points.iter().any(|(x, y)| !(*x > 0.0 && *y > 0.0)) {
        return None;
    }
    let logs: Vec<(f64, f64)> = points.iter().map(|(x, y)| (ln64(*x), ln64(*y))).collect();
    let mean = |f: fn(&(f64, f64)) -> f64| logs.iter().map(f).sum::<f64>() / n;
    let (mx, my) = (mean(|p| p.0), mean(|p| p.1));
    let sxx: f64 = logs.iter().map(|(x, _)| (x - mx) * (x - mx)).sum();
    if !(sxx > 0.0) {
        return None;
    }
    let k = logs.iter().map(|(x, y)| (x - mx) * (y - my)).sum::<f64>() / sxx;
    let residual: f64 = logs.iter().map(|(x, y)| (y - my - k * (x - mx)) * (y - my - k * (x - mx))).sum();
    let half = student_quantile(0.975, n - 2.0) * (residual / (n - 2.0) / sxx).sqrt();
    Some(Interval { value: k, low: k - half, high: k + half })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn powers_are_found() {
        let cubes: Vec<(f64, f64)> = (1..8).map(|x| (f64::from(x), 5.0 * f64::from(x * x * x))).collect();
        let e = exponent(&cubes).unwrap();
        assert!((e.value - 3.0).abs() < 1e-9 && e.high - e.low < 1e-6, "{e:?}");
        let noisy: Vec<(f64, f64)> =
            cubes.iter().enumerate().map(|(i, (x, y))| (*x, y * if i % 2 == 0 { 1.1 } else { 0.9 })).collect();
        let e = exponent(&noisy).unwrap();
        assert!(e.low < 3.0 && 3.0 < e.high && e.high - e.low > 0.1, "{e:?}");
        assert_eq!(exponent(&cubes[..2]), None);
        assert_eq!(exponent(&[(1.0, 1.0); 4]), None);
    }
}
