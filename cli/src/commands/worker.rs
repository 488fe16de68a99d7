//! `lightfarm worker`: fetches scenes, runs units and delivers results.

use crate::exit::{Failure, Outcome};
use crate::farm::{FarmArgs, default_cache};
use crate::options::ThreadArgs;
use crate::output::Console;
use crate::signals;
use renderer::job::Stop;
use std::path::PathBuf;
use worker::{Options, WorkerError};

/// How to work.
#[derive(Debug, clap::Args)]
pub struct Args {
    #[command(flatten)]
    farm: FarmArgs,
    /// Name shown to people [default: the host's name]
    #[arg(long, value_name = "NAME")]
    name: Option<String>,
    #[command(flatten)]
    threads: ThreadArgs,
    /// Folder for files of scenes [default: lightfarm in the user's cache folder]
    #[arg(long, value_name = "DIR")]
    cache: Option<PathBuf>,
    /// Size that the cache may have, in MiB
    #[arg(long, value_name = "N", default_value_t = 10_240)]
    cache_mib: u64,
}

static STOP: Stop = Stop::new();

/// Runs it.
pub fn run(args: Args, _: &Console) -> Outcome {
    signals::stop_on_interrupt(&STOP).map_err(|e| Failure::Machine(format!("error: {e}")))?;
    let options = Options {
        coordinator: args.farm.coordinator,
        name: args.name.unwrap_or_else(host_name),
        threads: args.threads.count(),
        cache: args.cache.unwrap_or_else(default_cache),
        cache_bytes: args.cache_mib.saturating_mul(1 << 20),
        token: args.farm.token,
    };
    worker::run(&options, &STOP).map_err(|e| match e {
        WorkerError::Address(_) | WorkerError::Token(_) => Failure::Usage(format!("error: {e}")),
        _ => Failure::Machine(format!("error: {e}")),
    })
}

/// The kernel's name of this host.
fn host_name() -> String {
    let name = std::fs::read_to_string("/proc/sys/kernel/hostname").unwrap_or_default();
    match name.trim() {
        "" => format!("worker-{}", std::process::id()),
        name => name.to_string(),
    }
}
