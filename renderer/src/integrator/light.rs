//! Light tracing: paths from the lights, each vertex connected to the camera (Arvo 1986; the t = 1 strategies of Veach 1997, chapter 10).
//!
//! It sees what a path from a light can reach and the camera can see without a mirror in between; a scene's `path` image without such
//! mirrors is the same image.

use super::UnitContext;
use crate::bsdf::{ShadingPoint, Transport};
use crate::film::{Counters, SplatSums};
use crate::light::Light;
use crate::math::{Anchor, Vec2};
use crate::path::roulette;
use crate::sampling::{Choice, Sampler, SobolSampler};
use crate::spectrum::Rgb;
use std::ops::Range;

/// Streams of light paths lie beyond all pixel numbers.
const LIGHT_STREAM: u64 = 1 << 40;

/// Traces light paths `paths` of the replicate; returns the luminance splatted per light, `None` when stopped.
///
/// The sum of the splats over N paths, divided by N, is the image.
pub fn trace_paths(
    c: &UnitContext<'_>,
    paths: Range<u64>,
    splats: &mut SplatSums,
    counters: &mut Counters,
) -> Option<Vec<f64>> {
    counters.samples += paths.end - paths.start;
    let mut tracer = Tracer { c, splats, counters, light_sums: vec![0.0; c.scene.lights.len()], light: 0 };
    for path in paths {
        if path % 256 == 0 && (c.stopped)() {
            return None;
        }
        let mut sampler = SobolSampler::new(c.seed, c.replicate, LIGHT_STREAM + (path >> 32), path as u32);
        let lens_u = if c.view.camera.is_pinhole() { Vec2::ZERO } else { sampler.next_2d() };
        let Some(choice) = c.selector.sample(sampler.next_1d()) else { continue };
        let light = &c.scene.lights[choice.index];
        tracer.light = choice.index;
        tracer.emission(light, &choice, lens_u, &mut sampler);
        tracer.walk(light, &choice, lens_u, &mut sampler);
    }
    Some(tracer.light_sums)
}

struct Tracer<'a> {
    c: &'a UnitContext<'a>,
    splats: &'a mut SplatSums,
    counters: &'a mut Counters,
    /// Luminance splatted per light.
    light_sums: Vec<f64>,
    /// The light of the path under way.
    light: usize,
}

impl Tracer<'_> {
    /// The light seen directly: a point of the light (or a direction of the sky) drawn towards a point of the lens.
    fn emission(&mut self, light: &Light, choice: &Choice, lens_u: Vec2, sampler: &mut impl Sampler) {
        let u = sampler.next_2d();
        let view = self.c.view;
        if self.c.max_depth < 1 {
            return;
        }
        let lens = view.camera.generate_ray(Vec2::ZERO, lens_u).o;
        let Some(li) = light.sample_li(&self.c.scene.light_context(), lens, choice.u, u) else { return };
        if li.delta {
            return;
        }
        let Some(raster) = view.camera.project_direction(li.wi, lens) else { return };
        // Directions per raster area, from the density of uniform raster positions over the whole picture.
        let pixels = view.width as f32 * view.height as f32;
        let per_raster_area = view.camera.pdf_we(li.wi).1 * pixels;
        let value = li.radiance * (per_raster_area / (li.pdf * choice.pmf));
        self.splat(raster, value, || li.shadow_ray(&Anchor::free(lens)));
    }

    /// The walk through the scene; every vertex is connected to the camera.
    fn walk(&mut self, light: &Light, choice: &Choice, lens_u: Vec2, sampler: &mut impl Sampler) {
        let scene = self.c.scene;
        let (u_pos, u_dir) = (sampler.next_2d(), sampler.next_2d());
        let Some(le) = light.sample_le(&scene.light_context(), choice.u, u_pos, u_dir) else { return };
        let mut beta = le.throughput() / choice.pmf;
        let start = beta.max_component();
        let mut ray = le.ray;
        let mut edges = 0;
        // A connection adds an edge to those that the walk has behind it.
        while edges + 1 < self.c.max_depth && self.counters.admit(beta) && !beta.is_black() {
            edges += 1;
            sampler.start_vertex(edges);
            self.counters.rays += 1;
            let Some(hit) = scene.accel.intersect(&ray) else { break };
            let hit = scene.geometry.interaction(&ray, &hit);
            let material = scene.objects[hit.object.0 as usize].material;
            let shading = ShadingPoint::new(&scene.materials, &scene.textures, material, &hit, -ray.d);

            // Connect to the camera.
            if !shading.is_delta_only()
                && let Some(we) = self.c.view.camera.sample_we(hit.p, lens_u)
            {
                let f = shading.eval(we.wi, Transport::Importance);
                let cos = shading.abs_cos(we.wi) * shading.adjoint_correction(we.wi);
                let value = beta * f * (cos * we.we / we.pdf);
                self.splat(we.raster, value, || we.shadow_ray(&hit.anchor()));
            }

            // Go on in a direction drawn from the BSDF.
            let uc = sampler.next_1d();
            let u = sampler.next_2d();
            let Some(s) = shading.sample(uc, u, Transport::Importance) else { break };
            beta *= s.weight() * shading.adjoint_correction(s.wi);
            ray = hit.spawn_ray(s.wi);

            // End the path by chance when it carries little of what it started with.
            if edges >= self.c.rr_depth {
                let Some(factor) = roulette(beta / start, sampler.next_1d()) else { break };
                beta *= factor;
            }
        }
    }

    /// Adds a contribution at a raster position to all pixels whose filter covers it, if nothing is in the way.
    fn splat(&mut self, raster: Vec2, value: Rgb, shadow_ray: impl FnOnce() -> crate::math::Ray) {
        if value.is_black() || !self.counters.admit(value) {
            return;
        }
        let footprint = self.c.view.filter.weights(raster);
        if footprint.is_empty() {
            return;
        }
        self.counters.rays += 1;
        if self.c.scene.accel.occluded(&shadow_ray()) {
            return;
        }
        let mut total = 0.0;
        for (x, y, weight) in footprint.iter() {
            self.splats.add(x, y, value * weight);
            total += weight;
        }
        self.light_sums[self.light] += f64::from(value.luminance() * total);
    }
}
