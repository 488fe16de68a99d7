//! What a chain has found counts for the pixels around.
//!
//! Chains stay for long where they have found light, and so most of the noise of a picture is how often a region happened to be visited:
//! it is alike in neighbouring pixels. So now and then not the path at hand is splatted, but all paths that differ from it in nothing but
//! the raster position and what follows from that: from positions on a lattice around, through the same mirrors and glasses, to the first
//! surface that is neither, and from there to the vertex after it, which they have in common.
//!
//! A chain's density of paths is proportional to the target `T`, whatever technique made them, since the weights of all techniques add
//! up to one. So if a path is drawn with probability `T / b`, and then one of the set of those that differ as said, with probabilities
//! proportional to their `T`, the outcome is distributed as the chain is (Gibbs sampling, one step of heat bath). What is splatted is the
//! expectation over that choice: the contribution of each over the sum of all `T`. No density of any technique takes part; the ratio
//! of two paths is that of what happens between the lens and the vertex that they have in common, as in
//! Bekaert, Sbert and Halton 2002, "Accelerating Path Tracing by Re-Using Paths".
//!
//! From every path of a set the same set must follow. So lattices are cut from the picture without regard to the path, and those paths
//! make no set, from wherever one looks, that have a delta lobe at one of the two vertices that are joined, pass through the first of
//! them, or lose a colour; nor is the vertex in common seen from more than one side. What makes no set counts for itself, with every
//! mutation.

use super::chain::splat;
use super::constants::ChainConstants;
use super::evaluate::{Evaluator, Proposal};
use crate::bsdf::{DirectionSample, ShadingPoint, Transport};
use crate::film::SplatSums;
use crate::integrator::UnitContext;
use crate::math::{Anchor, ONE_MINUS_EPSILON, Ray, Vec2, Vec3};
use crate::path::{Scattering, Vertex, VertexKind};
use crate::spectrum::Rgb;

/// Points of the lattice along each axis.
const SIDE: i64 = 8;
/// Pixels from one to the next.
const STRIDE: i64 = 2;
/// Share in the picture of those mutations that count for the pixels around.
const SHARE: f64 = 0.8;
/// Mirrors and glasses that a path may meet before its first other surface.
const MAX_PASSED: u32 = 16;

/// How much the mutations of a chain count that leads to sets: every `period`th with the neighbours, the others without.
#[derive(Clone, Copy, Debug)]
pub(super) struct Period {
    period: u32,
    /// Weight of a mutation without neighbours.
    alone: f64,
    /// Weight of one with them.
    together: f64,
}

impl Period {
    /// For chains of `mutations`; the weights add up to their number. `None` when none takes neighbours.
    pub(super) fn new(period: u32, mutations: u32) -> Option<Self> {
        let together = mutations.checked_div(period).filter(|n| *n > 0)?;
        let alone = mutations - together;
        let share = if alone == 0 { 1.0 } else { SHARE };
        let each = |share: f64, n: u32| share * f64::from(mutations) / f64::from(n.max(1));
        Some(Self { period, alone: each(1.0 - share, alone), together: each(share, together) })
    }

    /// Whether a mutation takes the neighbours.
    pub fn has(&self, mutation: u32) -> bool {
        mutation % self.period == self.period - 1
    }

    /// Weight of a mutation of a path that makes a set.
    pub fn weight(&self, together: bool) -> f64 {
        if together { self.together } else { self.alone }
    }
}

/// What the paths of a set have in common.
#[derive(Clone, Copy, Debug)]
pub struct Tail {
    lens_u: Vec2,
    /// Number of mirrors and glasses first met, and a bit for each that is passed through.
    passed: u32,
    transmitted: u32,
    /// The vertex in common.
    anchor: Anchor,
    shading: ShadingPoint,
    /// Unit direction from there to the next; `None` if `shading` is seen from that.
    onward: Option<Vec3>,
    /// Unit direction from there to the vertex before, of the path at hand.
    back: Vec3,
    /// What happens between the lens and the vertex in common, on the path at hand.
    own: Rgb,
}

/// Where a camera ray ends: the first surface that is neither mirror nor glass.
struct End {
    anchor: Anchor,
    shading: ShadingPoint,
    /// Unit direction from which it is seen.
    wo: Vec3,
    /// What mirrors and glasses left of the radiance.
    throughput: Rgb,
}

