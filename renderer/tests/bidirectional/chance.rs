//! Connections through media that are left to chance before they are followed.

use crate::scenes;
use renderer::camera::Camera;
use renderer::math::Vec2;
use renderer::path::mis::Heuristic;
use renderer::path::{Always, Chance, Connection, Counters, Subpath, Tracer};
use renderer::sampling::{IndependentSampler, Sampler};

const EDGES: usize = 5;
const SAMPLES: u64 = 20_000;

/// Roulette below a threshold, which counts what it drops.
struct Dropping {
    threshold: f32,
    numbers: IndependentSampler,
    dropped: u32,
}

impl Chance for Dropping {
    fn keep(&mut self, estimate: impl FnOnce() -> f32) -> Option<f32> {
        let q = (estimate() / self.threshold).min(1.0);
        let kept = self.numbers.next_1d() < q;
        self.dropped += u32::from(!kept);
        kept.then_some(q)
    }
}

/// What all connections of two walks contribute, those to the lens apart.
fn connected(
    tracer: &mut Tracer<'_>,
    camera: &Subpath,
    light: &Subpath,
    numbers: &mut IndependentSampler,
    chance: &mut impl Chance,
) -> f64 {
    let mut sum = 0.0;
    for t in 2..=camera.vertices.len() {
        let (uc, u) = (numbers.next_1d(), numbers.next_2d());
        let mut add = |path: Option<Connection>| sum += path.map_or(0.0, |p| f64::from(p.weighted().luminance()));
        add(tracer.next_event(camera, t, uc, u, chance));
        for s in 2..=light.vertices.len().min(EDGES + 1 - t) {
            add(tracer.join(light, s, camera, t, chance));
        }
    }
    sum
}

#[test]
fn what_is_left_to_chance_keeps_its_mean_and_saves_rays() {
    for (k, (what, scene, _)) in scenes::all().into_iter().enumerate().filter(|(_, (what, ..))| what.contains("fog")) {
        let view = Camera::new(&scene.camera, 64, 64).unwrap();
        let mut tracer = Tracer {
            scene: &scene,
            camera: &view,
            selector: &scene.selector,
            rr_depth: None,
            heuristic: Heuristic::Power,
            counters: Counters::default(),
        };
        let (mut camera, mut light) = (Subpath::default(), Subpath::default());
        let (mut sum, mut squares, mut total) = (0.0, 0.0, 0.0);
        let (mut all, mut some) = (0, 0);
        let mut chance = Dropping { threshold: 0.05, numbers: IndependentSampler::new([61, k as u64]), dropped: 0 };
        for index in 0..SAMPLES {
            let seed = |what: u64| IndependentSampler::new([what, k as u64, index]);
            let ray = view.generate_ray(seed(62).next_2d() * 64.0, Vec2::ZERO);
            tracer.camera_walk(&mut camera, &mut seed(63), ray, EDGES);
            tracer.light_walk(&mut light, &mut seed(64), EDGES);
            let rays = |t: &Tracer<'_>| t.counters.rays;
            let before = rays(&tracer);
            let a = connected(&mut tracer, &camera, &light, &mut seed(65), &mut Always);
            let between = rays(&tracer);
            let b = connected(&mut tracer, &camera, &light, &mut seed(65), &mut chance);
            (all, some) = (all + between - before, some + rays(&tracer) - between);
            let d = b - a;
            (sum, squares, total) = (sum + d, squares + d * d, total + a);
        }
        let n = SAMPLES as f64;
        let (mean, truth) = (sum / n, total / n);
        let half = 3.29 * ((squares / n - mean * mean) / n).sqrt();
        assert!(half < 0.03 * truth, "{what}: {mean} +- {half} of {truth} tells nothing");
        assert!(mean.abs() < half, "{what}: {mean} +- {half} of {truth}");
        assert!(chance.dropped > 10_000 && 10 * some < 9 * all, "{what}: {some} of {all} rays");
    }
}
