//! What survives a crash: SQLite for state, segment files for results. One thread writes; what it confirms is on disk.

mod schema;
mod segment;
mod writer;

pub use schema::{Restored, StoredJob, StoredResult};
pub use segment::SegmentReader;

use crate::ids::{JobId, WorkerId};
use crate::job::{JobSpec, JobState, Progress};
use bytes::Bytes;
use renderer::scene::bundle::Digest;
use std::fs::{File, TryLockError};
use std::io::{self, Write};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::mpsc::SyncSender;
use std::time::Duration;
use tokio::sync::oneshot;

/// Requests that may wait for the writer; beyond that, callers wait.
const QUEUE: usize = 4096;

/// Why something could not be stored or read.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum StoreError {
    /// No space is left.
    #[error("the disk of the data folder is full: {0}")]
    Full(String),
    /// Another fault of the disk or the database.
    #[error("the data folder can't be used: {0}")]
    Fault(String),
    /// Somebody else uses the folder.
    #[error("another coordinator uses the data folder {0}; stop it, or give this one another --data")]
    Locked(String),
    /// The job is over, so its results are gone.
    #[error("the job has ended")]
    Ended,
}

impl From<std::io::Error> for StoreError {
    fn from(e: std::io::Error) -> Self {
        use std::io::ErrorKind;
        match e.kind() {
            ErrorKind::StorageFull | ErrorKind::QuotaExceeded | ErrorKind::FileTooLarge => Self::Full(e.to_string()),
            _ => Self::Fault(e.to_string()),
        }
    }
}

impl From<rusqlite::Error> for StoreError {
    fn from(e: rusqlite::Error) -> Self {
        match e.sqlite_error_code() {
            Some(rusqlite::ErrorCode::DiskFull) => Self::Full(e.to_string()),
            _ => Self::Fault(e.to_string()),
        }
    }
}

/// What became of a result.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Appended {
    /// It is on disk, at this place.
    New(StoredResult),
    /// One of this digest was there before.
    Existing(Digest),
}

/// A result to be stored.
#[derive(Clone, Debug)]
pub struct NewResult {
    /// The job.
    pub job: JobId,
    /// Its pass.
    pub pass: u32,
    /// The unit.
    pub unit: u32,
    /// The result, as it came.
    pub bytes: Bytes,
    /// Of the bytes.
    pub digest: Digest,
    /// Who brought it.
    pub worker: WorkerId,
}

/// A change of state to be stored.
#[derive(Clone, Debug)]
pub enum Change {
    /// A new job.
    Add(JobId, Arc<JobSpec>),
    /// A job's state, with the time for which it was active.
    State {
        /// The job.
        job: JobId,
        /// Its state.
        state: JobState,
        /// Why.
        message: String,
        /// Time for which it was active.
        elapsed: Duration,
        /// What was merged, for a job that ends.
        progress: Progress,
    },
    /// The time for which a job was active.
    Elapsed(JobId, Duration),
    /// The merge was saved under this number when it had folded all before unit `.2` of pass `.1`: what is folded is not needed any more.
    Checkpoint(JobId, u32, u32, u32),
    /// Stored results that can't be read.
    Forget(JobId, u32, Vec<u32>),
    /// A pass is merged, and what was decided then: whether the time was up.
    PassEnd(JobId, u32, bool),
}

/// What is asked of the writer.
enum Request {
    Append(NewResult, oneshot::Sender<Result<Appended, StoreError>>),
    Find(JobId, u32, u32, oneshot::Sender<Result<Option<Digest>, StoreError>>),
    Change(Change, oneshot::Sender<Result<(), StoreError>>),
    Close,
}

/// An answer that will come when the disk has it.
pub type Receipt<T> = oneshot::Receiver<Result<T, StoreError>>;

/// Handle to the data folder.
#[derive(Clone, Debug)]
pub struct Store {
    folder: PathBuf,
    requests: SyncSender<Request>,
}

/// Keeps the folder to itself and ends the writer when dropped.
#[derive(Debug)]
pub struct StoreGuard {
    requests: SyncSender<Request>,
    thread: Option<std::thread::JoinHandle<()>>,
    _lock: File,
}

