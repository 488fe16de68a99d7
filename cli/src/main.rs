//! The `lightfarm` command. This file only parses; each subcommand is a file of `commands/`.

mod commands;
mod exit;
mod farm;
mod options;
mod output;
mod pictures;
mod preview;
mod progress;
mod save;
mod scene_file;
mod signals;

use clap::Parser;
use std::process::ExitCode;

/// Renders physically based images on one machine or on many.
#[derive(Debug, Parser)]
#[command(name = "lightfarm", version, max_term_width = 110, after_help = exit::HELP)]
struct Cli {
    /// One JSON object per line on standard output, for scripts
    #[arg(long, global = true)]
    json: bool,
    #[command(subcommand)]
    command: commands::Command,
}

fn main() -> ExitCode {
    let cli = Cli::parse();
    output::start_log(cli.command.default_log_level());
    let console = output::Console::new(cli.json);
    match cli.command.run(&console) {
        Ok(()) => ExitCode::SUCCESS,
        Err(failure) => {
            console.failure(&failure);
            ExitCode::from(failure.status())
        }
    }
}
