//! From renders to figures.

use super::measure::{Deviation, MEASURES, Measure, compare};
use super::reference::Reference;
use super::runs::Run;
use super::stats::{self, Interval, mean_without};
use serde::Serialize;
use serde::ser::{SerializeMap, Serializer};

/// Above this share of the reference's variance in a squared error, a comparison is flagged.
pub const FLAG: f64 = 0.1;

/// All figures of one run of the tool.
#[derive(Debug, Serialize)]
pub struct Report {
    /// The scene file.
    pub scene: String,
    /// Width and height in pixels.
    pub size: (u32, u32),
    /// Edges of the longest path; `None` = unbounded.
    pub max_depth: Option<u32>,
    /// Render threads.
    pub threads: usize,
    /// Renders of each variant.
    pub rounds: usize,
    /// What the pictures were compared with.
    pub reference: String,
    /// What a reader must know.
    pub notes: Vec<String>,
    /// One per variant.
    pub rows: Vec<Row>,
    /// One per pair of variants.
    pub ratios: Vec<Ratio>,
}

/// A figure for each measure.
#[derive(Clone, Copy, Debug)]
pub struct ByMeasure<T>(pub [T; MEASURES]);

impl<T> ByMeasure<T> {
    fn new(f: impl Fn(Measure) -> T) -> Self {
        Self(Measure::ALL.map(f))
    }

    /// The figure for a measure.
    pub fn of(&self, m: Measure) -> &T {
        &self.0[m as usize]
    }
}

impl<T: Serialize> Serialize for ByMeasure<T> {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let mut map = serializer.serialize_map(Some(MEASURES))?;
        for m in Measure::ALL {
            map.serialize_entry(m.name(), self.of(m))?;
        }
        map.end()
    }
}

/// One variant. Figures are means over its renders.
#[derive(Debug, Serialize)]
pub struct Row {
    /// Its name.
    pub variant: String,
    /// Wall seconds.
    pub seconds: Interval,
    /// Processor seconds of all threads.
    pub cpu_seconds: Option<Interval>,
    /// Expected error of one render, less the variance of the reference.
    pub error: ByMeasure<Interval>,
    /// Variance of the reference over the error.
    pub reference_share: ByMeasure<f64>,
    /// Error times wall seconds.
    pub error_seconds: ByMeasure<Interval>,
    /// relMSE times processor seconds per thread: `relMSE x s` of an idle machine.
    pub relmse_cpu_seconds: Option<Interval>,
    /// `1 / (relMSE x s)`.
    pub efficiency: f64,
    /// Mean of the picture over that of the reference.
    pub mean_ratio: Interval,
    /// Samples (light paths, mutations) per second of one core.
    pub samples_per_core_s: f64,
    /// Rays per second.
    pub rays_per_s: f64,
    /// Largest peak of resident memory, the scene included.
    pub peak_mib: Option<f64>,
}

/// How much longer `a` takes than `b` to the same error: above 1, `b` is the better.
#[derive(Debug, Serialize)]
pub struct Ratio {
    /// Name of the variant that is divided.
    pub a: String,
    /// Name of the variant that divides.
    pub b: String,
    /// Error times wall seconds of `a` over that of `b`.
    pub seconds: ByMeasure<Interval>,
    /// relMSE times processor seconds of `a` over that of `b`.
    pub relmse_cpu_seconds: Option<Interval>,
    /// Whether the reference's variance is more than a tenth of the error of either, by any measure.
    pub flagged: bool,
}

/// All renders of one variant, in the order of the rounds.
struct Series<'a> {
    runs: Vec<&'a Run>,
    deviations: Vec<Deviation>,
    threads: f64,
}

impl Series<'_> {
    fn mean(&self, left_out: Option<usize>, f: impl Fn(&Run, &Deviation) -> f64) -> f64 {
        mean_without(&self.values(f), left_out)
    }

    fn values(&self, f: impl Fn(&Run, &Deviation) -> f64) -> Vec<f64> {
        self.runs.iter().zip(&self.deviations).map(|(r, d)| f(r, d)).collect()
    }

    fn error_seconds(&self, m: Measure, left_out: Option<usize>) -> f64 {
        self.mean(left_out, |_, d| d.error(m)) * self.mean(left_out, |r, _| r.seconds)
    }

    fn has_cpu(&self) -> bool {
        self.runs.iter().all(|r| r.cpu_seconds.is_some())
    }

    fn relmse_cpu_seconds(&self, left_out: Option<usize>) -> f64 {
        let seconds = self.mean(left_out, |r, _| r.cpu_seconds.unwrap_or(f64::NAN));
        self.mean(left_out, |_, d| d.error(Measure::RelMse)) * seconds / self.threads
    }

    fn row(&self, variant: &str) -> Row {
        let n = self.runs.len();
        let total = |f: &dyn Fn(&Run) -> f64| self.runs.iter().map(|r| f(r)).sum::<f64>();
        let wall = total(&|r| r.seconds);
        let cpu = self.has_cpu().then(|| total(&|r| r.cpu_seconds.unwrap_or(f64::NAN)));
        let share =
            |m: Measure| self.mean(None, |_, d| d.reference[m as usize]) / self.mean(None, |_, d| d.error(m)).max(0.0);
        Row {
            variant: variant.into(),
            seconds: stats::mean(&self.values(|r, _| r.seconds)),
            cpu_seconds: cpu.map(|_| stats::mean(&self.values(|r, _| r.cpu_seconds.unwrap_or(f64::NAN)))),
            error: ByMeasure::new(|m| stats::mean(&self.values(|_, d| d.error(m)))),
            reference_share: ByMeasure::new(share),
            error_seconds: ByMeasure::new(|m| stats::positive(n, |j| self.error_seconds(m, j))),
            relmse_cpu_seconds: cpu.map(|_| stats::positive(n, |j| self.relmse_cpu_seconds(j))),
            efficiency: 1.0 / self.error_seconds(Measure::RelMse, None),
            mean_ratio: stats::mean(&self.values(|_, d| d.mean_ratio)),
            samples_per_core_s: total(&|r| r.counters.samples as f64) / cpu.unwrap_or(wall * self.threads),
            rays_per_s: total(&|r| r.counters.rays as f64) / wall,
            peak_mib: self.runs.iter().filter_map(|r| r.peak_mib).reduce(f64::max),
        }
    }
}

