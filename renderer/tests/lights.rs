//! Learned selection of lights: less noise where lights are hidden, and neither the expectation nor the truth of the error changes.

#![allow(clippy::unwrap_used, clippy::panic, reason = "test helpers")]

mod common;

use common::deviations;
use renderer::film::MergedImage;
use renderer::integrator::IntegratorKind;
use renderer::job::{Merger, RenderOptions, RenderSettings, Stop, run_unit};
use renderer::scene::Scene;
use renderer::scene::bundle::DiskSource;
use statcheck::Mean;
use std::path::Path;

const RENDERS: u64 = 48;
/// Student's t of some fifty degrees, two-sided 99.9 %.
const T: f64 = 3.5;
/// Relative variance without over that with what is learned, at least: six of seven lights are in vain, and most of their power.
const LEAST_GAIN: f64 = 4.0;
/// The same where lights are selected by place, by which some of the six are passed over already.
const LEAST_GAIN_BY_PLACE: f64 = 2.0;

/// A lamp, and six brighter ones that reach nothing.
fn scene() -> Scene {
    let file = Path::new(env!("CARGO_MANIFEST_DIR")).join("../scenes/stress/hidden-lights.toml");
    let (source, root) = DiskSource::for_scene(&file).unwrap();
    Scene::load(&source, &root).unwrap().0
}

fn render(scene: &Scene, kind: IntegratorKind, learns: bool, seed: u64) -> MergedImage {
    let counting = RenderOptions::counting(kind, 32);
    let options = RenderOptions { size: Some((32, 24)), max_depth: Some(5), seed: Some(seed), ..counting };
    let settings = RenderSettings::resolve(&options, &scene.defaults).unwrap();
    let mut merger = Merger::new(settings.clone());
    loop {
        let mut plan = merger.plan().clone();
        if !learns {
            plan.light_weights.clear();
        }
        for id in 0..plan.unit_count() {
            let result = run_unit(scene, &settings, &plan, &plan.unit(id).unwrap(), &Stop::new()).unwrap();
            merger.fold(id, &result).unwrap();
        }
        if merger.advance(false).is_none() {
            return merger.image();
        }
    }
}

/// Means of the renders.
fn image_means(renders: &[MergedImage]) -> Mean {
    let of = |r: &MergedImage| r.mean.iter().flatten().map(|v| f64::from(*v)).sum::<f64>() / (3 * r.mean.len()) as f64;
    renders.iter().map(of).collect()
}

fn check(kind: IntegratorKind) {
    let scene = scene();
    let renders = |learns: bool, first: u64| -> Vec<_> {
        (first..first + RENDERS).map(|seed| render(&scene, kind, learns, seed)).collect()
    };
    let (learned, not) = (renders(true, 0), renders(false, 1000));
    let (a, b) = (image_means(&learned), image_means(&not));
    let (difference, error) = (a.mean() - b.mean(), a.error().hypot(b.error()));
    assert!(difference.abs() < T * error, "{kind:?}: {a:?} against {b:?} without, +- {error}");

    let ((found, told), (without, _)) = (deviations(&learned), deviations(&not));
    let total = |v: &[f64]| v.iter().sum::<f64>();
    let ratio = total(&without) / total(&found);
    let least = if kind == IntegratorKind::Path { LEAST_GAIN_BY_PLACE } else { LEAST_GAIN };
    assert!(ratio > least, "{kind:?}: variance is only {ratio} times less");
    if kind == IntegratorKind::Path {
        let difference: Mean = told.iter().zip(&found).map(|(t, f)| t - f).collect();
        let (mean, error) = (difference.mean(), difference.error());
        assert!(mean.abs() < T * error, "told variance less true variance: {mean} +- {error}");
    }
}

#[test]
fn path_learns_which_lights_to_select() {
    check(IntegratorKind::Path);
}

#[test]
fn light_learns_which_lights_to_select() {
    check(IntegratorKind::Light);
}

#[test]
fn bdpt_learns_which_lights_to_select() {
    check(IntegratorKind::Bdpt);
}

#[test]
fn mmlt_learns_which_lights_to_select() {
    check(IntegratorKind::Mmlt);
}
