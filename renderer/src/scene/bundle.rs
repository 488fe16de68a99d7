//! The files of a scene, by name and content: what a loader read is what a farm ships.

use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::io;
use std::path::{Component, Path, PathBuf};
use std::sync::{Arc, Mutex};

/// Where a loader gets its files: a disk, or the blobs of a bundle. Paths are relative to the scene's folder, with `/`.
pub trait FileSource: Sync {
    /// The whole file.
    fn read(&self, path: &str) -> io::Result<Arc<[u8]>>;
}

/// A digest of content or of a manifest: BLAKE3, lower-case hex in text.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(try_from = "String", into = "String")]
pub struct Digest(pub [u8; 32]);

impl Digest {
    /// The digest of `bytes`.
    pub fn of(bytes: &[u8]) -> Self {
        Self(*blake3::hash(bytes).as_bytes())
    }
}

impl std::fmt::Display for Digest {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        self.0.iter().try_for_each(|b| write!(f, "{b:02x}"))
    }
}

impl From<Digest> for String {
    fn from(d: Digest) -> Self {
        d.to_string()
    }
}

impl TryFrom<String> for Digest {
    type Error = String;
    fn try_from(s: String) -> Result<Self, String> {
        blake3::Hash::from_hex(&s)
            .map(|h| Self(*h.as_bytes()))
            .map_err(|e| format!("{s:?} is not a BLAKE3 digest: {e}"))
    }
}

/// One file of a bundle.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct BundleFile {
    /// As the loader asked for it.
    pub path: String,
    /// Of its content.
    pub digest: Digest,
    /// In bytes.
    pub len: u64,
}

/// The manifest of a scene: its main file and all files it uses, sorted by path.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Manifest {
    /// The scene file's path among `files`.
    pub root: String,
    /// Every file read.
    pub files: Vec<BundleFile>,
}

impl Manifest {
    /// The scene's digest: of the canonical JSON of this manifest.
    pub fn digest(&self) -> Digest {
        let mut hasher = blake3::Hasher::new();
        let mut field = |bytes: &[u8]| {
            hasher.update(&(bytes.len() as u64).to_le_bytes());
            hasher.update(bytes);
        };
        field(self.root.as_bytes());
        for f in &self.files {
            field(f.path.as_bytes());
            field(&f.digest.0);
        }
        Digest(*hasher.finalize().as_bytes())
    }
}

/// Reads from a folder and remembers what was read.
pub struct DiskSource {
    base: PathBuf,
    seen: Mutex<BTreeMap<String, Arc<[u8]>>>,
}

impl DiskSource {
    /// For the scene file at `scene`; returns the source and the scene's own path within it.
    pub fn for_scene(scene: &Path) -> io::Result<(Self, String)> {
        let name = scene.file_name().and_then(|n| n.to_str());
        let name = name
            .ok_or_else(|| io::Error::new(io::ErrorKind::InvalidInput, "not the path of a file with a UTF-8 name"))?;
        let base = scene.parent().unwrap_or(Path::new("")).to_path_buf();
        Ok((Self { base, seen: Mutex::default() }, name.to_string()))
    }

    /// The manifest of what was read so far, and the contents by digest.
    pub fn into_bundle(self, root: String) -> (Manifest, BTreeMap<Digest, Arc<[u8]>>) {
        let seen = self.seen.into_inner().unwrap_or_else(std::sync::PoisonError::into_inner);
        let mut blobs = BTreeMap::new();
        let files = seen
            .into_iter()
            .map(|(path, bytes)| {
                let digest = Digest::of(&bytes);
                let file = BundleFile { path, digest, len: bytes.len() as u64 };
                blobs.insert(digest, bytes);
                file
            })
            .collect();
        (Manifest { root, files }, blobs)
    }
}

impl FileSource for DiskSource {
    fn read(&self, path: &str) -> io::Result<Arc<[u8]>> {
        let mut seen = self.seen.lock().unwrap_or_else(std::sync::PoisonError::into_inner);
        if let Some(bytes) = seen.get(path) {
            return Ok(bytes.clone());
        }
        let full = self.base.join(path);
        if !std::fs::metadata(&full)?.is_file() {
            return Err(io::Error::new(io::ErrorKind::InvalidInput, "not a regular file"));
        }
        let bytes: Arc<[u8]> = std::fs::read(full)?.into();
        seen.insert(path.to_string(), bytes.clone());
        Ok(bytes)
    }
}

/// Files held in memory: a bundle on a worker, or a test's scene.
#[derive(Clone, Debug, Default)]
pub struct MemorySource {
    /// By path.
    pub files: BTreeMap<String, Arc<[u8]>>,
}

impl FileSource for MemorySource {
    fn read(&self, path: &str) -> io::Result<Arc<[u8]>> {
        self.files.get(path).cloned().ok_or_else(|| io::Error::new(io::ErrorKind::NotFound, "not in the bundle"))
    }
}

/// `relative` as written in the file `from`, as a path of the same source: joined, `.` and `..` resolved, with `/`.
pub fn resolve(from: &str, relative: &str) -> String {
    let relative = relative.replace('\\', "/");
    let joined = Path::new(from).parent().unwrap_or(Path::new("")).join(relative);
    let mut out: Vec<String> = Vec::new();
    let mut prefix = "";
    for c in joined.components() {
        match c {
            Component::ParentDir if out.last().is_some_and(|l| l != "..") => {
                out.pop();
            }
            Component::ParentDir => out.push("..".into()),
            Component::Normal(s) => out.push(s.to_string_lossy().into_owned()),
            Component::RootDir => prefix = "/",
            Component::CurDir | Component::Prefix(_) => {}
        }
    }
    format!("{prefix}{}", out.join("/"))
}
