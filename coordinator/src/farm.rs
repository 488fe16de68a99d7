//! Jobs, workers and leases: the scheduler as a synchronous state machine. Time comes in as an argument; what has to be stored is
//! stored by the caller, before it tells the farm.

use crate::ids::{Epoch, Epochs, JobId, WorkerId};
use crate::job::{Job, JobSpec, JobState, Pass, Progress};
use crate::lease::PassBoard;
use crate::registry::{Worker, WorkerState, forget_old};
use crate::units::UnitSet;
use renderer::job::PassPlan;
use renderer::scene::bundle::Digest;
use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;
use std::time::Duration;

/// Times that the scheduler goes by.
#[derive(Clone, Copy, Debug)]
pub struct Tuning {
    /// A worker that was not heard of for so long has lost its leases.
    pub lease: Duration,
    /// What a lease aims to hold: so many seconds of the worker's time.
    pub target_seconds: f64,
    /// A worker with less than this to do gets more.
    pub low_seconds: f64,
    /// After a start, units of an unfinished job are not given out for so long: workers that went on rendering come back first.
    pub settle: Duration,
}

impl Default for Tuning {
    fn default() -> Self {
        Self {
            lease: Duration::from_secs(10),
            target_seconds: 4.0,
            low_seconds: 2.0,
            settle: Duration::from_millis(1500),
        }
    }
}

/// What was counted since the start.
#[derive(Clone, Copy, Debug, Default)]
pub struct Totals {
    /// Units accepted.
    pub accepted: u64,
    /// Their compute time.
    pub seconds: f64,
    /// Units that failed.
    pub failures: u64,
    /// Leases given out.
    pub leases: u64,
    /// Leases lost with their worker.
    pub losses: u64,
}

/// The scheduler.
#[derive(Debug)]
pub struct Farm {
    pub(crate) tuning: Tuning,
    pub(crate) epochs: Epochs,
    pub(crate) jobs: BTreeMap<JobId, Job>,
    pub(crate) workers: BTreeMap<WorkerId, Worker>,
    /// Workers whose call should be looked at again.
    pub(crate) wakes: BTreeSet<WorkerId>,
    orders: u64,
    pub(crate) totals: Totals,
}

impl Farm {
    /// An empty farm; `generation` counts the starts of the coordinator on this data folder.
    pub fn new(tuning: Tuning, generation: u32) -> Self {
        Self {
            tuning,
            epochs: Epochs::of_generation(generation),
            jobs: BTreeMap::new(),
            workers: BTreeMap::new(),
            wakes: BTreeSet::new(),
            orders: 0,
            totals: Totals::default(),
        }
    }

    /// The jobs.
    pub fn jobs(&self) -> &BTreeMap<JobId, Job> {
        &self.jobs
    }

    /// A job.
    pub fn job(&self, id: JobId) -> Option<&Job> {
        self.jobs.get(&id)
    }

    /// The workers.
    pub fn workers(&self) -> &BTreeMap<WorkerId, Worker> {
        &self.workers
    }

    /// What was counted since the start.
    pub fn totals(&self) -> Totals {
        self.totals
    }

    /// Workers whose waiting call should be looked at again.
    pub fn take_wakes(&mut self) -> BTreeSet<WorkerId> {
        std::mem::take(&mut self.wakes)
    }

    /// Adds a job: new, or from the store.
    pub fn add_job(&mut self, mut job: Job) {
        self.orders += 1;
        job.order = self.orders;
        job.served = self.least_share(job.spec.priority);
        self.jobs.insert(job.id, job);
    }

    /// A job that comes in, or back, starts level with the one that had least, instead of catching up.
    fn least_share(&self, priority: i32) -> f64 {
        let peers = self.jobs.values().filter(|j| j.state == JobState::Active && j.spec.priority == priority);
        peers.map(Job::share).min_by(f64::total_cmp).unwrap_or(0.0)
    }

    /// A new job's entry.
    pub fn new_job(id: JobId, spec: JobSpec, state: JobState) -> Job {
        Job {
            id,
            order: 0,
            spec: Arc::new(spec),
            state,
            message: String::new(),
            pass: None,
            progress: Progress::default(),
            served: 0.0,
            unit_seconds: None,
            settled: Duration::ZERO,
            clock: Default::default(),
            meter: Default::default(),
        }
    }

    /// A pass begins: its units, less those that are done, can be given out.
    pub fn begin_pass(&mut self, id: JobId, plan: Arc<PassPlan>, document: Digest, done: UnitSet, now: Duration) {
        let Some(job) = self.jobs.get_mut(&id) else { return };
        if let JobState::Restoring { paused } = job.state {
            job.state = if paused { JobState::Paused } else { JobState::Active };
            // Workers that went on rendering take their units up again before these are given to others.
            job.settled = now + self.tuning.settle;
            self.workers.values_mut().for_each(|w| w.report_again = true);
        }
        if job.state.ended() {
            return;
        }
        let board = PassBoard::new(plan.unit_count(), done);
        job.progress.folded = 0;
        let (failures, mismatches) = (BTreeMap::new(), BTreeMap::new());
        job.pass = Some(Pass { plan, document, board, failures, mismatches, pools_are_wrong: false });
        self.wake_all();
    }

    /// The merge has come on.
    pub fn note_progress(&mut self, id: JobId, progress: Progress, now: Duration) {
        if let Some(job) = self.jobs.get_mut(&id) {
            job.meter.note(now, progress.counters.samples, progress.fraction);
            job.progress = progress;
        }
    }

