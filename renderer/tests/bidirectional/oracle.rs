//! The weights of a path from first principles: every density of every strategy is evaluated anew at the path's points, and whole
//! products are compared in the logarithm (Veach 1997, equations 10.3 to 10.9). Slow, and shares no code with the walks.

use renderer::bsdf::{ShadingPoint, Transport};
use renderer::camera::Camera;
use renderer::geometry::Interaction;
use renderer::math::{Anchor, Ray, Vec3};
use renderer::scene::Scene;

/// A path from the light to the lens, as points.
pub struct Path {
    /// Index of the light.
    pub light: usize,
    /// The light's point; of a light infinitely far away, the direction in which its light travels.
    pub start: Start,
    /// Surfaces, from the light's end.
    pub surfaces: Vec<Anchor>,
    /// The lens.
    pub lens: Vec3,
}

impl Path {
    /// Whether its directions are known to some seven digits from its points: edges not much shorter than the scene, none grazing.
    /// Elsewhere the points' rounding moves the densities themselves.
    pub fn is_well_conditioned(&self) -> bool {
        let mut points: Vec<Anchor> = self.surfaces.clone();
        if let Start::At(p) = self.start {
            points.insert(0, p);
        }
        points.push(Anchor::free(self.lens));
        points.windows(2).all(|pair| {
            let d = pair[1].p - pair[0].p;
            let steep = |a: &Anchor| a.ng == Vec3::ZERO || a.ng.dot(d).abs() > 0.1 * d.length();
            d.length() > 0.3 && pair.iter().all(steep)
        })
    }
}

/// Where the light comes from.
#[derive(Clone, Copy)]
pub enum Start {
    /// A point of the light.
    At(Anchor),
    /// From infinity, travelling along this.
    Along(Vec3),
}

/// Weights of all strategies s = 0 ..= edges (t = edges + 1 - s) of a path, by the power heuristic.
pub fn weights(scene: &Scene, camera: &Camera, path: &Path) -> Vec<f64> {
    let n = path.surfaces.len();
    let edges = n + 1;
    let hits: Vec<Interaction> = (0..n).map(|i| surface(scene, path, i)).collect();
    let log = |s: usize| log_density(scene, camera, path, &hits, s);
    let logs: Vec<f64> = (0..=edges).map(log).collect();
    let largest = logs.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    let squares: Vec<f64> = logs.iter().map(|l| libm::exp(2.0 * (l - largest))).collect();
    let total: f64 = squares.iter().sum();
    squares.iter().map(|s| s / total).collect()
}

/// All there is to know of surface `i`, found again by a ray from its neighbour on the camera's side.
fn surface(scene: &Scene, path: &Path, i: usize) -> Interaction {
    let from = path.surfaces.get(i + 1).copied().unwrap_or(Anchor::free(path.lens));
    let at = path.surfaces[i];
    let w = (at.p - from.p).normalize();
    let ray: Ray = from.ray(w);
    let hit = scene.accel.intersect(&ray).unwrap();
    let mut hit = scene.geometry.interaction(&ray, &hit);
    // The very point of the path: distances to neighbours may be short.
    assert!((hit.p - at.p).length() < 1e-4, "the path's surface is there: {} {}", hit.p, at.p);
    (hit.p, hit.p_error) = (at.p, at.p_error);
    hit
}

/// Logarithm of the density with which strategy s makes the path; minus infinity when it can't.
fn log_density(scene: &Scene, camera: &Camera, path: &Path, hits: &[Interaction], s: usize) -> f64 {
    let light = &scene.lights[path.light];
    let flags = light.flags();
    if s == 0 && flags.is_delta() {
        return f64::NEG_INFINITY;
    }
    let context = scene.light_context();
    let edges = hits.len() + 1;
    let mut log = 0.0;
    let pmf = f64::from(scene.selector.pmf(path.light));
    // From the light: vertices 0 .. s - 1.
    for i in 0..s {
        let density = match (i, path.start) {
            // The one point or direction: the same density in all strategies.
            (0, _) if flags.is_delta() => pmf,
            (0, Start::At(p)) if s == 1 => {
                let pdf = light.pdf_li(&context, hits[0].p, &p);
                pmf * f64::from(pdf) * per_area(&p, hits[0].p)
            }
            (0, Start::At(p)) => pmf * f64::from(light.pdf_le(&context, p.ng, (hits[0].p - p.p).normalize()).0),
            (0, Start::Along(w)) => pmf * f64::from(light.pdf_li_escaped(-w)),
            (1, Start::At(p)) => {
                let pdf = light.pdf_le(&context, p.ng, (hits[0].p - p.p).normalize()).1;
                f64::from(pdf) * per_area(&hits[0].anchor(), p.p)
            }
            (1, Start::Along(w)) => f64::from(light.pdf_le(&context, w, w).0) * f64::from(hits[0].ng.dot(w).abs()),
            _ => {
                let before = if i == 2 { to_light(path, hits) } else { (hits[i - 3].p - hits[i - 2].p).normalize() };
                scatter(scene, &hits[i - 2], before, hits[i - 1].p, Transport::Importance)
                    * per_area(&hits[i - 1].anchor(), hits[i - 2].p)
            }
        };
        log += libm::log(density);
    }
    // From the camera: vertices edges - 1 down to s (the lens, vertex `edges`, is common to all).
    for i in (s..edges).rev() {
        let next = |i: usize| if i == edges { path.lens } else { hits[i - 1].p };
        let density = if i == edges - 1 {
            let w = (hits[i - 1].p - path.lens).normalize();
            f64::from(camera.pdf_we(w).1) * per_area(&hits[i - 1].anchor(), path.lens)
        } else {
            let at = &hits[i];
            let wo = (next(i + 2) - at.p).normalize();
            match (i, path.start) {
                (0, Start::At(p)) => scatter(scene, at, wo, p.p, Transport::Radiance) * per_area(&p, at.p),
                (0, Start::Along(w)) => scatter(scene, at, wo, at.p - w, Transport::Radiance),
                _ => scatter(scene, at, wo, hits[i - 1].p, Transport::Radiance) * per_area(&hits[i - 1].anchor(), at.p),
            }
        };
        log += libm::log(density);
    }
    log
}

fn to_light(path: &Path, hits: &[Interaction]) -> Vec3 {
    match path.start {
        Start::At(p) => (p.p - hits[0].p).normalize(),
        Start::Along(w) => -w,
    }
}

/// Density per solid angle of a walk at `hit` that came from `wo` to go on towards `to`.
fn scatter(scene: &Scene, hit: &Interaction, wo: Vec3, to: Vec3, mode: Transport) -> f64 {
    let material = scene.objects[hit.object.0 as usize].material;
    let shading = ShadingPoint::new(&scene.materials, &scene.textures, material, hit, wo);
    f64::from(shading.pdf((to - hit.p).normalize(), mode))
}

/// From directions at `from` to area at `at`.
fn per_area(at: &Anchor, from: Vec3) -> f64 {
    let d = at.p.as_dvec3() - from.as_dvec3();
    let d2 = d.length_squared();
    let cos = if at.ng == Vec3::ZERO { 1.0 } else { at.ng.as_dvec3().dot(d).abs() / d2.sqrt() };
    cos / d2
}
