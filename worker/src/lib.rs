//! A worker: dials the coordinator, fetches scenes, runs units, delivers results.
//!
//! Heartbeats have a thread of their own, transfers another, loading scenes a third; units are rendered on compute threads that never
//! touch the network. What they share is the [`board`].

mod board;
mod cache;
mod convert;
mod delivery;
mod loader;
mod pool;
mod session;
mod transfer;

use board::Board;
use cache::Cache;
use proto::connect::{AddressError, Credentials, TokenError, channel};
use renderer::job::Stop;
use std::io;
use std::path::PathBuf;
use std::sync::Arc;
use std::thread::JoinHandle;
use tonic::codegen::InterceptedService;
use tonic::transport::Channel;
use uuid::Uuid;

/// A channel that says who calls.
pub(crate) type Line = InterceptedService<Channel, Credentials>;

/// How a worker is set up.
#[derive(Clone, Debug)]
pub struct Options {
    /// The coordinator's address, `http://HOST:PORT`.
    pub coordinator: String,
    /// Its name, for people.
    pub name: String,
    /// Compute threads.
    pub threads: usize,
    /// Folder for files of scenes.
    pub cache: PathBuf,
    /// Bytes that the folder may hold, apart from what the scene in use needs.
    pub cache_bytes: u64,
    /// The shared token.
    pub token: Option<String>,
}

/// Why a worker ended before it was asked to.
#[derive(Debug, thiserror::Error)]
pub enum WorkerError {
    /// The address.
    #[error(transparent)]
    Address(#[from] AddressError),
    /// The token.
    #[error(transparent)]
    Token(#[from] TokenError),
    /// The coordinator does not want it: its version or its token.
    #[error("the coordinator refuses this worker: {0}")]
    Refused(String),
    /// Draining, but nobody takes the last results.
    #[error(
        "the coordinator can't be reached, so {0} finished units could not be delivered; they will be rendered again"
    )]
    Undelivered(usize),
    /// The cache folder.
    #[error("the cache folder {0} can't be used: {1}")]
    Cache(PathBuf, io::Error),
    /// Threads or sockets.
    #[error("the worker can't run: {0}")]
    Run(#[from] io::Error),
}

/// Works until `drain` is stopped: then finishes what is running, delivers it, gives the rest back and returns.
pub fn run(options: &Options, drain: &Stop) -> Result<(), WorkerError> {
    let cache =
        Cache::open(&options.cache, options.cache_bytes).map_err(|e| WorkerError::Cache(options.cache.clone(), e))?;
    let credentials = Credentials::new(options.token.as_deref().filter(|t| !t.is_empty()))?;
    let board = Arc::new(Board::default());
    let id = Uuid::new_v4();

    // Two connections: heartbeats don't queue behind bulk data.
    let bulk =
        tokio::runtime::Builder::new_multi_thread().worker_threads(1).thread_name("transfer").enable_all().build()?;
    let line = {
        let _context = bulk.enter();
        InterceptedService::new(channel(&options.coordinator)?, credentials.clone())
    };
    bulk.spawn(delivery::deliver(board.clone(), id, line.clone()));
    let mut threads = pool::start(&board, options.threads)?;
    threads.push(loader::start(&board, id, cache, line, bulk.handle().clone())?);

    tracing::info!(name = options.name, threads = options.threads, "worker for {}", options.coordinator);
    let control = tokio::runtime::Builder::new_current_thread().enable_all().build()?;
    let ended = control.block_on(session::keep(options, id, &board, credentials, drain));
    board.quit();
    threads.into_iter().for_each(join);
    bulk.shutdown_background();
    ended
}

fn join(thread: JoinHandle<()>) {
    if thread.join().is_err() {
        tracing::error!("a thread of the worker panicked");
    }
}