impl Store {
    /// Opens or makes the data folder, and reads what it holds.
    pub fn open(folder: &Path) -> Result<(Self, StoreGuard, Restored), StoreError> {
        std::fs::create_dir_all(folder.join("jobs"))?;
        let lock = File::create(folder.join("lock"))?;
        match lock.try_lock() {
            Ok(()) => {}
            Err(TryLockError::WouldBlock) => return Err(StoreError::Locked(folder.display().to_string())),
            Err(TryLockError::Error(e)) => return Err(e.into()),
        }
        let mut db = schema::open(folder)?;
        let restored = schema::restore(&mut db)?;
        let (requests, inbox) = std::sync::mpsc::sync_channel(QUEUE);
        let writer = writer::Writer::new(db, folder.to_path_buf(), &restored);
        let thread = std::thread::Builder::new().name("store".into()).spawn(move || writer.run(&inbox))?;
        let guard = StoreGuard { requests: requests.clone(), thread: Some(thread), _lock: lock };
        Ok((Self { folder: folder.to_path_buf(), requests }, guard, restored))
    }

    /// Stores a result unless there is one for its unit.
    pub fn append(&self, result: NewResult) -> Receipt<Appended> {
        self.send(|reply| Request::Append(result, reply))
    }

    /// The digest of a unit's stored result.
    pub fn find(&self, job: JobId, pass: u32, unit: u32) -> Receipt<Option<Digest>> {
        self.send(|reply| Request::Find(job, pass, unit, reply))
    }

    /// Stores a change of state.
    pub fn change(&self, change: Change) -> Receipt<()> {
        self.send(|reply| Request::Change(change, reply))
    }

    fn send<T>(&self, request: impl FnOnce(oneshot::Sender<Result<T, StoreError>>) -> Request) -> Receipt<T> {
        let (reply, receipt) = oneshot::channel();
        // A writer that is gone drops the reply: the caller sees it.
        let _ = self.requests.send(request(reply));
        receipt
    }

    /// The stored results of a pass.
    pub fn results(&self, job: JobId, pass: u32) -> Result<Vec<StoredResult>, StoreError> {
        schema::results(&schema::open_reader(&self.folder)?, job, pass)
    }

    /// What was decided at the end of a pass, if it has ended.
    pub fn pass_end(&self, job: JobId, pass: u32) -> Result<Option<bool>, StoreError> {
        schema::pass_end(&schema::open_reader(&self.folder)?, job, pass)
    }

    /// A segment of a job, to read.
    pub fn segment(&self, job: JobId, number: u32) -> Result<SegmentReader, StoreError> {
        SegmentReader::open(&segment::path(&self.folder, job, number))
    }

    /// Bytes of a job's files.
    pub fn stored_bytes(&self, job: JobId) -> u64 {
        let files = std::fs::read_dir(segment::folder(&self.folder, job)).into_iter().flatten().flatten();
        files.filter_map(|f| f.metadata().ok()).map(|m| m.len()).sum()
    }

    /// Stores the state of a job's merge, which `save` writes; it counts with [`Change::Checkpoint`]. Returns its length.
    pub fn write_checkpoint(
        &self,
        job: JobId,
        number: u32,
        save: impl FnOnce(&mut File) -> io::Result<u64>,
    ) -> Result<u64, StoreError> {
        Ok(crate::files::write_durably(&checkpoint_path(&self.folder, job, number), save)?)
    }

    /// The state of a job's merge.
    pub fn read_checkpoint(&self, job: JobId, number: u32) -> Result<Vec<u8>, StoreError> {
        let path = checkpoint_path(&self.folder, job, number);
        std::fs::read(&path).map_err(|e| StoreError::Fault(format!("{}: {e}", path.display())))
    }

    /// Where a job's image is, or will be.
    pub fn image_path(&self, job: JobId) -> PathBuf {
        segment::folder(&self.folder, job).join("image.exr")
    }

    /// Stores a job's image: complete or not at all.
    pub fn write_image(&self, job: JobId, exr: &[u8]) -> Result<(), StoreError> {
        let path = self.image_path(job);
        std::fs::create_dir_all(segment::folder(&self.folder, job))?;
        crate::files::write_durably(&path, |f| f.write_all(exr))?;
        Ok(())
    }
}

/// A saved merge.
fn checkpoint_path(data: &Path, job: JobId, number: u32) -> PathBuf {
    segment::folder(data, job).join(format!("{number}.merge"))
}

/// Waits, on a thread of its own, for a receipt.
pub fn wait<T>(receipt: Receipt<T>) -> Result<T, StoreError> {
    receipt.blocking_recv().unwrap_or_else(|_| Err(gone()))
}

/// Waits for a receipt.
pub async fn received<T>(receipt: Receipt<T>) -> Result<T, StoreError> {
    receipt.await.unwrap_or_else(|_| Err(gone()))
}

fn gone() -> StoreError {
    StoreError::Fault("the writer has ended".into())
}

impl Drop for StoreGuard {
    fn drop(&mut self) {
        let _ = self.requests.send(Request::Close);
        if let Some(thread) = self.thread.take() {
            let _ = thread.join();
        }
    }
}

#[cfg(test)]
mod tests;
