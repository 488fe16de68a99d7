//! Random walks from the camera and from the lights.

use super::mis::{Heuristic, delta_density};
use super::scattering::{MediumPoint, Scattering};
use super::vertex::{Edge, Escape, LightStart, Subpath, Vertex, VertexKind};
use super::{Counters, roulette};
use crate::bsdf::{DirectionSample, Transport};
use crate::camera::Camera;
use crate::geometry::Interaction;
use crate::light::LightSelector;
use crate::math::{Anchor, Ray, Vec2, Vec3};
use crate::medium::Channels;
use crate::sampling::Sampler;
use crate::scene::{Enclosures, Event, Scene};
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
    /// What encloses the ray.
    around: Enclosures,
}

impl Tracer<'_> {
    /// Walks from the camera along `ray` until there are `limit` vertices, the lens among them.
    pub fn camera_walk(&mut self, path: &mut Subpath, sampler: &mut impl Sampler, ray: Ray, limit: usize) {
        path.clear();
        let (pdf_pos, pdf_dir) = self.camera.pdf_we(ray.d);
        let lens = Vertex { pdf_fwd: f64::from(pdf_pos), ..self.lens(ray.o) };
        let around = lens.around;
        path.vertices.push(lens);
        let head = Head { ray, beta: Rgb::ONE, pdf: f64::from(pdf_dir), unit: 1.0, around };
        self.walk(path, sampler, head, Transport::Radiance, limit);
    }

    /// A vertex on the lens.
    pub fn lens(&self, p: Vec3) -> Vertex {
        let around = self.scene.camera_enclosures;
        Vertex { around, ..Vertex::first(VertexKind::Lens, Anchor::free(p), 0.0) }
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
        path.vertices.push(Vertex::first(VertexKind::Light, le.light, pmf * own));
        let beta = le.throughput() / choice.pmf;
        let around = if !self.scene.features.has_media() {
            Enclosures::default()
        } else if le.flags.infinite && self.scene.medium_in(&Enclosures::default()).is_some() {
            // Nothing comes from infinitely far through a medium, and so not from the disk either.
            return;
        } else {
            self.scene.enclosures_of_light(choice.index, &le.light, le.ray.d)
        };
        let head = Head { ray: le.ray, beta, pdf: onwards, unit: beta.max_component(), around };
        self.walk(path, sampler, head, Transport::Importance, limit);
    }

    fn walk(&mut self, path: &mut Subpath, sampler: &mut impl Sampler, mut head: Head, mode: Transport, limit: usize) {
        // Product of squared index ratios so far: radiance is scaled by it inside glass, which must not steer the roulette.
        let mut eta_scale = 1.0f32;
        while path.vertices.len() < limit && self.counters.admit(head.beta) && !head.beta.is_black() {
            // Find the next surface, or the point of a medium that scatters.
            let edges = path.vertices.len() as u32;
            sampler.start_vertex(edges);
            if !self.arrive(path, sampler, &mut head, mode) || path.vertices.len() >= limit {
                return;
            }

            // Go on in a direction drawn from what scatters there.
            let Some(eta) = self.depart(path, sampler, &mut head, mode) else { return };
            eta_scale *= eta * eta;

            // End the walk by chance when it carries little of what it started with. The chance depends on the walk's history, so it
            // stays out of the densities.
            if self.rr_depth.is_some_and(|from| edges >= from) {
                let left = head.beta * (eta_scale / head.unit);
                let Some(factor) = roulette(left, sampler.next_1d()) else { return };
                head.beta *= factor;
            }
        }
    }

    /// Follows the walk's ray to its next vertex, or notes that it left the scene; whether there is one.
    #[inline]
    fn arrive(&mut self, path: &mut Subpath, sampler: &mut impl Sampler, head: &mut Head, mode: Transport) -> bool {
        if self.scene.features.has_media() {
            return self.arrive_through_media(path, sampler.next_1d(), head, mode);
        }
        self.counters.rays += 1;
        let hit = self.scene.accel.intersect(&head.ray);
        let Some(hit) = &hit else {
            path.escape = Some(Escape { w: head.ray.d, beta: head.beta, pdf: head.pdf, tau: Rgb::ZERO });
            return false;
        };
        let hit = self.scene.geometry.interaction(&head.ray, hit);
        let edge = self.edge_to(path, &hit.anchor(), &head.ray);
        self.meet(path, &hit, edge, head, mode);
        true
    }

    /// The same where there are media: `u` samples how far the flight comes. Apart, so that it costs nothing where there are none.
    #[inline(never)]
    fn arrive_through_media(&mut self, path: &mut Subpath, u: f32, head: &mut Head, mode: Transport) -> bool {
        // Densities are those of channels chosen alike: as weights need no more than one function of the path, they may be.
        let channels = Channels::by_throughput(head.beta);
        let flight = self.scene.fly(&channels, &head.ray, head.around, u, &mut self.counters.rays);
        head.beta *= flight.weight;
        head.around = flight.around;
        let from = path.vertices.last().and_then(Vertex::medium).copied();
        match &flight.event {
            Event::Escaped => {
                path.escape = Some(Escape { w: head.ray.d, beta: head.beta, pdf: head.pdf, tau: flight.tau });
                return false;
            }
            Event::Scatter { p, medium } => {
                let medium = self.scene.media[medium.0 as usize];
                let anchor = Anchor::free(*p);
                let edge = self.edge_to(path, &anchor, &head.ray).through(flight.tau, from.as_ref(), Some(&medium));
                let at = Scattering::Medium(MediumPoint { medium, wo: -head.ray.d });
                let (beta, around) = (head.beta, head.around);
                let first = Vertex::first(VertexKind::Inner(at), anchor, head.pdf * edge.forward);
                path.vertices.push(Vertex { beta, around, edge, ..first });
            }
            Event::Surface(hit) => {
                let edge = self.edge_to(path, &hit.anchor(), &head.ray).through(flight.tau, from.as_ref(), None);
                self.meet(path, hit, edge, head, mode);
            }
        }
        true
    }

    /// Adds the vertex where the walk meets a surface.
    #[inline]
    fn meet(&self, path: &mut Subpath, hit: &Interaction, edge: Edge, head: &Head, mode: Transport) {
        let scene = self.scene;
        let wo = -head.ray.d;
        let info = &scene.objects[hit.object.0 as usize];
        let scattering = Scattering::at_surface(&scene.materials, &scene.textures, info.material, hit, wo);
        let emitted = match (mode, info.light) {
            (Transport::Radiance, Some(index)) => {
                Some((index, scene.lights[index as usize].radiance(&scene.light_context(), hit, wo)))
            }
            _ => None,
        };
        path.vertices.push(Vertex {
            kind: VertexKind::Inner(scattering),
            anchor: hit.anchor(),
            beta: head.beta,
            pdf_fwd: head.pdf * edge.forward,
            edge,
            delta: false,
            tail: 0.0,
            around: head.around,
            object: Some(hit.object),
            emitted,
        });
    }

    /// The walk leaves its last vertex in a direction drawn there. The index of refraction ahead over that behind, which radiance is
    /// scaled by the square of; `None` where the walk ends.
    #[inline]
    fn depart(&self, path: &mut Subpath, sampler: &mut impl Sampler, head: &mut Head, mode: Transport) -> Option<f32> {
        let last = path.vertices.last()?;
        let VertexKind::Inner(at) = &last.kind else { return None };
        let (uc, u) = at.numbers(sampler);
        let sample = at.sample(uc, u, mode);
        let s = sample.as_ref()?;
        head.beta *= at.weight(s);
        if mode == Transport::Importance {
            head.beta *= at.adjoint_correction(s.wi);
        }
        head.pdf = match (s.lobe.delta, mode, at) {
            (true, Transport::Radiance, Scattering::Surface(shading)) => {
                delta_density(s.cos_theta, shading.wo.z.abs(), s.eta)
            }
            (true, ..) => 1.0,
            (false, ..) => f64::from(s.pdf),
        };
        head.ray = last.anchor.ray(s.wi);
        if self.scene.features.has_media() {
            head.around = last.around_towards(self.scene, s.wi);
        }
        self.leave(path, s, mode);
        Some(if mode == Transport::Radiance { s.eta } else { 1.0 })
    }

    /// The edge from the last vertex to `to`, along `ray`, without what media do to its densities.
    #[inline]
    fn edge_to(&self, path: &mut Subpath, to: &Anchor, ray: &Ray) -> Edge {
        let from = &path.vertices[path.vertices.len() - 1];
        let Some(light) = path.light.as_mut().filter(|_| path.vertices.len() == 1) else {
            return Edge::between(&from.anchor, to, ray.d);
        };
        if light.flags.infinite {
            return Edge::from_infinity(to, ray.d);
        }
        let edge = Edge::between(&from.anchor, to, ray.d);
        // How likely the light's point is when it is sampled from here.
        if !light.flags.is_delta() {
            let pdf = self.selector.pmf(light.index)
                * self.scene.lights[light.index].pdf_li(&self.scene.light_context(), to.p, &from.anchor);
            light.direct = f64::from(pdf) * edge.backward / from.pdf_fwd;
        }
        edge
    }

    /// The walk leaves its last vertex by `s`: now the way back from here to the vertex before is known.
    #[inline]
    fn leave(&self, path: &mut Subpath, s: &DirectionSample, mode: Transport) {
        let last = path.vertices.len() - 1;
        let v = &path.vertices[last];
        let pdf_back = match (&v.kind, s.lobe.delta) {
            (VertexKind::Inner(at), false) => v.pdf_back(at, s.wi, mode),
            (VertexKind::Inner(Scattering::Surface(shading)), true) if mode == Transport::Importance => {
                delta_density(shading.wo.z.abs(), s.cos_theta, 1.0 / s.eta) * v.edge.backward
            }
            _ => v.edge.backward,
        };
        let before = path.vertices.get(last.wrapping_sub(2)).map_or(0.0, |v| v.tail);
        let step = path.step(self.heuristic, last - 1, pdf_back, false);
        path.vertices[last - 1].tail = self.heuristic.fold(before, step);
        path.vertices[last].delta = s.lobe.delta;
    }

    /// A point of the lens, for a walk that is to be connected to the camera.
    #[inline]
    pub fn lens_numbers(&self, sampler: &mut impl Sampler) -> Vec2 {
        if self.camera.is_pinhole() { Vec2::ZERO } else { sampler.next_2d() }
    }
}
