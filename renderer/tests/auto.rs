//! `auto`: what it chooses, that nothing of its trials is in the image, and what its trials know of light that `path` would miss.

#![allow(clippy::unwrap_used, reason = "test helpers")]

mod common;

use common::{build, camera, emission, lambert, shape};
use renderer::bsdf::Material;
use renderer::film::MergedImage;
use renderer::integrator::IntegratorKind;
use renderer::job::{Merger, PassPlan, RenderOptions, RenderSettings, Stop, run_unit};
use renderer::math::{DAffine3, DVec3};
use renderer::scene::Scene;
use renderer::scene::desc::{FilterDesc, LightDesc, SceneDesc, ShapeKind};
use renderer::spectrum::Rgb;
use renderer::texture::RgbParam;

/// A plate below whatever hangs over it.
fn plate_under(shapes: Vec<renderer::scene::desc::ShapeDesc>, lights: Vec<LightDesc>) -> Scene {
    let plate = DAffine3::from_rotation_x(-std::f64::consts::FRAC_PI_2) * DAffine3::from_scale(DVec3::splat(4.0));
    let glass = Material::Dielectric {
        eta: 1.5,
        reflectance: RgbParam::Const(Rgb::ONE),
        transmittance: RgbParam::Const(Rgb::ONE),
        roughness: None,
    };
    build(SceneDesc {
        shapes: std::iter::once(shape(ShapeKind::Rectangle, plate, 0)).chain(shapes).collect(),
        materials: vec![lambert(0.6), glass],
        lights,
        camera: camera(DVec3::new(0.0, 3.0, 7.0), DVec3::ZERO, 50.0),
        ..Default::default()
    })
}

/// A lamp of radius 0.02 over a glass ball: `path` finds its caustic by luck alone.
fn caustic() -> Scene {
    let mut lamp = shape(
        ShapeKind::Sphere,
        DAffine3::from_scale_rotation_translation(DVec3::splat(0.02), Default::default(), DVec3::Y * 4.0),
        0,
    );
    lamp.emission = emission(5000.0);
    plate_under(vec![lamp, shape(ShapeKind::Sphere, DAffine3::from_translation(DVec3::Y * 1.2), 1)], Vec::new())
}

/// An even sky: next-event estimation is all that it takes.
fn open() -> Scene {
    let ball = shape(ShapeKind::Sphere, DAffine3::from_translation(DVec3::Y * 1.2), 0);
    plate_under(vec![ball], vec![LightDesc::Constant { radiance: Rgb::new(0.4, 0.5, 0.6) }])
}

/// A lamp over the plate, and one below it that is a thousand times stronger, of which nothing is seen.
fn hidden() -> Scene {
    let lamp = |at: f64, radiance: f32| {
        let place = DAffine3::from_scale_rotation_translation(DVec3::splat(0.3), Default::default(), DVec3::Y * at);
        let mut lamp = shape(ShapeKind::Sphere, place, 0);
        lamp.emission = emission(radiance);
        lamp
    };
    plate_under(vec![lamp(3.0, 10.0), lamp(-3.0, 1e4)], Vec::new())
}

fn settings(scene: &Scene, options: RenderOptions) -> RenderSettings {
    let options = RenderOptions { size: Some((96, 64)), max_depth: Some(6), ..options };
    RenderSettings::resolve(&options, &scene.defaults).unwrap()
}

/// Renders a job; after each pass, the merger is written and read again, if asked to.
fn run(scene: &Scene, settings: &RenderSettings, reload: bool) -> Merger {
    run_watched(scene, settings, reload, &mut |_| {})
}

/// The same, showing the plan of every pass.
fn run_watched(scene: &Scene, settings: &RenderSettings, reload: bool, watch: &mut dyn FnMut(&PassPlan)) -> Merger {
    let mut merger = Merger::new(settings.clone());
    loop {
        let plan = merger.plan().clone();
        watch(&plan);
        for id in 0..plan.unit_count() {
            let unit = plan.unit(id).unwrap();
            merger.fold(id, &run_unit(scene, settings, &plan, &unit, &Stop::new()).unwrap()).unwrap();
            if reload && id == plan.unit_count() / 2 {
                let mut bytes = Vec::new();
                assert_eq!(merger.save(&mut bytes).unwrap(), bytes.len() as u64);
                for cut in [0, 7, bytes.len() / 2, bytes.len() - 1] {
                    assert!(Merger::load(&bytes[..cut]).is_none());
                }
                merger = Merger::load(&bytes).unwrap();
                assert!(*merger.plan() == plan && merger.next_unit() == id + 1);
            }
        }
        if merger.advance(false).is_none() {
            return merger;
        }
    }
}

#[test]
fn light_that_path_would_miss_is_known() {
    let scene = caustic();
    let merger = run(&scene, &settings(&scene, RenderOptions::counting(IntegratorKind::Auto, 64)), false);
    let choice = merger.choice().unwrap();
    assert_ne!(choice.integrator, IntegratorKind::Path, "{choice:?}");
    let path = choice.trials[0];
    assert!(path.unseen > 0.5 * path.variance, "{choice:?}");
    assert!(choice.why.contains("misses light"), "{}", choice.why);
}

#[test]
fn easy_scenes_are_left_to_path() {
    let scene = open();
    let merger = run(&scene, &settings(&scene, RenderOptions::counting(IntegratorKind::Auto, 64)), false);
    let choice = merger.choice().unwrap();
    assert_eq!(choice.integrator, IntegratorKind::Path, "{choice:?}");
    assert!(choice.share.unwrap() < 0.35, "{choice:?}");
}

