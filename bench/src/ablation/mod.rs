//! What each skip saves: the same render with and without it. And what features cost that a scene has, but nothing in it uses.

mod count;
mod render;
mod skips;
mod table;
mod unused;

use crate::error::stats::{Interval, mean_without, positive};
use render::{Arm, Sample};
use serde::Serialize;
use skips::{SKIPS, Skip};

/// Renders with and without each skip.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// Names of skips [default: all]
    #[arg(long, value_delimiter = ',')]
    skips: Vec<String>,
    /// Another scene in place of each skip's own; instructions are not counted then
    #[arg(long)]
    scene: Option<String>,
    /// Processor seconds of a render, about
    #[arg(long, default_value_t = 1.0)]
    seconds: f64,
    /// Renders with and without
    #[arg(long, default_value_t = 6)]
    rounds: u32,
    /// Don't count instructions, which takes valgrind
    #[arg(long)]
    uncounted: bool,
    /// Runs one render and says nothing: what is counted
    #[arg(long, hide = true, value_name = "NAME:ARM:COUNT")]
    only: Option<String>,
}

/// A skip and what it saves. Ratios are those of the render without it to the render with it: above 1, it pays.
#[derive(Debug, Serialize)]
pub struct Row {
    name: &'static str,
    what: &'static str,
    scene: String,
    integrator: &'static str,
    /// Samples or mutations a pixel.
    count: u32,
    /// Instructions; `None` where they are not counted.
    instructions: Option<f64>,
    /// Processor seconds.
    seconds: Interval,
    /// Squared relative error after the same number of samples.
    error: Interval,
    /// Processor seconds to the same error.
    cost: Interval,
}

/// A feature that is there and not used.
#[derive(Debug, Serialize)]
pub struct Unused {
    name: &'static str,
    scene: &'static str,
    integrator: &'static str,
    /// Instructions of the render over those without the feature.
    instructions: f64,
}

/// Both tables.
#[derive(Debug, Serialize)]
pub struct Report {
    skips: Vec<Row>,
    unused: Vec<Unused>,
    /// Why instructions were not counted.
    note: Option<String>,
}

/// Runs the comparison.
pub fn run(args: &Args) -> Result<Report, String> {
    let mut report = Report { skips: Vec::new(), unused: Vec::new(), note: None };
    if let Some(only) = &args.only {
        count::counted(only)?;
        return Ok(report);
    }
    let counts = if args.uncounted || args.scene.is_some() {
        Err("instructions were not counted".into())
    } else {
        count::available()
    };
    report.note = counts.err();
    for skip in chosen(&args.skips)? {
        let row = row(skip, args, report.note.is_none())?;
        eprintln!("{}", table::line(&row));
        report.skips.push(row);
    }
    if report.note.is_none() && args.skips.is_empty() {
        report.unused = unused::rows()?;
    }
    Ok(report)
}

fn chosen(names: &[String]) -> Result<Vec<&'static Skip>, String> {
    if names.is_empty() {
        return Ok(SKIPS.iter().collect());
    }
    names.iter().map(|n| skips::find(n)).collect()
}

fn row(skip: &'static Skip, args: &Args, counted: bool) -> Result<Row, String> {
    let file = args.scene.as_deref().unwrap_or(skip.scene);
    let scene = |arm| render::scene(skip, file, arm);
    let (with, without) = (scene(Arm::With)?, scene(Arm::Without)?);
    let count = render::count_for(skip, &with, args.seconds)?;
    let mut samples: [Vec<Sample>; 2] = Default::default();
    for round in 0..args.rounds.max(2) {
        // Independent of each other, so that means of one are no part of the error of the other.
        let seed = 2 * u64::from(round);
        samples[0].push(render::render(skip, &with, Arm::With, count, seed + 2)?);
        samples[1].push(render::render(skip, &without, Arm::Without, count, seed + 3)?);
    }
    let seconds = samples.each_ref().map(|s| s.iter().map(|s| s.seconds).collect::<Vec<_>>());
    let error = |arm: usize, left_out| render::squared_error(&samples, arm, left_out);
    let time = |arm: usize, left_out| mean_without(&seconds[arm], left_out);
    let rounds = samples[0].len();
    let instructions = if counted { Some(count::ratio(skip, count)?) } else { None };
    Ok(Row {
        name: skip.name,
        what: skip.what,
        scene: file.into(),
        integrator: skip.integrator.name(),
        count,
        instructions,
        seconds: positive(rounds, |j| time(1, j) / time(0, j)),
        error: positive(rounds, |j| error(1, j) / error(0, j)),
        cost: positive(rounds, |j| time(1, j) * error(1, j) / (time(0, j) * error(0, j))),
    })
}

impl std::fmt::Display for Report {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        table::write(self, f)
    }
}
