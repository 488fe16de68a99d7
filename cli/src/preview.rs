//! The picture so far, on disk while it renders.

use crate::save;
use renderer::film::{ErrorSummary, png};
use renderer::job::{Merger, Sampling};
use std::path::PathBuf;
use std::time::{Duration, Instant};

/// When a picture that is not complete yet is better than none.
const PATIENCE: Duration = Duration::from_secs(1);
/// Time between previews.
const INTERVAL: Duration = Duration::from_secs(3);
/// A preview is made so seldom that it takes less than a hundredth of the time.
const REST: u32 = 100;

/// Writes a PNG of what is merged: as soon as every pixel has samples (or a second after the start, what is there), then every few
/// seconds.
pub struct Preview {
    path: PathBuf,
    exposure: f64,
    started: Instant,
    /// When the first was on disk, after the start.
    first: Option<Duration>,
    /// Units seen so far in the first pass.
    seen: u32,
    covered: bool,
    next: Instant,
    /// No more can be written.
    broken: bool,
    error: Option<ErrorSummary>,
}

impl Preview {
    /// To `path`, exposed by `exposure` stops; the user waits since `started`.
    pub fn new(path: PathBuf, exposure: f64, started: Instant) -> Self {
        let next = started + PATIENCE;
        Self { path, exposure, started, first: None, seen: 0, covered: false, next, broken: false, error: None }
    }

    /// The error as of the last preview.
    pub fn error(&self) -> Option<ErrorSummary> {
        self.error
    }

    /// When the first preview was on disk, in seconds after the start.
    pub fn first(&self) -> Option<f64> {
        self.first.map(|d| d.as_secs_f64())
    }

    /// Writes a preview when it is time to. `Err` says, once, why none can be written.
    pub fn update(&mut self, merger: &Merger) -> Result<(), String> {
        // Nothing of the image is there while integrators are tried.
        if merger.counters().samples == 0 {
            return Ok(());
        }
        let completed = !self.covered && self.covers(merger);
        let due = completed || Instant::now() >= self.next;
        if self.broken || !due {
            return Ok(());
        }
        let begun = Instant::now();
        let image = merger.image();
        self.error = image.error;
        let written = png::encode(&image, self.exposure)
            .and_then(|bytes| save::write(&self.path, &bytes).map_err(|e| e.to_string()));
        self.next = Instant::now() + INTERVAL.max(begun.elapsed() * REST);
        self.broken = written.is_err();
        if written.is_ok() {
            self.first.get_or_insert_with(|| self.started.elapsed());
        }
        written.map_err(|e| format!("{}: {e}", self.path.display()))
    }

    /// Whether every pixel has samples: the first group of the first pass is complete. Splats cover the film from the start.
    fn covers(&mut self, merger: &Merger) -> bool {
        if !self.covered {
            let done = merger.next_unit();
            let plan = merger.plan();
            self.covered = plan.own_pass() > 0
                || (plan.sampling == Sampling::Paths && done > 0)
                || (self.seen..done).any(|unit| plan.covers_film(unit));
            self.seen = done;
        }
        self.covered
    }
}
