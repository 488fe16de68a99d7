//! `lightfarm resume`: goes on with a paused job.

use crate::exit::Outcome;
use crate::farm::{Farm, JobArgs, view};
use crate::output::Console;

/// Runs it.
pub fn run(args: JobArgs, console: &Console) -> Outcome {
    let farm = Farm::open(&args.farm)?;
    let status = farm.call(|mut jobs| {
        let id = args.id.clone();
        async move { jobs.resume(proto::JobRef { id }).await }
    })?;
    console.result(view::state_line(&status), &proto::json::job(&status));
    Ok(())
}
