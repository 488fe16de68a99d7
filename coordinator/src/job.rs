//! A job as the scheduler sees it.

use crate::ids::{JobId, WorkerId};
use crate::lease::PassBoard;
use crate::mismatch::Disagreement;
use renderer::film::Counters;
use renderer::integrator::IntegratorKind;
use renderer::job::{PassPlan, RenderSettings};
use renderer::scene::bundle::Digest;
use std::collections::{BTreeMap, VecDeque};
use std::sync::Arc;
use std::time::Duration;

/// A unit that fails so often, on whatever workers, fails its job; a worker that fails so often gets no more of the job.
pub const MAX_FAILURES: u32 = 3;

/// Where a job is in its life.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum JobState {
    /// Its stored results are being folded again after a restart; goes on as the state inside.
    Restoring {
        /// Whether it was paused before.
        paused: bool,
    },
    /// Its units are given out.
    Active,
    /// Its units are not given out; late results count.
    Paused,
    /// The image is complete.
    Done,
    /// Can't be completed.
    Failed,
    /// Not wanted any more.
    Cancelled,
}

impl JobState {
    /// Whether it is over.
    pub fn ended(self) -> bool {
        matches!(self, Self::Done | Self::Failed | Self::Cancelled)
    }

    /// As it is stored.
    pub fn name(self) -> &'static str {
        match self {
            Self::Restoring { paused: false } | Self::Active => "active",
            Self::Restoring { paused: true } | Self::Paused => "paused",
            Self::Done => "done",
            Self::Failed => "failed",
            Self::Cancelled => "cancelled",
        }
    }

    /// From its name, as after a restart.
    pub fn restored(name: &str) -> Option<Self> {
        match name {
            "active" => Some(Self::Restoring { paused: false }),
            "paused" => Some(Self::Restoring { paused: true }),
            "done" => Some(Self::Done),
            "failed" => Some(Self::Failed),
            "cancelled" => Some(Self::Cancelled),
            _ => None,
        }
    }
}

/// What never changes about a job.
#[derive(Clone, Debug, PartialEq)]
pub struct JobSpec {
    /// Its name: the scene file's, for people.
    pub name: String,
    /// Higher goes first.
    pub priority: i32,
    /// Blob of the scene's manifest.
    pub manifest: Digest,
    /// Digest of the scene.
    pub scene: Digest,
    /// Everything else that decides the pixels.
    pub settings: RenderSettings,
    /// The settings as they came: parsed alike after every restart.
    pub settings_json: String,
    /// Lights of the scene.
    pub lights: u32,
    /// Names the submission: same id and same digest = the same job.
    pub payload: Digest,
    /// When it was submitted, in milliseconds since 1970.
    pub submitted_ms: u64,
}

/// How far the merge has come.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Progress {
    /// Units of the pass that are folded.
    pub folded: u32,
    /// Share of the job (of the pass, without a sample budget).
    pub fraction: f64,
    /// Samples per pixel of completed passes.
    pub done_spp: u32,
    /// What was met.
    pub counters: Counters,
    /// Relative error and its upper bound at the last completed pass.
    pub error: Option<(f64, f64)>,
    /// What `auto` chose, and why.
    pub choice: Option<(IntegratorKind, String)>,
}

/// The pass under way.
#[derive(Clone, Debug)]
pub struct Pass {
    /// Its plan.
    pub plan: Arc<PassPlan>,
    /// The blob that tells workers all about it.
    pub document: Digest,
    /// Who works on what.
    pub board: PassBoard,
    /// Why units failed, by unit.
    pub failures: BTreeMap<u32, Vec<String>>,
    /// Workers that disagree with the pools that the pass's chains start from.
    pub mismatches: BTreeMap<WorkerId, Disagreement>,
    /// Workers on two machines disagreed: the job is about to fail.
    pub pools_are_wrong: bool,
}

/// A job.
#[derive(Clone, Debug)]
pub struct Job {
    /// Its id.
    pub id: JobId,
    /// Counts submissions.
    pub order: u64,
    /// What never changes.
    pub spec: Arc<JobSpec>,
    /// Where it is in its life.
    pub state: JobState,
    /// Why it failed or was paused.
    pub message: String,
    /// The pass under way; none while restoring, between passes and at the end.
    pub pass: Option<Pass>,
    /// How far the merge has come.
    pub progress: Progress,
    /// Compute time of its finished units, for the fair share; starts level with the jobs that are there.
    pub served: f64,
    /// Seconds per unit, over all workers.
    pub unit_seconds: Option<f64>,
    /// Its units are not given out before.
    pub settled: Duration,
    /// When it was active.
    pub clock: ActiveClock,
    /// How fast the merge comes on.
    pub meter: Meter,
}

impl Job {
    /// Compute time given to it so far: what is finished and, as estimated, what is held.
    pub fn share(&self) -> f64 {
        let held: u32 = self.pass.as_ref().map_or(0, |p| p.board.leases().map(|(_, l)| l.units.len()).sum());
        self.served + f64::from(held) * self.unit_seconds.unwrap_or(0.1)
    }
}

/// Measures the time during which a job was active.
#[derive(Clone, Copy, Debug, Default)]
pub struct ActiveClock {
    total: Duration,
    since: Option<Duration>,
}

impl ActiveClock {
    /// Goes on from a stored time.
    pub fn from_total(total: Duration) -> Self {
        Self { total, since: None }
    }

    /// Starts, if it stands.
    pub fn start(&mut self, now: Duration) {
        self.since.get_or_insert(now);
    }

    /// Stops.
    pub fn stop(&mut self, now: Duration) {
        self.total = self.elapsed(now);
        self.since = None;
    }

    /// The time measured.
    pub fn elapsed(&self, now: Duration) -> Duration {
        self.total + self.since.map_or(Duration::ZERO, |s| now.saturating_sub(s))
    }
}

/// Rates over the last seconds.
#[derive(Clone, Debug, Default)]
pub struct Meter {
    points: VecDeque<(Duration, u64, f64)>,
}

impl Meter {
    const SPAN: Duration = Duration::from_secs(20);
    const STEP: Duration = Duration::from_millis(250);

    /// Notes how much is done.
    pub fn note(&mut self, now: Duration, samples: u64, fraction: f64) {
        if self.points.back().is_some_and(|p| now < p.0 + Self::STEP) {
            return;
        }
        self.points.push_back((now, samples, fraction));
        while self.points.front().is_some_and(|p| p.0 + Self::SPAN < now) {
            self.points.pop_front();
        }
    }

    /// Forgets all: a pause is not slowness.
    pub fn reset(&mut self) {
        self.points.clear();
    }

    /// Samples per second, and the share of the job per second.
    pub fn rates(&self) -> Option<(f64, f64)> {
        let (first, last) = (self.points.front()?, self.points.back()?);
        let seconds = last.0.saturating_sub(first.0).as_secs_f64();
        (seconds > 0.0)
            .then(|| (last.1.saturating_sub(first.1) as f64 / seconds, (last.2 - first.2).max(0.0) / seconds))
    }
}
