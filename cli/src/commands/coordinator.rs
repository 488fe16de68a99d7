//! `lightfarm coordinator`: plans, leases, merges and stores.

use crate::exit::{Failure, Outcome};
use crate::output::Console;
use crate::signals;
use coordinator::{Config, Coordinator, ServeError};
use renderer::job::Stop;
use std::net::SocketAddr;
use std::path::PathBuf;
use std::time::Duration;

/// How to serve.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// Where workers and clients dial
    #[arg(long, value_name = "ADDR:PORT", default_value = "127.0.0.1:50051")]
    listen: SocketAddr,
    /// Folder for everything that must survive
    #[arg(long, value_name = "DIR", default_value = "lightfarm-data")]
    data: PathBuf,
    /// Serve a web page with jobs and workers, and metrics
    #[arg(long, value_name = "ADDR:PORT")]
    http: Option<SocketAddr>,
    /// Token that workers and clients must give; needed to listen beyond this machine
    #[arg(long, value_name = "TOKEN", env = "LIGHTFARM_TOKEN", hide_env_values = true)]
    token: Option<String>,
}

static STOP: Stop = Stop::new();
/// How often the stop flag is looked at.
const LOOK: Duration = Duration::from_millis(50);

/// Runs it.
pub fn run(args: Args, console: &Console) -> Outcome {
    let fault = |e: String| Failure::Machine(format!("error: {e}"));
    signals::stop_on_interrupt(&STOP).map_err(|e| fault(e.to_string()))?;
    let mut config = Config::new(args.listen, args.data);
    (config.http, config.token) = (args.http, args.token);
    let runtime = tokio::runtime::Builder::new_multi_thread().worker_threads(2).enable_all().build();
    let runtime = runtime.map_err(|e| fault(e.to_string()))?;
    let served = runtime.block_on(async {
        let coordinator = Coordinator::bind(&config).await?;
        let address = coordinator.address().map_err(|e| ServeError::Listen(config.listen, e))?;
        let http = coordinator.http_address();
        console.event(&serde_json::json!({"event": "listening", "address": address, "http": http}));
        tracing::info!("listening on {address}, data in {}", config.data.display());
        if let Some(http) = http {
            tracing::info!("web page on http://{http}/");
        }
        let stopped = async {
            while !STOP.stopped() {
                tokio::time::sleep(LOOK).await;
            }
        };
        coordinator.serve(stopped).await
    });
    // A download to a client that does not read must not keep the process.
    runtime.shutdown_timeout(Duration::from_secs(2));
    served.map_err(|e| match e {
        ServeError::NoToken(_) => Failure::Usage(format!("error: {e}")),
        _ => fault(e.to_string()),
    })
}
