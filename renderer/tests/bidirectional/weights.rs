use crate::oracle::{Path, Point, Start, weights};
use crate::scenes::{self, Fog};
use renderer::camera::Camera;
use renderer::math::Vec2;
use renderer::path::mis::Heuristic;
use renderer::path::{Always, Connection, Counters, Subpath, Tracer, Vertex};
use renderer::sampling::{IndependentSampler, Sampler};
use renderer::scene::Scene;

const EDGES: usize = 6;

/// The walks of one sample and what joins them.
struct Sample<'a> {
    tracer: Tracer<'a>,
    camera: Subpath,
    light: Subpath,
}

/// A path in points, from its strategy's walks; the light's point for s = 1 is `sampled`.
fn points(sample: &Sample<'_>, s: usize, t: usize, sampled: Option<(usize, Start)>) -> Path {
    let (camera, light) = (&sample.camera.vertices, &sample.light.vertices);
    let scene = sample.tracer.scene;
    let point = |v: &Vertex| Point { anchor: v.anchor, medium: v.medium().copied() };
    let mut points: Vec<Point> = light[..s].iter().skip(1).map(point).collect();
    let from_camera = if s == 0 { t - 1 } else { t };
    points.extend(camera[1..from_camera].iter().rev().map(point));
    let (index, start) = match s {
        0 if camera.len() < t => {
            let index = scene.infinite_lights.iter().find(|i| !scene.lights[**i as usize].flags().is_delta());
            (*index.unwrap() as usize, Start::Along(-sample.camera.escape.unwrap().w))
        }
        0 => (camera[t - 1].emitted.unwrap().0 as usize, Start::At(camera[t - 1].anchor)),
        1 => sampled.unwrap(),
        _ => {
            let start = sample.light.light.unwrap();
            let along = (light[1].anchor.p - light[0].anchor.p).normalize();
            let start_at = if start.flags.infinite { Start::Along(along) } else { Start::At(light[0].anchor) };
            (start.index, start_at)
        }
    };
    Path { light: index, start, points, lens: camera[0].anchor.p }
}

/// Compares every strategy of one sample; returns how many paths there were.
fn compare(sample: &mut Sample<'_>, view: &Camera, fog: &Fog, numbers: &mut IndependentSampler, what: &str) -> usize {
    let mut count = 0;
    let (uc, u) = (numbers.next_1d(), numbers.next_2d());
    let scene = sample.tracer.scene;
    for t in 1..=sample.camera.vertices.len() + 1 {
        for s in 0..=sample.light.vertices.len() {
            let (walked, escaped) = (t <= sample.camera.vertices.len(), t == sample.camera.vertices.len() + 1);
            let mut sampled = None;
            let path: Option<Connection> = match (s, t) {
                (0, 1) | (1, 1) | (0, 2) => None,
                (0, _) if escaped => sample.tracer.escaped(&sample.camera).next(),
                _ if !walked => None,
                (0, _) => sample.tracer.hit(&sample.camera, t),
                (1, _) => {
                    sampled = light_point(scene, &sample.camera, t, uc, u);
                    sample.tracer.next_event(&sample.camera, t, uc, u, &mut Always)
                }
                (_, 1) => sample.tracer.to_lens(&sample.light, s, Vec2::ZERO),
                _ => sample.tracer.join(&sample.light, s, &sample.camera, t, &mut Always),
            };
            let Some(path) = path else { continue };
            if s + t > EDGES + 1 || !sample.tracer.is_free(&path) {
                continue;
            }
            let points = points(sample, s, t, sampled);
            if !points.is_well_conditioned() {
                continue;
            }
            let expected = weights(scene, view, fog, &points)[s];
            let difference = (path.weight - expected).abs();
            assert!(difference < 1e-5, "{what}: ({s}, {t}) weighs {}, should be {expected}", path.weight);
            count += 1;
        }
    }
    count
}

/// The point that strategy (1, t) samples.
fn light_point(scene: &Scene, camera: &Subpath, t: usize, uc: f32, u: Vec2) -> Option<(usize, Start)> {
    let choice = scene.selector.sample(uc)?;
    let light = &scene.lights[choice.index];
    let li = light.sample_li(&scene.light_context(), camera.vertices[t - 1].anchor.p, choice.u, u)?;
    Some((choice.index, if light.flags().infinite { Start::Along(-li.wi) } else { Start::At(li.light) }))
}

#[test]
fn every_weight_is_that_of_the_oracle() {
    for (what, scene, fog) in scenes::all() {
        let view = Camera::new(&scene.camera, 64, 64).unwrap();
        let tracer = Tracer {
            scene: &scene,
            camera: &view,
            selector: &scene.selector,
            rr_depth: None,
            heuristic: Heuristic::Power,
            counters: Counters::default(),
        };
        let mut sample = Sample { tracer, camera: Subpath::default(), light: Subpath::default() };
        let mut count = 0;
        for index in 0..1500 {
            let mut numbers = IndependentSampler::new([51, index]);
            let ray = view.generate_ray(numbers.next_2d() * 64.0, Vec2::ZERO);
            sample.tracer.camera_walk(&mut sample.camera, &mut IndependentSampler::new([52, index]), ray, EDGES + 1);
            sample.tracer.light_walk(&mut sample.light, &mut IndependentSampler::new([53, index]), EDGES);
            count += compare(&mut sample, &view, &fog, &mut numbers, what);
        }
        assert!(count > 1000, "{what}: {count} paths");
    }
}
