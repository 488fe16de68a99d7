//! What was found, and the verdict.

use super::compare::{Comparison, FAMILY};
use serde::Serialize;

/// What is to be said of a picture.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Verdict {
    /// It is what it should be.
    Agrees,
    /// It is something else.
    Differs,
    /// The interval of its mean is too wide to tell.
    TooWide,
}

/// A picture, and what it was compared with.
#[derive(Debug, Serialize)]
pub struct Row {
    /// The scene.
    pub scene: String,
    /// The integrator.
    pub integrator: &'static str,
    /// `path`, or the radiance that is known; `None` for `path` itself.
    pub against: Option<String>,
    /// Samples (light paths, mutations) per pixel.
    pub spp: u32,
    /// Seconds.
    pub seconds: f64,
    /// Half the width of the 99 % interval of the image mean, relative: the largest of the channels.
    pub half_width: f64,
    /// What it must not exceed.
    pub required: f64,
    /// Contributions that were not numbers, or negative.
    pub dropped: u64,
    /// The tests.
    pub comparison: Option<Comparison>,
    /// The verdict.
    pub verdict: Verdict,
}

/// All rows.
#[derive(Debug, Serialize)]
pub struct Report {
    /// Pictures and comparisons.
    pub rows: Vec<Row>,
    /// Tests of image means and blocks, all scenes and integrators together.
    pub tests: usize,
    /// The level of each of them: 99 % for the whole family (Sidak).
    pub least_p: f64,
    /// Whether all agree.
    pub passed: bool,
}

impl Report {
    /// Judges the rows.
    pub fn new(mut rows: Vec<Row>) -> Self {
        let tests = rows.iter().filter_map(|r| r.comparison.as_ref()).map(|c| c.tests).sum::<usize>();
        let least_p = statcheck::sidak(FAMILY, tests.max(1));
        for row in &mut rows {
            row.verdict = match &row.comparison {
                Some(c) if !c.agrees(least_p) => Verdict::Differs,
                _ if !(row.half_width <= row.required) => Verdict::TooWide,
                _ => Verdict::Agrees,
            };
        }
        let passed = rows.iter().all(|r| r.verdict == Verdict::Agrees);
        Self { rows, tests, least_p, passed }
    }
}

/// The head of [`figures`].
const HEAD: &str = "scene               integrator  against               spp        s  half %   diff %    p mean   p block  rms z  \
                    pixels %";

/// A row without its verdict, which depends on all rows.
pub fn figures(r: &Row) -> String {
    let against = r.against.as_deref().unwrap_or("-");
    let half = 100.0 * r.half_width;
    let own = format!("{:18}  {:10}  {against:17}  {:7}  {:7.1}  {half:6.3}", r.scene, r.integrator, r.spp, r.seconds);
    let Some(c) = &r.comparison else {
        return own + &format!("  {:>7}  {:>8}  {:>8}  {:>5}  {:>8}", "-", "-", "-", "-", "-");
    };
    let (difference, pixels) = (100.0 * c.difference, 100.0 * c.pixels);
    own + &format!("  {difference:+7.3}  {:8.2e}  {:8.2e}  {:5.2}  {pixels:8.2}", c.mean_p, c.block_p, c.block_rms_z)
}

/// What else is to be said of a row.
fn remarks(r: &Row) -> String {
    let mut text = String::new();
    if r.dropped > 0 {
        text += &format!(" ({} contributions dropped)", r.dropped);
    }
    let Some(c) = &r.comparison else { return text };
    if c.noisy > 0 {
        text +=
            &format!(" ({} of {} blocks and channels too noisy to test)", c.noisy, c.noisy + c.tests.saturating_sub(3));
    }
    if let (Verdict::Differs, Some(w)) = (r.verdict, &c.worst) {
        let place = w.block.map_or("image".into(), |[x, y]| format!("block at {x}, {y}"));
        text += &format!(
            "\n    {place}, {}: {:.6} against {:.6}, t = {:+.2} with {:.0} degrees of freedom, p = {:.2e}",
            w.channel, w.mean, w.other, w.t, w.dof, w.p
        );
    }
    text
}

/// The rows as a table.
pub fn table(report: &Report) -> String {
    let mut text = format!("{HEAD}  verdict");
    for r in &report.rows {
        let verdict = match r.verdict {
            Verdict::Agrees => "agrees".into(),
            Verdict::Differs => "DIFFERS".into(),
            Verdict::TooWide => format!("TOO WIDE, {} % is required", 100.0 * r.required),
        };
        text += &format!("\n{}  {verdict}{}", figures(r), remarks(r));
    }
    text += &format!(
        "\n{} tests, each at p >= {:.2e}: {}",
        report.tests,
        report.least_p,
        if report.passed { "all agree" } else { "NOT all agree" }
    );
    text
}