impl Tail {
    /// That of the path which was made last, if it makes a set; `ray` is its camera ray, `connection` the direction in which the two walks
    /// were joined, from the camera's.
    pub(super) fn of(
        e: &Evaluator<'_>,
        path: &Proposal,
        lens_u: Vec2,
        ray: &Ray,
        connection: Option<Vec3>,
    ) -> Option<Self> {
        let (camera, light) = (&e.camera.vertices, &e.light.vertices);
        let s = path.technique as usize;
        let t = e.edges + 1 - s;
        let passed = if t == 1 { 0 } else { camera[1..].iter().take_while(|v| v.delta).count() };
        // The vertex in common is followed by another.
        if passed + 3 > e.edges || passed as u32 > MAX_PASSED {
            return None;
        }

        // Find the vertices that are joined, and where the path goes on.
        let (first, common, onward) = match t - passed {
            1 => (&light[s - 1], &light[s - 2], None),
            2 => (&camera[t - 1], &light[s - 1], None),
            left => {
                let common = camera.get(passed + 2)?;
                let onward = match camera.get(passed + 3) {
                    _ if left == 3 => connection?.normalize(),
                    Some(next) => (next.anchor.p - common.anchor.p).normalize(),
                    None => e.camera.escape?.w,
                };
                (&camera[passed + 1], common, Some(onward))
            }
        };
        let ((end, at_end), (anchor, shading)) = (connectible(first)?, connectible(common)?);

        // What mirrors and glasses did.
        let (mut throughput, mut transmitted, mut wo) = (Rgb::ONE, 0, -ray.d);
        for (i, v) in camera.iter().skip(1).take(passed).enumerate() {
            let VertexKind::Inner(Scattering::Surface(at)) = &v.kind else { return None };
            let wi = (camera[i + 2].anchor.p - v.anchor.p).normalize();
            let transmission = v.anchor.ng.dot(wo) * v.anchor.ng.dot(wi) < 0.0;
            let event = delta_event(at, transmission)?;
            throughput *= event.weight() * event.pdf;
            transmitted |= u32::from(transmission) << i;
            wo = -wi;
        }
        let back = (end.p - anchor.p).normalize();
        let (anchor, shading) = (*anchor, *shading);
        let passed = passed as u32;
        let mut tail = Self { lens_u, passed, transmitted, anchor, shading, onward, back, own: Rgb::ZERO };
        tail.own = tail.joined(&End { anchor: *end, shading: *at_end, wo, throughput }, t == 1)?;
        Some(tail)
    }

    /// What happens between the lens and the vertex in common if `end` is joined to that, visibility left out; `None` if that path is not
    /// of the set. `turned`: the shading of the end is seen from the vertex in common.
    fn joined(&self, end: &End, turned: bool) -> Option<Rgb> {
        let d = end.anchor.p - self.anchor.p;
        let d2 = d.length_squared();
        let w = d / d2.sqrt();
        let alike = |n: Vec3, a: Vec3, b: Vec3| n.dot(a) * n.dot(b) > 0.0;
        let sides = alike(end.anchor.ng, end.wo, -w)
            && alike(self.anchor.ng, w, self.back)
            && alike(self.shading.frame.n, w, self.back);
        if !(d2 > 0.0 && sides) {
            return None;
        }
        // Reflection is the same for radiance and importance.
        let reflected = match turned {
            true => end.shading.eval(end.wo, Transport::Importance),
            false => end.shading.eval(-w, Transport::Radiance),
        };
        let at = &self.shading;
        let common = match self.onward {
            Some(onward) => at.seen_from(w).eval(onward, Transport::Radiance) * self.anchor.ng.dot(w).abs(),
            None => at.eval(w, Transport::Importance) * (at.abs_cos(w) * at.adjoint_correction(w)),
        };
        let all = end.throughput * reflected * common * (end.shading.abs_cos(w) / d2);
        (all.min_component() > 0.0 && all.is_valid()).then_some(all)
    }
}

/// A surface that can be joined to others, and that its walk did not leave by a delta lobe.
fn connectible(vertex: &Vertex) -> Option<(&Anchor, &ShadingPoint)> {
    match &vertex.kind {
        VertexKind::Inner(Scattering::Surface(at)) if !vertex.delta && !at.is_delta_only() => {
            Some((&vertex.anchor, at))
        }
        _ => None,
    }
}

/// The delta lobe that reflects or passes on: the first or the last of those that there are.
fn delta_event(at: &ShadingPoint, transmission: bool) -> Option<DirectionSample> {
    let event = |uc: f32| at.sample(uc, Vec2::splat(0.5), Transport::Radiance);
    let wanted = |s: &DirectionSample| s.lobe.delta && s.lobe.transmission == transmission;
    event(0.0).filter(wanted).or_else(|| event(ONE_MINUS_EPSILON).filter(wanted))
}

