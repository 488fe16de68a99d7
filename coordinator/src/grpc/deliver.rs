//! Taking in outcomes: checked, stored, then acknowledged. Bytes in memory are counted against the budget before they are read, so that
//! a crowd of workers waits in its own send buffers.

use crate::convert::{self, Head};
use crate::hub::Hub;
use crate::job::JobState;
use crate::outcome::{Expected, Interest};
use crate::store::{Appended, NewResult, StoreError, received};
use bytes::{Bytes, BytesMut};
use proto::Verdict;
use renderer::job::UnitResult;
use renderer::scene::bundle::Digest;
use std::sync::Arc;
use std::time::Duration;
use tokio::sync::OwnedSemaphorePermit;
use tokio::task::JoinHandle;
use tokio::time::timeout;
use tonic::{Status, Streaming};

/// Outcomes in one call.
const MAX_OUTCOMES: usize = 4096;
/// A sender that is silent for so long in the middle of a call is cut off.
const PATIENCE: Duration = Duration::from_secs(30);

/// A verdict that comes when the disk has the result.
type Pending = JoinHandle<Result<Verdict, Status>>;

/// Receives the outcomes of one call; the verdicts come in their order.
pub async fn receive(hub: &Arc<Hub>, mut parts: Streaming<proto::OutcomePart>) -> Result<Vec<Verdict>, Status> {
    let mut pending: Vec<Pending> = Vec::new();
    let mut open: Option<Incoming> = None;
    while let Some(part) = next(&mut parts).await? {
        if let Some(raw) = &part.head {
            if open.is_some() {
                return Err(Status::invalid_argument("an outcome begins before the one before it is complete"));
            }
            if pending.len() >= MAX_OUTCOMES {
                return Err(Status::invalid_argument(format!("over {MAX_OUTCOMES} outcomes in one call")));
            }
            open = Some(Incoming::begin(hub, convert::head(raw)?).await?);
        }
        let Some(incoming) = &mut open else { return Err(Status::invalid_argument("data without an outcome")) };
        incoming.add(part.data)?;
        if incoming.complete()
            && let Some(incoming) = open.take()
        {
            pending.push(tokio::spawn(incoming.settle(hub.clone())));
        }
    }
    if open.is_some() {
        return Err(Status::invalid_argument("the last outcome is not complete"));
    }
    let mut verdicts = Vec::with_capacity(pending.len());
    for task in pending {
        verdicts.push(task.await.map_err(|e| Status::internal(format!("storing a result failed: {e}")))??);
    }
    Ok(verdicts)
}

async fn next(parts: &mut Streaming<proto::OutcomePart>) -> Result<Option<proto::OutcomePart>, Status> {
    timeout(PATIENCE, parts.message()).await.map_err(|_| Status::deadline_exceeded("nothing came for too long"))?
}

/// An outcome whose data is coming in.
struct Incoming {
    head: Head,
    interest: Interest,
    data: BytesMut,
    /// Bytes of the data that came, kept or not.
    came: u64,
    permit: Option<OwnedSemaphorePermit>,
    too_long: bool,
}

impl Incoming {
    async fn begin(hub: &Arc<Hub>, head: Head) -> Result<Self, Status> {
        let interest = hub.with(|farm, _| farm.interest(head.at.job, head.at.pass, head.at.unit));
        let mut incoming = Self { head, interest, data: BytesMut::new(), came: 0, permit: None, too_long: false };
        match &incoming.interest {
            Interest::Later => return Err(Status::unavailable("the job is being restored; try again")),
            Interest::Wanted(e) => {
                let unit = e.plan.unit(incoming.head.at.unit);
                incoming.too_long = unit.is_none_or(|u| incoming.head.len > UnitResult::longest(&e.plan, &u, e.lights));
            }
            Interest::Stored | Interest::Unwanted => {}
        }
        if incoming.keeps() {
            let permits = Hub::budget_of(incoming.head.len);
            let permit = hub.budget.clone().acquire_many_owned(permits).await;
            incoming.permit = Some(permit.map_err(|_| Status::unavailable("the coordinator is ending"))?);
        }
        Ok(incoming)
    }

    /// Whether the data is of any use.
    fn keeps(&self) -> bool {
        matches!(self.interest, Interest::Wanted(_)) && !self.too_long && self.head.failure.is_none()
    }

    fn add(&mut self, data: Bytes) -> Result<(), Status> {
        self.came += data.len() as u64;
        if self.came > self.head.len {
            return Err(Status::invalid_argument("more data than the outcome announced"));
        }
        if self.keeps() {
            self.data.extend_from_slice(&data);
        }
        Ok(())
    }

    fn complete(&self) -> bool {
        self.came == self.head.len
    }

