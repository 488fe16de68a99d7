//! Random walks from the camera and from the lights.

use super::mis::{Heuristic, delta_density};
use super::vertex::{Edge, Escape, LightStart, Subpath, Vertex, VertexKind};
use super::{Counters, roulette};
use crate::bsdf::{DirectionSample, ShadingPoint, Transport};
use crate::camera::Camera;
use crate::light::LightSelector;
use crate::math::{Anchor, Ray, Vec2};
use crate::sampling::Sampler;
use crate::scene::Scene;
use crate::spectrum::Rgb;

/// Traces and connects walks.
#[derive(Debug)]
pub struct Tracer<'a> {
    /// The scene.
    pub scene: &'a Scene,
    /// The camera, for the film's size.
    pub camera: &'a Camera,
    /// Chooses lights.
    pub selector: &'a LightSelector,
    /// Edges from which Russian roulette may end a walk; `None` = never.
    pub rr_depth: Option<u32>,
    /// How strategies share a path.
    pub heuristic: Heuristic,
    /// What was met.
    pub counters: Counters,
}

/// Where a walk is.
struct Head {
    ray: Ray,
    beta: Rgb,
    /// Density of the ray's direction (from an infinite light: of its point on the disk).
    pdf: f64,
    /// What the roulette measures `beta` by.
    unit: f32,
}

