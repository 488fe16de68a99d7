//! What the services share: the farm behind a lock, the store, the blobs, the merge, and the calls that wait.

use crate::blobs::Blobs;
use crate::farm::Farm;
use crate::ids::{JobId, WorkerId};
use crate::job::{Job, JobState};
use crate::merge::{MergeQueue, Snapshot};
use crate::serve::Config;
use crate::store::{Change, Store, StoreError, received};
use std::collections::BTreeMap;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};
use tokio::sync::{Notify, Semaphore};

/// Bytes of results that may be in memory on their way to the disk, in KiB.
const BUDGET_KIB: usize = 256 << 10;
/// How often the time for which jobs were active is stored.
const STORE_CLOCKS: Duration = Duration::from_secs(5);

/// What the services share.
pub struct Hub {
    farm: Mutex<Farm>,
    waiting: Mutex<BTreeMap<WorkerId, Arc<Notify>>>,
    started: Instant,
    /// The data folder's state and results.
    pub store: Store,
    /// The data folder's blobs.
    pub blobs: Blobs,
    /// The merging thread.
    pub merge: MergeQueue,
    /// Byte budget of results on their way, in KiB.
    pub budget: Arc<Semaphore>,
    /// One submission at a time: looking a job up and adding it belong together.
    pub submitting: tokio::sync::Mutex<()>,
    /// What workers must have in common with this coordinator.
    pub fingerprint: String,
    /// See [`Config::checkpoint_bytes`].
    pub checkpoint_bytes: u64,
}

/// Why a job can't change its state.
#[derive(Debug, thiserror::Error)]
pub enum ControlError {
    /// It is over.
    #[error("the job is {0}; it can't be changed any more")]
    Ended(&'static str),
    /// The disk.
    #[error(transparent)]
    Store(#[from] StoreError),
}

impl Hub {
    /// Over an opened data folder.
    pub fn new(config: &Config, generation: u32, store: Store, blobs: Blobs, merge: MergeQueue) -> Self {
        Self {
            farm: Mutex::new(Farm::new(config.tuning, generation)),
            waiting: Mutex::default(),
            started: Instant::now(),
            store,
            blobs,
            merge,
            budget: Arc::new(Semaphore::new(BUDGET_KIB)),
            submitting: Default::default(),
            fingerprint: config.fingerprint.clone(),
            checkpoint_bytes: config.checkpoint_bytes,
        }
    }

    /// Time since the start.
    pub fn now(&self) -> Duration {
        self.started.elapsed()
    }

    /// Does something with the farm, then wakes the calls that it concerns.
    pub fn with<T>(&self, action: impl FnOnce(&mut Farm, Duration) -> T) -> T {
        let (result, wakes) = {
            let mut farm = self.farm.lock().unwrap_or_else(PoisonError::into_inner);
            let result = action(&mut farm, self.now());
            (result, farm.take_wakes())
        };
        if !wakes.is_empty() {
            let waiting = self.lock_waiting();
            wakes.iter().filter_map(|w| waiting.get(w)).for_each(|n| n.notify_one());
        }
        result
    }

    /// What wakes a worker's call.
    pub fn notify_of(&self, worker: WorkerId) -> Arc<Notify> {
        self.lock_waiting().entry(worker).or_default().clone()
    }

    fn lock_waiting(&self) -> MutexGuard<'_, BTreeMap<WorkerId, Arc<Notify>>> {
        self.waiting.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Permits for `bytes` of the budget.
    pub fn budget_of(bytes: u64) -> u32 {
        bytes.div_ceil(1024).clamp(1, BUDGET_KIB as u64) as u32
    }

    /// Lets time pass, for ever.
    pub async fn keep_time(&self) {
        let mut stored = self.now();
        loop {
            tokio::time::sleep(Duration::from_millis(250)).await;
            self.with(|farm, now| farm.tick(now));
            let known: Vec<WorkerId> = self.with(|farm, _| farm.workers().keys().copied().collect());
            self.lock_waiting().retain(|w, _| known.contains(w));
            if self.now() >= stored + STORE_CLOCKS {
                stored = self.now();
                self.store_clocks();
            }
        }
    }

    /// Stores how long the jobs with a time budget were active; a crash loses the seconds since.
    fn store_clocks(&self) {
        let timed = |j: &&Job| j.state == JobState::Active && j.spec.settings.budget.time_s.is_some();
        let clocks: Vec<(JobId, Duration)> =
            self.with(|farm, now| farm.jobs().values().filter(timed).map(|j| (j.id, j.clock.elapsed(now))).collect());
        for (job, elapsed) in clocks {
            drop(self.store.change(Change::Elapsed(job, elapsed)));
        }
    }

    /// The stored form of a job's state as it would be in `state`.
    fn state_change(&self, id: JobId, state: JobState, message: &str) -> Option<Change> {
        self.with(|farm, now| {
            let job = farm.job(id)?;
            Some(Change::State {
                job: id,
                state,
                message: message.to_string(),
                elapsed: job.clock.elapsed(now),
                progress: job.progress.clone(),
            })
        })
    }

    /// Pauses, resumes, cancels or fails a job: stored first, then done.
    pub async fn set_state(&self, id: JobId, state: JobState, message: &str) -> Result<(), ControlError> {
        let current = self.with(|farm, _| farm.job(id).map(|j| j.state));
        if let Some(current) = current.filter(|s| s.ended()) {
            return if current == state { Ok(()) } else { Err(ControlError::Ended(current.name())) };
        }
        let Some(change) = self.state_change(id, state, message) else { return Ok(()) };
        received(self.store.change(change)).await?;
        self.with(|farm, now| match state {
            JobState::Paused => farm.pause(id, message, now),
            JobState::Active => farm.resume(id),
            _ => farm.end(id, state, message, now),
        });
        if state.ended() {
            self.merge.forget(id);
        } else {
            self.merge.nudge(id);
        }
        Ok(())
    }

    /// The disk is in trouble: the job stops until somebody has seen to it. Storing that is tried, but may fail as well.
    pub fn pause_for(&self, id: JobId, trouble: &StoreError) {
        let message = format!("{trouble}; make room or repair it, then: lightfarm resume {id}");
        let changed = self.with(|farm, now| {
            let active = farm
                .job(id)
                .is_some_and(|j| matches!(j.state, JobState::Active | JobState::Restoring { paused: false }));
            farm.pause(id, &message, now);
            active
        });
        if changed {
            tracing::error!(job = %id, "paused: {message}");
            if let Some(change) = self.state_change(id, JobState::Paused, &message) {
                drop(self.store.change(change));
            }
        }
    }

    /// The image so far.
    pub async fn snapshot(&self, id: JobId) -> Option<Snapshot> {
        self.merge.snapshot(id).await
    }
}
