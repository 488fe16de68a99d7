//! Wire messages to our types and back: the only place where a message's fields are trusted with nothing.

use crate::farm::Farm;
use crate::ids::{Epoch, JobId, WorkerId};
use crate::job::{Job, JobState};
use crate::outcome::UnitAt;
use crate::registry::{Worker, WorkerState};
use crate::sync::{Held, Reply, Report};
use crate::units::UnitSet;
use renderer::integrator::mmlt::Mismatch;
use renderer::scene::bundle::Digest;
use std::ops::Range;
use std::time::Duration;
use tonic::Status;

/// Characters of a name, and of a message, that are kept.
const NAME: usize = 128;
const MESSAGE: usize = 8192;
/// Leases that a worker may say it holds, and units in them.
const MAX_HELD: usize = 1024;
const MAX_HELD_UNITS: u64 = 1 << 20;

/// A digest of 32 bytes.
pub fn digest(bytes: &[u8]) -> Result<Digest, Status> {
    let fail = |_| Status::invalid_argument(format!("a digest has 32 bytes, not {}", bytes.len()));
    bytes.try_into().map(Digest).map_err(fail)
}

/// A job's id of 16 bytes.
pub fn job_id(bytes: &[u8]) -> Result<JobId, Status> {
    JobId::from_slice(bytes)
        .ok_or_else(|| Status::invalid_argument(format!("a job's id has 16 bytes, not {}", bytes.len())))
}

/// A worker's id of 16 bytes.
pub fn worker_id(bytes: &[u8]) -> Result<WorkerId, Status> {
    WorkerId::from_slice(bytes)
        .ok_or_else(|| Status::invalid_argument(format!("a worker's id has 16 bytes, not {}", bytes.len())))
}

/// Text for people from the wire: no control characters but line breaks, and not too long.
pub fn text(raw: &str, most: usize) -> String {
    raw.chars().filter(|c| !c.is_control() || *c == '\n').take(most).collect()
}

/// A one-line name.
pub fn name(raw: &str) -> String {
    let name: String = raw.chars().filter(|c| !c.is_control()).take(NAME).collect();
    if name.trim().is_empty() { "unnamed".into() } else { name }
}

/// A message about a failure.
pub fn message(raw: &str) -> String {
    text(raw, MESSAGE)
}

fn range(r: &proto::UnitRange) -> Result<Range<u32>, Status> {
    let end = r.first.checked_add(r.count);
    end.map(|end| r.first..end).ok_or_else(|| Status::invalid_argument("a range of units ends beyond 2^32"))
}

fn to_ranges(units: &UnitSet) -> Vec<proto::UnitRange> {
    units.ranges().map(|r| proto::UnitRange { first: r.start, count: r.end - r.start }).collect()
}

/// A worker's report.
pub fn report(r: &proto::SynchronizeRequest, address: String) -> Result<Report, Status> {
    if r.held.len() > MAX_HELD {
        return Err(Status::invalid_argument(format!(
            "a worker can't hold {} leases; at most {MAX_HELD}",
            r.held.len()
        )));
    }
    let state = match r.state() {
        proto::WorkerState::Ready => WorkerState::Ready,
        proto::WorkerState::Draining => WorkerState::Draining,
        proto::WorkerState::Leaving => WorkerState::Left,
        proto::WorkerState::Unspecified => return Err(Status::invalid_argument("the worker does not say its state")),
    };
    let mut left = MAX_HELD_UNITS;
    let mut held = Vec::with_capacity(r.held.len());
    for h in &r.held {
        let mut units = UnitSet::default();
        for u in &h.units {
            left = left
                .checked_sub(u64::from(u.count).max(1))
                .ok_or_else(|| Status::invalid_argument(format!("a worker can't hold over {MAX_HELD_UNITS} units")))?;
            units.insert_range(range(u)?);
        }
        held.push(Held { job: job_id(&h.job)?, pass: h.pass, epoch: Epoch(h.epoch), units });
    }
    Ok(Report {
        worker: worker_id(&r.worker_id)?,
        name: name(&r.name),
        address,
        threads: r.threads.clamp(1, 4096),
        sequence: r.sequence,
        state,
        held,
    })
}

/// What a worker is told.
pub fn reply(r: Reply) -> proto::SynchronizeResponse {
    let grants = r.grants.into_iter().map(|g| proto::Lease {
        job: bytes_of(g.job),
        pass: g.pass,
        epoch: g.epoch.0,
        units: Some(proto::UnitRange { first: g.units.start, count: g.units.end - g.units.start }),
        document: g.document.0.to_vec().into(),
    });
    let revocations = r.revoked.iter().map(|(e, units)| proto::Revocation { epoch: e.0, units: to_ranges(units) });
    proto::SynchronizeResponse {
        grants: grants.collect(),
        revocations: revocations.collect(),
        call_again_ms: 0,
        notice: r.notice,
    }
}

fn bytes_of(id: JobId) -> bytes::Bytes {
    id.0.as_bytes().to_vec().into()
}

/// An outcome's head.
pub struct Head {
    /// Which unit.
    pub at: UnitAt,
    /// Who brings it.
    pub worker: WorkerId,
    /// Compute time.
    pub seconds: f64,
    /// Bytes that follow.
    pub len: u64,
    /// Of these bytes.
    pub digest: Digest,
    /// Why there are none.
    pub failure: Option<String>,
    /// The failure is that the start of a chain is not what the pool says.
    pub mismatch: Option<Mismatch>,
}