impl Tracer<'_> {
    /// Walks from the camera along `ray` until there are `limit` vertices, the lens among them.
    pub fn camera_walk(&mut self, path: &mut Subpath, sampler: &mut impl Sampler, ray: Ray, limit: usize) {
        path.clear();
        let (pdf_pos, pdf_dir) = self.camera.pdf_we(ray.d);
        path.vertices.push(Vertex {
            kind: VertexKind::Lens,
            anchor: Anchor::free(ray.o),
            beta: Rgb::ONE,
            pdf_fwd: f64::from(pdf_pos),
            edge: Edge::NONE,
            delta: false,
            tail: 0.0,
            emitted: None,
        });
        let head = Head { ray, beta: Rgb::ONE, pdf: f64::from(pdf_dir), unit: 1.0 };
        self.walk(path, sampler, head, Transport::Radiance, limit);
    }

    /// Walks from a light until there are `limit` vertices, the light among them.
    pub fn light_walk(&mut self, path: &mut Subpath, sampler: &mut impl Sampler, limit: usize) {
        path.clear();
        sampler.start_vertex(0);
        let (uc, u_pos, u_dir) = (sampler.next_1d(), sampler.next_2d(), sampler.next_2d());
        let Some(choice) = self.selector.sample(uc) else { return };
        let light = &self.scene.lights[choice.index];
        let Some(le) = light.sample_le(&self.scene.light_context(), choice.u, u_pos, u_dir) else { return };
        let pmf = f64::from(choice.pmf);
        let (pdf_pos, pdf_dir) = (f64::from(le.pdf_pos), f64::from(le.pdf_dir));
        let (own, onwards) = if le.flags.infinite { (pdf_dir, pdf_pos) } else { (pdf_pos, pdf_dir) };
        path.light = Some(LightStart { index: choice.index, flags: le.flags, direct: 1.0 });
        path.vertices.push(Vertex {
            kind: VertexKind::Light,
            anchor: le.light,
            beta: Rgb::ONE,
            pdf_fwd: pmf * own,
            edge: Edge::NONE,
            delta: false,
            tail: 0.0,
            emitted: None,
        });
        let beta = le.throughput() / choice.pmf;
        let head = Head { ray: le.ray, beta, pdf: onwards, unit: beta.max_component() };
        self.walk(path, sampler, head, Transport::Importance, limit);
    }

    fn walk(&mut self, path: &mut Subpath, sampler: &mut impl Sampler, mut head: Head, mode: Transport, limit: usize) {
        let scene = self.scene;
        // Product of squared index ratios so far: radiance is scaled by it inside glass, which must not steer the roulette.
        let mut eta_scale = 1.0f32;
        while path.vertices.len() < limit && self.counters.admit(head.beta) && !head.beta.is_black() {
            // Find the next surface.
            let edges = path.vertices.len() as u32;
            sampler.start_vertex(edges);
            self.counters.rays += 1;
            let Some(hit) = scene.accel.intersect(&head.ray) else {
                path.escape = Some(Escape { w: head.ray.d, beta: head.beta, pdf: head.pdf });
                return;
            };
            let hit = scene.geometry.interaction(&head.ray, &hit);
            let wo = -head.ray.d;
            let edge = self.edge_to(path, &hit.anchor(), &head.ray);
            let info = &scene.objects[hit.object.0 as usize];
            let shading = ShadingPoint::new(&scene.materials, &scene.textures, info.material, &hit, wo);
            let emitted = match (mode, info.light) {
                (Transport::Radiance, Some(index)) => {
                    Some((index, scene.lights[index as usize].radiance(&scene.light_context(), &hit, wo)))
                }
                _ => None,
            };
            path.vertices.push(Vertex {
                kind: VertexKind::Surface(shading),
                anchor: hit.anchor(),
                beta: head.beta,
                pdf_fwd: head.pdf * edge.forward,
                edge,
                delta: false,
                tail: 0.0,
                emitted,
            });
            if path.vertices.len() >= limit {
                return;
            }

            // Go on in a direction drawn from the BSDF.
            let (uc, u) = (sampler.next_1d(), sampler.next_2d());
            let Some(s) = shading.sample(uc, u, mode) else { return };
            self.leave(path, &shading, &s, mode);
            head.beta *= s.weight();
            if mode == Transport::Importance {
                head.beta *= shading.adjoint_correction(s.wi);
            } else {
                eta_scale *= s.eta * s.eta;
            }
            head.pdf = match (s.lobe.delta, mode) {
                (false, _) => f64::from(s.pdf),
                (true, Transport::Radiance) => delta_density(s.cos_theta, shading.wo.z.abs(), s.eta),
                (true, Transport::Importance) => 1.0,
            };
            head.ray = hit.spawn_ray(s.wi);

            // End the walk by chance when it carries little of what it started with. The chance depends on the walk's history, so it
            // stays out of the densities.
            if self.rr_depth.is_some_and(|from| edges >= from) {
                let left = head.beta * (eta_scale / head.unit);
                let Some(factor) = roulette(left, sampler.next_1d()) else { return };
                head.beta *= factor;
            }
        }
    }

    /// The edge from the last vertex to `to`, along `ray`.
    #[inline]
    fn edge_to(&self, path: &mut Subpath, to: &Anchor, ray: &Ray) -> Edge {
        let from = path.vertices[path.vertices.len() - 1].anchor;
        let Some(light) = path.light.as_mut().filter(|_| path.vertices.len() == 1) else {
            return Edge::between(&from, to, ray.d);
        };
        if light.flags.infinite {
            return Edge::from_infinity(to, ray.d);
        }
        let edge = Edge::between(&from, to, ray.d);
        // How likely the light's point is when it is sampled from here.
        if !light.flags.is_delta() {
            let pdf = self.selector.pmf(light.index)
                * self.scene.lights[light.index].pdf_li(&self.scene.light_context(), to.p, &from);
            light.direct = f64::from(pdf) * edge.backward / path.vertices[0].pdf_fwd;
        }
        edge
    }

    /// The walk leaves its last vertex by `s`: now the way back from here to the vertex before is known.
    #[inline]
    fn leave(&self, path: &mut Subpath, shading: &ShadingPoint, s: &DirectionSample, mode: Transport) {
        let last = path.vertices.len() - 1;
        let pdf_back = match (s.lobe.delta, mode) {
            (false, Transport::Radiance) => f64::from(shading.pdf_reverse(s.wi, Transport::Importance)),
            (false, Transport::Importance) => f64::from(shading.pdf_reverse(s.wi, Transport::Radiance)),
            (true, Transport::Radiance) => 1.0,
            (true, Transport::Importance) => delta_density(shading.wo.z.abs(), s.cos_theta, 1.0 / s.eta),
        };
        let before = path.vertices.get(last.wrapping_sub(2)).map_or(0.0, |v| v.tail);
        let step = path.step(last - 1, pdf_back * path.vertices[last].edge.backward, false);
        path.vertices[last - 1].tail = self.heuristic.fold(before, step);
        path.vertices[last].delta = s.lobe.delta;
    }

    /// A point of the lens, for a walk that is to be connected to the camera.
    #[inline]
    pub fn lens_numbers(&self, sampler: &mut impl Sampler) -> Vec2 {
        if self.camera.is_pinhole() { Vec2::ZERO } else { sampler.next_2d() }
    }
}
