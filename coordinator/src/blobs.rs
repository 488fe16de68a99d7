//! Content-addressed files: `cas/<first two hex digits>/<digest>`. A file is there completely and verified, or not at all.

use crate::files::{move_durably, sync_folder, write_durably};
use renderer::scene::bundle::Digest;
use std::collections::BTreeSet;
use std::fs::{File, OpenOptions};
use std::io::{self, Read, Write};
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::{Duration, SystemTime};

/// The largest blob: 64 GiB.
pub const MAX_BLOB: u64 = 64 << 30;
/// Parts of uploads that nobody went on with for so long are removed at the start.
const STALE: Duration = Duration::from_secs(24 * 3600);

/// Why an upload can't go on.
#[derive(Debug, thiserror::Error)]
pub enum UploadError {
    /// Somebody else uploads the same blob.
    #[error("blob {0} is being uploaded by another client; try again")]
    Busy(Digest),
    /// Larger than any blob may be.
    #[error("a blob of {0} bytes is too large; at most {MAX_BLOB} are taken")]
    TooLarge(u64),
    /// The part that is here ends elsewhere.
    #[error("the upload goes on at byte {asked}, but {have} bytes are here; ask again what is missing")]
    Offset {
        /// Where the client wants to go on.
        asked: u64,
        /// What is here.
        have: u64,
    },
    /// More or fewer bytes than announced, or others.
    #[error("the bytes that came are not those of blob {0}; upload it again from the start")]
    Content(Digest),
    /// The disk.
    #[error(transparent)]
    Io(#[from] io::Error),
}

/// The blobs of a data folder.
#[derive(Clone, Debug)]
pub struct Blobs {
    folder: PathBuf,
    uploading: Arc<Mutex<BTreeSet<Digest>>>,
}

impl Blobs {
    /// Opens or makes the folder.
    pub fn open(data: &Path) -> io::Result<Self> {
        let folder = data.join("cas");
        std::fs::create_dir_all(folder.join("parts"))?;
        for part in std::fs::read_dir(folder.join("parts"))?.flatten() {
            let age =
                part.metadata().and_then(|m| m.modified()).ok().and_then(|t| SystemTime::now().duration_since(t).ok());
            if age.is_none_or(|a| a > STALE) {
                let _ = std::fs::remove_file(part.path());
            }
        }
        Ok(Self { folder, uploading: Arc::default() })
    }

    fn path(&self, digest: Digest) -> PathBuf {
        let hex = digest.to_string();
        self.folder.join(&hex[..2]).join(hex)
    }

    fn part_path(&self, digest: Digest) -> PathBuf {
        self.folder.join("parts").join(digest.to_string())
    }

    /// The length of a blob that is here.
    pub fn len_of(&self, digest: Digest) -> Option<u64> {
        std::fs::metadata(self.path(digest)).ok().filter(|m| m.is_file()).map(|m| m.len())
    }

    /// How many bytes of a blob are here from an upload that was cut.
    pub fn part_len(&self, digest: Digest) -> u64 {
        std::fs::metadata(self.part_path(digest)).map_or(0, |m| m.len())
    }

    /// Opens a blob for reading.
    pub fn open_blob(&self, digest: Digest) -> io::Result<File> {
        File::open(self.path(digest))
    }

    /// Reads a small blob and verifies it.
    pub fn read(&self, digest: Digest, most: u64) -> io::Result<Vec<u8>> {
        let mut bytes = Vec::new();
        self.open_blob(digest)?.take(most + 1).read_to_end(&mut bytes)?;
        if bytes.len() as u64 > most {
            return Err(io::Error::new(
                io::ErrorKind::FileTooLarge,
                format!("blob {digest} is longer than {most} bytes"),
            ));
        }
        if Digest::of(&bytes) != digest {
            return Err(io::Error::new(io::ErrorKind::InvalidData, format!("blob {digest} is damaged")));
        }
        Ok(bytes)
    }

    /// Stores bytes made here.
    pub fn put(&self, bytes: &[u8]) -> io::Result<Digest> {
        let digest = Digest::of(bytes);
        if self.len_of(digest) != Some(bytes.len() as u64) {
            let path = self.path(digest);
            self.make_parent(&path)?;
            write_durably(&path, |f| f.write_all(bytes))?;
        }
        Ok(digest)
    }

    fn make_parent(&self, path: &Path) -> io::Result<()> {
        if let Some(parent) = path.parent().filter(|p| !p.exists()) {
            std::fs::create_dir_all(parent)?;
            sync_folder(&self.folder)?;
        }
        Ok(())
    }

