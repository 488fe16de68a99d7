//! Figures: rays per second, samples per second, error against time, what the farm costs; whether integrators agree and
//! whether the errors that they tell are true. See `README.md` beside this crate.

mod ablation;
mod agree;
mod auto;
mod coverage;
mod error;
mod farm;
mod load;
mod meshes;
mod rays;
mod report;
mod samples;

use clap::{Parser, Subcommand};
use serde::Serialize;
use std::process::ExitCode;

#[derive(Debug, Parser)]
#[command(name = "bench", about = "Measures lightfarm")]
struct Cli {
    /// One JSON document on standard output instead of a table.
    #[arg(long, global = true)]
    json: bool,
    #[command(subcommand)]
    what: What,
}

#[derive(Debug, Subcommand)]
enum What {
    /// Rays per second of the acceleration structure, on one thread.
    Rays(rays::Args),
    /// Samples per second of whole renders.
    Samples(samples::Args),
    /// Error against time of integrators, compared.
    Error(error::Args),
    /// Error against time on many scenes, next to other renderers, and growth of cost: an HTML page.
    Report(report::Args),
    /// Two one-thread workers against one two-thread render.
    Farm(farm::Args),
    /// Error times cost of path, bdpt and mmlt, and whether `auto` chooses the best of them.
    Auto(auto::Args),
    /// What each skip saves, and what unused features cost.
    Ablation(ablation::Args),
    /// Whether all integrators render the same pictures; exit status 1 when they don't.
    Agree(agree::Args),
    /// Whether the errors that pictures tell of themselves are true; exit status 1 when they aren't.
    Coverage(coverage::Args),
}

fn main() -> ExitCode {
    let cli = Cli::parse();
    let figures = |text: String| (text, true);
    let result = match &cli.what {
        What::Rays(args) => rays::run(args).map(|r| figures(show(cli.json, &r, rays::table))),
        What::Samples(args) => samples::run(args).map(|r| figures(show(cli.json, &r, |r| samples::table(r)))),
        What::Error(args) => error::run(args).map(|r| figures(show(cli.json, &r, ToString::to_string))),
        What::Report(args) => report::run(args).map(figures),
        What::Farm(args) => farm::run(args).map(|r| figures(show(cli.json, &r, ToString::to_string))),
        What::Auto(args) => auto::run(args).map(|r| figures(show(cli.json, &r, ToString::to_string))),
        What::Ablation(args) => ablation::run(args).map(|r| figures(show(cli.json, &r, ToString::to_string))),
        What::Agree(args) => agree::run(args).map(|r| (show(cli.json, &r, agree::table), r.passed)),
        What::Coverage(args) => coverage::run(args).map(|r| (show(cli.json, &r, ToString::to_string), r.passed())),
    };
    match result {
        Ok((text, passed)) => {
            println!("{text}");
            if passed { ExitCode::SUCCESS } else { ExitCode::FAILURE }
        }
        Err(message) => {
            eprintln!("error: {message}");
            ExitCode::FAILURE
        }
    }
}

/// The report as a table or as JSON.
fn show<T: Serialize>(json: bool, report: &T, table: impl Fn(&T) -> String) -> String {
    if json {
        // A plain struct of numbers and names always serialises.
        serde_json::to_string_pretty(report).unwrap_or_default()
    } else {
        table(report)
    }
}
