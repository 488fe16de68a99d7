//! The worker's call: what it reports, and what it is told.

use crate::farm::Farm;
use crate::ids::{Epoch, JobId, WorkerId};
use crate::job::{Job, JobState};
use crate::lease::Pace;
use crate::registry::{Worker, WorkerState};
use crate::units::UnitSet;
use renderer::scene::bundle::Digest;
use std::collections::BTreeMap;
use std::ops::Range;
use std::time::Duration;

/// The most units that one lease holds.
const MAX_LEASE: u32 = 4096;
/// Leases given out in one answer.
const MAX_GRANTS: usize = 4;
/// A worker stays with its job until another of the same priority is so many seconds of compute time behind: every change of
/// scenes costs it time.
const STICKY_SECONDS: f64 = 20.0;

/// What a worker says.
#[derive(Clone, Debug)]
pub struct Report {
    /// Who.
    pub worker: WorkerId,
    /// Its name.
    pub name: String,
    /// Where it dialled from.
    pub address: String,
    /// Compute threads.
    pub threads: u32,
    /// Counts its calls.
    pub sequence: u64,
    /// Ready, draining or leaving.
    pub state: WorkerState,
    /// Its leases, with the units that it has not delivered.
    pub held: Vec<Held>,
}

/// A lease that a worker says it holds.
#[derive(Clone, Debug)]
pub struct Held {
    /// Of this job,
    pub job: JobId,
    /// and this pass.
    pub pass: u32,
    /// Its token.
    pub epoch: Epoch,
    /// What is left of it.
    pub units: UnitSet,
}

/// A new lease.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Grant {
    /// Of this job,
    pub job: JobId,
    /// and this pass.
    pub pass: u32,
    /// Its token.
    pub epoch: Epoch,
    /// Its units.
    pub units: Range<u32>,
    /// The blob that describes them.
    pub document: Digest,
}

/// What a worker is told.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Reply {
    /// New leases.
    pub grants: Vec<Grant>,
    /// Units to forget; an empty set is the whole lease.
    pub revoked: Vec<(Epoch, UnitSet)>,
    /// For its user.
    pub notice: String,
}

/// What became of a waiting call.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Poll {
    /// There is something to say.
    Reply(Reply),
    /// There is not.
    Wait,
    /// The worker has called again, or is gone.
    Superseded,
}

impl Farm {
    /// Takes in a worker's report; `false` when a later call overtook it.
    pub fn report(&mut self, r: Report, now: Duration) -> bool {
        let entry = self.workers.entry(r.worker);
        let w = entry.or_insert_with(|| Worker::new(r.name.clone(), r.address.clone(), r.threads));
        if r.sequence <= w.sequence {
            return false;
        }
        (w.sequence, w.seen, w.deadline) = (r.sequence, now, now + self.tuning.lease);
        (w.name, w.address, w.threads) = (r.name, r.address, r.threads);
        let known = std::mem::take(&mut w.leases);
        w.revoked.clear();
        w.state = if r.state == WorkerState::Left { WorkerState::Draining } else { r.state };
        w.report_again = false;
        let leaves = r.state == WorkerState::Left;
        let mut freed = false;

        // What it does not hold any longer, or never got, is free.
        for (epoch, job) in known {
            let held = r.held.iter().find(|h| h.epoch == epoch);
            let Some(board) = self.jobs.get_mut(&job).and_then(|j| j.pass.as_mut()).map(|p| &mut p.board) else {
                continue;
            };
            let Some(held) = held else {
                freed |= board.release(epoch).is_some();
                continue;
            };
            let gone: Vec<u32> = board
                .lease(epoch)
                .map(|l| l.units.iter().filter(|u| !held.units.contains(*u)).collect())
                .unwrap_or_default();
            for unit in gone {
                freed |= board.give_back(epoch, unit, now);
            }
        }
        if freed {
            self.wake_all();
        }
        for held in &r.held {
            self.reconcile(r.worker, held, now);
        }
        if leaves {
            self.lose(r.worker, WorkerState::Left, now);
        }
        true
    }

    /// Compares a lease that a worker holds with ours; takes it over if it can be (after a restart, after an interruption), and
    /// revokes what is done or somebody else's.
    fn reconcile(&mut self, worker: WorkerId, held: &Held, now: Duration) {
        let job = self.jobs.get_mut(&held.job);
        let state = job.as_ref().map(|j| j.state);
        let pass = job.and_then(|j| j.pass.as_mut()).filter(|p| p.plan.pass == held.pass);
        let Some(w) = self.workers.get_mut(&worker) else { return };
        let kept = match (state, pass) {
            // Until its results are read again nothing can be said about its units.
            (Some(JobState::Restoring { paused: false }), _) => return,
            (Some(JobState::Active), Some(pass)) => match pass.board.lease(held.epoch) {
                Some(lease) if lease.worker == worker => lease.units.clone(),
                _ if w.quarantined.is_some() => UnitSet::default(),
                _ => pass.board.adopt(worker, held.epoch, &held.units, now),
            },
            _ => UnitSet::default(),
        };
        if kept.is_empty() {
            w.revoked.push((held.epoch, UnitSet::default()));
            return;
        }
        w.leases.insert(held.epoch, held.job);
        let gone: UnitSet = held.units.iter().filter(|u| !kept.contains(*u)).collect();
        if !gone.is_empty() {
            w.revoked.push((held.epoch, gone));
        }
    }