    /// Decides what becomes of it.
    async fn settle(self, hub: Arc<Hub>) -> Result<Verdict, Status> {
        let keeps = self.keeps();
        let Self { head, interest, data, permit, too_long, .. } = self;
        let expected = match interest {
            Interest::Wanted(e) => e,
            Interest::Stored if head.failure.is_none() => return compare(&hub, &head).await,
            _ => return Ok(Verdict::Unwanted),
        };
        if let Some(message) = &head.failure {
            fail(&hub, &head, message).await?;
            return Ok(Verdict::Accepted);
        }
        if !keeps || too_long {
            fail(&hub, &head, &format!("a result of {} bytes is too long for this unit", head.len)).await?;
            return Ok(Verdict::Refused);
        }
        let bytes = data.freeze();
        match check(bytes.clone(), &head, expected).await? {
            Err(why) => {
                fail(&hub, &head, &why).await?;
                Ok(Verdict::Refused)
            }
            Ok(decoded) => {
                let verdict = store(&hub, &head, bytes, decoded).await;
                drop(permit);
                verdict
            }
        }
    }
}

/// Whether the bytes are what they claim to be; decoding is work, so not on the threads that serve.
async fn check(bytes: Bytes, head: &Head, e: Expected) -> Result<Result<Box<UnitResult>, String>, Status> {
    let (digest, unit) = (head.digest, head.at.unit);
    let work = move || {
        if Digest::of(&bytes) != digest {
            return Err("the bytes that came are not those that were announced".to_string());
        }
        let unit = e.plan.unit(unit).ok_or("there is no such unit")?;
        let (w, h) = (e.plan.width, e.plan.height);
        UnitResult::decode(&bytes, &unit, w, h, e.lights as usize).map(Box::new).map_err(|e| e.to_string())
    };
    tokio::task::spawn_blocking(work).await.map_err(|e| Status::internal(format!("checking a result failed: {e}")))
}

/// Stores a result; the answer comes when it is durable.
async fn store(hub: &Arc<Hub>, head: &Head, bytes: Bytes, decoded: Box<UnitResult>) -> Result<Verdict, Status> {
    let at = head.at;
    let result =
        NewResult { job: at.job, pass: at.pass, unit: at.unit, bytes, digest: head.digest, worker: head.worker };
    match received(hub.store.append(result)).await {
        Ok(Appended::New(stored)) => {
            hub.with(|farm, now| farm.accepted(at.job, at.pass, at.unit, head.worker, head.seconds, now));
            hub.merge.stored(at.job, at.pass, stored, Some(decoded));
            Ok(Verdict::Accepted)
        }
        Ok(Appended::Existing(digest)) => Ok(same(hub, head, digest)),
        Err(StoreError::Ended) => Ok(Verdict::Unwanted),
        Err(e) => {
            hub.pause_for(at.job, &e);
            Err(Status::unavailable(format!("the result could not be stored, keep it: {e}")))
        }
    }
}

/// A unit that is stored already: the same bits, or somebody computes wrongly.
async fn compare(hub: &Arc<Hub>, head: &Head) -> Result<Verdict, Status> {
    let at = head.at;
    match received(hub.store.find(at.job, at.pass, at.unit)).await {
        Ok(Some(digest)) => Ok(same(hub, head, digest)),
        // The job ended in between.
        Ok(None) => Ok(Verdict::Unwanted),
        Err(e) => Err(Status::unavailable(e.to_string())),
    }
}

fn same(hub: &Arc<Hub>, head: &Head, stored: Digest) -> Verdict {
    if stored == head.digest {
        return Verdict::Duplicate;
    }
    let at = head.at;
    let why = format!(
        "its result of unit {} of pass {} of job {} differs from the stored one: one of the two computers is faulty",
        at.unit, at.pass, at.job
    );
    tracing::error!(worker = %head.worker, "quarantined: {why}");
    hub.with(|farm, _| farm.quarantine(head.worker, &why));
    Verdict::Mismatch
}

/// Counts a failure; the third of a unit fails the job. A start of a chain that is not what the pool says is the worker's fault, or
/// the pool's.
async fn fail(hub: &Arc<Hub>, head: &Head, message: &str) -> Result<(), Status> {
    let at = head.at;
    tracing::warn!(job = %at.job, pass = at.pass, unit = at.unit, worker = %head.worker, "a unit failed: {message}");
    let fails = hub.with(|farm, now| match &head.mismatch {
        Some(mismatch) => farm.start_mismatched(at, head.worker, mismatch, now),
        None => farm.unit_failed(at, head.worker, message, now),
    });
    if let Some(why) = fails {
        tracing::error!(job = %at.job, "failed: {why}");
        hub.set_state(at.job, JobState::Failed, &why).await.map_err(super::jobs::control_status)?;
    }
    Ok(())
}
