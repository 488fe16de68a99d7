//! Error against time on many scenes, next to other renderers, and how cost grows: one HTML page and one JSON file.

mod document;
mod equal;
mod evaluate;
mod external;
pub mod growth;
mod measure;
mod page;
mod picture;
mod picture_file;
mod scene;
mod truth;

use crate::error::process;
use crate::load;
use document::{About, Document, SceneReport};
use external::External;
use measure::{Clock, Contender, Maker, Stage};
use scene::{BenchScene, Budget};
use std::path::{Path, PathBuf};
use std::time::Instant;

/// Measures error against time on scenes, next to other renderers, and writes a page.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// Scenes by name or file; `none` for growth of cost alone [default: those of the budget].
    #[arg(long, value_delimiter = ',', value_name = "NAME,...")]
    scenes: Vec<String>,
    /// Integrators of lightfarm, such as `path`, `mmlt:plain` [default: those of the scene].
    #[arg(long, value_delimiter = ';', value_name = "KIND[:OPTION,...];...")]
    integrators: Vec<String>,
    /// How much is measured.
    #[arg(long, value_enum, default_value_t = Budget::Quick)]
    budget: Budget,
    /// The TOML file of another renderer; may be given many times.
    #[arg(long, value_name = "RENDERER.toml")]
    with: Vec<PathBuf>,
    /// The folder of the report.
    #[arg(short, long, value_name = "FOLDER", default_value = "out/report")]
    output: PathBuf,
    /// Where references are stored [default: `references` in the report's folder].
    #[arg(long, value_name = "FOLDER")]
    references: Option<PathBuf>,
    /// Keeps what the folder's report holds of other scenes and other growth.
    #[arg(long)]
    append: bool,
    /// What growth of cost is measured by: threads, workers, resolution, triangles, lights, depth, or none.
    #[arg(long, value_delimiter = ',', value_name = "NAME,...")]
    growth: Option<Vec<String>>,
    /// Renders of each checkpoint [default: the budget's].
    #[arg(long, value_parser = clap::value_parser!(u32).range(2..=1000))]
    rounds: Option<u32>,
    /// Size of all pictures [default: the scene's in the list].
    #[arg(long, value_name = "WxH", value_parser = crate::error::size)]
    size: Option<(u32, u32)>,
    /// What times are: of the wall, or of the processors over the number of threads, which tells less of what else the machine does.
    #[arg(long, value_enum, default_value_t = Clock::Wall)]
    clock: Clock,
    /// The first seed.
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// Render threads.
    #[arg(long, default_value_t = 2)]
    threads: usize,
}

/// Runs the benchmark; what it tells at the end.
pub fn run(args: &Args) -> Result<String, String> {
    let others: Vec<External> = args.with.iter().map(|p| External::read(p)).collect::<Result<_, _>>()?;
    let json = args.output.join("report.json");
    let mut document = if args.append { read(&json)? } else { Document::default() };
    let kinds = growth::kinds(args.growth.as_deref())?;
    let only_growth = args.scenes.iter().any(|s| s == "none");
    let (scenes, notes) = if only_growth { Default::default() } else { scene::choose(&args.scenes, args.budget)? };
    if scenes.is_empty() && kinds.is_empty() {
        return Err(format!("there is nothing to measure; {}", notes.join("; ")));
    }
    document.about = about();
    document.notes = notes;
    write(&args.output, &json, &document)?;
    for bench in &scenes {
        let report = measure_scene(args, bench, &others)?;
        match document.scenes.iter_mut().find(|s| s.name == report.name) {
            Some(place) => *place = report,
            None => document.scenes.push(report),
        }
        // What is finished is kept, whatever comes.
        write(&args.output, &json, &document)?;
    }
    for kind in kinds {
        let growth = growth::measure(kind, args.budget, args.threads.max(1))?;
        document.scaling.retain(|g| g.name != growth.name);
        document.scaling.push(growth);
        write(&args.output, &json, &document)?;
    }
    Ok(format!("{}{}", tell(&document), args.output.join("report.html").display()))
}

