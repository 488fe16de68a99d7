//! Samples per second of whole renders, and how they grow with threads.

use crate::load;
use renderer::integrator::IntegratorKind;
use renderer::job::{LocalOptions, RenderOptions, RenderSettings, Stop, render_local};
use renderer::scene::Scene;
use serde::Serialize;
use std::path::PathBuf;
use std::time::Instant;

/// Times the renders of a scene, without loading it.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// The scenes.
    #[arg(default_value = "scenes/cornell.toml")]
    scenes: Vec<PathBuf>,
    /// Samples per pixel, or mutations.
    #[arg(long, default_value_t = 64)]
    spp: u32,
    /// Side of the square picture in pixels.
    #[arg(long, default_value_t = 256)]
    side: u32,
    /// Counted runs.
    #[arg(long, default_value_t = 3)]
    runs: usize,
}

/// One scene, integrator and number of threads.
#[derive(Debug, Serialize)]
pub struct Row {
    scene: String,
    integrator: &'static str,
    threads: usize,
    /// Samples (light paths; of mmlt, samples of all kinds and mutations) per second, median.
    samples_per_s: f64,
    /// Mutations per second over the whole render, pools and ordinary samples included in its time; 0 without chains.
    mutations_per_s: f64,
    rays_per_s: f64,
    /// `sqrt(mean of variance / (I^2 + 0.01))`.
    relative_error: f64,
    /// Squared relative error times seconds: lower is better, whatever the number of samples.
    error2_seconds: f64,
    /// Seconds to load the scene and build its tree.
    load_s: f64,
}

/// Runs the benchmark.
pub fn run(args: &Args) -> Result<Vec<Row>, String> {
    let mut rows = Vec::new();
    for path in &args.scenes {
        let started = Instant::now();
        let scene = load::scene(path)?;
        let load_s = started.elapsed().as_secs_f64();
        for &(_, integrator) in IntegratorKind::ALL {
            for threads in [1, 2] {
                rows.push(time(args, path.display().to_string(), &scene, integrator, threads, load_s)?);
            }
        }
    }
    Ok(rows)
}

fn time(
    args: &Args,
    name: String,
    scene: &Scene,
    integrator: IntegratorKind,
    threads: usize,
    load_s: f64,
) -> Result<Row, String> {
    let options = RenderOptions { size: Some((args.side, args.side)), ..RenderOptions::counting(integrator, args.spp) };
    let settings = RenderSettings::resolve(&options, &scene.defaults).map_err(|e| e.to_string())?;
    let mut seconds = Vec::new();
    let mut image = None;
    for _ in 0..args.runs.max(1) {
        let started = Instant::now();
        let outcome = render_local(scene, &settings, &LocalOptions { threads }, &Stop::new(), &mut |_| {});
        seconds.push(started.elapsed().as_secs_f64());
        image = Some(outcome.map_err(|e| e.to_string())?);
    }
    seconds.sort_by(f64::total_cmp);
    let median = seconds[seconds.len() / 2];
    let outcome = image.ok_or("no run was asked for")?;
    let (image, chains) = (outcome.image, outcome.chains);
    let relative_error = image.error.map_or(f64::NAN, |e| e.relative);
    Ok(Row {
        scene: name,
        integrator: integrator.name(),
        threads,
        samples_per_s: image.counters.samples as f64 / median,
        mutations_per_s: (chains.small + chains.large) as f64 / median,
        rays_per_s: image.counters.rays as f64 / median,
        relative_error,
        error2_seconds: relative_error * relative_error * median,
        load_s,
    })
}

/// The rows as a table.
pub fn table(rows: &[Row]) -> String {
    let mut text = String::from(
        "integrator  threads   ksamples/s  kmutations/s  krays/s   rel. error  error^2 x s  load s  scene",
    );
    for r in rows {
        text += &format!(
            "\n{:10}  {:7}  {:11.1}  {:12.1}  {:7.0}  {:11.5}  {:11.6}  {:6.2}  {}",
            r.integrator,
            r.threads,
            r.samples_per_s / 1e3,
            r.mutations_per_s / 1e3,
            r.rays_per_s / 1e3,
            r.relative_error,
            r.error2_seconds,
            r.load_s,
            r.scene
        );
    }
    text
}
