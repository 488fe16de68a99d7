//! One job's merge.

use crate::ids::JobId;
use crate::job::{JobSpec, Progress};
use crate::merge::Snapshot;
use crate::store::{Change, SegmentReader, Store, StoreError, StoredResult, wait};
use crate::units::UnitSet;
use renderer::job::{Merger, PassPlan, UnitResult};
use std::collections::BTreeMap;
use std::sync::Arc;
use std::time::{Duration, Instant};

/// Decoded results that wait in memory for their turn, and bytes of them; more are read from the disk again.
const DECODED: usize = 64;
const DECODED_BYTES: usize = 256 << 20;
/// The error is worth its computation once in so long.
const ERROR_EVERY: Duration = Duration::from_secs(1);

/// What came of trying to fold a unit.
pub enum Step {
    /// It is folded.
    Folded,
    /// The next one is not stored yet.
    Waits,
    /// All are folded.
    PassComplete,
    /// Its stored result can't be used.
    Damaged(u32, StoreError),
}

/// A job's merge.
pub struct Merging {
    id: JobId,
    /// What never changes.
    pub spec: Arc<JobSpec>,
    merger: Merger,
    waiting: BTreeMap<u32, StoredResult>,
    decoded: BTreeMap<u32, Box<UnitResult>>,
    decoded_bytes: usize,
    segment: Option<(u32, SegmentReader)>,
    /// Bytes folded since the last checkpoint.
    folded_bytes: u64,
    /// Number and length of the last checkpoint.
    checkpoint: Option<(u32, u64)>,
    error: Option<(f64, f64)>,
    error_at: Option<Instant>,
    /// The pass under way was published.
    pub begun: bool,
    /// Nothing is done before a nudge: the disk is in trouble.
    pub stuck: bool,
    /// The image is being written.
    pub finishing: bool,
    /// Stored results that were damaged.
    pub damaged: u32,
}

impl Merging {
    /// Nothing merged yet.
    pub fn new(id: JobId, spec: Arc<JobSpec>) -> Self {
        let merger = Merger::new(spec.settings.clone());
        Self::of(id, spec, merger, None)
    }

    /// Goes on from a checkpoint.
    pub fn restore(id: JobId, spec: Arc<JobSpec>, store: &Store, number: u32) -> Result<Self, StoreError> {
        let state = store.read_checkpoint(id, number)?;
        let damaged = || StoreError::Fault(format!("checkpoint {number} of job {id} is damaged or of another version"));
        let merger = Merger::load(&state).filter(|m| *m.settings() == spec.settings).ok_or_else(damaged)?;
        Ok(Self::of(id, spec, merger, Some((number, state.len() as u64))))
    }

    fn of(id: JobId, spec: Arc<JobSpec>, merger: Merger, checkpoint: Option<(u32, u64)>) -> Self {
        Self {
            id,
            spec,
            merger,
            waiting: BTreeMap::new(),
            decoded: BTreeMap::new(),
            decoded_bytes: 0,
            segment: None,
            folded_bytes: 0,
            checkpoint,
            error: None,
            error_at: None,
            begun: false,
            stuck: false,
            finishing: false,
            damaged: 0,
        }
    }

    /// The pass under way.
    pub fn pass(&self) -> u32 {
        self.merger.plan().pass
    }

    /// Its plan.
    pub fn plan(&self) -> &PassPlan {
        self.merger.plan()
    }

    /// Whether there is something to do.
    pub fn ready(&self) -> bool {
        let next = self.merger.pass_complete() || self.waiting.contains_key(&self.merger.next_unit());
        self.begun && !self.stuck && !self.finishing && next
    }

    /// Reads which results of the pass are stored.
    pub fn load(&mut self, store: &Store) -> Result<UnitSet, StoreError> {
        self.segment = None;
        self.decoded.clear();
        let stored = store.results(self.id, self.pass())?;
        let count = self.plan().unit_count();
        let next = self.merger.next_unit();
        self.waiting = stored.into_iter().filter(|r| (next..count).contains(&r.unit)).map(|r| (r.unit, r)).collect();
        let mut done = UnitSet::from_range(0..next);
        for unit in self.waiting.keys() {
            done.insert(*unit);
        }
        Ok(done)
    }

