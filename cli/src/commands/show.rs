//! `lightfarm show`: all about one job.

use crate::exit::Outcome;
use crate::farm::{Farm, JobArgs, view};
use crate::output::Console;

/// Runs it.
pub fn run(args: JobArgs, console: &Console) -> Outcome {
    let farm = Farm::open(&args.farm)?;
    let detail = farm.call(|mut jobs| {
        let id = args.id.clone();
        async move { jobs.show(proto::JobRef { id }).await }
    })?;
    console.result(view::detail(&detail), &proto::json::detail(&detail));
    Ok(())
}
