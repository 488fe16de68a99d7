//! What the threads of a worker share: its leases, the units that run, the outcomes that wait to be delivered.

use crate::convert::{Grant, Revocation};
use renderer::integrator::mmlt::Mismatch;
use renderer::job::document::PassDocument;
use renderer::job::{Stop, Unit};
use renderer::scene::Scene;
use renderer::scene::bundle::Digest;
use std::collections::{BTreeMap, BTreeSet, VecDeque};
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};
use std::time::Duration;
use tokio::sync::Notify;
use uuid::Uuid;

/// Bytes of results that may wait to be delivered before no new units are begun.
const MAX_OUTBOX: usize = 256 << 20;
/// Outcomes, and bytes of them, delivered in one call.
const BATCH: usize = 256;
const BATCH_BYTES: usize = 32 << 20;

/// All that the units of a pass need.
#[derive(Debug)]
pub struct PassContext {
    /// The scene.
    pub scene: Arc<Scene>,
    /// Settings and plan.
    pub document: PassDocument,
}

/// A unit to run.
#[derive(Clone, Debug)]
pub struct Task {
    /// Its lease.
    pub epoch: u64,
    /// The unit.
    pub unit: Unit,
    /// What it needs.
    pub context: Arc<PassContext>,
    /// Ends it early.
    pub stop: Arc<Stop>,
}

/// Why a unit has no result.
#[derive(Clone, Debug, PartialEq)]
pub struct Failure {
    /// For people.
    pub message: String,
    /// Set when the start of a chain is not what the pool says.
    pub mismatch: Option<Mismatch>,
}

/// What came of a unit.
#[derive(Clone, Debug)]
pub struct Outcome {
    /// Its job.
    pub job: Uuid,
    /// Its pass.
    pub pass: u32,
    /// The unit.
    pub unit: u32,
    /// Its lease.
    pub epoch: u64,
    /// Compute time.
    pub seconds: f64,
    /// Its bytes, or why there are none.
    pub result: Result<bytes::Bytes, Failure>,
}

impl Outcome {
    fn len(&self) -> usize {
        self.result.as_ref().map_or(0, bytes::Bytes::len)
    }
}

/// What the worker says that it holds.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Held {
    /// The job.
    pub job: Uuid,
    /// The pass.
    pub pass: u32,
    /// The lease.
    pub epoch: u64,
    /// Units that are not acknowledged, in order.
    pub units: Vec<u32>,
}

#[derive(Debug)]
struct HeldLease {
    job: Uuid,
    pass: u32,
    document: Digest,
    todo: VecDeque<u32>,
    running: BTreeMap<u32, Arc<Stop>>,
    /// Finished, not acknowledged.
    unsent: BTreeSet<u32>,
}

impl HeldLease {
    fn is_empty(&self) -> bool {
        self.todo.is_empty() && self.running.is_empty() && self.unsent.is_empty()
    }
}

#[derive(Debug, Default)]
struct Inner {
    leases: BTreeMap<u64, HeldLease>,
    /// Leases up to this one were seen: an answer that comes late does not bring them back.
    newest: u64,
    ready: BTreeMap<Digest, Arc<PassContext>>,
    /// Documents to load, in the order of need.
    wanted: VecDeque<Digest>,
    outbox: VecDeque<Outcome>,
    /// Bytes in the outbox and on their way.
    outbox_bytes: usize,
    sending: usize,
    draining: bool,
    quit: bool,
}

/// The shared state.
#[derive(Debug, Default)]
pub struct Board {
    inner: Mutex<Inner>,
    /// For compute threads and the loader.
    work: Condvar,
    /// For the delivery.
    pub outcomes: Notify,
}

impl Board {
    fn lock(&self) -> MutexGuard<'_, Inner> {
        self.inner.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Everything that the worker holds.
    pub fn held(&self) -> Vec<Held> {
        let inner = self.lock();
        let one = |(epoch, l): (&u64, &HeldLease)| {
            let mut units: Vec<u32> = l.todo.iter().chain(l.running.keys()).chain(&l.unsent).copied().collect();
            units.sort_unstable();
            Held { job: l.job, pass: l.pass, epoch: *epoch, units }
        };
        inner.leases.iter().map(one).collect()
    }

