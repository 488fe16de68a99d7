//! Squared errors of one picture against an estimate of the truth whose own variance is known.

/// Keeps relative measures from dividing by the darkness of black pixels.
pub const FLOOR: f64 = 0.01;
/// The share of pixels that the trimmed measure leaves out: fireflies.
const TRIM: f64 = 0.001;
/// The share of pixels that count as dark.
const DARK: f64 = 0.25;

/// A measure of the error. Means run over channels and over the pixels that are finite in both pictures.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Measure {
    /// `mean (I - R)^2`.
    Mse,
    /// `mean (I - R)^2 / (R^2 + 0.01)`.
    RelMse,
    /// The same without the 0.1 % of pixels where it is largest.
    RelMseTrimmed,
    /// `mean (I - R)^2` of the quarter of the pixels where R's luminance is lowest.
    DarkMse,
    /// `mean (I - R)^2 / (R^2 + 0.01)` of these.
    DarkRelMse,
}

/// Number of measures.
pub const MEASURES: usize = 5;

impl Measure {
    /// All of them, each at the place of its number.
    pub const ALL: [Self; MEASURES] = [Self::Mse, Self::RelMse, Self::RelMseTrimmed, Self::DarkMse, Self::DarkRelMse];

    /// Its name in JSON.
    pub fn name(self) -> &'static str {
        ["mse", "relmse", "relmse_trimmed", "dark_mse", "dark_relmse"][self as usize]
    }
}

/// What a picture is compared with.
#[derive(Clone, Debug, Default)]
pub struct Target {
    /// The estimate of the truth.
    pub mean: Vec<[f64; 3]>,
    /// Its variance; 0 where it is not known.
    pub variance: Vec<[f64; 3]>,
}

/// How far a picture is from its target.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Deviation {
    /// Mean squared deviation by each measure: the picture's error and the target's variance together.
    pub squared: [f64; MEASURES],
    /// What the target's variance adds to it.
    pub reference: [f64; MEASURES],
    /// Mean of the picture over the mean of the target.
    pub mean_ratio: f64,
}

impl Deviation {
    /// The picture's own error. The picture and its target must be independent; then
    /// `E (I - R)^2 = E (I - truth)^2 + Var R` for an unbiased R.
    pub fn error(&self, m: Measure) -> f64 {
        self.squared[m as usize] - self.reference[m as usize]
    }
}

/// One pixel, summed over channels.
#[derive(Clone, Copy)]
struct Term {
    luminance: f64,
    /// Squared deviation, and the variance of the target.
    absolute: [f64; 2],
    /// Both over `R^2 + 0.01`.
    relative: [f64; 2],
}

/// Compares a picture with its target; `None` when no pixel is finite in both.
pub fn compare(picture: &[[f32; 3]], target: &Target) -> Option<Deviation> {
    let (mut terms, mut sums) = (Vec::with_capacity(picture.len()), [0.0; 2]);
    for ((i, r), v) in picture.iter().zip(&target.mean).zip(&target.variance) {
        let i = i.map(f64::from);
        if i.iter().chain(r).chain(v).all(|x| x.is_finite()) {
            sums[0] += i.iter().sum::<f64>();
            sums[1] += r.iter().sum::<f64>();
            terms.push(term(&i, r, v));
        }
    }
    if terms.is_empty() {
        return None;
    }
    let (mut squared, mut reference) = ([0.0; MEASURES], [0.0; MEASURES]);
    let mut set = |m: Measure, terms: &[Term], of: fn(&Term) -> [f64; 2]| {
        let values = 3.0 * terms.len() as f64;
        squared[m as usize] = terms.iter().map(|t| of(t)[0]).sum::<f64>() / values;
        reference[m as usize] = terms.iter().map(|t| of(t)[1]).sum::<f64>() / values;
    };
    set(Measure::Mse, &terms, |t| t.absolute);
    set(Measure::RelMse, &terms, |t| t.relative);
    let dark = part(&mut terms, DARK, |t| t.luminance);
    set(Measure::DarkMse, dark, |t| t.absolute);
    set(Measure::DarkRelMse, dark, |t| t.relative);
    let kept = part(&mut terms, 1.0 - TRIM, |t| t.relative[0]);
    set(Measure::RelMseTrimmed, kept, |t| t.relative);
    Some(Deviation { squared, reference, mean_ratio: sums[0] / sums[1] })
}

fn term(i: &[f64; 3], r: &[f64; 3], v: &[f64; 3]) -> Term {
    let (mut absolute, mut relative) = ([0.0; 2], [0.0; 2]);
    for c in 0..3 {
        let (d, scale) = (i[c] - r[c], r[c] * r[c] + FLOOR);
        absolute[0] += d * d;
        absolute[1] += v[c];
        relative[0] += d * d / scale;
        relative[1] += v[c] / scale;
    }
    Term { luminance: 0.2126 * r[0] + 0.7152 * r[1] + 0.0722 * r[2], absolute, relative }
}

/// The share of the terms, at least one, whose key is lowest.
fn part(terms: &mut [Term], share: f64, key: impl Fn(&Term) -> f64) -> &[Term] {
    let count = ((share * terms.len() as f64).ceil() as usize).clamp(1, terms.len());
    terms.select_nth_unstable_by(count - 1, |a, b| key(a).total_cmp(&key(b)));
    &terms[..count]
}

#[cfg(test)]
mod tests {
    use super::*;

    fn target(mean: Vec<[f64; 3]>, variance: f64) -> Target {
        Target { variance: vec![[variance; 3]; mean.len()], mean }
    }

    #[test]
    fn measures_worked_out_by_hand() {
        let picture = [[1.0, 2.0, 0.0], [f32::NAN, 0.0, 0.0], [0.1, 0.0, 0.0]];
        let d = compare(&picture, &target(vec![[1.0, 1.0, 0.5], [0.0; 3], [0.0; 3]], 0.0)).unwrap();
        let close = |m: Measure, y: f64| assert!((d.error(m) - y).abs() < 1e-8, "{m:?}: {} for {y}", d.error(m));
        close(Measure::Mse, 1.26 / 6.0);
        close(Measure::RelMse, (1.0 / 1.01 + 0.25 / 0.26 + 1.0) / 6.0);
        close(Measure::DarkMse, 0.01 / 3.0);
        close(Measure::DarkRelMse, 1.0 / 3.0);
        assert!((d.mean_ratio - 3.1 / 2.5).abs() < 1e-6);
    }

    #[test]
    fn variance_of_the_target_is_taken_off() {
        let d = compare(&[[1.5; 3]; 2], &target(vec![[1.0; 3]; 2], 0.05)).unwrap();
        assert!((d.error(Measure::Mse) - 0.2).abs() < 1e-12);
        assert!((d.error(Measure::DarkRelMse) - 0.2 / 1.01).abs() < 1e-12);
    }

    #[test]
    fn trimming_leaves_out_one_firefly_in_a_thousand() {
        let mut picture = vec![[1.1f32; 3]; 1000];
        picture[17] = [1e6; 3];
        let d = compare(&picture, &target(vec![[1.0; 3]; 1000], 0.0)).unwrap();
        assert!((d.error(Measure::RelMseTrimmed) - 0.01 / 1.01).abs() < 1e-6);
        assert!(d.error(Measure::RelMse) > 1e8);
    }

    #[test]
    fn nothing_to_compare_has_no_measures() {
        assert_eq!(compare(&[[1.0; 3]], &target(vec![[f64::INFINITY; 3]], 0.0)), None);
    }
}
