//! Talking to a coordinator.

pub mod picture;
pub mod upload;
pub mod view;
pub mod watch;

use crate::exit::Failure;
use clap::Args;
use proto::connect::{Credentials, channel};
use proto::job_service_client::JobServiceClient;
use std::path::PathBuf;
use std::time::Duration;
use tokio::runtime::Runtime;
use tonic::codegen::InterceptedService;
use tonic::transport::Channel;
use tonic::{Code, Status};

/// A channel that says who calls.
pub type Line = InterceptedService<Channel, Credentials>;

/// How long a coordinator that can't be reached (one that restarts, say) is tried again.
const PATIENCE: Duration = Duration::from_secs(60);
const WAIT: Duration = Duration::from_millis(500);
/// How long a short call may take.
const CALL: Duration = Duration::from_secs(120);

/// Which farm.
#[derive(Clone, Debug, Args)]
#[command(next_help_heading = "Farm")]
pub struct FarmArgs {
    /// Address of the coordinator
    #[arg(long, value_name = "URL", env = "LIGHTFARM_COORDINATOR")]
    pub coordinator: String,
    /// Token that the coordinator asks for
    #[arg(long, value_name = "TOKEN", env = "LIGHTFARM_TOKEN", hide_env_values = true)]
    pub token: Option<String>,
}

/// A farm, and one of its jobs.
#[derive(Clone, Debug, Args)]
pub struct JobArgs {
    /// The job's id, or the first digits of it
    #[arg(value_name = "ID")]
    pub id: String,
    #[command(flatten)]
    pub farm: FarmArgs,
}

/// A connection to a coordinator, with a runtime to use it from plain code.
pub struct Farm {
    runtime: Runtime,
    line: Line,
}

impl Farm {
    /// Gets ready; nothing is sent yet.
    pub fn open(args: &FarmArgs) -> Result<Self, Failure> {
        let fault = |e: std::io::Error| Failure::Machine(format!("error: no runtime: {e}"));
        let runtime =
            tokio::runtime::Builder::new_multi_thread().worker_threads(1).enable_all().build().map_err(fault)?;
        let usage = |e: String| Failure::Usage(format!("error: {e}"));
        let token = args.token.as_deref().filter(|t| !t.is_empty());
        let credentials = Credentials::new(token).map_err(|e| usage(e.to_string()))?;
        let line = {
            let _context = runtime.enter();
            InterceptedService::new(channel(&args.coordinator).map_err(|e| usage(e.to_string()))?, credentials)
        };
        Ok(Self { runtime, line })
    }

    /// The channel.
    pub fn line(&self) -> Line {
        self.line.clone()
    }

    /// The calls of clients.
    pub fn jobs(&self) -> JobServiceClient<Line> {
        JobServiceClient::new(self.line())
    }

    /// Runs to the end.
    pub fn block_on<T>(&self, work: impl Future<Output = T>) -> T {
        self.runtime.block_on(work)
    }

    /// A short call, tried again while the coordinator can't be reached. The call must bear being made twice.
    pub fn call<T, F>(&self, attempt: impl Fn(JobServiceClient<Line>) -> F) -> Result<T, Failure>
    where
        F: Future<Output = Result<tonic::Response<T>, Status>>,
    {
        let work = persist(|| async {
            let late = |_| Status::deadline_exceeded("the coordinator does not answer");
            tokio::time::timeout(CALL, attempt(self.jobs())).await.map_err(late)?
        });
        self.block_on(work).map(tonic::Response::into_inner).map_err(|s| failure(&s))
    }
}

/// Tries again while the coordinator can't be reached.
pub async fn persist<T, F>(mut attempt: impl FnMut() -> F) -> Result<T, Status>
where
    F: Future<Output = Result<T, Status>>,
{
    let began = tokio::time::Instant::now();
    let mut said = false;
    loop {
        match attempt().await {
            Err(status) if status.code() == Code::Unavailable && began.elapsed() < PATIENCE => {
                if !said {
                    tracing::warn!("the coordinator can't be reached, trying again: {}", status.message());
                    said = true;
                }
                tokio::time::sleep(WAIT).await;
            }
            other => return other,
        }
    }
}

/// What a status means for the exit status.
pub fn failure(status: &Status) -> Failure {
    let message = format!("error: {}", status.message());
    match status.code() {
        Code::NotFound | Code::InvalidArgument | Code::AlreadyExists => Failure::Input(message),
        Code::Unavailable => Failure::Machine(format!("error: the coordinator can't be reached: {}", status.message())),
        _ => Failure::Machine(message),
    }
}

/// Where a worker keeps files of scenes, unless told otherwise: the user's cache folder.
pub fn default_cache() -> PathBuf {
    let from = |key: &str| std::env::var_os(key).filter(|v| !v.is_empty()).map(PathBuf::from);
    let base = from("XDG_CACHE_HOME").or_else(|| from("HOME").map(|h| h.join(".cache")));
    base.unwrap_or_else(std::env::temp_dir).join("lightfarm")
}
