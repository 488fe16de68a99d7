//! Rays per second on one thread: camera rays, diffuse bounces, occlusion, in procedural rooms.

use crate::meshes::{Random, room};
use renderer::accel::Accel;
use renderer::geometry::{Geometry, Interaction, MeshId, Object, Shape};
use renderer::math::{Frame, Ray, Transform, Vec2, Vec3};
use renderer::sampling::warp;
use serde::Serialize;
use std::time::Instant;

/// Times the acceleration structure.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// Triangles of the meshes.
    #[arg(long, value_delimiter = ',', default_values_t = [50_000, 1_000_000])]
    triangles: Vec<usize>,
    /// Counted passes over each set of rays; the median counts.
    #[arg(long, default_value_t = 9)]
    runs: usize,
}

/// One mesh; rates in million rays a second.
#[derive(Debug, Serialize)]
pub struct Row {
    triangles: usize,
    build_s: f64,
    bytes_per_triangle: f64,
    camera: f64,
    first_bounce: f64,
    second_bounce: f64,
    occlusion_first: f64,
    occlusion_second: f64,
    shadow: f64,
}

/// Side of the square of camera rays.
const SIDE: usize = 256;

/// Runs the benchmark.
pub fn run(args: &Args) -> Result<Vec<Row>, String> {
    args.triangles.iter().map(|&n| measure(n.max(2000), args.runs.max(1))).collect()
}

fn measure(triangles: usize, runs: usize) -> Result<Row, String> {
    let object = Object { shape: Shape::Mesh(MeshId(0)), to_world: Transform::IDENTITY, flip_normals: false };
    let geometry = Geometry { meshes: vec![room(triangles)], objects: vec![object] };
    let started = Instant::now();
    let accel = Accel::build(&geometry).map_err(|e| e.to_string())?;
    let build_s = started.elapsed().as_secs_f64();

    // Camera rays, then two diffuse bounces from where they hit.
    let eye = Vec3::new(0.9, 0.5, 0.9);
    let frame = Frame::from_normal((Vec3::new(0.0, -0.2, 0.0) - eye).normalize());
    let camera: Vec<Ray> = (0..SIDE * SIDE)
        .map(|i| {
            let (x, y) = ((i % SIDE) as f32 / SIDE as f32 - 0.5, (i / SIDE) as f32 / SIDE as f32 - 0.5);
            Ray::new(eye, (frame.n + frame.s * x * 1.6 + frame.t * y * 1.6).normalize())
        })
        .collect();
    let mut random = Random(7);
    let first = bounce(&geometry, &accel, &camera, &mut random);
    let second = bounce(&geometry, &accel, &first, &mut random);
    let shadow: Vec<Ray> = hits(&geometry, &accel, &camera)
        .map(|hit| {
            let light = Vec3::new(random.next() - 0.5, 0.99, random.next() - 0.5);
            let ray = hit.spawn_ray(light - hit.p);
            Ray::segment(ray.o, light - ray.o, 1.0)
        })
        .collect();

    let closest = |rays: &[Ray]| rate(rays, runs, |r| accel.intersect(r).map_or(0, |h| u64::from(h.primitive)));
    let occluded = |rays: &[Ray]| rate(rays, runs, |r| u64::from(accel.occluded(r)));
    let count = geometry.meshes[0].triangles.len();
    Ok(Row {
        triangles: count,
        build_s,
        bytes_per_triangle: accel.bytes() as f64 / count as f64,
        camera: closest(&camera),
        first_bounce: closest(&first),
        second_bounce: closest(&second),
        occlusion_first: occluded(&first),
        occlusion_second: occluded(&second),
        shadow: occluded(&shadow),
    })
}

fn hits<'a>(geometry: &'a Geometry, accel: &'a Accel, rays: &'a [Ray]) -> impl Iterator<Item = Interaction> + 'a {
    rays.iter().filter_map(|r| accel.intersect(r).map(|h| geometry.interaction(r, &h)))
}

/// One cosine-distributed ray from each hit, on the side that the ray came from.
fn bounce(geometry: &Geometry, accel: &Accel, rays: &[Ray], random: &mut Random) -> Vec<Ray> {
    rays.iter()
        .filter_map(|r| {
            let hit = geometry.interaction(r, &accel.intersect(r)?);
            let n = if hit.ng.dot(r.d) > 0.0 { -hit.ng } else { hit.ng };
            let w = Frame::from_normal(n).to_world(warp::cosine_hemisphere(Vec2::new(random.next(), random.next())));
            Some(hit.spawn_ray(w))
        })
        .collect()
}

/// Million rays a second, median over the runs.
fn rate(rays: &[Ray], runs: usize, trace: impl Fn(&Ray) -> u64) -> f64 {
    let mut times: Vec<f64> = (0..=runs)
        .map(|_| {
            let started = Instant::now();
            std::hint::black_box(rays.iter().map(&trace).sum::<u64>());
            started.elapsed().as_secs_f64()
        })
        .skip(1)
        .collect();
    times.sort_by(f64::total_cmp);
    rays.len() as f64 / times[times.len() / 2] / 1e6
}

/// The rows as a table.
pub fn table(rows: &Vec<Row>) -> String {
    let mut text = String::from(
        "                                Mray/s: closest hit               occlusion\n\
         triangles  build s  bytes/tri   camera  bounce 1  bounce 2   bounce 1  bounce 2  shadow",
    );
    for r in rows {
        text += &format!(
            "\n{:9}  {:7.2}  {:9.1}   {:6.2}  {:8.2}  {:8.2}   {:8.2}  {:8.2}  {:6.2}",
            r.triangles,
            r.build_s,
            r.bytes_per_triangle,
            r.camera,
            r.first_bounce,
            r.second_bounce,
            r.occlusion_first,
            r.occlusion_second,
            r.shadow
        );
    }
    text
}
