//! The two pictures of a job, EXR and PNG, and the line that sums it up.

use crate::exit::Failure;
use crate::options::OutputArgs;
use crate::progress::{duration, quantity};
use crate::save;
use renderer::film::exr::{self, Provenance};
use renderer::film::{Counters, ErrorSummary, MergedImage, png};
use renderer::integrator::IntegratorKind;
use renderer::integrator::mmlt::ChainStats;
use renderer::job::{Choice, LocalOutcome, RenderSettings, skipped};
use renderer::scene::SceneFeatures;
use renderer::scene::bundle::Digest;
use serde::Serialize;
use std::fmt;
use std::path::{Path, PathBuf};

/// Where the pictures go.
#[derive(Clone, Debug)]
pub struct Pictures {
    /// The EXR.
    pub exr: PathBuf,
    /// The PNG.
    pub png: PathBuf,
    /// Exposure of the PNG in stops.
    pub exposure: f64,
}

/// Where they went.
#[derive(Clone, Debug)]
pub struct Saved {
    /// The EXR.
    pub exr: PathBuf,
    /// The PNG.
    pub png: PathBuf,
    /// Why one of them is not where it was asked for.
    pub failure: Option<Failure>,
}

impl Pictures {
    /// As asked for, for the scene at `scene`.
    pub fn new(output: &OutputArgs, scene: &Path) -> Result<Self, Failure> {
        let (exr, png) = output.paths(scene)?;
        Ok(Self { exr, png, exposure: output.exposure })
    }

    /// Checks that both can be written, before anything is rendered for nothing.
    pub fn check(&self) -> Result<(), Failure> {
        save::check(&self.exr)?;
        save::check(&self.png)
    }

    /// Writes both; what can't be written at its place is saved at another.
    pub fn save(&self, image: &MergedImage, about: &Provenance) -> Result<Saved, Failure> {
        let fault = |e: String| Failure::Machine(format!("error: {}: {e}", self.exr.display()));
        let (exr, exr_failure) = save::keep(&self.exr, &exr::encode(image, about).map_err(fault)?)?;
        let (png, png_failure) = save::keep(&self.png, &png::encode(image, self.exposure).map_err(fault)?)?;
        Ok(Saved { exr, png, failure: exr_failure.or(png_failure) })
    }
}

/// What a finished (or interrupted) job is told by.
#[derive(Clone, Debug, Serialize)]
pub struct Summary {
    event: &'static str,
    interrupted: bool,
    scene: Digest,
    integrator: IntegratorKind,
    /// What `auto` chose, and why.
    choice: Option<Choice>,
    width: u32,
    height: u32,
    spp: f64,
    seconds: f64,
    first_preview_s: Option<f64>,
    rays_per_s: f64,
    error: Option<ErrorSummary>,
    #[serde(flatten)]
    counters: Counters,
    chains: ChainStats,
    /// What was not computed.
    skipped: Vec<String>,
    exr: String,
    png: String,
}

impl Summary {
    /// Of a job of this process.
    pub fn new(
        outcome: &LocalOutcome,
        settings: &RenderSettings,
        (scene, features): (Digest, &SceneFeatures),
        seconds: f64,
        saved: &Saved,
    ) -> Self {
        let image = &outcome.image;
        let rendered = outcome.choice.as_ref().map(|c| settings.rendered_by(c.integrator, None));
        Self {
            event: "done",
            interrupted: outcome.interrupted,
            scene,
            integrator: settings.integrator,
            choice: outcome.choice.clone(),
            width: image.width,
            height: image.height,
            spp: image.counters.samples as f64 / (f64::from(image.width) * f64::from(image.height)),
            seconds,
            first_preview_s: None,
            rays_per_s: image.counters.rays as f64 / seconds,
            error: image.error,
            counters: image.counters,
            chains: outcome.chains,
            skipped: skipped(features, rendered.as_ref().unwrap_or(settings)),
            exr: saved.exr.display().to_string(),
            png: saved.png.display().to_string(),
        }
    }

    /// Notes when the first preview was on disk.
    pub fn with_first_preview(self, seconds: Option<f64>) -> Self {
        Self { first_preview_s: seconds, ..self }
    }
}

impl fmt::Display for Summary {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let c = &self.counters;
        let samples = self.choice.as_ref().map_or(self.integrator, |c| c.integrator).sample_name();
        if let Some(c) = &self.choice {
            let share =
                c.share.map_or_else(String::new, |s| format!("; trials took {:.1} % of the samples", 100.0 * s));
            writeln!(f, "auto chose {}: {}{share}", c.integrator.name(), c.why)?;
        }
        write!(f, "{} x {} pixels, {:.1} {samples} per pixel", self.width, self.height, self.spp)?;
        write!(f, " in {}", duration(self.seconds))?;
        write!(f, ", {}rays/s", quantity(self.rays_per_s))?;
        match self.error {
            Some(e) => write!(f, ", relative error {:.4} (below {:.4} at 95 %)", e.relative, e.upper95)?,
            None => write!(f, ", relative error unknown (one replicate)")?,
        }
        if self.interrupted {
            write!(f, ", interrupted")?;
        }
        let m = &self.chains;
        if m.small + m.large > 0 {
            let percent = |part: u64, all: u64| 100.0 * part as f64 / all.max(1) as f64;
            let mutations = quantity((m.small + m.large) as f64);
            let (small, large) = (percent(m.small_accepted, m.small), percent(m.large_accepted, m.large));
            write!(
                f,
                ", {mutations} mutations ({small:.0} % of the small steps and {large:.0} % of the large ones accepted)"
            )?;
        }
        let dropped = c.non_finite + c.negative;
        write!(f, ", {dropped} contributions dropped")?;
        if dropped > 0 {
            write!(f, " ({} not finite, {} negative)", c.non_finite, c.negative)?;
        }
        if !self.skipped.is_empty() {
            write!(f, "\nskipped: {}", self.skipped.join("; "))?;
        }
        write!(f, "\n{}\n{}", self.exr, self.png)
    }
}
