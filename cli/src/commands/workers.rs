//! `lightfarm workers`: lists the farm's workers.

use crate::exit::Outcome;
use crate::farm::{Farm, FarmArgs, view};
use crate::output::Console;

/// Which farm.
#[derive(Debug, clap::Args)]
pub struct Args {
    #[command(flatten)]
    farm: FarmArgs,
}

/// Runs it.
pub fn run(args: Args, console: &Console) -> Outcome {
    let farm = Farm::open(&args.farm)?;
    let list = farm.call(|mut jobs| async move { jobs.workers(proto::WorkersRequest {}).await })?.workers;
    let values: Vec<_> = list.iter().map(proto::json::worker).collect();
    console.result(view::workers(&list), &serde_json::json!({"workers": values}));
    Ok(())
}
