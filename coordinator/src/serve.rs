//! Starting and ending a coordinator.

use crate::blobs::Blobs;
use crate::farm::{Farm, Tuning};
use crate::grpc::{self, Guard, Linked, Token};
use crate::hub::Hub;
use crate::job::ActiveClock;
use crate::merge::MergeQueue;
use crate::store::{Store, StoreError};
use proto::connect::{CONNECTION_WINDOW, KEEP_ALIVE, KEEP_ALIVE_TIMEOUT, STREAM_WINDOW};
use std::io;
use std::net::SocketAddr;
use std::path::PathBuf;
use std::sync::Arc;
use tokio::net::TcpListener;
use tokio_stream::StreamExt;
use tonic::transport::Server;
use tonic::transport::server::TcpIncoming;

/// How a coordinator is set up.
#[derive(Clone, Debug)]
pub struct Config {
    /// Where workers and clients dial.
    pub listen: SocketAddr,
    /// The data folder.
    pub data: PathBuf,
    /// Where the web page and the metrics are, if anywhere.
    pub http: Option<SocketAddr>,
    /// The shared token.
    pub token: Option<String>,
    /// Times that the scheduler goes by.
    pub tuning: Tuning,
    /// What workers must have in common with this coordinator.
    pub fingerprint: String,
    /// The merge of a job is saved, and the results in it freed, when these are so many bytes.
    pub checkpoint_bytes: u64,
}

impl Config {
    /// With the usual tuning, for workers of this build.
    pub fn new(listen: SocketAddr, data: PathBuf) -> Self {
        let fingerprint = renderer::FINGERPRINT.to_string();
        let tuning = Tuning::default();
        Self { listen, data, http: None, token: None, tuning, fingerprint, checkpoint_bytes: 256 << 20 }
    }
}

/// Why a coordinator can't serve.
#[derive(Debug, thiserror::Error)]
pub enum ServeError {
    /// Open to a network without a token.
    #[error(
        "{0} can be reached from other machines, so a token is needed: set LIGHTFARM_TOKEN (the same for workers and clients)"
    )]
    NoToken(SocketAddr),
    /// The address.
    #[error("can't listen on {0}: {1}")]
    Listen(SocketAddr, io::Error),
    /// The data folder.
    #[error(transparent)]
    Store(#[from] StoreError),
    /// Threads or sockets.
    #[error("the coordinator can't run: {0}")]
    Run(String),
}

/// A coordinator that listens but does not serve yet.
pub struct Coordinator {
    pub(crate) hub: Arc<Hub>,
    listener: TcpListener,
    http: Option<TcpListener>,
    token: Option<Token>,
    _store: crate::store::StoreGuard,
}

impl Coordinator {
    /// Opens the data folder and the sockets.
    pub async fn bind(config: &Config) -> Result<Self, ServeError> {
        for address in std::iter::once(config.listen).chain(config.http) {
            if !address.ip().is_loopback() && config.token.as_deref().is_none_or(str::is_empty) {
                return Err(ServeError::NoToken(address));
            }
        }
        let (store, guard, restored) = Store::open(&config.data)?;
        let blobs = Blobs::open(&config.data).map_err(StoreError::from)?;
        let listener = listen(config.listen).await?;
        let http = match config.http {
            Some(address) => Some(listen(address).await?),
            None => None,
        };
        let (queue, inbox) = MergeQueue::new();
        let hub = Arc::new(Hub::new(config, restored.generation, store, blobs, queue));
        inbox.start(&hub).map_err(|e| ServeError::Run(e.to_string()))?;
        for stored in restored.jobs {
            let mut job = Farm::new_job(stored.id, stored.spec, stored.state);
            job.message = stored.message;
            job.progress = stored.progress;
            job.clock = ActiveClock::from_total(stored.elapsed);
            let (id, spec, checkpoint) = (job.id, job.spec.clone(), stored.checkpoint);
            let ended = job.state.ended();
            hub.with(|farm, _| farm.add_job(job));
            if !ended {
                tracing::info!(job = %id, name = spec.name, "taken up again");
                hub.merge.start(id, spec, checkpoint);
            }
        }
        let token = config.token.as_deref().filter(|t| !t.is_empty()).map(Token::new);
        Ok(Self { hub, listener, http, token, _store: guard })
    }

    /// Where it listens.
    pub fn address(&self) -> io::Result<SocketAddr> {
        self.listener.local_addr()
    }

    /// Where the web page is.
    pub fn http_address(&self) -> Option<SocketAddr> {
        self.http.as_ref().and_then(|h| h.local_addr().ok())
    }

    /// Serves until `end`.
    pub async fn serve(self, end: impl Future<Output = ()>) -> Result<(), ServeError> {
        let guard = Guard::new(self.token.clone());
        let hub = self.hub.clone();
        let incoming = TcpIncoming::from(self.listener).with_nodelay(Some(true));
        let incoming = incoming.map(move |stream| stream.map(|s| Linked::new(s, hub.clone())));
        let server = Server::builder()
            .initial_stream_window_size(STREAM_WINDOW)
            .initial_connection_window_size(CONNECTION_WINDOW)
            .http2_keepalive_interval(Some(KEEP_ALIVE))
            .http2_keepalive_timeout(Some(KEEP_ALIVE_TIMEOUT))
            .max_concurrent_streams(256)
            .tcp_nodelay(true)
            .add_routes(grpc::routes(&self.hub, &guard))
            .serve_with_incoming(incoming);
        let time = self.hub.keep_time();
        let router = crate::http::router(&self.hub, self.token);
        let http = async {
            match self.http {
                Some(listener) => axum::serve(listener, router).await,
                None => std::future::pending().await,
            }
        };
        // What is confirmed is durable, so there is nothing to wind down: waiting calls are cut, and their callers call again.
        tokio::select! {
            served = server => served.map_err(|e| ServeError::Run(e.to_string())),
            served = http => served.map_err(|e| ServeError::Run(e.to_string())),
            () = time => Ok(()),
            () = end => Ok(()),
        }
    }
}

async fn listen(address: SocketAddr) -> Result<TcpListener, ServeError> {
    TcpListener::bind(address).await.map_err(|e| ServeError::Listen(address, e))
}