fn measure_scene(args: &Args, bench: &BenchScene, others: &[External]) -> Result<SceneReport, String> {
    let resident = process::resident_mib();
    let started = Instant::now();
    let (scene, source, root) = load::with_source(&bench.file)?;
    let load_s = started.elapsed().as_secs_f64();
    let digest = source.into_bundle(root).0.digest();
    let stage = Stage {
        bench,
        scene: &scene,
        load_s,
        resident_mib: resident.unwrap_or(0.0),
        size: args.size.unwrap_or(bench.size),
        threads: args.threads.max(1),
        seed: args.seed,
        clock: args.clock,
    };
    let names = if args.integrators.is_empty() { &bench.variants } else { &args.integrators };
    let mut contenders = Vec::with_capacity(names.len() + others.len());
    for name in names {
        contenders.push(Contender { name: name.clone(), maker: Maker::Own(name.parse()?) });
    }
    let mut left_out = Vec::new();
    for other in others {
        match other.objection(bench) {
            None => contenders.push(Contender { name: other.name().into(), maker: Maker::Other(other.clone()) }),
            Some(why) => left_out.push(format!("{} is left out: {why}", other.name())),
        }
    }
    let rounds = args.rounds.map_or(args.budget.rounds(), |r| r as usize);
    let tracks = measure::measure(&stage, &contenders, args.budget, rounds);
    if let Some(failed) = tracks.iter().find_map(|t| t.failed.as_ref().filter(|_| t.levels.is_empty())) {
        return Err(failed.clone());
    }
    let folder = args.references.clone().unwrap_or_else(|| args.output.join("references"));
    let truth = truth::find(&stage, digest, &tracks, &folder, args.budget.reference_s())?;
    let mut report = evaluate::evaluate(&stage, &tracks, &truth, args.budget.name())?;
    report.notes.extend(left_out);
    Ok(report)
}

fn about() -> About {
    let info = std::fs::read_to_string("/proc/cpuinfo").unwrap_or_default();
    let model = info.lines().find_map(|l| l.strip_prefix("model name")?.split_once(':'));
    let command: Vec<String> = std::env::args().skip(1).collect();
    About {
        version: env!("CARGO_PKG_VERSION").into(),
        processor: model.map_or("unknown processor".into(), |(_, name)| name.trim().to_string()),
        cores: std::thread::available_parallelism().map_or(1, usize::from),
        command: format!("bench {}", command.join(" ")),
    }
}

fn read(json: &Path) -> Result<Document, String> {
    if !json.is_file() {
        return Ok(Document::default());
    }
    let text = std::fs::read_to_string(json).map_err(|e| format!("{}: {e}", json.display()))?;
    let wrong = |e| {
        format!("{}: {e}; it is not a report of this version: leave --append out, or give another -o", json.display())
    };
    serde_json::from_str(&text).map_err(wrong)
}

fn write(folder: &Path, json: &Path, document: &Document) -> Result<(), String> {
    let text = serde_json::to_string_pretty(document).map_err(|e| e.to_string())?;
    let page = folder.join("report.html");
    std::fs::create_dir_all(folder)
        .and_then(|()| std::fs::write(json, text))
        .and_then(|()| std::fs::write(&page, page::html(document)))
        .map_err(|e| format!("{}: {e}", folder.display()))
}

/// The ratios to equal error, for the terminal.
fn tell(document: &Document) -> String {
    let mut out = String::new();
    for s in &document.scenes {
        out += &format!("{}: time to the same error over that of the best of lightfarm\n", s.name);
        for c in &s.curves {
            let of = |measure: &str| {
                let found = s.equal_error.iter().find(|e| e.name == c.name && e.measure == measure);
                found.map_or("-".into(), |e| {
                    format!(
                        "{}{:.3} [{:.3}, {:.3}] at {:.2e} by {}",
                        e.bound, e.ratio.value, e.ratio.low, e.ratio.high, e.error, e.by
                    )
                })
            };
            out += &format!("  {:16} relMSE {:48} trimmed {}\n", c.name, of("relMSE"), of("trimmed relMSE"));
        }
    }
    for g in &document.scaling {
        let exponent =
            g.exponent.map_or(String::new(), |e| format!("exponent {:.3} [{:.3}, {:.3}]", e.value, e.low, e.high));
        out += &format!("growth with {}: {exponent}\n", g.name);
        for r in &g.rows {
            let more: Vec<String> = r.more.iter().map(|(n, v)| format!("{n} {v:.4}")).collect();
            out += &format!("  {:>9}  {:.5e} {}  {}\n", r.x, r.cost.value, g.unit, more.join(", "));
        }
    }
    out
}