    /// Takes new leases.
    pub fn grant(&self, grants: Vec<Grant>) {
        let mut inner = self.lock();
        for g in grants {
            if g.epoch <= inner.newest || inner.draining {
                continue;
            }
            inner.newest = g.epoch;
            if !inner.ready.contains_key(&g.document) && !inner.wanted.contains(&g.document) {
                inner.wanted.push_back(g.document);
            }
            let lease = HeldLease {
                job: g.job,
                pass: g.pass,
                document: g.document,
                todo: g.units.collect(),
                running: BTreeMap::new(),
                unsent: BTreeSet::new(),
            };
            inner.leases.insert(g.epoch, lease);
        }
        inner.forget_unused();
        self.work.notify_all();
    }

    /// Drops units, running or not.
    pub fn revoke(&self, revocations: &[Revocation]) {
        let mut inner = self.lock();
        for r in revocations {
            inner.revoke(r.epoch, |unit| r.units.is_empty() || r.units.iter().any(|range| range.contains(&unit)));
        }
        inner.forget_unused();
    }

    /// Drops all leases of a pass that can't be begun; it is loaded afresh with the next lease.
    pub fn give_up(&self, document: Digest) {
        let mut inner = self.lock();
        let epochs: Vec<u64> = inner.leases.iter().filter(|(_, l)| l.document == document).map(|(e, _)| *e).collect();
        epochs.into_iter().for_each(|e| inner.revoke(e, |_| true));
        inner.wanted.retain(|d| *d != document);
    }

    /// The job for which a document is needed; `None` when it is not needed any longer.
    pub fn job_of(&self, document: Digest) -> Option<Uuid> {
        self.lock().leases.values().find(|l| l.document == document).map(|l| l.job)
    }

    /// Waits for a document to load; `None` at the end.
    pub fn next_wanted(&self) -> Option<Digest> {
        let mut inner = self.lock();
        loop {
            if inner.quit {
                return None;
            }
            if let Some(document) = inner.wanted.front() {
                return Some(*document);
            }
            inner = self.work.wait(inner).unwrap_or_else(PoisonError::into_inner);
        }
    }

    /// A pass can begin.
    pub fn set_ready(&self, document: Digest, context: Arc<PassContext>) {
        let mut inner = self.lock();
        inner.wanted.retain(|d| *d != document);
        inner.ready.insert(document, context);
        inner.forget_unused();
        self.work.notify_all();
    }

    /// Waits for a unit to run; `None` at the end.
    pub fn next_task(&self) -> Option<Task> {
        let mut inner = self.lock();
        loop {
            if inner.quit {
                return None;
            }
            if let Some(task) = inner.take_task() {
                return Some(task);
            }
            inner = self.work.wait(inner).unwrap_or_else(PoisonError::into_inner);
        }
    }

    /// A unit has ended; `None`: it was stopped.
    pub fn finished(&self, task: &Task, seconds: f64, result: Option<Result<bytes::Bytes, Failure>>) {
        let mut inner = self.lock();
        let unit = task.unit.id;
        let Some(lease) = inner.leases.get_mut(&task.epoch) else { return };
        // One that was revoked meanwhile is nobody's any more.
        if lease.running.remove(&unit).is_none() {
            return;
        }
        if let Some(result) = result {
            lease.unsent.insert(unit);
            let (job, pass) = (lease.job, lease.pass);
            let outcome = Outcome { job, pass, unit, epoch: task.epoch, seconds, result };
            inner.outbox_bytes += outcome.len();
            inner.outbox.push_back(outcome);
            self.outcomes.notify_one();
        } else {
            inner.drop_if_empty(task.epoch);
        }
    }

    /// Takes outcomes to deliver.
    pub fn take_batch(&self) -> Vec<Outcome> {
        let mut inner = self.lock();
        let (mut batch, mut bytes) = (Vec::new(), 0);
        while batch.len() < BATCH && bytes < BATCH_BYTES {
            let Some(outcome) = inner.outbox.pop_front() else { break };
            bytes += outcome.len();
            batch.push(outcome);
        }
        inner.sending = batch.len();
        batch
    }

