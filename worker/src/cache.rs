//! Files of scenes on this machine's disk, by digest: `<first two hex digits>/<digest>`. Verified when they come and when they are read;
//! those not used for longest go first. Several workers may share a folder.

use renderer::scene::bundle::Digest;
use std::collections::BTreeSet;
use std::fs::File;
use std::io::{self, Write};
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::SystemTime;

/// The folder.
#[derive(Debug)]
pub struct Cache {
    folder: PathBuf,
    limit: u64,
    parts: AtomicU64,
}

/// A file that is coming in.
#[derive(Debug)]
pub struct Incoming {
    file: File,
    path: PathBuf,
    hasher: blake3::Hasher,
    len: u64,
    digest: Digest,
}

impl Incoming {
    /// Bytes that came.
    pub fn len(&self) -> u64 {
        self.len
    }

    /// Adds bytes.
    pub fn write(&mut self, bytes: &[u8]) -> io::Result<()> {
        self.file.write_all(bytes)?;
        self.hasher.update(bytes);
        self.len += bytes.len() as u64;
        Ok(())
    }
}

impl Drop for Incoming {
    fn drop(&mut self) {
        // After a rename there is nothing to remove.
        let _ = std::fs::remove_file(&self.path);
    }
}

impl Cache {
    /// Opens or makes the folder; it is kept below `limit` bytes.
    pub fn open(folder: &Path, limit: u64) -> io::Result<Self> {
        std::fs::create_dir_all(folder)?;
        Ok(Self { folder: folder.to_path_buf(), limit, parts: AtomicU64::new(0) })
    }

    fn path(&self, digest: Digest) -> PathBuf {
        let hex = digest.to_string();
        self.folder.join(&hex[..2]).join(hex)
    }

    /// Whether a file is there.
    pub fn has(&self, digest: Digest) -> bool {
        self.path(digest).is_file()
    }

    /// Reads a file and notes that it was used; one that is damaged is removed and counts as missing.
    pub fn read(&self, digest: Digest) -> io::Result<Vec<u8>> {
        let path = self.path(digest);
        let bytes = std::fs::read(&path)?;
        if Digest::of(&bytes) != digest {
            std::fs::remove_file(&path)?;
            return Err(io::Error::new(io::ErrorKind::NotFound, format!("{} was damaged", path.display())));
        }
        // Only the order of removal suffers where this is not allowed.
        let _ = File::options().append(true).open(&path).and_then(|f| f.set_modified(SystemTime::now()));
        Ok(bytes)
    }

    /// Begins to receive a file.
    pub fn receive(&self, digest: Digest) -> io::Result<Incoming> {
        let number = self.parts.fetch_add(1, Ordering::Relaxed);
        let path = self.folder.join(format!("part-{}-{number}", std::process::id()));
        let file = File::create(&path)?;
        Ok(Incoming { file, path, hasher: blake3::Hasher::new(), len: 0, digest })
    }

    /// Verifies a file that has come and puts it in its place; `false` when it is another one.
    pub fn keep(&self, incoming: Incoming) -> io::Result<bool> {
        if Digest(*incoming.hasher.finalize().as_bytes()) != incoming.digest {
            return Ok(false);
        }
        let path = self.path(incoming.digest);
        std::fs::create_dir_all(path.parent().unwrap_or(&self.folder))?;
        std::fs::rename(&incoming.path, path)?;
        Ok(true)
    }

    /// Removes what was not used for longest until the rest is below the limit; `needed` stays in any case.
    pub fn trim(&self, needed: &BTreeSet<Digest>) -> io::Result<()> {
        let mut files = Vec::new();
        for entry in std::fs::read_dir(&self.folder)?.flatten() {
            let Ok(inside) = std::fs::read_dir(entry.path()) else { continue };
            for file in inside.flatten() {
                let Ok(meta) = file.metadata() else { continue };
                let digest = file.file_name().into_string().ok().and_then(|n| Digest::try_from(n).ok());
                if let Some(digest) = digest {
                    files.push((meta.modified()?, meta.len(), digest));
                }
            }
        }
        let mut total: u64 = files.iter().map(|f| f.1).sum();
        files.sort();
        for (_, len, digest) in files {
            if total <= self.limit {
                break;
            }
            if !needed.contains(&digest) {
                std::fs::remove_file(self.path(digest))?;
                total -= len;
            }
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::time::Duration;

    fn put(cache: &Cache, bytes: &[u8]) -> Digest {
        let digest = Digest::of(bytes);
        let mut incoming = cache.receive(digest).unwrap();
        incoming.write(bytes).unwrap();
        assert!(cache.keep(incoming).unwrap());
        digest
    }

    #[test]
    fn keeps_what_is_right_and_drops_what_is_old() {
        let folder = tempfile::tempdir().unwrap();
        let cache = Cache::open(folder.path(), 250).unwrap();
        let digests: Vec<Digest> = (0..4u8).map(|n| put(&cache, &[n; 100])).collect();
        for (n, d) in digests.iter().enumerate() {
            let time = SystemTime::UNIX_EPOCH + Duration::from_secs(1000 + n as u64);
            File::options().append(true).open(cache.path(*d)).unwrap().set_modified(time).unwrap();
        }
        assert_eq!(cache.read(digests[0]).unwrap(), [0; 100]);
        cache.trim(&BTreeSet::from([digests[1]])).unwrap();
        let left: Vec<bool> = digests.iter().map(|d| cache.has(*d)).collect();
        assert_eq!(left, [true, true, false, false], "the first was just used, the second is needed");

        let mut wrong = cache.receive(Digest::of(b"right")).unwrap();
        wrong.write(b"wrong").unwrap();
        assert!(!cache.keep(wrong).unwrap() && !cache.has(Digest::of(b"right")));
        std::fs::write(cache.path(digests[0]), [7; 100]).unwrap();
        assert!(cache.read(digests[0]).is_err() && !cache.has(digests[0]));
        let parts = std::fs::read_dir(folder.path()).unwrap().flatten().filter(|e| e.path().is_file()).count();
        assert_eq!(parts, 0, "a part was left behind");
    }
}
