//! The subcommands: one file each, one line each in [`Command`] and its `match`.

mod diff;
mod info;
mod render;

use crate::exit::Outcome;
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
}

impl Command {
    /// Runs it to its end.
    pub fn run(self, console: &Console) -> Outcome {
        match self {
            Self::Render(args) => render::run(args, console),
            Self::Diff(args) => diff::run(args, console),
            Self::Info(args) => info::run(args, console),
        }
    }

    /// What is logged when `RUST_LOG` is not set: services say what they do, the others only what is wrong.
    pub fn default_log_level(&self) -> &'static str {
        match self {
            Self::Render(_) | Self::Diff(_) | Self::Info(_) => "warn",
        }
    }
}
