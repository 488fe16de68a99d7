//! Short independent renders of all variants, in turn.

use super::process;
use renderer::film::Counters;
use renderer::job::{LocalOptions, RenderSettings, Stop, render_local};
use renderer::scene::Scene;
use std::time::Instant;

/// One render.
pub struct Run {
    /// Its variant.
    pub variant: usize,
    /// Wall time of the whole job, its set-up included; the scene was loaded before.
    pub seconds: f64,
    /// Processor time of all threads.
    pub cpu_seconds: Option<f64>,
    /// Peak of resident memory, without the pictures of the renders before.
    pub peak_mib: Option<f64>,
    /// What was traced.
    pub counters: Counters,
    /// The picture.
    pub pixels: Vec<[f32; 3]>,
}

/// Renders each of the jobs `rounds` times, A B A B ..., so that drift of the machine's speed hits all alike. Every render has a seed of
/// its own, counted from that of the first job.
pub fn render_rounds(
    scene: &Scene,
    jobs: &[(&str, RenderSettings)],
    rounds: usize,
    threads: usize,
) -> Result<Vec<Run>, String> {
    let mut runs: Vec<Run> = Vec::with_capacity(jobs.len() * rounds);
    for round in 1..=rounds {
        let mut line = format!("round {round} of {rounds}:");
        for (variant, (name, settings)) in jobs.iter().enumerate() {
            let seed = jobs[0].1.seed.wrapping_add(runs.len() as u64);
            let mut run = render(scene, &RenderSettings { seed, ..settings.clone() }, threads)?;
            run.variant = variant;
            let held: usize = runs.iter().map(|r| size_of_val(r.pixels.as_slice())).sum();
            run.peak_mib = run.peak_mib.map(|p| p - held as f64 / f64::from(1 << 20));
            line += &format!("  {name} {:.2} s", run.seconds);
            runs.push(run);
        }
        eprintln!("{line}");
    }
    Ok(runs)
}

/// One render; its variant is left to the caller.
pub fn render(scene: &Scene, settings: &RenderSettings, threads: usize) -> Result<Run, String> {
    process::reset_peak();
    let (cpu, started) = (process::cpu_seconds(), Instant::now());
    let outcome = render_local(scene, settings, &LocalOptions { threads }, &Stop::new(), &mut |_| {});
    let seconds = started.elapsed().as_secs_f64();
    let cpu_seconds = process::cpu_seconds().zip(cpu).map(|(after, before)| after - before);
    let peak_mib = process::peak_mib();
    let image = outcome.map_err(|e| e.to_string())?.image;
    Ok(Run { variant: 0, seconds, cpu_seconds, peak_mib, counters: image.counters, pixels: image.mean })
}
