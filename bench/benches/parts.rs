//! Microbenchmarks of what a render is made of: rays, BSDFs, textures, chains, merging. `cargo bench -p bench -- NAME` chooses.

#![allow(missing_docs, reason = "a benchmark has no public items")]

#[path = "../src/meshes.rs"]
mod meshes;

use divan::counter::ItemsCount;
use divan::{Bencher, black_box};
use meshes::{Random, room};
use renderer::accel::Accel;
use renderer::bsdf::{Bsdf, Transport, roster};
use renderer::geometry::{Geometry, MeshId, Object, Shape};
use renderer::integrator::IntegratorKind;
use renderer::job::{Merger, RenderOptions, RenderSettings, Stop, Unit, UnitKind, UnitResult, run_unit};
use renderer::math::{Ray, Transform, Vec2, Vec3};
use renderer::sampling::warp;
use renderer::scene::Scene;
use renderer::scene::bundle::DiskSource;
use renderer::spectrum::Rgb;
use renderer::texture::{Filter, Image, Samples, Texels, Texture, UvTransform, Wrap};
use std::path::Path;
use std::sync::Arc;

fn main() {
    divan::main();
}

/// Rays, points or directions of one iteration.
const ITEMS: usize = 4096;

/// Rays between random points of a room of `triangles` triangles.
fn rays(triangles: usize) -> (Accel, Vec<Ray>) {
    let object = Object { shape: Shape::Mesh(MeshId(0)), to_world: Transform::IDENTITY, flip_normals: false };
    let geometry = Geometry::new(vec![room(triangles)], vec![object]);
    let mut random = Random(7);
    let mut point = || Vec3::new(random.next(), random.next(), random.next()) * 1.6 - Vec3::splat(0.8);
    let rays = (0..ITEMS).map(|_| {
        let (from, to) = (point(), point());
        Ray::segment(from, to - from, 1.0)
    });
    let rays = rays.collect();
    let accel = Accel::build(&geometry).unwrap_or_else(|e| unreachable!("the room is sound: {e}"));
    (accel, rays)
}

#[divan::bench(args = [50_000, 500_000])]
fn ray_closest_hit(bencher: Bencher, triangles: usize) {
    let (accel, rays) = rays(triangles);
    let hit = |r: &Ray| accel.intersect(&Ray::new(r.o, r.d.normalize())).map_or(0, |h| u64::from(h.primitive));
    bencher.counter(ItemsCount::new(ITEMS)).bench(|| rays.iter().map(hit).sum::<u64>());
}

#[divan::bench(args = [50_000, 500_000])]
fn ray_occlusion(bencher: Bencher, triangles: usize) {
    let (accel, rays) = rays(triangles);
    bencher.counter(ItemsCount::new(ITEMS)).bench(|| rays.iter().map(|r| u64::from(accel.occluded(r))).sum::<u64>());
}

/// The first instance of each kind of BSDF that the statistical tests examine.
fn bsdf_names() -> Vec<String> {
    let mut names: Vec<String> = Vec::new();
    for example in roster() {
        let kind = |name: &str| name.split(',').next().map(str::to_string);
        if !names.iter().any(|n| kind(n) == kind(&example.name)) {
            names.push(example.name);
        }
    }
    names
}

fn bsdf(name: &str) -> Bsdf {
    let found = roster().into_iter().find(|e| e.name == name);
    found.map_or_else(|| unreachable!("{name} is in the roster"), |e| e.bsdf)
}

fn directions(seed: u64) -> Vec<Vec3> {
    let mut random = Random(seed);
    (0..ITEMS).map(|_| warp::cosine_hemisphere(Vec2::new(random.next(), random.next()))).collect()
}

#[divan::bench(args = bsdf_names())]
fn bsdf_eval(bencher: Bencher, name: &str) {
    let (bsdf, wo, wi) = (bsdf(name), directions(1), directions(2));
    bencher.counter(ItemsCount::new(ITEMS)).bench(|| {
        let value = |(o, i): (&Vec3, &Vec3)| bsdf.eval_pdf(*o, *i, Transport::Radiance).1;
        wo.iter().zip(&wi).map(value).sum::<f32>()
    });
}

#[divan::bench(args = bsdf_names())]
fn bsdf_sample(bencher: Bencher, name: &str) {
    let (bsdf, wo) = (bsdf(name), directions(1));
    let mut random = Random(3);
    let numbers: Vec<[f32; 3]> = (0..ITEMS).map(|_| [random.next(), random.next(), random.next()]).collect();
    bencher.counter(ItemsCount::new(ITEMS)).bench(|| {
        let value = |(o, [c, u, v]): (&Vec3, &[f32; 3])| {
            bsdf.sample(*o, *c, Vec2::new(*u, *v), Transport::Radiance).map_or(0.0, |s| s.pdf)
        };
        wo.iter().zip(&numbers).map(value).sum::<f32>()
    });
}

#[divan::bench(args = [Filter::Nearest, Filter::Linear])]
fn texture_eval(bencher: Bencher, filter: &Filter) {
    let mut random = Random(5);
    let texels = (0..1024 * 1024).map(|_| Rgb::splat(random.next())).collect();
    look_up(bencher, *filter, Texels::Float(texels));
}

