//! Results, one after the other in files. What the database does not list does not count.

use super::{StoreError, StoredResult};
use crate::ids::JobId;
use renderer::scene::bundle::Digest;
use std::fs::{File, OpenOptions};
use std::os::unix::fs::FileExt;
use std::path::{Path, PathBuf};

/// The folder of a job.
pub fn folder(data: &Path, job: JobId) -> PathBuf {
    data.join("jobs").join(job.to_string())
}

/// A segment of a job: results are appended to one until it is full, then to the next.
pub fn path(data: &Path, job: JobId, number: u32) -> PathBuf {
    folder(data, job).join(format!("{number}.results"))
}

/// The numbers of a job's segments, in no order.
pub fn numbers(data: &Path, job: JobId) -> Vec<u32> {
    let files = std::fs::read_dir(folder(data, job)).into_iter().flatten().flatten();
    files.filter_map(|f| f.file_name().to_str()?.strip_suffix(".results")?.parse().ok()).collect()
}

/// A segment that grows.
#[derive(Debug)]
pub struct Segment {
    file: File,
    /// Bytes that the database lists.
    committed: u64,
    /// Bytes written.
    end: u64,
}

impl Segment {
    /// Opens or makes a segment, cut to the bytes that the database lists: a crash may have left more.
    pub fn open(data: &Path, job: JobId, number: u32, committed: u64) -> Result<Self, StoreError> {
        let path = path(data, job, number);
        let folder = folder(data, job);
        if !folder.exists() {
            std::fs::create_dir_all(&folder)?;
            crate::files::sync_folder(&data.join("jobs"))?;
        }
        let fresh = !path.exists();
        let file = OpenOptions::new().write(true).create(true).truncate(false).open(&path)?;
        // Should it be shorter, its reader finds the results damaged, and their units are rendered again.
        file.set_len(committed)?;
        if fresh {
            crate::files::sync_folder(&folder)?;
        }
        Ok(Self { file, committed, end: committed })
    }

    /// Bytes written.
    pub fn len(&self) -> u64 {
        self.end
    }

    /// Writes bytes at the end and says where they begin.
    pub fn append(&mut self, bytes: &[u8]) -> Result<u64, StoreError> {
        let place = self.end;
        self.file.write_all_at(bytes, place)?;
        self.end += bytes.len() as u64;
        Ok(place)
    }

    /// Makes what was written durable.
    pub fn sync(&self) -> Result<(), StoreError> {
        Ok(self.file.sync_data()?)
    }

    /// The database lists what was written.
    pub fn commit(&mut self) {
        self.committed = self.end;
    }

    /// What was written since the last commit is void.
    pub fn roll_back(&mut self) {
        self.end = self.committed;
        // Frees the space; should it fail, the next append overwrites what is there.
        let _ = self.file.set_len(self.committed);
    }
}

/// Reads stored results.
#[derive(Debug)]
pub struct SegmentReader {
    file: File,
    path: PathBuf,
}

impl SegmentReader {
    /// Opens a segment.
    pub fn open(path: &Path) -> Result<Self, StoreError> {
        let file = File::open(path).map_err(|e| StoreError::Fault(format!("{}: {e}", path.display())))?;
        Ok(Self { file, path: path.to_path_buf() })
    }

    /// A stored result, checked against its digest.
    pub fn read(&self, at: &StoredResult) -> Result<Vec<u8>, StoreError> {
        let fault = |what: String| StoreError::Fault(format!("{}, unit {}: {what}", self.path.display(), at.unit));
        let len = usize::try_from(at.len).map_err(|e| fault(e.to_string()))?;
        let mut bytes = vec![0; len];
        self.file.read_exact_at(&mut bytes, at.place).map_err(|e| fault(e.to_string()))?;
        if Digest::of(&bytes) != at.digest {
            return Err(fault("the stored result is damaged".into()));
        }
        Ok(bytes)
    }
}