    /// What a waiting call is told; `last` when it has to be answered now.
    pub fn poll(&mut self, id: WorkerId, sequence: u64, last: bool, now: Duration) -> Poll {
        let Some(w) = self.workers.get_mut(&id).filter(|w| w.sequence == sequence) else { return Poll::Superseded };
        let again = std::mem::take(&mut w.report_again);
        let mut reply = Reply { revoked: std::mem::take(&mut w.revoked), ..Reply::default() };
        if let Some(why) = &w.quarantined {
            reply.notice = format!("this worker gets no work: {why}");
        }
        while reply.grants.len() < MAX_GRANTS
            && let Some(grant) = self.grant(id, now)
        {
            reply.grants.push(grant);
        }
        let silent = reply.grants.is_empty() && reply.revoked.is_empty() && !again;
        if silent && !last { Poll::Wait } else { Poll::Reply(reply) }
    }

    /// A lease for a worker that has too little to do.
    fn grant(&mut self, id: WorkerId, now: Duration) -> Option<Grant> {
        let w = self.workers.get(&id)?;
        if !w.takes_work() || self.seconds_left(w) >= self.tuning.low_seconds {
            return None;
        }
        let (order, idle) = (self.job_order(w, now), w.leases.is_empty());
        // New units first, in the order of the jobs; an overdue unit counts as new. Then, for the idle, what others have not finished.
        for eager in [false, true] {
            if eager && !idle {
                break;
            }
            for job in &order {
                if let Some(grant) = self.grant_of(id, *job, eager, now) {
                    return Some(grant);
                }
            }
        }
        None
    }

    /// The jobs that a worker may work on: by priority, then by who had least; it stays with its own for a while.
    fn job_order(&self, w: &Worker, now: Duration) -> Vec<JobId> {
        let may = |j: &&Job| {
            let with = w.jobs.get(&j.id);
            j.state == JobState::Active
                && j.pass.is_some()
                && j.settled <= now
                && with.is_none_or(|r| r.blocked.is_none() && r.not_before <= now)
        };
        let key = |j: &Job| {
            let bonus = if w.last_job == Some(j.id) { STICKY_SECONDS } else { 0.0 };
            (std::cmp::Reverse(j.spec.priority), j.share() - bonus, j.order)
        };
        let mut keyed: Vec<_> = self.jobs.values().filter(may).map(|j| (key(j), j.id)).collect();
        keyed.sort_by(|(a, _), (b, _)| a.0.cmp(&b.0).then(a.1.total_cmp(&b.1)).then(a.2.cmp(&b.2)));
        keyed.into_iter().map(|(_, id)| id).collect()
    }

    fn grant_of(&mut self, id: WorkerId, job_id: JobId, eager: bool, now: Duration) -> Option<Grant> {
        let crowd = self.workers.values().filter(|w| w.takes_work()).count() as u32;
        let threads = self.workers.get(&id)?.threads.max(1);
        let own = self.workers.get(&id).and_then(|w| self.pace(w, job_id));
        let paces = self.holder_paces(job_id)?;
        let epoch = self.epochs.fresh();
        let job = self.jobs.get_mut(&job_id)?;
        let pass = job.pass.as_mut()?;
        let units = if pass.board.free().is_empty() {
            let pace = own.unwrap_or(Pace { threads, unit_seconds: 0.1 });
            pass.board.grant_second(id, epoch, pace, !eager, now, |w| paces.get(&w).copied())?
        } else {
            // Some seconds of units; two per thread while the speed is unknown; less when few are left, so that all end together.
            let wanted = own.map_or(2 * threads, |p| {
                (self.tuning.target_seconds * f64::from(threads) / p.unit_seconds.max(1e-6)) as u32
            });
            let fair = pass.board.free().len().div_ceil(2 * crowd.max(1));
            pass.board.grant(id, epoch, wanted.min(fair).max(threads).min(MAX_LEASE), now)?
        };
        job.clock.start(now);
        let grant = Grant { job: job_id, pass: pass.plan.pass, epoch, units, document: pass.document };
        let w = self.workers.get_mut(&id)?;
        w.leases.insert(epoch, job_id);
        w.last_job = Some(job_id);
        self.totals.leases += 1;
        Some(grant)
    }

    /// How fast those are who hold a job's last units; empty while there are free ones.
    fn holder_paces(&self, job: JobId) -> Option<BTreeMap<WorkerId, Pace>> {
        let board = &self.jobs.get(&job)?.pass.as_ref()?.board;
        if !board.free().is_empty() {
            return Some(BTreeMap::new());
        }
        let pace = |id: WorkerId| Some((id, self.pace(self.workers.get(&id)?, job)?));
        Some(board.leases().filter_map(|(_, l)| pace(l.worker)).collect())
    }

    /// How fast a worker is with a job: as measured, else as the others are.
    fn pace(&self, w: &Worker, job: JobId) -> Option<Pace> {
        let own = w.jobs.get(&job).and_then(|j| j.unit_seconds);
        let all = || self.jobs.get(&job).and_then(|j| j.unit_seconds);
        Some(Pace { threads: w.threads.max(1), unit_seconds: own.or_else(all)? })
    }

    /// Seconds of work that a worker holds; plenty while its speed is not known.
    pub(crate) fn seconds_left(&self, w: &Worker) -> f64 {
        let seconds = |(epoch, job): (&Epoch, &JobId)| {
            let lease = self.jobs.get(job).and_then(|j| j.pass.as_ref()).and_then(|p| p.board.lease(*epoch));
            let units = lease.map_or(0, |l| l.units.len());
            match self.pace(w, *job) {
                _ if units == 0 => 0.0,
                Some(p) => f64::from(units) * p.unit_seconds / f64::from(p.threads),
                None => f64::INFINITY,
            }
        };
        w.leases.iter().map(seconds).sum()
    }
}
