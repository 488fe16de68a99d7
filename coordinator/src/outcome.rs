//! What comes of units: results, failures, and results that contradict each other.

use crate::farm::Farm;
use crate::ids::{Epoch, JobId, WorkerId};
use crate::job::{JobState, MAX_FAILURES};
use crate::units::UnitSet;
use renderer::job::{PassPlan, RenderSettings};
use std::sync::Arc;
use std::time::Duration;

/// The weight of the newest unit in the average time of a unit.
const NEWEST: f64 = 0.2;
/// How long a worker waits before it tries a job again that it could not begin.
const RETRY: Duration = Duration::from_secs(5);

/// Whether a unit's outcome is of use, asked before it is read.
#[derive(Clone, Debug)]
pub enum Interest {
    /// It is missing.
    Wanted(Expected),
    /// It is there; the digests can be compared.
    Stored,
    /// Ask again: the job is being restored.
    Later,
    /// Its job or pass is over, or there is no such unit.
    Unwanted,
}

/// What a result has to fit.
#[derive(Clone, Debug)]
pub struct Expected {
    /// The job's settings.
    pub settings: Arc<RenderSettings>,
    /// The pass's plan.
    pub plan: Arc<PassPlan>,
    /// Lights of the scene.
    pub lights: u32,
}

impl Farm {
    /// Whether the outcome of a unit is of use.
    pub fn interest(&self, job: JobId, pass: u32, unit: u32) -> Interest {
        let Some(job) = self.jobs.get(&job).filter(|j| !j.state.ended()) else { return Interest::Unwanted };
        if matches!(job.state, JobState::Restoring { .. }) {
            return Interest::Later;
        }
        match &job.pass {
            Some(p) if p.plan.pass == pass && unit < p.board.count() => {
                if p.board.done().contains(unit) {
                    return Interest::Stored;
                }
                let (settings, plan) = (Arc::new(job.spec.settings.clone()), p.plan.clone());
                Interest::Wanted(Expected { settings, plan, lights: job.spec.lights })
            }
            _ => Interest::Unwanted,
        }
    }

    /// A result is stored: it counts, whoever brought it, once.
    pub fn accepted(&mut self, id: JobId, pass: u32, unit: u32, by: WorkerId, seconds: f64, now: Duration) {
        let Some(job) = self.jobs.get_mut(&id) else { return };
        let Some(p) = job.pass.as_mut().filter(|p| p.plan.pass == pass) else { return };
        let Some(holders) = p.board.complete(unit, now) else { return };
        p.failures.remove(&unit);
        let average = |old: Option<f64>| Some(old.map_or(seconds, |o| o + NEWEST * (seconds - o)));
        job.unit_seconds = average(job.unit_seconds);
        job.served += seconds;
        self.totals.accepted += 1;
        self.totals.seconds += seconds;
        for (epoch, worker) in holders {
            let Some(w) = self.workers.get_mut(&worker) else { continue };
            if p.board.lease(epoch).is_none() {
                w.leases.remove(&epoch);
            }
            if worker != by {
                // Somebody else was quicker.
                w.revoked.push((epoch, UnitSet::from_range(unit..unit + 1)));
                self.wakes.insert(worker);
            }
        }
        let Some(w) = self.workers.get_mut(&by) else { return };
        w.units += 1;
        w.busy_seconds += seconds;
        let with = w.jobs.entry(id).or_default();
        with.units += 1;
        with.unit_seconds = average(with.unit_seconds);
        if let Some(w) = self.workers.get(&by)
            && self.seconds_left(w) < self.tuning.low_seconds
        {
            self.wakes.insert(by);
        }
    }

    /// A unit failed on a worker. Returns why the job fails, if it does.
    pub fn unit_failed(&mut self, at: UnitAt, by: WorkerId, message: &str, now: Duration) -> Option<String> {
        let job = self.jobs.get_mut(&at.job)?;
        let p = job.pass.as_mut().filter(|p| p.plan.pass == at.pass && !p.board.done().contains(at.unit))?;
        p.board.give_back(at.epoch, at.unit, now);
        let name = self.workers.get(&by).map_or_else(|| by.to_string(), |w| w.name.clone());
        let messages = p.failures.entry(at.unit).or_default();
        messages.push(format!("on worker {name}: {message}"));
        let fails = messages.len() as u32 >= MAX_FAILURES;
        let why =
            format!("unit {} of pass {} failed {} times; {}", at.unit, at.pass, messages.len(), messages.join("; "));
        self.count_failure(at.job, by, message, now);
        self.wake_all();
        fails.then_some(why)
    }

    /// A worker can't work on a job because of its own machine.
    pub fn machine_fault(&mut self, job: JobId, by: WorkerId, message: &str, now: Duration) {
        if self.jobs.contains_key(&job) {
            self.drop_leases(by, Some(job));
            self.count_failure(job, by, message, now + RETRY);
            self.wake_all();
        }
    }

    fn count_failure(&mut self, job: JobId, by: WorkerId, message: &str, retry_at: Duration) {
        let Some(w) = self.workers.get_mut(&by) else { return };
        w.failures += 1;
        self.totals.failures += 1;
        let with = w.jobs.entry(job).or_default();
        with.fail(message, retry_at);
        if with.blocked.is_some() {
            self.drop_leases(by, Some(job));
        }
    }

    /// A worker gets no more work: its results contradict stored ones.
    pub fn quarantine(&mut self, id: WorkerId, why: &str) {
        if let Some(w) = self.workers.get_mut(&id) {
            w.quarantined.get_or_insert_with(|| why.to_string());
            self.drop_leases(id, None);
            self.wake_all();
        }
    }

    /// Calls back a worker's leases, of one job or all.
    fn drop_leases(&mut self, id: WorkerId, only: Option<JobId>) {
        let Some(w) = self.workers.get_mut(&id) else { return };
        let of_job = |j: &JobId| only.is_none_or(|o| o == *j);
        let dropped: Vec<(Epoch, JobId)> = w.leases.iter().filter(|(_, j)| of_job(j)).map(|(e, j)| (*e, *j)).collect();
        for (epoch, job) in dropped {
            w.leases.remove(&epoch);
            w.revoked.push((epoch, UnitSet::default()));
            if let Some(pass) = self.jobs.get_mut(&job).and_then(|j| j.pass.as_mut()) {
                pass.board.release(epoch);
            }
        }
        self.wakes.insert(id);
    }
}

/// Which unit, under which lease.
#[derive(Clone, Copy, Debug)]
pub struct UnitAt {
    /// The job.
    pub job: JobId,
    /// Its pass.
    pub pass: u32,
    /// The unit.
    pub unit: u32,
    /// The lease's token.
    pub epoch: Epoch,
}
