//! The picture so far, on disk while it renders.

use crate::save;
use renderer::film::{ErrorSummary, png};
use renderer::job::Merger;
use std::path::PathBuf;
use std::time::{Duration, Instant};

/// Time between previews.
const INTERVAL: Duration = Duration::from_secs(3);
/// A preview is made so seldom that it takes less than a hundredth of the time.
const REST: u32 = 100;

/// Writes a PNG of what is merged: as soon as every pixel has samples, then every few seconds.
pub struct Preview {
    path: PathBuf,
    exposure: f64,
    /// Units seen so far in the first pass.
    seen: u32,
    covered: bool,
    next: Instant,
    error: Option<ErrorSummary>,
}

impl Preview {
    /// To `path`, exposed by `exposure` stops.
    pub fn new(path: PathBuf, exposure: f64) -> Self {
        Self { path, exposure, seen: 0, covered: false, next: Instant::now(), error: None }
    }

    /// The error as of the last preview.
    pub fn error(&self) -> Option<ErrorSummary> {
        self.error
    }

    /// Writes a preview when it is time to. `Err` says why it can't be written.
    pub fn update(&mut self, merger: &Merger) -> Result<bool, String> {
        if !self.covers(merger) || Instant::now() < self.next {
            return Ok(false);
        }
        let started = Instant::now();
        let image = merger.image();
        self.error = image.error;
        let written = png::encode(&image, self.exposure)
            .and_then(|bytes| save::write(&self.path, &bytes).map_err(|e| e.to_string()));
        self.next = Instant::now() + INTERVAL.max(started.elapsed() * REST);
        written.map(|()| true)
    }

    /// Whether every pixel has samples: the first group of the first pass is complete. Splats cover the film from the start.
    fn covers(&mut self, merger: &Merger) -> bool {
        if !self.covered {
            let done = merger.next_unit();
            let plan = merger.plan();
            self.covered = plan.pass > 0
                || (plan.splats && done > 0)
                || (self.seen..done).any(|unit| plan.ends_group(unit).is_some());
            self.seen = done;
        }
        self.covered
    }
}