/// The figures of all variants and of all pairs of them.
pub fn evaluate(
    names: &[&str],
    runs: &[Run],
    threads: usize,
    reference: &Reference<'_>,
) -> Result<(Vec<Row>, Vec<Ratio>), String> {
    let mut series: Vec<Series<'_>> =
        names.iter().map(|_| Series { runs: Vec::new(), deviations: Vec::new(), threads: threads as f64 }).collect();
    for (i, run) in runs.iter().enumerate() {
        let deviation = compare(&run.pixels, &reference.target(i)).ok_or("no pixel of the reference is finite")?;
        series[run.variant].runs.push(run);
        series[run.variant].deviations.push(deviation);
    }
    let rows: Vec<Row> = names.iter().zip(&series).map(|(name, s)| s.row(name)).collect();
    let mut ratios = Vec::new();
    for (i, a) in series.iter().enumerate() {
        for (j, b) in series.iter().enumerate().skip(i + 1) {
            let n = a.runs.len();
            let quotient = |m| stats::positive(n, |j| a.error_seconds(m, j) / b.error_seconds(m, j));
            let cpu = || stats::positive(n, |j| a.relmse_cpu_seconds(j) / b.relmse_cpu_seconds(j));
            ratios.push(Ratio {
                a: names[i].into(),
                b: names[j].into(),
                seconds: ByMeasure::new(quotient),
                relmse_cpu_seconds: (a.has_cpu() && b.has_cpu()).then(cpu),
                flagged: rows[i].flagged() || rows[j].flagged(),
            });
        }
    }
    Ok((rows, ratios))
}

impl Row {
    /// Whether the reference's variance is more than a tenth of the error by any measure.
    pub fn flagged(&self) -> bool {
        // Also where the share is not a number.
        Measure::ALL.into_iter().any(|m| !(*self.reference_share.of(m) <= FLAG))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::error::reference::Pool;
    use crate::meshes::Random;
    use renderer::film::Counters;

    /// Eight renders of each of two variants, with errors of 0.04 in 1 s and 0.01 in 2 s, on a machine whose speed drifts.
    fn runs() -> Vec<Run> {
        let mut random = Random(2);
        let one = |i: usize| {
            let variant = i % 2;
            let width = (12.0 * [0.04f64, 0.01][variant]).sqrt() as f32;
            Run {
                variant,
                seconds: [1.0, 2.0][variant] * (1.0 + 0.1 * (i / 2) as f64),
                cpu_seconds: Some([2.0, 4.0][variant]),
                peak_mib: None,
                counters: Counters { samples: 1000, rays: 5000, ..Default::default() },
                pixels: (0..3000).map(|_| [0; 3].map(|_| 1.0 + width * (random.next() - 0.5))).collect(),
            }
        };
        (0..16).map(one).collect()
    }

    #[test]
    fn the_figures_are_those_put_in() {
        let runs = runs();
        let pictures: Vec<&[[f32; 3]]> = runs.iter().map(|r| r.pixels.as_slice()).collect();
        let pool = Pool::new(&pictures, runs.iter().map(|r| Some(r.variant)).collect());
        let (rows, ratios) = evaluate(&["a", "b"], &runs, 2, &Reference::Pool(pool)).unwrap();
        let near = |i: &Interval, v: f64| assert!((i.value / v - 1.0).abs() < 0.03 && i.low < i.high, "{i:?} for {v}");
        near(rows[0].error.of(Measure::Mse), 0.04);
        near(rows[1].error.of(Measure::RelMse), 0.01 / 1.01);
        near(&rows[1].relmse_cpu_seconds.unwrap(), 0.01 / 1.01 * 2.0);
        near(&rows[0].mean_ratio, 1.0);
        near(ratios[0].seconds.of(Measure::Mse), 2.0);
        near(&ratios[0].relmse_cpu_seconds.unwrap(), 2.0);
        assert_eq!(rows[0].samples_per_core_s, 500.0);
        // The mean of the others has about (8 x 0.04 + 7 x 0.01) / 15^2 = 0.0017: a sixth of the quieter one's error.
        assert!(!rows[0].flagged() && rows[1].flagged() && ratios[0].flagged);
    }
}