/// The same from samples of 8 bits.
#[divan::bench(args = [Filter::Nearest, Filter::Linear])]
fn texture_eval_bytes(bencher: Bencher, filter: &Filter) {
    static VALUES: [f32; 256] = [0.5; 256];
    let mut random = Random(5);
    let data: Vec<u8> = (0..3 * 1024 * 1024).map(|_| (256.0 * random.next()) as u8).collect();
    let samples = Samples::new(data, 3, &VALUES);
    look_up(bencher, *filter, samples.map_or_else(|| unreachable!("they are whole texels"), Texels::Bytes));
}

fn look_up(bencher: Bencher, filter: Filter, texels: Texels) {
    let mut random = Random(6);
    let image = Arc::new(Image { width: 1024, height: 1024, texels });
    let texture = Texture::Image { image, wrap: [Wrap::Repeat; 2], filter, uv: UvTransform::IDENTITY, scale: Rgb::ONE };
    let points: Vec<Vec2> = (0..ITEMS).map(|_| Vec2::new(random.next(), random.next()) * 4.0).collect();
    bencher.counter(ItemsCount::new(ITEMS)).bench(|| points.iter().map(|p| texture.eval(*p).luminance()).sum::<f32>());
}

fn scene() -> Scene {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../scenes/cornell-diffuse.toml");
    let loaded = DiskSource::for_scene(&path).map_err(|e| e.to_string());
    let loaded = loaded.and_then(|(source, root)| Scene::load(&source, &root).map_err(|e| e.to_string()));
    loaded.map_or_else(|e| unreachable!("{} is sound: {e}", path.display()), |(scene, _)| scene)
}

fn settings(kind: IntegratorKind, count: u32, scene: &Scene) -> RenderSettings {
    let options = RenderOptions { size: Some((256, 256)), max_depth: Some(9), ..RenderOptions::counting(kind, count) };
    RenderSettings::resolve(&options, &scene.defaults).unwrap_or_else(|e| unreachable!("the settings are sound: {e}"))
}

/// Runs and folds passes until one holds a unit that is `wanted`; the merger stands at the beginning of that pass.
fn until(scene: &Scene, settings: &RenderSettings, wanted: impl Fn(&UnitKind) -> bool) -> (Merger, Unit) {
    let mut merger = Merger::new(settings.clone());
    loop {
        let plan = merger.plan().clone();
        let units = || (0..plan.unit_count()).filter_map(|id| plan.unit(id));
        if let Some(unit) = units().find(|u| wanted(&u.kind)) {
            return (merger, unit);
        }
        for unit in units() {
            let result = run_unit(scene, settings, &plan, &unit, &Stop::new());
            let folded =
                result.map_err(|e| e.to_string()).and_then(|r| merger.fold(unit.id, &r).map_err(|e| e.to_string()));
            folded.unwrap_or_else(|e| unreachable!("units made here fit: {e}"));
        }
        if merger.advance(false).is_none() {
            unreachable!("the job has no such unit");
        }
    }
}

/// One unit of chains: some 2^18 mutations at 256 x 256 pixels.
#[divan::bench(sample_count = 10)]
fn chains(bencher: Bencher) {
    let scene = scene();
    let settings = settings(IntegratorKind::Mmlt, 16, &scene);
    let (merger, unit) = until(&scene, &settings, |k| matches!(k, UnitKind::Chains { .. }));
    bencher.bench(|| run_unit(&scene, &settings, merger.plan(), black_box(&unit), &Stop::new()).is_ok());
}

/// One unit of samples, 2^16 of them at most.
#[divan::bench(args = ["path", "bdpt"], sample_count = 10)]
fn unit_of_samples(bencher: Bencher, integrator: &str) {
    let scene = scene();
    let kind = integrator.parse().unwrap_or(IntegratorKind::Path);
    let settings = settings(kind, 16, &scene);
    let (merger, unit) = until(&scene, &settings, |k| matches!(k, UnitKind::Tile { .. }));
    bencher.bench(|| run_unit(&scene, &settings, merger.plan(), black_box(&unit), &Stop::new()).is_ok());
}

/// Folding all results of a job of 256 x 256 pixels, and making its image.
#[divan::bench(args = ["path", "bdpt"], sample_count = 10)]
fn merge(bencher: Bencher, integrator: &str) {
    let scene = scene();
    let settings = settings(integrator.parse().unwrap_or(IntegratorKind::Path), 8, &scene);
    let merger = Merger::new(settings.clone());
    let plan = merger.plan().clone();
    let units = (0..plan.unit_count()).filter_map(|id| plan.unit(id));
    let results: Vec<(u32, UnitResult)> = units
        .filter_map(|unit| Some((unit.id, run_unit(&scene, &settings, &plan, &unit, &Stop::new()).ok()?)))
        .collect();
    bencher.with_inputs(|| Merger::new(settings.clone())).bench_values(|mut merger| {
        let folded = results.iter().filter(|(id, r)| merger.fold(*id, r).is_ok()).count();
        (folded, merger.image().mean.len())
    });
}
