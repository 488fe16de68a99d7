//! The subcommands: one file each, one line each in [`Command`] and its `match`.

mod cancel;
mod coordinator;
mod diff;
mod fetch;
mod info;
mod jobs;
mod pause;
mod render;
mod resume;
mod show;
mod stress;
mod submit;
mod watch;
mod worker;
mod workers;

use crate::exit::Outcome;
use crate::farm::JobArgs;
use crate::output::Console;
use clap::Subcommand;

/// What to do.
#[derive(Debug, Subcommand)]
pub enum Command {
    /// Plan, render and merge in this process
    Render(render::Args),
    /// Compare a picture with a reference
    Diff(diff::Args),
    /// Show what a scene contains, what will be skipped, and all that is wrong with it
    Info(info::Args),
    /// Run a farm's coordinator: it plans, gives out work, merges and stores
    Coordinator(coordinator::Args),
    /// Work for a farm
    Worker(worker::Args),
    /// Hand a scene to a farm; prints the job's id
    Submit(submit::Args),
    /// List a farm's jobs
    Jobs(jobs::Args),
    /// Show all about one job
    Show(JobArgs),
    /// Follow a job to its end
    Watch(JobArgs),
    /// Bring a job's image here, also an unfinished one
    Fetch(fetch::Args),
    /// Stop a job; its units are called back
    Pause(JobArgs),
    /// Go on with a paused job
    Resume(JobArgs),
    /// End a job for good
    Cancel(JobArgs),
    /// List a farm's workers
    Workers(workers::Args),
    /// Test this build on scenes and numbers at the ends of their ranges
    #[command(hide = true)]
    Stress(stress::Args),
}

impl Command {
    /// Runs it to its end.
    pub fn run(self, console: &Console) -> Outcome {
        match self {
            Self::Render(args) => render::run(args, console),
            Self::Diff(args) => diff::run(args, console),
            Self::Info(args) => info::run(args, console),
            Self::Coordinator(args) => coordinator::run(args, console),
            Self::Worker(args) => worker::run(args, console),
            Self::Submit(args) => submit::run(args, console),
            Self::Jobs(args) => jobs::run(args, console),
            Self::Show(args) => show::run(args, console),
            Self::Watch(args) => watch::run(args, console),
            Self::Fetch(args) => fetch::run(args, console),
            Self::Pause(args) => pause::run(args, console),
            Self::Resume(args) => resume::run(args, console),
            Self::Cancel(args) => cancel::run(args, console),
            Self::Workers(args) => workers::run(args, console),
            Self::Stress(args) => stress::run(args, console),
        }
    }

    /// What is logged when `RUST_LOG` is not set: services say what they do, the others only what is wrong.
    pub fn default_log_level(&self) -> &'static str {
        match self {
            Self::Coordinator(_) | Self::Worker(_) => "info",
            _ => "warn",
        }
    }
}
