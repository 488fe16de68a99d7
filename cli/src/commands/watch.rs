//! `lightfarm watch`: follows a job to its end.

use crate::exit::{Failure, Outcome};
use crate::farm::watch::{verdict, watch};
use crate::farm::{Farm, JobArgs, view};
use crate::output::Console;
use crate::signals;
use renderer::job::Stop;

static STOP: Stop = Stop::new();

/// Runs it.
pub fn run(args: JobArgs, console: &Console) -> Outcome {
    signals::stop_on_interrupt(&STOP).map_err(|e| Failure::Machine(format!("error: {e}")))?;
    let farm = Farm::open(&args.farm)?;
    let status = watch(&farm, &args.id, console, || STOP.stopped())?;
    if !console.json {
        console.result(view::state_line(&status), &());
    }
    verdict(&status)
}
