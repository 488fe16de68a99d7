//! The workers that are connected, or were.

use crate::ids::{Epoch, JobId, WorkerId};
use crate::job::MAX_FAILURES;
use crate::units::UnitSet;
use std::collections::BTreeMap;
use std::time::Duration;

/// Workers that are gone are remembered so long, and so many of them.
const REMEMBER: Duration = Duration::from_secs(3600);
const REMEMBER_MOST: usize = 256;

/// What a worker is up to.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum WorkerState {
    /// Takes work.
    Ready,
    /// Finishes what it has.
    Draining,
    /// Said goodbye.
    Left,
    /// Was cut off or not heard of for too long.
    Lost,
}

/// A worker's record with one job.
#[derive(Clone, Debug, Default)]
pub struct WithJob {
    /// Seconds per unit on one thread.
    pub unit_seconds: Option<f64>,
    /// Units accepted.
    pub units: u64,
    /// Units (or attempts to begin) that failed.
    pub failures: u32,
    /// Why it gets no more units of this job.
    pub blocked: Option<String>,
    /// It gets none before.
    pub not_before: Duration,
}

impl WithJob {
    /// Counts a failure: after [`MAX_FAILURES`] the worker is blocked for the job.
    pub fn fail(&mut self, message: &str, retry_at: Duration) {
        self.failures += 1;
        self.not_before = retry_at;
        if self.failures >= MAX_FAILURES && self.blocked.is_none() {
            self.blocked = Some(format!("{} failures, the last: {message}", self.failures));
        }
    }
}

/// A worker process.
#[derive(Clone, Debug)]
pub struct Worker {
    /// Its name, for people.
    pub name: String,
    /// Where it dialled from.
    pub address: String,
    /// Compute threads.
    pub threads: u32,
    /// What it is up to.
    pub state: WorkerState,
    /// Why it gets no work at all.
    pub quarantined: Option<String>,
    /// The call that counts.
    pub sequence: u64,
    /// When it was last heard of.
    pub seen: Duration,
    /// Its leases end when nothing was heard by then.
    pub deadline: Duration,
    /// Its leases, with their jobs.
    pub leases: BTreeMap<Epoch, JobId>,
    /// What it should forget, not yet told.
    pub revoked: Vec<(Epoch, UnitSet)>,
    /// Its waiting call is answered at once, so that it says again what it holds.
    pub report_again: bool,
    /// Its record with each job.
    pub jobs: BTreeMap<JobId, WithJob>,
    /// The job it last got units of.
    pub last_job: Option<JobId>,
    /// Units accepted.
    pub units: u64,
    /// Compute time of these, over all threads.
    pub busy_seconds: f64,
    /// Units that failed.
    pub failures: u32,
    /// Leases lost with a connection or a deadline.
    pub losses: u32,
}

impl Worker {
    /// One that has just called for the first time.
    pub fn new(name: String, address: String, threads: u32) -> Self {
        Self {
            name,
            address,
            threads,
            state: WorkerState::Ready,
            quarantined: None,
            sequence: 0,
            seen: Duration::ZERO,
            deadline: Duration::ZERO,
            leases: BTreeMap::new(),
            revoked: Vec::new(),
            report_again: false,
            jobs: BTreeMap::new(),
            last_job: None,
            units: 0,
            busy_seconds: 0.0,
            failures: 0,
            losses: 0,
        }
    }

    /// Whether it is there.
    pub fn present(&self) -> bool {
        matches!(self.state, WorkerState::Ready | WorkerState::Draining)
    }

    /// Whether it may get units of some job.
    pub fn takes_work(&self) -> bool {
        self.state == WorkerState::Ready && self.quarantined.is_none()
    }

    /// Why it gets no units of `job` now or ever; `None` when it does.
    pub fn refusal(&self, job: JobId) -> Option<String> {
        let blocked = || self.jobs.get(&job).and_then(|j| j.blocked.clone());
        match self.state {
            WorkerState::Left => Some("it has left".into()),
            WorkerState::Lost => Some("it is lost".into()),
            WorkerState::Draining => Some("it is draining".into()),
            WorkerState::Ready => self.quarantined.clone().or_else(blocked),
        }
    }

    /// Whether it runs on the same machine as another, by name and address: a worker that was started again is a new one.
    pub fn same_machine(&self, other: &Self) -> bool {
        let host = |w: &Self| w.address.rsplit_once(':').map_or(w.address.clone(), |(host, _)| host.to_string());
        self.name == other.name && host(self) == host(other)
    }

    /// What `workers` shows as its state.
    pub fn state_name(&self) -> &'static str {
        match self.state {
            WorkerState::Ready if self.quarantined.is_some() => "quarantined",
            WorkerState::Ready => "ready",
            WorkerState::Draining => "draining",
            WorkerState::Left => "left",
            WorkerState::Lost => "lost",
        }
    }
}

/// Forgets workers that went long ago, and the oldest when they are too many.
pub fn forget_old(workers: &mut BTreeMap<WorkerId, Worker>, now: Duration) {
    workers.retain(|_, w| w.present() || now.saturating_sub(w.seen) < REMEMBER);
    let mut gone: Vec<(Duration, WorkerId)> =
        workers.iter().filter(|(_, w)| !w.present()).map(|(id, w)| (w.seen, *id)).collect();
    gone.sort();
    for (_, id) in gone.iter().rev().skip(REMEMBER_MOST) {
        workers.remove(id);
    }
}
