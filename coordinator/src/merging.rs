//! One job's merge.

use crate::ids::JobId;
use crate::job::{JobSpec, Progress};
use crate::merge::Snapshot;
use crate::store::{SegmentReader, Store, StoreError, StoredResult};
use crate::units::UnitSet;
use renderer::job::{Merger, PassPlan, UnitResult};
use std::collections::BTreeMap;
use std::sync::Arc;
use std::time::{Duration, Instant};

/// Decoded results that wait in memory for their turn; more are read from the disk again.
const DECODED: usize = 64;
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
    segment: Option<SegmentReader>,
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
        Self {
            id,
            spec,
            merger,
            waiting: BTreeMap::new(),
            decoded: BTreeMap::new(),
            segment: None,
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
        self.waiting = stored.into_iter().filter(|r| r.unit < count).map(|r| (r.unit, r)).collect();
        Ok(self.waiting.keys().copied().collect())
    }

    /// A result is stored.
    pub fn stored(&mut self, pass: u32, at: StoredResult, decoded: Option<Box<UnitResult>>) {
        if pass != self.pass() || at.unit < self.merger.next_unit() {
            return;
        }
        self.waiting.insert(at.unit, at);
        if let Some(d) = decoded
            && self.decoded.len() < DECODED
        {
            self.decoded.insert(at.unit, d);
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
            Some(result) => Ok(*result),
            None => self.read(store, &at),
        };
        let folded = result.and_then(|r| self.merger.fold(unit, &r).map_err(|e| StoreError::Fault(e.to_string())));
        self.waiting.remove(&unit);
        match folded {
            Ok(()) if self.merger.pass_complete() => Step::PassComplete,
            Ok(()) => Step::Folded,
            Err(e) => Step::Damaged(unit, e),
        }
    }

    fn read(&mut self, store: &Store, at: &StoredResult) -> Result<UnitResult, StoreError> {
        let segment = match self.segment.take() {
            Some(segment) => segment,
            None => store.segment(self.id, self.pass())?,
        };
        let bytes = segment.read(at)?;
        self.segment = Some(segment);
        let s = &self.spec.settings;
        let unit = self.plan().unit(at.unit).ok_or_else(|| StoreError::Fault("no such unit".into()))?;
        UnitResult::decode(&bytes, &unit, s.width, s.height, self.spec.lights as usize)
            .map_err(|e| StoreError::Fault(e.to_string()))
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
        }
    }

    /// The image so far.
    pub fn snapshot(&self) -> Snapshot {
        let image = self.merger.image();
        let mut progress = self.progress();
        progress.error = image.error.map(|e| (e.relative, e.upper95));
        Snapshot { image, spec: self.spec.clone(), progress }
    }
}
