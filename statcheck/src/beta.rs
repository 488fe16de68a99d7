/// Terms of the continued fraction; enough for parameters up to some millions.
const MAX_TERMS: usize = 100_000;

/// Replaces a zero denominator in Lentz's method.
const TINY: f64 = 1e-300;

/// Regularised incomplete beta function `I_x(a, b)`, for `a, b > 0` (Press et al., "Numerical Recipes", 6.4).
pub fn regularized_beta(x: f64, a: f64, b: f64) -> f64 {
    if !(x > 0.0) {
        return 0.0;
    }
    if x >= 1.0 {
        return 1.0;
    }
    let ln_front = libm::lgamma(a + b) - libm::lgamma(a) - libm::lgamma(b) + a * x.ln() + b * (-x).ln_1p();
    if x < (a + 1.0) / (a + b + 2.0) {
        ln_front.exp() * beta_fraction(x, a, b) / a
    } else {
        1.0 - ln_front.exp() * beta_fraction(1.0 - x, b, a) / b
    }
}

fn beta_fraction(x: f64, a: f64, b: f64) -> f64 {
    let mut c = 1.0;
    let mut d = 1.0 / nonzero(1.0 - (a + b) * x / (a + 1.0));
    let mut h = d;
    for m in 1..MAX_TERMS {
        let m = m as f64;
        let even = m * (b - m) * x / ((a + 2.0 * m - 1.0) * (a + 2.0 * m));
        d = 1.0 / nonzero(1.0 + even * d);
        c = nonzero(1.0 + even / c);
        h *= d * c;
        let odd = -(a + m) * (a + b + m) * x / ((a + 2.0 * m) * (a + 2.0 * m + 1.0));
        d = 1.0 / nonzero(1.0 + odd * d);
        c = nonzero(1.0 + odd / c);
        h *= d * c;
        if (d * c - 1.0).abs() < 1e-15 {
            break;
        }
    }
    h
}

fn nonzero(x: f64) -> f64 {
    if x.abs() < TINY { TINY } else { x }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn beta_with_whole_parameters_is_a_binomial_tail() {
        // I_x(a, b) = P(Binomial(a + b - 1, x) >= a).
        for (a, b, x) in [(1, 1, 0.3f64), (2, 5, 0.1), (5, 6, 0.5), (20, 3, 0.9)] {
            let n = a + b - 1;
            let tail: f64 = (a..=n)
                .map(|k| {
                    let choose = (0..k).fold(1.0, |c, i| c * f64::from(n - i) / f64::from(i + 1));
                    choose * x.powi(k) * (1.0 - x).powi(n - k)
                })
                .sum();
            let i = regularized_beta(x, f64::from(a), f64::from(b));
            assert!((i - tail).abs() < 1e-12, "I_{x}({a}, {b}) = {i}, tail {tail}");
        }
    }
}