    /// Begins an upload of `len` bytes, or goes on with one at `offset`.
    pub fn upload(&self, digest: Digest, len: u64, offset: u64) -> Result<Upload, UploadError> {
        if len > MAX_BLOB {
            return Err(UploadError::TooLarge(len));
        }
        if !self.lock().insert(digest) {
            return Err(UploadError::Busy(digest));
        }
        let turn = Turn { blobs: self.clone(), digest };
        let part = self.part_path(digest);
        let mut options = OpenOptions::new();
        let mut file = options.read(true).write(true).create(true).truncate(offset == 0).open(part)?;
        let have = file.metadata()?.len();
        if have != offset || offset > len {
            return Err(UploadError::Offset { asked: offset, have });
        }
        // Reading what is here leaves the file at its end.
        let mut hasher = blake3::Hasher::new();
        hasher.update_reader(&mut file)?;
        Ok(Upload { turn, file, hasher, at: offset, len })
    }

    fn lock(&self) -> std::sync::MutexGuard<'_, BTreeSet<Digest>> {
        self.uploading.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// The right to write one blob's part.
#[derive(Debug)]
struct Turn {
    blobs: Blobs,
    digest: Digest,
}

impl Drop for Turn {
    fn drop(&mut self) {
        self.blobs.lock().remove(&self.digest);
    }
}

/// An upload under way; dropped unfinished it leaves its part to go on with.
#[derive(Debug)]
pub struct Upload {
    turn: Turn,
    file: File,
    hasher: blake3::Hasher,
    at: u64,
    len: u64,
}

impl Upload {
    /// Adds bytes.
    pub fn write(&mut self, bytes: &[u8]) -> Result<(), UploadError> {
        self.at += bytes.len() as u64;
        if self.at > self.len {
            return self.refuse();
        }
        self.hasher.update(bytes);
        Ok(self.file.write_all(bytes)?)
    }

    /// Verifies the whole and puts it in its place.
    pub fn finish(mut self) -> Result<(), UploadError> {
        let digest = self.turn.digest;
        if self.at < self.len || Digest(*self.hasher.finalize().as_bytes()) != digest {
            return self.refuse();
        }
        self.file.sync_all()?;
        let (blobs, path) = (&self.turn.blobs, self.turn.blobs.path(digest));
        blobs.make_parent(&path)?;
        Ok(move_durably(&blobs.part_path(digest), &path)?)
    }

    fn refuse(&mut self) -> Result<(), UploadError> {
        let _ = std::fs::remove_file(self.turn.blobs.part_path(self.turn.digest));
        Err(UploadError::Content(self.turn.digest))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_cut_upload_goes_on_and_a_wrong_one_is_refused() {
        let folder = tempfile::tempdir().unwrap();
        let blobs = Blobs::open(folder.path()).unwrap();
        let bytes: Vec<u8> = (0..100_000u32).flat_map(u32::to_le_bytes).collect();
        let (digest, len) = (Digest::of(&bytes), bytes.len() as u64);

        let mut cut = blobs.upload(digest, len, 0).unwrap();
        cut.write(&bytes[..1000]).unwrap();
        assert!(matches!(blobs.upload(digest, len, 0), Err(UploadError::Busy(_))));
        drop(cut);
        assert_eq!((blobs.part_len(digest), blobs.len_of(digest)), (1000, None));
        assert!(matches!(blobs.upload(digest, len, 999), Err(UploadError::Offset { have: 1000, .. })));
        let mut rest = blobs.upload(digest, len, 1000).unwrap();
        rest.write(&bytes[1000..]).unwrap();
        rest.finish().unwrap();
        assert_eq!((blobs.part_len(digest), blobs.len_of(digest)), (0, Some(len)));
        assert_eq!(blobs.read(digest, len).unwrap(), bytes);
        assert!(blobs.read(digest, len - 1).is_err());

        let other = Digest::of(b"other");
        let mut wrong = blobs.upload(other, 5, 0).unwrap();
        wrong.write(b"wrong").unwrap();
        assert!(matches!(wrong.finish(), Err(UploadError::Content(_))));
        assert_eq!((blobs.part_len(other), blobs.len_of(other)), (0, None));
        let mut long = blobs.upload(other, 5, 0).unwrap();
        assert!(matches!(long.write(b"too long"), Err(UploadError::Content(_))));
        drop(long);
        assert!(matches!(blobs.upload(other, MAX_BLOB + 1, 0), Err(UploadError::TooLarge(_))));
        let mut right = blobs.upload(other, 5, 0).unwrap();
        right.write(b"other").unwrap();
        right.finish().unwrap();
        assert_eq!(blobs.put(b"other").unwrap(), other);
    }
}
