//! Renders with and without a skip, in this thread.

use super::skips::{Skip, Without};
use crate::error::measure::FLOOR;
use crate::error::stats::mean_without;
use crate::load;
use renderer::integrator::IntegratorKind;
use renderer::job::{Merger, PassPlan, RenderOptions, RenderSettings, Stop, run_unit};
use renderer::scene::Scene;
use std::path::{Path, PathBuf};

/// Size of the pictures.
const SIZE: (u32, u32) = (96, 96);
/// Edges of the longest path, where neither the scene nor the skip bounds it.
const MAX_DEPTH: i32 = 12;

/// One of the two renders.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Arm {
    /// As shipped.
    With,
    /// All is computed.
    Without,
}

/// A finished render.
#[derive(Debug, Default)]
pub struct Sample {
    pub picture: Vec<[f32; 3]>,
    /// Processor seconds.
    pub seconds: f64,
}

/// A file of this repository.
pub fn path(file: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("..").join(file)
}

/// The scene of a render.
pub fn scene(skip: &Skip, file: &str, arm: Arm) -> Result<Scene, String> {
    let mut scene = load::scene(&path(file))?;
    if let (Without::Scene(change), Arm::Without) = (&skip.without, arm) {
        change(&mut scene);
    }
    Ok(scene)
}

/// Settings of a small picture.
pub fn settings(scene: &Scene, integrator: IntegratorKind, count: u32, seed: u64) -> Result<RenderSettings, String> {
    let max_depth = scene.defaults.max_depth.is_none().then_some(MAX_DEPTH);
    let counting = RenderOptions::counting(integrator, count);
    let options = RenderOptions { size: Some(SIZE), max_depth, seed: Some(seed), ..counting };
    RenderSettings::resolve(&options, &scene.defaults).map_err(|e| e.to_string())
}

/// Renders without a change.
pub fn plain(scene: &Scene, integrator: IntegratorKind, count: u32) -> Result<(), String> {
    finish(scene, &settings(scene, integrator, count, 1)?, |_| {}).map(drop)
}

/// Renders; `count` in samples or mutations a pixel.
pub fn render(skip: &Skip, scene: &Scene, arm: Arm, count: u32, seed: u64) -> Result<Sample, String> {
    let mut settings = settings(scene, skip.integrator, count, seed)?;
    (skip.settings)(&mut settings);
    if let (Without::Settings(change), Arm::Without) = (&skip.without, arm) {
        change(&mut settings);
    }
    let time = || crate::farm::cpu_seconds(std::process::id()).ok_or("the processor time is not told");
    let before = time()?;
    let picture = finish(scene, &settings, |plan| {
        if let (Without::Plan(change), Arm::Without) = (&skip.without, arm) {
            change(plan);
        }
    })?;
    Ok(Sample { picture, seconds: time()? - before })
}

/// Renders by plans that are changed, unit after unit.
fn finish(scene: &Scene, settings: &RenderSettings, change: impl Fn(&mut PassPlan)) -> Result<Vec<[f32; 3]>, String> {
    let mut merger = Merger::new(settings.clone());
    loop {
        let mut plan = merger.plan().clone();
        change(&mut plan);
        for id in 0..plan.unit_count() {
            let unit = plan.unit(id).ok_or("a plan has fewer units than it says")?;
            let result = run_unit(scene, settings, &plan, &unit, &Stop::new()).map_err(|e| e.to_string())?;
            merger.fold(id, &result).map_err(|e| e.to_string())?;
        }
        if merger.advance(false).is_none() {
            return Ok(merger.image().mean);
        }
    }
}

/// How many samples or mutations a pixel take so long.
pub fn count_for(skip: &Skip, scene: &Scene, seconds: f64) -> Result<u32, String> {
    let mut count = 16.0;
    loop {
        let took = render(skip, scene, Arm::With, count as u32, 0)?.seconds;
        let share = took / seconds;
        if share > 0.3 {
            return Ok((count / share).max(16.0).round() as u32);
        }
        count *= if share > 0.05 { 0.5 / share } else { 8.0 };
    }
}

/// Mean over pixels of the variance of one render over the squared radiance: renders are their own truth, as all are unbiased.
pub fn squared_error(samples: &[Vec<Sample>; 2], arm: usize, left_out: Option<usize>) -> f64 {
    let pixels = samples[0].first().map_or(0, |s| s.picture.len());
    let mut sum = 0.0;
    for i in 0..3 * pixels {
        let values = |arm: usize| samples[arm].iter().map(|s| f64::from(s.picture[i / 3][i % 3])).collect::<Vec<_>>();
        let (own, other) = (values(arm), values(1 - arm));
        let (mean, truth) = (mean_without(&own, left_out), mean_without(&other, left_out));
        let kept = own.iter().enumerate().filter(|(j, _)| Some(*j) != left_out);
        let (n, scatter) = kept.fold((0.0, 0.0), |(n, s), (_, v)| (n + 1.0, s + (v - mean) * (v - mean)));
        let level = 0.5 * (mean + truth);
        sum += scatter / (n - 1.0) / (level * level + FLOOR);
    }
    sum / (3 * pixels) as f64
}
