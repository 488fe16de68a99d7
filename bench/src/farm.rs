//! What the farm costs: two one-thread workers against one two-thread `render`, the same job, in turn.

use serde::Serialize;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

/// Times a farm on loopback against a local render.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// The lightfarm binary.
    #[arg(long, default_value = "target/release/lightfarm")]
    lightfarm: PathBuf,
    /// The scene.
    #[arg(long, default_value = "scenes/cornell.toml")]
    scene: PathBuf,
    /// Samples per pixel; the job should last some ten seconds at least.
    #[arg(long, default_value_t = 512)]
    spp: u32,
    /// Counted runs of each, in turn, after one of each that is not.
    #[arg(long, default_value_t = 5)]
    runs: usize,
    /// Address for the coordinator.
    #[arg(long, default_value = "127.0.0.1:50971")]
    listen: String,
}

/// The outcome; times in seconds.
#[derive(Debug, Serialize)]
pub struct Report {
    render_s: Vec<f64>,
    farm_s: Vec<f64>,
    render_median_s: f64,
    farm_median_s: f64,
    /// Median of farm over render, pair by pair.
    ratio: f64,
    /// Processor seconds of the coordinator over those of the workers.
    coordinator_share: Option<f64>,
}

/// A coordinator and its workers of one thread each, on loopback; they end with this value.
pub struct Farm {
    url: String,
    coordinator: Running,
    workers: Vec<Running>,
}

impl Farm {
    /// Starts them with data and caches in `folder`.
    pub fn start(lightfarm: &Path, listen: &str, folder: &Path, workers: usize) -> Result<Self, String> {
        let url = format!("http://{listen}");
        let data = folder.join("data").display().to_string();
        let coordinator = start(lightfarm, &["coordinator", "--listen", listen, "--data", &data])?;
        std::thread::sleep(Duration::from_secs(1));
        let worker = |i: usize| {
            let (name, cache) = (format!("worker-{i}"), folder.join(format!("worker-{i}")).display().to_string());
            start(lightfarm, &["worker", "--coordinator", &url, "--name", &name, "--threads", "1", "--cache", &cache])
        };
        let workers = (0..workers).map(worker).collect::<Result<_, _>>()?;
        std::thread::sleep(Duration::from_secs(1));
        Ok(Self { url, coordinator, workers })
    }

    /// The start of a command that submits a job here and waits for it.
    pub fn submit(&self) -> [&str; 4] {
        ["submit", "--coordinator", &self.url, "--wait"]
    }
}

/// A process that ends with this value.
struct Running(Child);

impl Drop for Running {
    fn drop(&mut self) {
        // It may have ended by itself.
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

/// Runs the benchmark.
pub fn run(args: &Args) -> Result<Report, String> {
    let folder = tempfile::tempdir().map_err(|e| format!("no temporary folder: {e}"))?;
    let farm = Farm::start(&args.lightfarm, &args.listen, folder.path(), 2)?;
    let (local, distant) = (folder.path().join("local.exr"), folder.path().join("farm.exr"));
    let (mut render_s, mut farm_s) = (Vec::new(), Vec::new());
    for run in 0..=args.runs {
        // Each run has its own seed, so that nothing can be answered from what is stored.
        let seed = run.to_string();
        let timed = |verb: &[&str], out| timed(&args.lightfarm, verb, &args.scene, args.spp, &seed, out);
        let a = timed(&["render", "--threads", "2"], &local)?;
        let b = timed(&farm.submit(), &distant)?;
        if run > 0 {
            render_s.push(a);
            farm_s.push(b);
        }
        let equal = Command::new(&args.lightfarm).args(["diff", "--bit-exact"]).args([&local, &distant]).output();
        if !equal.is_ok_and(|o| o.status.success()) {
            return Err("the farm's image is not that of the local render".into());
        }
    }
    let mut ratios: Vec<f64> = farm_s.iter().zip(&render_s).map(|(f, r)| f / r).collect();
    let busy: Option<f64> = farm.workers.iter().map(|w| cpu_seconds(w.0.id())).sum();
    let coordinator_share = cpu_seconds(farm.coordinator.0.id()).zip(busy).map(|(c, w)| c / w);
    Ok(Report {
        render_median_s: median(&mut render_s.clone()),
        farm_median_s: median(&mut farm_s.clone()),
        ratio: median(&mut ratios),
        render_s,
        farm_s,
        coordinator_share,
    })
}

impl std::fmt::Display for Report {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        writeln!(f, "render, 2 threads        {:8.2} s (median of {})", self.render_median_s, self.render_s.len())?;
        writeln!(f, "farm, 2 workers x 1      {:8.2} s", self.farm_median_s)?;
        write!(f, "farm / render            {:8.4} (median of pairs)", self.ratio)?;
        if let Some(share) = self.coordinator_share {
            write!(f, "\ncoordinator / workers    {share:8.4} (processor time)")?;
        }
        Ok(())
    }
}

fn start(lightfarm: &Path, line: &[&str]) -> Result<Running, String> {
    let child =
        Command::new(lightfarm).args(line).stdin(Stdio::null()).stdout(Stdio::null()).stderr(Stdio::null()).spawn();
    child.map(Running).map_err(|e| format!("{} can't be started: {e}; build it first", lightfarm.display()))
}

/// Seconds from start to end of a whole command.
pub fn timed(lightfarm: &Path, verb: &[&str], scene: &Path, spp: u32, seed: &str, out: &Path) -> Result<f64, String> {
    let started = Instant::now();
    let output = Command::new(lightfarm)
        .args(verb)
        .arg(scene)
        .args(["--spp", &spp.to_string(), "--seed", seed, "-o"])
        .arg(out)
        .stdin(Stdio::null())
        .output()
        .map_err(|e| format!("{} can't be started: {e}; build it first", lightfarm.display()))?;
    if !output.status.success() {
        return Err(format!("{verb:?} failed: {}", String::from_utf8_lossy(&output.stderr)));
    }
    Ok(started.elapsed().as_secs_f64())
}

fn median(values: &mut [f64]) -> f64 {
    values.sort_by(f64::total_cmp);
    let n = values.len();
    if n % 2 == 1 { values[n / 2] } else { 0.5 * (values[n / 2 - 1] + values[n / 2]) }
}

/// User and system time of a process, where the system tells (Linux: fields 14 and 15 of its stat file, in hundredths).
pub fn cpu_seconds(pid: u32) -> Option<f64> {
    let stat = std::fs::read_to_string(format!("/proc/{pid}/stat")).ok()?;
    let fields: Vec<&str> = stat.rsplit(')').next()?.split_whitespace().collect();
    let ticks: f64 = fields.get(11)?.parse::<f64>().ok()? + fields.get(12)?.parse::<f64>().ok()?;
    Some(ticks / 100.0)
}
