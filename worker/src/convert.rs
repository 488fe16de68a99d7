//! Wire messages to our types and back.

use crate::board::{Held, Outcome};
use bytes::Bytes;
use renderer::integrator::mmlt::Mismatch;
use renderer::scene::bundle::Digest;
use std::ops::Range;
use uuid::Uuid;

/// Units that one lease may hold.
const MAX_LEASE: u32 = 1 << 20;

/// A lease.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Grant {
    /// The job.
    pub job: Uuid,
    /// The pass.
    pub pass: u32,
    /// Its token.
    pub epoch: u64,
    /// Its units.
    pub units: Range<u32>,
    /// Describes them.
    pub document: Digest,
}

/// Units to drop; none = the whole lease.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Revocation {
    /// The lease.
    pub epoch: u64,
    /// The units.
    pub units: Vec<Range<u32>>,
}

/// A lease from the wire; `None` when it makes no sense.
pub fn grant(l: &proto::Lease) -> Option<Grant> {
    let units = range(l.units.as_ref()?)?;
    (units.len() as u64 <= u64::from(MAX_LEASE)).then_some(())?;
    let document = Digest(l.document.as_ref().try_into().ok()?);
    Some(Grant { job: Uuid::from_slice(&l.job).ok()?, pass: l.pass, epoch: l.epoch, units, document })
}

/// A revocation from the wire.
pub fn revocation(r: &proto::Revocation) -> Option<Revocation> {
    Some(Revocation { epoch: r.epoch, units: r.units.iter().map(range).collect::<Option<_>>()? })
}

fn range(r: &proto::UnitRange) -> Option<Range<u32>> {
    Some(r.first..r.first.checked_add(r.count)?)
}

/// A lease for the wire.
pub fn held(h: &Held) -> proto::HeldLease {
    let mut units: Vec<proto::UnitRange> = Vec::new();
    for unit in &h.units {
        match units.last_mut() {
            Some(r) if r.first + r.count == *unit => r.count += 1,
            _ => units.push(proto::UnitRange { first: *unit, count: 1 }),
        }
    }
    proto::HeldLease { job: id(h.job), pass: h.pass, epoch: h.epoch, units }
}

/// An id for the wire.
pub fn id(id: Uuid) -> Bytes {
    Bytes::copy_from_slice(id.as_bytes())
}

fn mismatch(m: &Mismatch) -> proto::StartMismatch {
    proto::StartMismatch { edges: m.edges, sample: m.index, expected: m.expected, found: m.found }
}

/// An outcome in parts.
pub fn parts(worker: Uuid, o: &Outcome) -> Vec<proto::OutcomePart> {
    let (data, failure, mismatch) = match &o.result {
        Ok(data) => (data.clone(), String::new(), None),
        Err(f) => {
            let message = if f.message.is_empty() { "unknown".into() } else { f.message.clone() };
            (Bytes::new(), message, f.mismatch.as_ref().map(self::mismatch))
        }
    };
    let head = proto::OutcomeHead {
        worker_id: id(worker),
        job: id(o.job),
        pass: o.pass,
        unit: o.unit,
        epoch: o.epoch,
        seconds: o.seconds,
        len: data.len() as u64,
        digest: if failure.is_empty() { Digest::of(&data).0.to_vec().into() } else { Bytes::new() },
        failure,
        mismatch,
    };
    let first = data.slice(..data.len().min(proto::CHUNK));
    let mut parts = vec![proto::OutcomePart { head: Some(head), data: first }];
    let mut at = proto::CHUNK;
    while at < data.len() {
        let end = data.len().min(at + proto::CHUNK);
        parts.push(proto::OutcomePart { head: None, data: data.slice(at..end) });
        at = end;
    }
    parts
}
