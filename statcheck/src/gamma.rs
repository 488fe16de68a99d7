/// Regularised upper incomplete gamma function `Q(a, x)`, `a > 0` (Press et al. 2007, "Numerical Recipes", section 6.2).
pub fn upper_gamma(a: f64, x: f64) -> f64 {
    if !(x > 0.0) {
        return 1.0;
    }
    // x^a e^-x / Gamma(a)
    let scale = libm::exp(a * libm::log(x) - x - libm::lgamma(a));
    if x < a + 1.0 { 1.0 - scale * series(a, x) } else { scale * continued_fraction(a, x) }
}

/// `1/a + x / (a (a + 1)) + ...`
fn series(a: f64, x: f64) -> f64 {
    let (mut term, mut sum, mut k) = (1.0 / a, 1.0 / a, a);
    while term > sum * 1e-16 {
        k += 1.0;
        term *= x / k;
        sum += term;
    }
    sum
}

/// `1 / (x + 1 - a - 1 (1 - a) / (x + 3 - a - ...))` by Lentz's method.
fn continued_fraction(a: f64, x: f64) -> f64 {
    const TINY: f64 = 1e-300;
    let mut b = x + 1.0 - a;
    let mut c = 1.0 / TINY;
    let mut d = 1.0 / b;
    let mut h = d;
    for i in 1..100_000 {
        let i = f64::from(i);
        let an = -i * (i - a);
        b += 2.0;
        let guard = |v: f64| if v.abs() < TINY { TINY } else { v };
        d = 1.0 / guard(an * d + b);
        c = guard(b + an / c);
        let delta = d * c;
        h *= delta;
        if (delta - 1.0).abs() < 1e-15 {
            break;
        }
    }
    h
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn whole_parameter_is_a_poisson_sum() {
        for (a, x) in [(1, 0.3f64), (3, 2.0), (3, 9.5), (12, 11.0), (30, 55.0)] {
            let mut term = (-x).exp();
            let mut sum = 0.0;
            for k in 0..a {
                sum += term;
                term *= x / f64::from(k + 1);
            }
            let q = upper_gamma(f64::from(a), x);
            assert!((q - sum).abs() < 1e-13, "Q({a}, {x}) = {q}, sum {sum}");
        }
    }
}