/// Reads an outcome's head.
pub fn head(h: &proto::OutcomeHead) -> Result<Head, Status> {
    let failed = !h.failure.is_empty();
    if failed && h.len != 0 {
        return Err(Status::invalid_argument("a failed unit has no data"));
    }
    Ok(Head {
        at: UnitAt { job: job_id(&h.job)?, pass: h.pass, unit: h.unit, epoch: Epoch(h.epoch) },
        worker: worker_id(&h.worker_id)?,
        seconds: if h.seconds.is_finite() { h.seconds.clamp(0.0, 1e6) } else { 0.0 },
        len: h.len,
        digest: if failed { Digest([0; 32]) } else { digest(&h.digest)? },
        failure: failed.then(|| message(&h.failure)),
        mismatch: h.mismatch.as_ref().filter(|_| failed).map(|m| Mismatch {
            edges: m.edges,
            index: m.sample,
            expected: m.expected,
            found: m.found,
        }),
    })
}

fn state(s: JobState) -> proto::JobState {
    match s {
        JobState::Restoring { .. } => proto::JobState::Restoring,
        JobState::Active => proto::JobState::Active,
        JobState::Paused => proto::JobState::Paused,
        JobState::Done => proto::JobState::Done,
        JobState::Failed => proto::JobState::Failed,
        JobState::Cancelled => proto::JobState::Cancelled,
    }
}

/// A job's status.
pub fn status(farm: &Farm, job: &Job, now: Duration) -> proto::JobStatus {
    let (s, p) = (&job.spec, &job.progress);
    let pass = job.pass.as_ref();
    let rates = job.meter.rates().filter(|_| job.state == JobState::Active);
    let working = |w: &&Worker| w.leases.values().any(|j| *j == job.id);
    let waits = || farm.attention(job.id, now).into_iter().next().unwrap_or_default();
    let message = if job.message.is_empty() { waits() } else { job.message.clone() };
    // Without a sample budget the share is that of the pass, and says nothing of the end.
    let counted = s.settings.budget.spp.or(s.settings.budget.mpp).is_some();
    let left = rates.filter(|(_, f)| *f > 0.0 && counted).map(|(_, f)| (1.0 - p.fraction) / f);
    proto::JobStatus {
        id: job.id.to_string(),
        name: s.name.clone(),
        state: state(job.state).into(),
        priority: s.priority,
        integrator: s.settings.integrator.name().into(),
        width: s.settings.width,
        height: s.settings.height,
        pass: pass.map_or(0, |x| x.plan.pass),
        units_stored: pass.map_or(0, |x| x.board.done().len()),
        units_folded: pass.map_or(0, |_| p.folded),
        units: pass.map_or(0, |x| x.board.count()),
        fraction: p.fraction,
        spp_done: p.done_spp,
        samples: p.counters.samples,
        rays: p.counters.rays,
        non_finite: p.counters.non_finite,
        negative: p.counters.negative,
        error: p.error.map(|e| e.0),
        error_upper: p.error.map(|e| e.1),
        seconds: job.clock.elapsed(now).as_secs_f64(),
        seconds_left: left,
        submitted_unix_ms: s.submitted_ms,
        message,
        workers: farm.workers().values().filter(working).count() as u32,
        scene: s.scene.to_string(),
        rate: rates.map_or(0.0, |r| r.0),
        chosen: p.choice.as_ref().map_or_else(String::new, |c| c.0.name().into()),
        chosen_because: p.choice.as_ref().map_or_else(String::new, |c| c.1.clone()),
    }
}

/// A job in detail; the bytes that it has stored are not known here.
pub fn detail(farm: &Farm, job: &Job, now: Duration) -> proto::JobDetail {
    let of_job = |w: &Worker| {
        let lease = |e: &Epoch| job.pass.as_ref().and_then(|p| p.board.lease(*e)).map_or(0, |l| l.units.len());
        let held = w.leases.iter().filter(|(_, j)| **j == job.id).map(|(e, _)| lease(e)).sum();
        let with = w.jobs.get(&job.id).cloned().unwrap_or_default();
        let blocked = w.refusal(job.id).filter(|_| with.blocked.is_some() || w.quarantined.is_some());
        let name = w.name.clone();
        proto::JobWorker {
            name,
            held_units: held,
            units: with.units,
            failures: with.failures,
            blocked: blocked.unwrap_or_default(),
        }
    };
    let concerned = |w: &&Worker| w.present() || w.jobs.contains_key(&job.id);
    proto::JobDetail {
        status: Some(status(farm, job, now)),
        settings: job.spec.settings_json.clone(),
        workers: farm.workers().values().filter(concerned).map(of_job).collect(),
        attention: farm.attention(job.id, now),
        stored_bytes: 0,
    }
}

/// All workers.
pub fn workers(farm: &Farm, now: Duration) -> Vec<proto::WorkerStatus> {
    let units_of = |w: &Worker| {
        let held = |(e, j): (&Epoch, &JobId)| {
            farm.job(*j).and_then(|j| j.pass.as_ref()).and_then(|p| p.board.lease(*e)).map_or(0, |l| l.units.len())
        };
        w.leases.iter().map(held).sum::<u32>()
    };
    let one = |(id, w): (&WorkerId, &Worker)| {
        let mut jobs: Vec<String> = w.leases.values().map(JobId::to_string).collect();
        jobs.dedup();
        proto::WorkerStatus {
            name: w.name.clone(),
            id: id.to_string(),
            threads: w.threads,
            state: w.state_name().into(),
            held_units: units_of(w),
            units: w.units,
            busy_seconds: w.busy_seconds,
            silent_seconds: now.saturating_sub(w.seen).as_secs_f64(),
            failures: w.failures,
            losses: w.losses,
            message: w.quarantined.clone().unwrap_or_default(),
            address: w.address.clone(),
            jobs,
        }
    };
    farm.workers().iter().map(one).collect()
}
