//! Jobs in this process: the number of threads changes no bit, and an interrupted job keeps what it finished.

#![allow(clippy::unwrap_used, reason = "test helpers")]

mod common;

use common::{build, camera, emission, lambert, shape};
use renderer::integrator::IntegratorKind;
use renderer::job::{LocalEvent, LocalOptions, RenderOptions, RenderSettings, Stop, render_local};
use renderer::math::{DAffine3, DVec3};
use renderer::scene::Scene;
use renderer::scene::desc::{LightDesc, SceneDesc, ShapeKind};
use renderer::spectrum::Rgb;

/// A glowing ball over a plate, under a dim sky.
fn scene() -> Scene {
    let mut ball = shape(ShapeKind::Sphere, DAffine3::from_translation(DVec3::Y * 1.5), 0);
    ball.emission = emission(2.0);
    let plate = DAffine3::from_rotation_x(-std::f64::consts::FRAC_PI_2) * DAffine3::from_scale(DVec3::splat(4.0));
    build(SceneDesc {
        shapes: vec![ball, shape(ShapeKind::Rectangle, plate, 0)],
        materials: vec![lambert(0.6)],
        lights: vec![LightDesc::Constant { radiance: Rgb::new(0.1, 0.2, 0.3) }],
        camera: camera(DVec3::new(0.0, 3.0, 7.0), DVec3::Y, 50.0),
        ..Default::default()
    })
}

fn settings(scene: &Scene, options: RenderOptions) -> RenderSettings {
    let options = RenderOptions { size: Some((100, 50)), max_depth: Some(4), ..options };
    RenderSettings::resolve(&options, &scene.defaults).unwrap()
}

#[test]
fn the_number_of_threads_changes_no_bit() {
    let scene = scene();
    for (_, kind) in IntegratorKind::ALL.iter().copied() {
        let s = settings(&scene, RenderOptions::counting(kind, 40));
        let images = [1, 2, 7].map(|threads| common::render_with(&scene, &s, threads));
        assert!(images[0].mean.iter().flatten().any(|v| *v > 0.0));
        assert!(images[0] == images[1] && images[0] == images[2], "{kind:?}");
        let mut other = s.clone();
        other.seed = 1;
        assert!(common::render_with(&scene, &other, 2) != images[0], "another seed is another image");
    }
}

#[test]
fn an_interrupted_job_keeps_what_it_finished_and_is_right() {
    let scene = scene();
    for (_, kind) in IntegratorKind::ALL.iter().copied() {
        let s = settings(&scene, RenderOptions::counting(kind, 192));
        let whole = common::render_with(&scene, &s, 2);
        let stop = Stop::new();
        let options = LocalOptions { threads: 2 };
        let part = render_local(&scene, &s, &options, &stop, &mut |e| {
            if let LocalEvent::Progress(m) = e
                && m.fraction() > 0.3
            {
                stop.stop();
            }
        })
        .unwrap();
        assert!(part.interrupted);
        let taken = f64::from(part.image.samples.iter().sum::<f32>()) / f64::from(whole.samples.iter().sum::<f32>());
        assert!(taken > 0.25 && taken < 0.9, "{kind:?}: {taken} of the samples");
        assert!(part.image.counters.samples < whole.counters.samples);
        common::assert_same_mean(&whole, &part.image, 0.05, &format!("{kind:?}"));
    }
}

#[test]
fn a_time_budget_ends_with_a_whole_pass() {
    let scene = scene();
    // Not adaptive: a fast machine would come to where pixels take what they need.
    let s = settings(&scene, RenderOptions { time_s: Some(0.3), adaptive: Some(false), ..Default::default() });
    let started = std::time::Instant::now();
    let mut passes = 0;
    let outcome = render_local(&scene, &s, &LocalOptions { threads: 2 }, &Stop::new(), &mut |e| {
        passes += u32::from(matches!(e, LocalEvent::PassDone(_)));
    })
    .unwrap();
    assert!(!outcome.interrupted && started.elapsed().as_secs_f64() >= 0.3);
    assert!(passes >= 2);
    let n = outcome.image.samples[0];
    assert!(n >= 16.0 && outcome.image.samples.iter().all(|v| *v == n), "every pixel has the same samples");
}

#[test]
fn a_target_error_is_met_when_the_job_says_so() {
    let scene = scene();
    let s = settings(&scene, RenderOptions { target_error: Some(0.01), ..Default::default() });
    let image = common::render_with(&scene, &s, 2);
    let error = image.error.unwrap();
    assert!(error.upper95 <= 0.01, "{error:?}");
    // Against a far better image: the root of the mean relative squared error is what was promised.
    let mut better = s.clone();
    better.budget = renderer::job::Budget { spp: Some(image.samples[0] as u32 * 8), ..Default::default() };
    better.seed = 99;
    let reference = common::render_with(&scene, &better, 2);
    let squared: f64 = image
        .mean
        .iter()
        .flatten()
        .zip(reference.mean.iter().flatten())
        .map(|(a, b)| f64::from((a - b) * (a - b) / (b * b + 0.01)))
        .sum();
    let actual = (squared / image.mean.len() as f64 / 3.0).sqrt();
    assert!(actual <= 0.01 && actual > 0.002, "promised 0.01, found {actual}");
}

#[test]
fn a_depth_limit_may_leave_nothing_to_chains() {
    let scene = scene();
    for depth in [0, 1, 2] {
        let limited = |kind| RenderOptions { max_depth: Some(depth), ..RenderOptions::counting(kind, 32) };
        let of = |kind| {
            let options = RenderOptions { size: Some((40, 20)), ..limited(kind) };
            common::render_with(&scene, &RenderSettings::resolve(&options, &scene.defaults).unwrap(), 2)
        };
        let (path, mmlt) = (of(IntegratorKind::Path), of(IntegratorKind::Mmlt));
        if depth == 0 {
            assert!(mmlt.mean.iter().flatten().all(|v| *v == 0.0));
        } else {
            common::assert_same_mean(&path, &mmlt, 0.1, &format!("depth {depth}"));
        }
    }
}