/// Every render learns which lights are worth selecting; trials, which are too short for it, begin with what the first of them has learned.
#[test]
fn trials_know_the_lights() {
    let scene = hidden();
    // The first pass of each render: who renders, and how the lights are weighed.
    let mut begins = Vec::new();
    let s = settings(&scene, RenderOptions::counting(IntegratorKind::Auto, 64));
    let merger = run_watched(&scene, &s, false, &mut |plan| {
        if plan.own_pass() == 0 {
            begins.push((plan.settings(&s).integrator, plan.light_weights.clone()));
        }
    });
    let (first, rest) = begins.split_first().unwrap();
    let (last, trials) = rest.split_last().unwrap();
    assert!(first.1.is_empty() && last.1.is_empty(), "{first:?} {last:?}");
    assert_eq!(trials[0].0, IntegratorKind::Path);
    assert!(trials.len() >= 4 && trials.iter().all(|(_, w)| w.len() == 2 && w[0] > 0.99), "{trials:?}");
    assert_eq!(merger.choice().unwrap().trials.len(), if trials.len() > 4 { 3 } else { 2 });
}

/// The same decisions and bits when the merge is written to disk and read again in every trial and every pass; and the image is that of
/// a job by the integrator itself.
#[test]
fn nothing_of_the_trials_is_in_the_image() {
    for scene in [caustic(), open(), hidden()] {
        let s = settings(&scene, RenderOptions::counting(IntegratorKind::Auto, 40));
        let (straight, reloaded) = (run(&scene, &s, false), run(&scene, &s, true));
        assert_eq!(straight.choice(), reloaded.choice());
        assert!(straight.image() == reloaded.image());
        let chosen = straight.choice().unwrap().integrator;
        let own =
            s.rendered_by(chosen, straight.plan().settings(&s).budget.spp.or(straight.plan().settings(&s).budget.mpp));
        let own = run(&scene, &own, false).image();
        let pixels = |i: &MergedImage| (i.mean.clone(), i.samples.clone(), i.error, i.counters.samples);
        assert!(pixels(&straight.image()) == pixels(&own));
    }
}

#[test]
fn every_budget_is_carried_over() {
    let scene = caustic();
    let s = settings(
        &scene,
        RenderOptions { integrator: Some(IntegratorKind::Auto), target_error: Some(0.5), ..Default::default() },
    );
    let merger = run(&scene, &s, false);
    assert!(merger.image().error.unwrap().upper95 <= 0.5 && merger.choice().is_some());
    // Time that is up before anything is chosen still gives a picture.
    let timed = settings(
        &scene,
        RenderOptions { integrator: Some(IntegratorKind::Auto), time_s: Some(1.0), ..Default::default() },
    );
    let mut merger = Merger::new(timed.clone());
    loop {
        let plan = merger.plan().clone();
        for id in 0..plan.unit_count() {
            let unit = plan.unit(id).unwrap();
            merger.fold(id, &run_unit(&scene, &timed, &plan, &unit, &Stop::new()).unwrap()).unwrap();
        }
        if merger.advance(true).is_none() {
            break;
        }
    }
    assert!(merger.finished() && merger.image().samples.iter().sum::<f32>() > 0.0);
}

/// Direct light on a plate: one length of path. The second moment that bidirectional samples find is that of `path`'s own samples:
/// exactly for a point light, and where two strategies share a path, within what the root of a sum of squares is off.
#[test]
fn the_second_moment_is_that_of_the_path_tracers_samples() {
    let point = LightDesc::Point { position: DVec3::new(0.0, 2.0, 0.0), intensity: Rgb::splat(9.0) };
    let mut lamp = shape(ShapeKind::Sphere, DAffine3::from_translation(DVec3::new(0.0, 6.0, 3.0)), 0);
    lamp.emission = emission(3.0);
    for (scene, low, high) in
        [(plate_under(vec![], vec![point]), 0.98, 1.02), (plate_under(vec![lamp], vec![]), 0.8, 1.45)]
    {
        let options = RenderOptions {
            size: Some((24, 16)),
            max_depth: Some(2),
            ..RenderOptions::counting(IntegratorKind::Bdpt, 64)
        };
        let mut s = RenderSettings::resolve(&options, &scene.defaults).unwrap();
        s.integrator = IntegratorKind::Moments;
        // A sample of a narrow filter counts for its own pixel alone.
        s.filter = FilterDesc::Box { radius: 0.5 };
        let total = |image: &MergedImage| image.mean.iter().map(|v| f64::from(v[1])).sum::<f64>();
        let found = total(&run(&scene, &s, false).image());
        // One sample of each pixel, squared, many times.
        let mut squares = 0.0;
        let renders = 400;
        for seed in 0..renders {
            let options = RenderOptions {
                seed: Some(seed),
                integrator: Some(IntegratorKind::Path),
                spp: Some(1),
                ..options.clone()
            };
            let mut one = RenderSettings::resolve(&options, &scene.defaults).unwrap();
            one.filter = s.filter;
            let image = run(&scene, &one, false).image();
            squares += image.mean.iter().map(|v| f64::from(v[1]) * f64::from(v[1])).sum::<f64>();
        }
        let ratio = found / (squares / renders as f64);
        assert!(ratio > low && ratio < high, "{ratio} is not between {low} and {high}");
    }
}
