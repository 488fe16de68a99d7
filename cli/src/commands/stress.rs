//! `lightfarm stress`: scenes and numbers at the ends of their ranges, row by row. For those who change or port the renderer.

use crate::exit::{Failure, Outcome};
use crate::output::Console;
use serde::Serialize;
use std::path::PathBuf;
use stress::{Effort, Options, Report};

/// What to run.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// Only rows with one of these words in their name
    #[arg(long, value_delimiter = ',', value_name = "NAME")]
    only: Vec<String>,
    /// Two minutes in place of the whole matrix
    #[arg(long)]
    quick: bool,
    /// Where the table goes, in Markdown
    #[arg(short, long, default_value = "stress.md", value_name = "FILE")]
    output: PathBuf,
    /// Render threads [default: all processors]
    #[arg(long, value_parser = clap::value_parser!(u16).range(1..))]
    threads: Option<u16>,
    /// Names the rows instead
    #[arg(long)]
    list: bool,
}

/// A row as a line of JSON.
#[derive(Serialize)]
struct Event<'a> {
    event: &'static str,
    #[serde(flatten)]
    row: &'a stress::Outcome,
}

/// Runs it.
pub fn run(args: Args, console: &Console) -> Outcome {
    let effort = if args.quick { Effort::Quick } else { Effort::Full };
    let threads = args.threads.map_or_else(|| std::thread::available_parallelism().map_or(1, usize::from), usize::from);
    let options = Options { effort, only: args.only, threads };
    let rows = options.rows().map_err(Failure::Usage)?;
    if args.list {
        for row in rows {
            console.result(
                format!("{:<14} {}", row.name, row.what),
                &serde_json::json!({"row": row.name, "what": row.what}),
            );
        }
        return Ok(());
    }
    if !console.json {
        console.result(Report::HEAD, &());
    }
    let report = stress::run(&rows, &options, &mut |row| console.result(row.line(), &Event { event: "row", row }));
    std::fs::write(&args.output, report.table())
        .map_err(|e| Failure::Machine(format!("error: {} can't be written: {e}", args.output.display())))?;
    let summary = report.summary();
    console.result(
        format!("\n{summary}"),
        &serde_json::json!({"event": "summary", "passed": report.passed, "text": summary}),
    );
    if report.passed { Ok(()) } else { Err(Failure::Input(format!("error: {summary}"))) }
}
