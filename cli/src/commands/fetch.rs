//! `lightfarm fetch`: brings a job's image here, also an unfinished one.

use crate::exit::Outcome;
use crate::farm::picture::{self, Fetched};
use crate::farm::view::{samples, state_line};
use crate::farm::{Farm, JobArgs};
use crate::options::OutputArgs;
use crate::output::Console;

/// Which image, and where to.
#[derive(Debug, clap::Args)]
pub struct Args {
    #[command(flatten)]
    job: JobArgs,
    #[command(flatten)]
    output: OutputArgs,
}

/// Runs it.
pub fn run(args: Args, console: &Console) -> Outcome {
    let farm = Farm::open(&args.job.farm)?;
    save(&picture::fetch(&farm, &args.job.id)?, &args.output, console)
}

/// Saves what was fetched and says what it is.
pub fn save(image: &Fetched, output: &OutputArgs, console: &Console) -> Outcome {
    let s = &image.status;
    if !image.complete {
        console.note(format!("note: this is not the final image: {}", state_line(s)));
    }
    if s.non_finite + s.negative > 0 {
        let (bad, negative) = (s.non_finite, s.negative);
        console.note(format!("warning: contributions were dropped: {bad} not finite, {negative} negative"));
    }
    let (exr, png, failure) = picture::write(image, output)?;
    let mut value = proto::json::job(s);
    value["event"] = "fetched".into();
    value["complete"] = image.complete.into();
    value["exr"] = exr.display().to_string().into();
    value["png"] = png.display().to_string().into();
    let text =
        format!("{} x {} pixels, {} per pixel\n{}\n{}", s.width, s.height, samples(s), exr.display(), png.display());
    console.result(text, &value);
    failure.map_or(Ok(()), Err)
}
