//! Sets of rays as paths make them.

use crate::meshes::Random;
use renderer::accel::Accel;
use renderer::geometry::{Geometry, Interaction};
use renderer::math::{Frame, Ray, Vec2, Vec3};
use renderer::sampling::warp;
use std::hint::black_box;
use std::time::Instant;

/// Rays of one kind.
pub struct Set {
    /// What it is called.
    pub name: &'static str,
    /// Whether only occlusion is asked.
    pub occlusion: bool,
    /// The rays.
    pub rays: Vec<Ray>,
}

impl Set {
    /// Seconds for all rays, one after the other.
    pub fn time(&self, accel: &Accel) -> f64 {
        let started = Instant::now();
        let sum: u64 = if self.occlusion {
            self.rays.iter().map(|r| u64::from(accel.occluded(r))).sum()
        } else {
            self.rays.iter().map(|r| accel.intersect(r).map_or(0, |h| u64::from(h.primitive))).sum()
        };
        black_box(sum);
        started.elapsed().as_secs_f64()
    }
}

/// Camera rays, the diffuse bounces from where they hit and the bounces from there; occlusion on both; shadow rays from the first hits
/// to a lamp under the ceiling.
pub fn all(geometry: &Geometry, accel: &Accel, camera: Vec<Ray>) -> Vec<Set> {
    let mut random = Random(7);
    let first = bounce(geometry, accel, &camera, &mut random);
    let second = bounce(geometry, accel, &first, &mut random);
    let shadow = to_lamp(geometry, accel, &camera, &mut random);
    let set = |name, occlusion, rays| Set { name, occlusion, rays };
    vec![
        set("camera", false, camera),
        set("bounce 1", false, first.clone()),
        set("bounce 2", false, second.clone()),
        set("occlusion, bounce 1", true, first),
        set("occlusion, bounce 2", true, second),
        set("occlusion, to a lamp", true, shadow),
    ]
}

/// Rays from `eye` through a square picture, row by row.
pub fn pinhole(eye: Vec3, target: Vec3, width: f32, side: usize) -> Vec<Ray> {
    let frame = Frame::from_normal((target - eye).normalize());
    (0..side * side)
        .map(|i| {
            let (x, y) = ((i % side) as f32 / side as f32 - 0.5, (i / side) as f32 / side as f32 - 0.5);
            Ray::new(eye, (frame.n + frame.s * x * width + frame.t * y * width).normalize())
        })
        .collect()
}

fn hits<'a>(geometry: &'a Geometry, accel: &'a Accel, rays: &'a [Ray]) -> impl Iterator<Item = Interaction> + 'a {
    rays.iter().filter_map(|r| accel.intersect(r).map(|h| geometry.interaction(r, &h)))
}

/// One cosine-distributed ray from each hit, on the side that the ray came from.
pub fn bounce(geometry: &Geometry, accel: &Accel, rays: &[Ray], random: &mut Random) -> Vec<Ray> {
    rays.iter()
        .filter_map(|r| {
            let hit = geometry.interaction(r, &accel.intersect(r)?);
            let n = if hit.ng.dot(r.d) > 0.0 { -hit.ng } else { hit.ng };
            let w = Frame::from_normal(n).to_world(warp::cosine_hemisphere(Vec2::new(random.next(), random.next())));
            Some(hit.spawn_ray(w))
        })
        .collect()
}

/// A ray from each hit to a point of a square under the top of the scene, half as wide as the sphere around it is.
fn to_lamp(geometry: &Geometry, accel: &Accel, rays: &[Ray], random: &mut Random) -> Vec<Ray> {
    let bounds = geometry.bounds();
    // Of a cube's sphere the cube is 1 / sqrt 3.
    let half = bounds.radius / 3f32.sqrt();
    hits(geometry, accel, rays)
        .map(|hit| {
            let on_lamp = Vec3::new(random.next() - 0.5, 0.99, random.next() - 0.5) * half;
            let light = bounds.centre + on_lamp;
            let ray = hit.spawn_ray(light - hit.p);
            Ray::segment(ray.o, light - ray.o, 1.0)
        })
        .collect()
}
