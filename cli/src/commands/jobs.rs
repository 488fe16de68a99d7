//! `lightfarm jobs`: lists the farm's jobs.

use crate::exit::Outcome;
use crate::farm::{Farm, FarmArgs, view};
use crate::output::Console;

/// Which farm.
#[derive(Debug, clap::Args)]
pub struct Args {
    #[command(flatten)]
    farm: FarmArgs,
    /// Show at most so many, the newest
    #[arg(long, value_name = "N", default_value_t = 200)]
    limit: u32,
}

/// Runs it.
pub fn run(args: Args, console: &Console) -> Outcome {
    let farm = Farm::open(&args.farm)?;
    let limit = args.limit.max(1);
    let list = farm.call(|mut jobs| async move { jobs.list(proto::ListRequest { limit }).await })?;
    let values: Vec<_> = list.jobs.iter().map(proto::json::job).collect();
    console.result(view::jobs(&list.jobs), &serde_json::json!({"jobs": values, "total": list.total}));
    if list.total as usize > list.jobs.len() {
        console.note(format!("{} of {} jobs; --limit shows more", list.jobs.len(), list.total));
    }
    Ok(())
}