    /// Pauses a job: its units are called back at once.
    pub fn pause(&mut self, id: JobId, message: &str, now: Duration) {
        let Some(job) = self.jobs.get_mut(&id) else { return };
        match &mut job.state {
            JobState::Restoring { paused } => *paused = true,
            state @ JobState::Active => *state = JobState::Paused,
            _ => return,
        }
        job.message = message.to_string();
        job.clock.stop(now);
        job.meter.reset();
        self.call_back(id);
    }

    /// Goes on with a paused job.
    pub fn resume(&mut self, id: JobId) {
        let least = self.jobs.get(&id).map_or(0.0, |j| self.least_share(j.spec.priority));
        let Some(job) = self.jobs.get_mut(&id) else { return };
        match &mut job.state {
            JobState::Restoring { paused } => *paused = false,
            state @ JobState::Paused => *state = JobState::Active,
            _ => return,
        }
        job.message.clear();
        job.served = job.served.max(least);
        self.wake_all();
    }

    /// Ends a job: done, failed or cancelled.
    pub fn end(&mut self, id: JobId, state: JobState, message: &str, now: Duration) {
        let Some(job) = self.jobs.get_mut(&id) else { return };
        if job.state.ended() {
            return;
        }
        job.state = state;
        job.message = message.to_string();
        job.clock.stop(now);
        if state == JobState::Done {
            job.progress.fraction = 1.0;
        }
        self.call_back(id);
        if let Some(job) = self.jobs.get_mut(&id) {
            job.pass = None;
        }
        self.workers.values_mut().for_each(|w| drop(w.jobs.remove(&id)));
        self.wake_all();
    }

    /// Tells all workers to forget a job's units.
    fn call_back(&mut self, id: JobId) {
        let Some(pass) = self.jobs.get_mut(&id).and_then(|j| j.pass.as_mut()) else { return };
        let epochs: Vec<Epoch> = pass.board.leases().map(|(e, _)| e).collect();
        for epoch in epochs {
            let Some(lease) = pass.board.release(epoch) else { continue };
            if let Some(w) = self.workers.get_mut(&lease.worker) {
                w.leases.remove(&epoch);
                w.revoked.push((epoch, UnitSet::default()));
                self.wakes.insert(lease.worker);
            }
        }
    }

    /// A worker's connection was cut during call `sequence`.
    pub fn disconnected(&mut self, id: WorkerId, sequence: u64, now: Duration) {
        if self.workers.get(&id).is_some_and(|w| w.sequence == sequence && w.present()) {
            self.lose(id, WorkerState::Lost, now);
        }
    }

    /// Time passes: leases run out, old workers are forgotten, those who wait for time to pass are woken.
    pub fn tick(&mut self, now: Duration) {
        let late: Vec<WorkerId> =
            self.workers.iter().filter(|(_, w)| w.present() && w.deadline <= now).map(|(id, _)| *id).collect();
        late.into_iter().for_each(|id| self.lose(id, WorkerState::Lost, now));
        forget_old(&mut self.workers, now);
        let idle = self.workers.iter().filter(|(_, w)| w.takes_work() && w.leases.is_empty());
        let idle: Vec<WorkerId> = idle.map(|(id, _)| *id).collect();
        self.wakes.extend(idle);
    }

    /// A worker is gone: its units are free at once.
    pub(crate) fn lose(&mut self, id: WorkerId, state: WorkerState, now: Duration) {
        let Some(w) = self.workers.get_mut(&id) else { return };
        w.state = state;
        w.revoked.clear();
        w.seen = w.seen.max(now.min(w.deadline));
        let leases = std::mem::take(&mut w.leases);
        if state == WorkerState::Lost {
            w.losses += leases.len() as u32;
            self.totals.losses += leases.len() as u64;
        }
        if leases.is_empty() {
            return;
        }
        for (epoch, job) in leases {
            if let Some(pass) = self.jobs.get_mut(&job).and_then(|j| j.pass.as_mut()) {
                pass.board.release(epoch);
            }
        }
        self.wake_all();
    }

    /// Looks at every waiting call again.
    pub(crate) fn wake_all(&mut self) {
        let ready = self.workers.iter().filter(|(_, w)| w.takes_work()).map(|(id, _)| *id);
        self.wakes.extend(ready);
    }

    /// What a user should look at, in sentences.
    pub fn attention(&self, id: JobId, now: Duration) -> Vec<String> {
        let Some(job) = self.jobs.get(&id) else { return Vec::new() };
        let mut list = Vec::new();
        if job.state != JobState::Active {
            return list;
        }
        let refusals: Vec<(String, Option<String>)> =
            self.workers.values().filter(|w| w.present()).map(|w| (w.name.clone(), w.refusal(id))).collect();
        if refusals.is_empty() {
            list.push("no worker is connected; start one with: lightfarm worker --coordinator URL".into());
        } else if refusals.iter().all(|(_, r)| r.is_some()) {
            list.push("no worker may work on this job; fix and restart one of them, or start another".into());
        }
        for (name, refusal) in refusals {
            list.extend(refusal.map(|r| format!("worker {name} gets no units of this job: {r}")));
        }
        let Some(pass) = &job.pass else { return list };
        for (unit, messages) in pass.failures.iter().filter(|(u, _)| !pass.board.done().contains(**u)) {
            let last = messages.last().map_or("", String::as_str);
            list.push(format!("unit {unit} of pass {} failed {} times: {last}", pass.plan.pass, messages.len()));
        }
        for (_, lease) in pass.board.leases() {
            let still = now.saturating_sub(lease.progress);
            let name = self.workers.get(&lease.worker).map_or("?", |w| w.name.as_str());
            if still > Duration::from_secs(60)
                && let Some(unit) = lease.units.first()
            {
                list.push(format!("worker {name} has brought nothing for {} s, from unit {unit} on", still.as_secs()));
            }
        }
        list
    }
}

#[cfg(test)]
#[path = "farm_tests/mod.rs"]
mod tests;
