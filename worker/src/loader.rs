//! Gets passes ready: fetches their documents and scenes, and loads scenes. The last scenes stay in memory for the next jobs.

use crate::board::{Board, PassContext};
use crate::cache::Cache;
use crate::transfer::{FetchError, fetch};
use crate::{Line, convert};
use proto::FaultKind;
use proto::worker_service_client::WorkerServiceClient;
use renderer::job::document::PassDocument;
use renderer::scene::Scene;
use renderer::scene::bundle::{Digest, Manifest, MemorySource};
use std::collections::BTreeSet;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::Arc;
use std::thread::JoinHandle;
use std::time::{Duration, Instant};
use tokio::runtime::Handle;
use uuid::Uuid;

/// Scenes kept in memory.
const SCENES: usize = 2;
/// How often a file that is gone from the cache before it is read is fetched again.
const ATTEMPTS: usize = 3;
/// Waits between attempts to reach the coordinator.
const WAIT: Duration = Duration::from_secs(1);
/// How long reporting a fault may take.
const REPORT: Duration = Duration::from_secs(10);
/// The longest message of a fault, in characters.
const MESSAGE: usize = 8000;

/// Why a pass can't begin here.
enum Fault {
    /// It is not needed any longer, or the worker ends.
    Dropped,
    /// The scene: the same everywhere.
    Scene(String),
    /// This machine.
    Machine(String),
}

/// Starts the thread; it ends with the board.
pub fn start(
    board: &Arc<Board>,
    worker: Uuid,
    cache: Cache,
    line: Line,
    network: Handle,
) -> std::io::Result<JoinHandle<()>> {
    let loader = Loader { board: board.clone(), worker, cache, line, network, scenes: Vec::new() };
    std::thread::Builder::new().name("loader".into()).spawn(move || loader.run())
}

struct Loader {
    board: Arc<Board>,
    worker: Uuid,
    cache: Cache,
    line: Line,
    network: Handle,
    /// By manifest, the latest last.
    scenes: Vec<(Digest, Arc<Scene>)>,
}

impl Loader {
    fn run(mut self) {
        while let Some(document) = self.board.next_wanted() {
            let job = self.board.job_of(document);
            match self.prepare(document) {
                Ok(context) => self.board.set_ready(document, Arc::new(context)),
                Err(fault) => {
                    self.board.give_up(document);
                    if let Some(job) = job {
                        self.report(job, fault);
                    }
                }
            }
        }
    }

    fn prepare(&mut self, digest: Digest) -> Result<PassContext, Fault> {
        let json = self.blob(digest, digest)?;
        let document = PassDocument::from_json(&json).map_err(Fault::Machine)?;
        let scene = self.scene(digest, document.manifest)?;
        Ok(PassContext { scene, document })
    }

    /// The scene of a manifest: from memory, or loaded.
    fn scene(&mut self, document: Digest, digest: Digest) -> Result<Arc<Scene>, Fault> {
        if let Some(at) = self.scenes.iter().position(|(d, _)| *d == digest) {
            let entry = self.scenes.remove(at);
            let scene = entry.1.clone();
            self.scenes.push(entry);
            return Ok(scene);
        }
        let began = Instant::now();
        let json = self.blob(document, digest)?;
        let manifest: Manifest =
            serde_json::from_slice(&json).map_err(|e| Fault::Machine(format!("the scene's manifest: {e}")))?;
        let needed: BTreeSet<Digest> = manifest.files.iter().map(|f| f.digest).chain([digest, document]).collect();
        if let Err(e) = self.cache.trim(&needed) {
            tracing::warn!("the cache can't be trimmed: {e}");
        }
        let mut files = MemorySource::default();
        for f in &manifest.files {
            files.files.insert(f.path.clone(), self.blob(document, f.digest)?.into());
        }
        // Room is made before the new scene is built.
        self.scenes.drain(..self.scenes.len().saturating_sub(SCENES - 1));
        let loaded = catch_unwind(AssertUnwindSafe(|| Scene::load(&files, &manifest.root)));
        let (scene, _) = loaded
            .map_err(|_| Fault::Scene("loading it panicked; see the worker's log".into()))?
            .map_err(|e| Fault::Scene(e.to_string()))?;
        let scene = Arc::new(scene);
        self.scenes.push((digest, scene.clone()));
        tracing::info!(scene = manifest.root, seconds = began.elapsed().as_secs_f64(), "scene loaded");
        Ok(scene)
    }

    /// A file's content, fetched if need be. While the coordinator can't be reached and the pass is needed, it is tried again.
    fn blob(&self, document: Digest, digest: Digest) -> Result<Vec<u8>, Fault> {
        let mut last = String::new();
        for _ in 0..ATTEMPTS {
            loop {
                match self.network.block_on(fetch(&self.line, &self.cache, digest)) {
                    Ok(()) => break,
                    Err(FetchError::Network(status)) => {
                        tracing::debug!("blob {digest}: {}", status.message());
                        if !self.board.sleep(WAIT) || self.board.job_of(document).is_none() {
                            return Err(Fault::Dropped);
                        }
                    }
                    Err(e) => return Err(Fault::Machine(e.to_string())),
                }
            }
            match self.cache.read(digest) {
                Ok(bytes) => return Ok(bytes),
                Err(e) => last = e.to_string(),
            }
        }
        Err(Fault::Machine(format!("the cache: {last}")))
    }

    fn report(&self, job: Uuid, fault: Fault) {
        let (kind, message) = match fault {
            Fault::Dropped => return,
            Fault::Scene(m) => (FaultKind::Scene, m),
            Fault::Machine(m) => (FaultKind::Machine, m),
        };
        tracing::error!(job = %job, "a job can't begin here: {message}");
        let message = message.chars().take(MESSAGE).collect();
        let report = proto::FaultReport {
            worker_id: convert::id(self.worker),
            job: convert::id(job),
            kind: kind.into(),
            message,
        };
        let mut client = WorkerServiceClient::new(self.line.clone());
        // Should it get lost: the leases are given back, so the job comes again, and fails again.
        let call = async { tokio::time::timeout(REPORT, client.report_fault(report)).await };
        match self.network.block_on(call) {
            Ok(Ok(_)) => {}
            Ok(Err(status)) => tracing::warn!("the fault could not be reported: {}", status.message()),
            Err(_) => tracing::warn!("the fault could not be reported: the coordinator does not answer"),
        }
    }
}