    /// Outcomes were acknowledged, or came to nothing (`failed`: they are tried again, unless they were revoked meanwhile).
    pub fn sent(&self, batch: Vec<Outcome>, failed: bool) {
        let mut inner = self.lock();
        inner.sending = 0;
        for outcome in batch.into_iter().rev() {
            let wanted = inner.leases.get(&outcome.epoch).is_some_and(|l| l.unsent.contains(&outcome.unit));
            if failed && wanted {
                inner.outbox.push_front(outcome);
                continue;
            }
            inner.outbox_bytes -= outcome.len();
            if let Some(lease) = inner.leases.get_mut(&outcome.epoch) {
                lease.unsent.remove(&outcome.unit);
            }
            inner.drop_if_empty(outcome.epoch);
        }
        self.work.notify_all();
    }

    /// Begins no more units.
    pub fn drain(&self) {
        let mut inner = self.lock();
        inner.draining = true;
        let epochs: Vec<u64> = inner.leases.keys().copied().collect();
        for epoch in epochs {
            if let Some(lease) = inner.leases.get_mut(&epoch) {
                lease.todo.clear();
            }
            inner.drop_if_empty(epoch);
        }
    }

    /// Outcomes that are not delivered; `None` while units are running.
    pub fn undelivered(&self) -> Option<usize> {
        let inner = self.lock();
        let running = inner.leases.values().any(|l| !l.running.is_empty());
        (!running).then_some(inner.outbox.len() + inner.sending)
    }

    /// Ends all threads; units that run are stopped.
    pub fn quit(&self) {
        let mut inner = self.lock();
        inner.quit = true;
        inner.leases.values().flat_map(|l| l.running.values()).for_each(|s| s.stop());
        self.work.notify_all();
    }

    /// Waits, without the lock, or until the end; `false` at the end.
    pub fn sleep(&self, time: Duration) -> bool {
        let inner = self.lock();
        let ended = |inner: &mut Inner| !inner.quit;
        let (inner, _) = self.work.wait_timeout_while(inner, time, ended).unwrap_or_else(PoisonError::into_inner);
        !inner.quit
    }
}

impl Inner {
    /// The first unit of the oldest lease that can run.
    fn take_task(&mut self) -> Option<Task> {
        if self.draining || self.outbox_bytes >= MAX_OUTBOX {
            return None;
        }
        for (epoch, lease) in &mut self.leases {
            let Some(context) = self.ready.get(&lease.document) else { continue };
            while let Some(id) = lease.todo.pop_front() {
                // A lease beyond the plan's end would be the coordinator's fault; it is told so by getting nothing.
                let Some(unit) = context.document.plan.unit(id) else { continue };
                let stop = Arc::new(Stop::new());
                lease.running.insert(id, stop.clone());
                return Some(Task { epoch: *epoch, unit, context: context.clone(), stop });
            }
        }
        None
    }

    fn revoke(&mut self, epoch: u64, which: impl Fn(u32) -> bool) {
        let Some(lease) = self.leases.get_mut(&epoch) else { return };
        lease.todo.retain(|u| !which(*u));
        lease.unsent.retain(|u| !which(*u));
        lease.running.retain(|u, stop| {
            if which(*u) {
                stop.stop();
            }
            !which(*u)
        });
        self.outbox.retain(|o| {
            let drop = o.epoch == epoch && which(o.unit);
            if drop {
                self.outbox_bytes -= o.len();
            }
            !drop
        });
        self.drop_if_empty(epoch);
    }

    fn drop_if_empty(&mut self, epoch: u64) {
        if self.leases.get(&epoch).is_some_and(HeldLease::is_empty) {
            self.leases.remove(&epoch);
        }
    }

    /// Keeps the documents of the leases that are held, and the latest: the next lease is most likely for it.
    fn forget_unused(&mut self) {
        let used: BTreeSet<Digest> = self.leases.values().map(|l| l.document).collect();
        if !used.is_empty() {
            self.ready.retain(|d, _| used.contains(d));
        }
        self.wanted.retain(|d| used.contains(d));
    }
}

#[cfg(test)]
#[path = "board_tests.rs"]
mod tests;