/// Splats paths with their neighbours.
pub(super) struct Neighbours<'a> {
    c: &'a UnitContext<'a>,
    constants: &'a ChainConstants,
    /// Those of a set that contribute: raster positions, contributions and targets.
    found: Vec<(Vec2, Rgb, f64)>,
    /// From the first surfaces of the others to the vertex in common.
    rays_to: Vec<Ray>,
    /// Rays that were traced.
    pub rays: u64,
}

impl<'a> Neighbours<'a> {
    pub fn new(c: &'a UnitContext<'a>, constants: &'a ChainConstants) -> Self {
        Self { c, constants, found: Vec::new(), rays_to: Vec::new(), rays: 0 }
    }

    /// Splats `weight` times the path's contribution, dealt to the paths of its set; `bits` move the grid of lattices.
    pub fn splat(&mut self, path: &Proposal, tail: &Tail, weight: f64, bits: u64, splats: &mut SplatSums) {
        let size = Vec2::new(self.c.view.width as f32, self.c.view.height as f32);
        // Find the paths of the set, visibility left out.
        self.found.clear();
        self.rays_to.clear();
        // How many steps back the lattice begins.
        let back = |x: f32, bits: u32| (x as i64 + i64::from(bits) % (SIDE * STRIDE)) % (SIDE * STRIDE) / STRIDE;
        let (back_x, back_y) = (back(path.raster.x, (bits >> 32) as u32), back(path.raster.y, bits as u32));
        let steps = (-back_y..SIDE - back_y).flat_map(|j| (-back_x..SIDE - back_x).map(move |i| (i, j)));
        for (i, j) in steps.filter(|step| *step != (0, 0)) {
            let raster = path.raster + Vec2::new((i * STRIDE) as f32, (j * STRIDE) as f32);
            let Some((end, joined)) = self.joined(tail, raster) else { continue };
            let value = path.value * (joined / tail.own);
            let target = self.constants.target_of(value, raster, size);
            if target > 0.0 {
                self.found.push((raster, value, f64::from(target)));
                self.rays_to.push(end.segment_to(&tail.anchor));
            }
        }

        // Leave out those whose first surface does not see the vertex in common.
        self.rays += self.rays_to.len() as u64;
        let mut hidden = self.c.scene.accel.occluded_each(&self.rays_to);
        self.found.retain(|_| hidden.next() == Some(false));
        let own = f64::from(self.constants.target_of(path.value, path.raster, size));
        self.found.push((path.raster, path.value, own));
        let sum: f64 = self.found.iter().map(|(_, _, target)| target).sum();
        if own > 0.0 {
            for &(raster, value, _) in &self.found {
                splat(self.c, splats, value, raster, weight * own / sum);
            }
        }
    }

    /// Where the path of a tail's set through a raster position meets the first surface, and what happens on it, visibility left out;
    /// `None` if there is none.
    fn joined(&mut self, tail: &Tail, raster: Vec2) -> Option<(Anchor, Rgb)> {
        if !self.c.view.camera.shows(raster) {
            return None;
        }
        let end = self.end(tail, raster)?;
        Some((end.anchor, tail.joined(&end, false)?))
    }

    /// Follows the camera ray through as many mirrors and glasses as the tail's path met.
    fn end(&mut self, tail: &Tail, raster: Vec2) -> Option<End> {
        let scene = self.c.scene;
        let mut ray = self.c.view.camera.generate_ray(raster, tail.lens_u);
        let mut throughput = Rgb::ONE;
        for i in 0..=tail.passed {
            self.rays += 1;
            let hit = scene.geometry.interaction(&ray, &scene.accel.intersect(&ray)?);
            let (anchor, wo) = (hit.anchor(), -ray.d);
            let material = scene.objects[hit.object.0 as usize].material;
            let shading = ShadingPoint::new(&scene.materials, &scene.textures, material, &hit, wo);
            if i == tail.passed {
                return (!shading.is_delta_only()).then_some(End { anchor, shading, wo, throughput });
            }
            let event = delta_event(&shading, tail.transmitted >> i & 1 == 1)?;
            throughput *= event.weight() * event.pdf;
            ray = anchor.ray(event.wi);
        }
        None
    }
}

#[cfg(test)]
mod tests;
