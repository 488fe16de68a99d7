//! Equal time and equal error: where curves of error against time cross a line.

/// Points (seconds, error) by rising time, seen on logarithmic axes; errors are those that are best so far.
#[derive(Clone, Debug, Default)]
pub struct Line(Vec<(f64, f64)>);

impl Line {
    /// From checkpoints; what is not positive is left out.
    pub fn new(points: impl IntoIterator<Item = (f64, f64)>) -> Self {
        let mut kept: Vec<(f64, f64)> = points.into_iter().filter(|(s, e)| *s > 0.0 && *e > 0.0).collect();
        kept.sort_by(|a, b| a.0.total_cmp(&b.0));
        let mut best = f64::INFINITY;
        for (_, e) in &mut kept {
            best = best.min(*e);
            *e = best;
        }
        Self(kept)
    }

    /// The lowest error.
    pub fn lowest(&self) -> Option<f64> {
        self.0.last().map(|p| p.1)
    }

    /// The last time.
    pub fn end(&self) -> Option<f64> {
        self.0.last().map(|p| p.0)
    }

    /// The first point.
    pub fn start(&self) -> Option<(f64, f64)> {
        self.0.first().copied()
    }

    /// Seconds until the error falls to `error`; `None` if it never does. At or below the first point's error, the first time.
    pub fn seconds_to(&self, error: f64) -> Option<f64> {
        let (first, last) = (self.0.first()?, self.0.last()?);
        // A last point is met in spite of rounding.
        if error < last.1 * (1.0 - 1e-9) {
            return None;
        }
        if error >= first.1 {
            return Some(first.0);
        }
        let pair = self.0.windows(2).find(|w| w[1].1 <= error * (1.0 + 1e-9))?;
        Some(between(pair[0], pair[1], error, |p| p.1, |p| p.0))
    }

    /// Error after `seconds`; `None` before the first point and beyond 1.05 of the last.
    pub fn error_at(&self, seconds: f64) -> Option<f64> {
        let (first, last) = (self.0.first()?, self.0.last()?);
        if seconds < first.0 || seconds > 1.05 * last.0 {
            return None;
        }
        let pair = self.0.windows(2).find(|w| w[1].0 >= seconds);
        Some(pair.map_or(last.1, |w| between(w[0], w[1], seconds, |p| p.0, |p| p.1)))
    }

    /// Slope of ln error over ln seconds by least squares over the last `n` points.
    pub fn slope(&self, n: usize) -> Option<f64> {
        let points = &self.0[self.0.len().saturating_sub(n)..];
        if points.len() < 3 {
            return None;
        }
        super::growth::fit::exponent(points).map(|e| e.value)
    }
}

/// Where on the segment (in logarithms) the coordinate `from` is `at`: the coordinate `to`.
fn between(a: (f64, f64), b: (f64, f64), at: f64, from: fn((f64, f64)) -> f64, to: fn((f64, f64)) -> f64) -> f64 {
    use renderer::math::{exp64, ln64};
    let (x0, x1) = (ln64(from(a)), ln64(from(b)));
    let t = if x0 == x1 { 1.0 } else { ((ln64(at) - x0) / (x1 - x0)).clamp(0.0, 1.0) };
    exp64(ln64(to(a)) * (1.0 - t) + ln64(to(b)) * t)
}

/// Time of `a` over time of `b` to the lowest error that both reach, that error, and which way the ratio is a bound: `>=` where `b` was
/// below the error at its first checkpoint, `<=` where `a` was, else nothing. `None` where a curve is empty.
pub fn ratio(a: &Line, b: &Line) -> Option<(f64, f64, &'static str)> {
    let error = a.lowest()?.max(b.lowest()?);
    let (ta, tb) = (a.seconds_to(error)?, b.seconds_to(error)?);
    let early = |l: &Line| l.start().is_some_and(|(_, e)| e < error);
    let bound = match (early(a), early(b)) {
        (false, true) => ">=",
        (true, false) => "<=",
        _ => "",
    };
    Some((ta / tb, error, bound))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn curves_that_fall_as_one_over_time() {
        let a = Line::new((0..6).map(|i| f64::from(1 << i)).map(|t| (t, 1.0 / t)));
        let b = Line::new((0..6).map(|i| f64::from(1 << i)).map(|t| (0.1 * t, 0.4 / t)));
        // b takes 0.04 / e to an error e, a takes 1 / e: 25 times as long.
        let (r, error, bound) = ratio(&a, &b).unwrap();
        assert!((r - 25.0).abs() < 1e-9 && (error - 1.0 / 32.0).abs() < 1e-12 && bound.is_empty(), "{r} {error}");
        assert!((a.error_at(3.0).unwrap() - 1.0 / 3.0).abs() < 1e-9);
        assert_eq!((a.error_at(0.5), a.error_at(40.0)), (None, None));
        assert!((a.slope(4).unwrap() + 1.0).abs() < 1e-9);
    }

    #[test]
    fn one_that_never_gets_there_is_bounded() {
        let stuck = Line::new([(1.0, 0.5), (2.0, 0.6), (4.0, 0.5)]);
        let good = Line::new([(0.5, 0.1), (1.0, 0.05)]);
        // The good one is below 0.5 at its first checkpoint already.
        assert_eq!(ratio(&stuck, &good), Some((2.0, 0.5, ">=")));
        assert_eq!(ratio(&good, &stuck), Some((0.5, 0.5, "<=")));
        assert_eq!(ratio(&Line::default(), &good), None);
        assert_eq!(Line::new([(1.0, f64::NAN), (2.0, -1.0)]).lowest(), None);
    }
}