    /// A result is stored.
    pub fn stored(&mut self, pass: u32, at: StoredResult, decoded: Option<Box<UnitResult>>) {
        if pass != self.pass() || at.unit < self.merger.next_unit() {
            return;
        }
        self.waiting.insert(at.unit, at);
        if let Some(d) = decoded
            && self.decoded.len() < DECODED
            && (self.decoded.is_empty() || self.decoded_bytes + d.memory() <= DECODED_BYTES)
        {
            self.decoded_bytes += d.memory();
            if let Some(old) = self.decoded.insert(at.unit, d) {
                self.decoded_bytes -= old.memory();
            }
        }
    }

    /// Folds the next unit if it is there.
    pub fn step(&mut self, store: &Store) -> Step {
        if self.merger.pass_complete() {
            return Step::PassComplete;
        }
        let unit = self.merger.next_unit();
        let Some(at) = self.waiting.get(&unit).copied() else { return Step::Waits };
        let result = match self.decoded.remove(&unit) {
            Some(result) => {
                self.decoded_bytes -= result.memory();
                Ok(*result)
            }
            None => self.read(store, &at),
        };
        let folded = result.and_then(|r| self.merger.fold(unit, &r).map_err(|e| StoreError::Fault(e.to_string())));
        self.waiting.remove(&unit);
        self.folded_bytes += at.len;
        match folded {
            Ok(()) if self.merger.pass_complete() => Step::PassComplete,
            Ok(()) => Step::Folded,
            Err(e) => Step::Damaged(unit, e),
        }
    }

    fn read(&mut self, store: &Store, at: &StoredResult) -> Result<UnitResult, StoreError> {
        let segment = match self.segment.take() {
            Some((number, segment)) if number == at.segment => segment,
            _ => store.segment(self.id, at.segment)?,
        };
        let bytes = segment.read(at)?;
        self.segment = Some((at.segment, segment));
        let (w, h) = (self.plan().width, self.plan().height);
        let unit = self.plan().unit(at.unit).ok_or_else(|| StoreError::Fault("no such unit".into()))?;
        UnitResult::decode(&bytes, &unit, w, h, self.spec.lights as usize).map_err(|e| StoreError::Fault(e.to_string()))
    }

    /// Saves the merge when so much was folded that its results are worth freeing: `bound` bytes, and twice what a save takes.
    pub fn save_if_due(&mut self, store: &Store, bound: u64) -> Result<(), StoreError> {
        if self.folded_bytes < bound.max(2 * self.checkpoint.map_or(0, |c| c.1)) {
            return Ok(());
        }
        let number = self.checkpoint.map_or(0, |c| c.0 + 1);
        let bytes = store.write_checkpoint(self.id, number, |file| self.merger.save(file))?;
        wait(store.change(Change::Checkpoint(self.id, number, self.pass(), self.merger.next_unit())))?;
        tracing::debug!(job = %self.id, number, bytes, "checkpoint");
        self.checkpoint = Some((number, bytes));
        self.folded_bytes = 0;
        Ok(())
    }

    /// Plans the next pass; `false` when the job is complete.
    pub fn advance(&mut self, time_up: bool) -> bool {
        if !self.plan().last && self.error_at.is_none_or(|t| t.elapsed() > ERROR_EVERY) {
            self.error_at = Some(Instant::now());
            self.error = self.merger.image().error.map(|e| (e.relative, e.upper95));
        }
        self.merger.advance(time_up).is_some()
    }

    /// How far it is.
    pub fn progress(&self) -> Progress {
        Progress {
            folded: self.merger.next_unit(),
            fraction: self.merger.fraction(),
            done_spp: self.merger.done_spp(),
            counters: self.merger.counters(),
            error: self.error,
            choice: self.merger.choice().map(|c| (c.integrator, c.why.clone())),
        }
    }

    /// The image so far.
    pub fn snapshot(&self) -> Snapshot {
        let image = self.merger.image();
        let mut progress = self.progress();
        progress.error = image.error.map(|e| (e.relative, e.upper95));
        Snapshot { image, spec: self.spec.clone(), choice: self.merger.choice().cloned(), progress }
    }
}
