//! Are the error bars true? Hundreds of small independent renders; how often their intervals contain the truth, and how often renders
//! that a target error ended have met it.

mod count;
mod render;
mod report;
mod target;
#[cfg(test)]
mod tests;

pub use report::Report;

use crate::agree::scenes;
use crate::load;
use count::{Area, Areas, Count, truth};
use render::{Telling, many, render};
use renderer::integrator::IntegratorKind;
use renderer::job::{RenderOptions, RenderSettings};
use renderer::scene::Scene;
use report::{Row, SkewBin, TargetRow};
use std::time::Instant;

/// Tests the errors that pictures tell of themselves.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// Names or files of scenes
    #[arg(long, value_delimiter = ',', default_values = ["scenes/cornell-diffuse.toml", "glossy-cornell"])]
    scene: Vec<String>,
    /// Integrators to test [default: all]
    #[arg(long, value_delimiter = ',')]
    integrators: Vec<IntegratorKind>,
    /// Independent renders of each [default: 200; with --target-error 60]
    #[arg(long)]
    renders: Option<u32>,
    /// Samples (mutations) per pixel of a render by bdpt (mmlt); path and light, whose samples cost less, make four times as many
    #[arg(long, default_value_t = 64)]
    samples: u32,
    /// Tests in place of intervals whether renders that this relative error ends have met it
    #[arg(long)]
    target_error: Option<f64>,
    /// Samples per pixel of the reference, which `path` renders
    #[arg(long, default_value_t = 32768)]
    reference: u32,
    /// Size of the pictures
    #[arg(long, value_name = "WxH", value_parser = crate::error::size, default_value = "32x24")]
    size: (u32, u32),
    /// Side of a block in pixels
    #[arg(long, default_value_t = 8, value_parser = clap::value_parser!(u32).range(1..))]
    block: u32,
    /// Other pictures
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// Renders at a time
    #[arg(long, default_value_t = 2)]
    threads: usize,
}

/// Replicate groups of every integrator here, whatever its default.
const GROUPS: u32 = 16;
/// The truth is the mean of so many renders by `path`; their scatter tells how well it is known.
const REFERENCE_RENDERS: u32 = 32;
/// Skewness of pixels that are reported together.
const SKEWNESS: [(f64, f64); 3] = [(0.0, 0.5), (0.5, 1.0), (1.0, f64::INFINITY)];

/// Runs the tests.
pub fn run(args: &Args) -> Result<Report, String> {
    let all = || IntegratorKind::ALL.iter().map(|(_, kind)| *kind).collect();
    let kinds: Vec<_> = if args.integrators.is_empty() { all() } else { args.integrators.clone() };
    let mut report = Report::default();
    for case in scenes::chosen(&args.scene)? {
        let scene = load::scene(&case.file)?;
        let session = Session { name: &case.name, scene: &scene, args };
        let reference = session.reference()?;
        for &kind in kinds.iter().filter(|k| **k != IntegratorKind::Light || case.light) {
            match args.target_error {
                None => report.coverage.push(session.coverage(kind, &reference)?),
                Some(target) => report.targets.push(session.target(kind, target, &reference)?),
            }
        }
    }
    Ok(report)
}

/// One scene.
struct Session<'a> {
    name: &'a str,
    scene: &'a Scene,
    args: &'a Args,
}

impl Session<'_> {
    /// Renders that are independent of all that are tested. The mean of the tested ones themselves would do for the scatter, but it
    /// hides a bias; this truth does not.
    fn reference(&self) -> Result<Vec<Telling>, String> {
        let samples = (self.args.reference / REFERENCE_RENDERS).max(GROUPS);
        let options = RenderOptions::counting(IntegratorKind::Path, samples);
        self.renders(&options, REFERENCE_RENDERS, !self.args.seed << 16)
    }

    /// `count` renders with seeds from `first`.
    fn renders(&self, options: &RenderOptions, count: u32, first: u64) -> Result<Vec<Telling>, String> {
        many(self.args.threads, count, |i| {
            let seed = Some(first + u64::from(i));
            let options = RenderOptions { size: Some(self.args.size), seed, ..options.clone() };
            let mut settings = RenderSettings::resolve(&options, &self.scene.defaults).map_err(|e| e.to_string())?;
            settings.replicates = GROUPS;
            render(self.scene, &settings, self.args.block)
        })
    }

    /// No two integrators share a random number.
    fn first_seed(&self, kind: IntegratorKind) -> u64 {
        let number = IntegratorKind::ALL.iter().position(|(_, k)| *k == kind).unwrap_or_default() as u64;
        (self.args.seed << 6 | number) << 16
    }

    fn coverage(&self, kind: IntegratorKind, reference: &[Telling]) -> Result<Row, String> {
        let started = Instant::now();
        let cheap = matches!(kind, IntegratorKind::Path | IntegratorKind::Light);
        let samples = self.args.samples * if cheap { 4 } else { 1 };
        let options = RenderOptions::counting(kind, samples);
        let count = self.args.renders.unwrap_or(200);
        let renders = self.renders(&options, count, self.first_seed(kind))?;
        let seconds = started.elapsed().as_secs_f64();
        let counted = |areas: Areas, keep: &dyn Fn(&Area) -> bool| {
            let of = |tellings: &[Telling]| tellings.iter().map(|t| areas.of(t)).collect::<Vec<_>>();
            Count::new(&of(&renders), &truth(&of(reference)), keep)
        };
        let nothing = || format!("{}: every render by {} is the same", self.name, kind.name());
        let bin = |(from, to): (f64, f64)| {
            let inside = |a: &Area| (from..to).contains(&a.skewness.abs());
            SkewBin { from, to: to.is_finite().then_some(to), count: counted(Areas::Pixels, &inside) }
        };
        let image = |tellings: &[Telling]| truth(&tellings.iter().map(|t| Areas::Image.of(t)).collect::<Vec<_>>());
        let bias = image(&renders).first().zip(image(reference).first()).and_then(|(own, other)| own.welch(other, 0.0));
        let row = Row {
            scene: self.name.into(),
            integrator: kind.name(),
            samples,
            seconds,
            bias: bias.map_or(f64::NAN, |w| w.t),
            image: counted(Areas::Image, &|_| true).ok_or_else(nothing)?,
            blocks: counted(Areas::Blocks, &|_| true).ok_or_else(nothing)?,
            pixels: SKEWNESS.map(bin).to_vec(),
        };
        eprintln!("{row}");
        Ok(row)
    }

    fn target(&self, kind: IntegratorKind, target: f64, reference: &[Telling]) -> Result<TargetRow, String> {
        let started = Instant::now();
        let options = RenderOptions { integrator: Some(kind), target_error: Some(target), ..RenderOptions::default() };
        let count = self.args.renders.unwrap_or(60);
        let renders = self.renders(&options, count, self.first_seed(kind))?;
        let row = TargetRow {
            scene: self.name.into(),
            integrator: kind.name(),
            target,
            seconds: started.elapsed().as_secs_f64(),
            met: target::Met::new(&renders, reference, target),
        };
        eprintln!("{row}");
        Ok(row)
    }
}
