//! How often intervals contain the truth, and whether that is as often as they should.

use super::render::Telling;
use serde::Serialize;
use statcheck::{Estimate, Mean};

/// What an interval promises.
pub const CONFIDENCE: f64 = 0.95;
/// Confidence at which a promise is found to be broken.
pub const CERTAINTY: f64 = 0.999;
/// Radiance is summed in single precision: a relative difference that is never held against an interval.
const ROUNDING: f64 = 1e-6;

/// Areas of a picture.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Areas {
    /// All of it as one, with the error that the product tells.
    Image,
    /// Its blocks.
    Blocks,
    /// Its pixels, channel by channel, with the errors that the product tells.
    Pixels,
}

impl Areas {
    /// What a render tells of these areas.
    pub fn of(self, t: &Telling) -> Vec<Estimate> {
        let square = |e: f64| e * e;
        let dof = t.image.error.map_or(f64::NAN, |e| f64::from(e.groups) - 1.0);
        match self {
            Self::Image => {
                let of = |e: &renderer::film::ErrorSummary| Estimate { mean: e.mean, variance: square(e.mean_se), dof };
                t.image.error.iter().map(of).collect()
            }
            Self::Blocks => t.blocks.clone(),
            Self::Pixels => {
                let (means, errors) = (t.image.mean.iter().flatten(), t.image.std_error.iter().flatten());
                let of = |(m, e): (&f32, &f32)| Estimate { mean: f64::from(*m), variance: square(f64::from(*e)), dof };
                means.zip(errors).map(of).collect()
            }
        }
    }
}

/// Several renders' means of the same areas, area by area.
fn scatter(renders: &[Vec<Estimate>]) -> Vec<Mean> {
    let areas = renders.first().map_or(0, Vec::len);
    (0..areas).map(|a| renders.iter().map(|r| r[a].mean).collect()).collect()
}

/// The truth as independent renders know it, from their scatter alone.
pub fn truth(renders: &[Vec<Estimate>]) -> Vec<Estimate> {
    let estimate = |m: &Mean| Estimate { mean: m.mean(), variance: m.error() * m.error(), dof: m.count() as f64 - 1.0 };
    scatter(renders).iter().map(estimate).collect()
}

/// How often intervals of some areas contained the truth.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Count {
    /// Independent renders.
    pub renders: usize,
    /// Areas of each that have an error at all.
    pub areas: usize,
    /// Intervals that contained the truth.
    pub covered: u64,
    /// Their share.
    pub share: f64,
    /// Lower end of the 99.9 % interval of the probability that an interval contains the truth.
    pub low: f64,
    /// Its upper end.
    pub high: f64,
    /// Root mean square of the errors that were told over the scatter of the renders; the median of the areas.
    pub told: f64,
    /// Skewness of the distribution of an area's mean over the renders; the largest of the areas.
    pub skewness: f64,
    /// Standard error of the truth over that of one render; the median of the areas.
    pub truth_error: f64,
}

impl Count {
    /// Counts over `areas` (all where `None`), given what each render told and the truth.
    ///
    /// Intervals of one area are a binomial count. Those of several areas of a render are not: neighbours share light paths, and all
    /// areas of chains share the mean of a pool. But the renders are independent, so the share of areas covered in each is an
    /// observation, and the mean of these has Student's interval whatever ties the areas together.
    pub fn new(renders: &[Vec<Estimate>], truth: &[Estimate], keep: impl Fn(&Area) -> bool) -> Option<Self> {
        let areas: Vec<Area> = areas(renders).into_iter().filter(|a| a.moves && keep(a)).collect();
        // All groups have samples everywhere: one quantile does for all.
        let dof = renders.first()?.first()?.dof;
        let quantile = statcheck::student_quantile(0.5 + 0.5 * CONFIDENCE, dof);
        let mut of_renders = Mean::default();
        let mut covered = 0;
        for render in renders {
            let hits = areas.iter().filter(|a| covers(&render[a.number], &truth[a.number], quantile)).count();
            covered += hits as u64;
            of_renders.push(hits as f64 / areas.len() as f64);
        }
        let (low, high) = if areas.len() == 1 {
            statcheck::clopper_pearson(covered, renders.len() as u64, CERTAINTY)
        } else {
            let half =
                statcheck::student_quantile(0.5 + 0.5 * CERTAINTY, renders.len() as f64 - 1.0) * of_renders.error();
            (of_renders.mean() - half, of_renders.mean() + half)
        };
        let median = |f: &dyn Fn(&Area) -> f64| median(areas.iter().map(f).collect());
        (!areas.is_empty()).then(|| Self {
            renders: renders.len(),
            areas: areas.len(),
            covered,
            share: of_renders.mean(),
            low,
            high,
            told: median(&|a| a.told / a.deviation),
            skewness: areas.iter().map(|a| a.skewness).fold(0.0, |a: f64, b| if b.abs() > a.abs() { b } else { a }),
            truth_error: median(&|a| truth[a.number].variance.sqrt() / a.deviation),
        })
    }

    /// Whether the intervals may keep what they promise.
    pub fn holds(&self) -> bool {
        self.low <= CONFIDENCE && CONFIDENCE <= self.high
    }
}

/// Whether the interval of a mean contains the truth. The truth's own variance widens it: their difference has both.
fn covers(own: &Estimate, truth: &Estimate, quantile: f64) -> bool {
    let half = quantile * (own.variance + truth.variance).sqrt();
    (own.mean - truth.mean).abs() <= half + ROUNDING * truth.mean.abs()
}

/// How an area's mean is distributed over the renders.
#[derive(Clone, Copy, Debug)]
pub struct Area {
    /// Its number.
    pub number: usize,
    /// Whether it varies: black and evenly lit areas tell nothing.
    moves: bool,
    /// Standard deviation.
    deviation: f64,
    /// Root mean square of the standard errors that were told.
    told: f64,
    /// Skewness.
    pub skewness: f64,
}

fn areas(renders: &[Vec<Estimate>]) -> Vec<Area> {
    let n = renders.len() as f64;
    let area = |(number, mean): (usize, Mean)| {
        let deviation = mean.variance().sqrt();
        let cube = |x: f64| x * x * x;
        let third = renders.iter().map(|r| cube(r[number].mean - mean.mean())).sum::<f64>() / n;
        let told = (renders.iter().map(|r| r[number].variance).sum::<f64>() / n).sqrt();
        let moves = deviation > ROUNDING * mean.mean().abs() || told > ROUNDING * mean.mean().abs();
        Area { number, moves, deviation, told, skewness: third / cube(deviation) }
    };
    scatter(renders).into_iter().enumerate().map(area).collect()
}

fn median(mut values: Vec<f64>) -> f64 {
    values.sort_by(f64::total_cmp);
    values.get(values.len() / 2).copied().unwrap_or(f64::NAN)
}
