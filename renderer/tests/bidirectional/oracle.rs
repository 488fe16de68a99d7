//! The weights of a path from first principles: every density of every strategy is evaluated anew at the path's points, and whole
//! products are compared in the logarithm (Veach 1997, equations 10.3 to 10.9). Slow, and shares no code with the walks.

use crate::scenes::Fog;
use renderer::bsdf::{ShadingPoint, Transport};
use renderer::camera::Camera;
use renderer::geometry::Interaction;
use renderer::math::{Anchor, Ray, Vec3};
use renderer::medium::Medium;
use renderer::scene::Scene;

/// A path from the light to the lens, as points.
pub struct Path {
    /// Index of the light.
    pub light: usize,
    /// The light's point; of a light infinitely far away, the direction in which its light travels.
    pub start: Start,
    /// What it meets, from the light's end.
    pub points: Vec<Point>,
    /// The lens.
    pub lens: Vec3,
}

impl Path {
    /// Whether its directions are known to some seven digits from its points: edges not much shorter than the scene, none grazing.
    /// Elsewhere the points' rounding moves the densities themselves.
    pub fn is_well_conditioned(&self) -> bool {
        let mut points: Vec<Anchor> = self.points.iter().map(|p| p.anchor).collect();
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

/// A point between the light and the lens.
#[derive(Clone, Copy)]
pub struct Point {
    /// Where it is.
    pub anchor: Anchor,
    /// The medium, if it is no surface.
    pub medium: Option<Medium>,
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
pub fn weights(scene: &Scene, camera: &Camera, fog: &Fog, path: &Path) -> Vec<f64> {
    let n = path.points.len();
    let edges = n + 1;
    let met: Vec<Met> = (0..n).map(|i| meet(scene, path, i)).collect();
    let log = |s: usize| log_density(scene, camera, fog, path, &met, s);
    let logs: Vec<f64> = (0..=edges).map(log).collect();
    let largest = logs.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    let squares: Vec<f64> = logs.iter().map(|l| libm::exp(2.0 * (l - largest))).collect();
    let total: f64 = squares.iter().sum();
    squares.iter().map(|s| s / total).collect()
}

/// What scatters at a point.
enum Met {
    Surface(Interaction),
    Medium(Vec3, Medium),
}

impl Met {
    fn p(&self) -> Vec3 {
        match self {
            Self::Surface(hit) => hit.p,
            Self::Medium(p, _) => *p,
        }
    }

    fn anchor(&self) -> Anchor {
        match self {
            Self::Surface(hit) => hit.anchor(),
            Self::Medium(p, _) => Anchor::free(*p),
        }
    }

    /// Density of flying along `w` exactly as far as from `from` to here: per length in a medium, else the chance of passing.
    fn reached(&self, fog: &Fog, from: Vec3) -> f64 {
        let tau = fog.depth(from, self.p());
        let medium = match self {
            Self::Surface(_) => None,
            Self::Medium(_, medium) => Some(medium),
        };
        distance(tau, medium)
    }
}

/// Mean over the colour channels of the density of a flight through depths `tau`.
fn distance(tau: [f64; 3], medium: Option<&Medium>) -> f64 {
    let channel = |c: usize| libm::exp(-tau[c]) * medium.map_or(1.0, |m| f64::from(m.sigma_t[c]));
    (0..3).map(channel).sum::<f64>() / 3.0
}

/// All there is to know of point `i`; a surface is found again by a ray from the side of its neighbour towards the camera.
fn meet(scene: &Scene, path: &Path, i: usize) -> Met {
    let at = path.points[i].anchor;
    if let Some(medium) = path.points[i].medium {
        return Met::Medium(at.p, medium);
    }
    let from = path.points.get(i + 1).map_or(path.lens, |p| p.anchor.p);
    let w = (at.p - from).normalize();
    // From close by: what rounding moves a distant ray by is much on a sphere seen at a grazing angle.
    let mut ray = Ray::new(at.p - w * 0.02, w);
    loop {
        let hit = scene.accel.intersect(&ray).unwrap();
        let mut hit = scene.geometry.interaction(&ray, &hit);
        // Surfaces that are not there are between.
        if scene.objects[hit.object.0 as usize].boundary.is_some_and(|b| b.null) {
            ray = hit.spawn_ray(w);
            continue;
        }
        // The very point of the path: distances to neighbours may be short.
        assert!((hit.p - at.p).length() < 1e-4, "the path's surface is there: {} {}", hit.p, at.p);
        (hit.p, hit.p_error) = (at.p, at.p_error);
        return Met::Surface(hit);
    }
}

/// Logarithm of the density with which strategy s makes the path; minus infinity when it can't.
fn log_density(scene: &Scene, camera: &Camera, fog: &Fog, path: &Path, met: &[Met], s: usize) -> f64 {
    let light = &scene.lights[path.light];
    let flags = light.flags();
    if s == 0 && flags.is_delta() {
        return f64::NEG_INFINITY;
    }
    let context = scene.light_context();
    let edges = met.len() + 1;
    let mut log = 0.0;
    let pmf = f64::from(scene.selector.pmf(path.light));
    let outside = |i: usize| {
        let Start::Along(w) = path.start else { return 1.0 };
        let medium = match &met[i] {
            Met::Surface(_) => None,
            Met::Medium(_, medium) => Some(medium),
        };
        distance(fog.depth(met[i].p(), met[i].p() - w * 1e4), medium)
    };
    // From the light: vertices 0 .. s - 1.
    for i in 0..s {
        let density = match (i, path.start) {
            // The one point or direction: the same density in all strategies.
            (0, _) if flags.is_delta() => pmf,
            (0, Start::At(p)) if s == 1 => {
                let pdf = light.pdf_li(&context, met[0].p(), &p);
                pmf * f64::from(pdf) * per_area(&p, met[0].p())
            }
            (0, Start::At(p)) => pmf * f64::from(light.pdf_le(&context, p.ng, (met[0].p() - p.p).normalize()).0),
            (0, Start::Along(w)) => pmf * f64::from(light.pdf_li_escaped(-w)),
            (1, Start::At(p)) => {
                let pdf = light.pdf_le(&context, p.ng, (met[0].p() - p.p).normalize()).1;
                f64::from(pdf) * per_area(&met[0].anchor(), p.p) * met[0].reached(fog, p.p)
            }
            (1, Start::Along(w)) => {
                let anchor = met[0].anchor();
                let cos = if anchor.ng == Vec3::ZERO { 1.0 } else { f64::from(anchor.ng.dot(w).abs()) };
                f64::from(light.pdf_le(&context, w, w).0) * cos * outside(0)
            }
            _ => {
                let before = if i == 2 { to_light(path, met) } else { (met[i - 3].p() - met[i - 2].p()).normalize() };
                scatter(scene, &met[i - 2], before, met[i - 1].p(), Transport::Importance)
                    * per_area(&met[i - 1].anchor(), met[i - 2].p())
                    * met[i - 1].reached(fog, met[i - 2].p())
            }
        };
        log += libm::log(density);
    }
    // From the camera: vertices edges - 1 down to s (the lens, vertex `edges`, is common to all).
    for i in (s..edges).rev() {
        let next = |i: usize| if i == edges { path.lens } else { met[i - 1].p() };
        let density = if i == edges - 1 {
            let w = (met[i - 1].p() - path.lens).normalize();
            f64::from(camera.pdf_we(w).1)
                * per_area(&met[i - 1].anchor(), path.lens)
                * met[i - 1].reached(fog, path.lens)
        } else {
            let at = &met[i];
            let wo = (next(i + 2) - at.p()).normalize();
            match (i, path.start) {
                (0, Start::At(p)) => {
                    scatter(scene, at, wo, p.p, Transport::Radiance)
                        * per_area(&p, at.p())
                        * distance(fog.depth(at.p(), p.p), None)
                }
                (0, Start::Along(w)) => {
                    scatter(scene, at, wo, at.p() - w, Transport::Radiance)
                        * distance(fog.depth(at.p(), at.p() - w * 1e4), None)
                }
                _ => {
                    scatter(scene, at, wo, met[i - 1].p(), Transport::Radiance)
                        * per_area(&met[i - 1].anchor(), at.p())
                        * met[i - 1].reached(fog, at.p())
                }
            }
        };
        log += libm::log(density);
    }
    log
}

fn to_light(path: &Path, met: &[Met]) -> Vec3 {
    match path.start {
        Start::At(p) => (p.p - met[0].p()).normalize(),
        Start::Along(w) => -w,
    }
}

/// Density per solid angle of a walk at `at` that came from `wo` to go on towards `to`.
fn scatter(scene: &Scene, at: &Met, wo: Vec3, to: Vec3, mode: Transport) -> f64 {
    let wi = (to - at.p()).normalize();
    match at {
        Met::Surface(hit) => {
            let material = scene.objects[hit.object.0 as usize].material;
            let shading = ShadingPoint::new(&scene.materials, &scene.textures, material, hit, wo);
            f64::from(shading.pdf(wi, mode))
        }
        Met::Medium(_, medium) => {
            // Henyey and Greenstein, in the textbook form.
            let g = f64::from(medium.phase.mean_cosine());
            let cos = -wo.as_dvec3().dot(wi.as_dvec3());
            let d = 1.0 + g * g - 2.0 * g * cos;
            (1.0 - g * g) / (4.0 * std::f64::consts::PI * d * d.sqrt())
        }
    }
}

/// From directions at `from` to area at `at`.
fn per_area(at: &Anchor, from: Vec3) -> f64 {
    let d = at.p.as_dvec3() - from.as_dvec3();
    let d2 = d.length_squared();
    let cos = if at.ng == Vec3::ZERO { 1.0 } else { at.ng.as_dvec3().dot(d).abs() / d2.sqrt() };
    cos / d2
}
