//! What was counted, and the verdict.

use super::count::Count;
use super::target::Met;
use serde::Serialize;
use std::fmt::{Display, Formatter, Result};

/// Intervals of one integrator in one scene.
#[derive(Clone, Debug, Serialize)]
pub struct Row {
    /// The scene.
    pub scene: String,
    /// The integrator.
    pub integrator: &'static str,
    /// Samples (light paths, mutations) per pixel.
    pub samples: u32,
    /// Seconds.
    pub seconds: f64,
    /// Student's t of the difference between the mean of all renders and the truth.
    pub bias: f64,
    /// Intervals of the image mean.
    pub image: Count,
    /// Intervals of the means of blocks.
    pub blocks: Count,
    /// Intervals of pixels and channels, by skewness; no claim.
    pub pixels: Vec<SkewBin>,
}

/// Pixels whose absolute skewness lies in a range.
#[derive(Clone, Debug, Serialize)]
pub struct SkewBin {
    /// From this on.
    pub from: f64,
    /// Up to this; `None` = any.
    pub to: Option<f64>,
    /// Their intervals, if there are any such pixels.
    pub count: Option<Count>,
}

/// Renders that a target error ended.
#[derive(Clone, Debug, Serialize)]
pub struct TargetRow {
    /// The scene.
    pub scene: String,
    /// The integrator.
    pub integrator: &'static str,
    /// The target.
    pub target: f64,
    /// Seconds.
    pub seconds: f64,
    /// How often it was met.
    pub met: Met,
}

/// All rows.
#[derive(Debug, Default, Serialize)]
pub struct Report {
    /// Intervals.
    pub coverage: Vec<Row>,
    /// Target errors.
    pub targets: Vec<TargetRow>,
}

impl Report {
    /// Whether no promise is found broken.
    pub fn passed(&self) -> bool {
        self.coverage.iter().all(|r| r.image.holds() && r.blocks.holds()) && self.targets.iter().all(|r| r.met.holds())
    }
}

fn verdict(holds: bool) -> &'static str {
    if holds { "true" } else { "FALSE" }
}

impl Display for Row {
    fn fmt(&self, f: &mut Formatter<'_>) -> Result {
        let name = self.scene.rsplit('/').next().unwrap_or_default().trim_end_matches(".toml");
        let count = |c: &Count| {
            let range = format!("[{:.1}, {:.1}]", 100.0 * c.low, 100.0 * c.high);
            let verdict = verdict(c.holds());
            format!(
                "{:5.1} {range:14} {verdict:5} {:5.2} {:+5.2} {:4.2}",
                100.0 * c.share,
                c.told,
                c.skewness,
                c.truth_error
            )
        };
        write!(f, "{name:15}  {:10}  {:6}  {:6.1}  {:+5.1}", self.integrator, self.samples, self.seconds, self.bias)?;
        write!(
            f,
            "  {:4}/{:<4} {}  {}",
            self.image.covered,
            self.image.renders,
            count(&self.image),
            count(&self.blocks)
        )?;
        for bin in &self.pixels {
            let text = bin.count.as_ref().map_or("-".into(), |c| format!("{:.1} of {}", 100.0 * c.share, c.areas));
            write!(f, "  {text:12}")?;
        }
        Ok(())
    }
}

impl Display for TargetRow {
    fn fmt(&self, f: &mut Formatter<'_>) -> Result {
        let name = self.scene.rsplit('/').next().unwrap_or_default().trim_end_matches(".toml");
        let (m, rate) = (&self.met, format!("{}/{}", self.met.met, self.met.renders));
        write!(f, "{name:15}  {:10}  {:6}  {:8.0}  {:6.1}", self.integrator, self.target, m.samples, self.seconds)?;
        write!(f, "  {rate:8} {:6.1}  {:5}", 100.0 * m.high, verdict(m.holds()))?;
        write!(f, "  {:5.2} {:5.2} {:5.2}", m.told, m.error, m.worst)
    }
}

impl Display for Report {
    fn fmt(&self, f: &mut Formatter<'_>) -> Result {
        if !self.coverage.is_empty() {
            let count = "    % of it [99.9 %]        told  skew  ref";
            writeln!(f, "{:55}  {:51}  {:40}  pixels: % covered, by skewness", "", "image mean", "blocks")?;
            writeln!(
                f,
                "scene            integrator  samples     s   bias  covered {count}  {count}  below 0.5     to 1          above"
            )?;
        }
        self.coverage.iter().try_for_each(|r| writeln!(f, "{r}"))?;
        if !self.targets.is_empty() {
            writeln!(
                f,
                "scene            integrator  target   samples       s  met      at most          told  true  worst, over the target"
            )?;
        }
        self.targets.iter().try_for_each(|r| writeln!(f, "{r}"))?;
        write!(f, "{}", if self.passed() { "no error bar is found false" } else { "some error bars are FALSE" })
    }
}
