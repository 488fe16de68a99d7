//! Light tracing: paths from the lights, each vertex connected to the camera (Arvo 1986; the t = 1 strategies of Veach 1997, chapter 10).
//!
//! It sees what a path from a light can reach and the camera can see without a mirror in between; a scene's `path` image without such
//! mirrors is the same image.

use super::UnitContext;
use crate::film::{Counters, SplatSums};
use crate::light::LightLessons;
use crate::math::Vec2;
use crate::path::{Subpath, Tracer};
use crate::sampling::{Sampler, SobolSampler};
use crate::spectrum::Rgb;
use std::ops::Range;

/// Streams of light paths lie beyond all pixel numbers.
const LIGHT_STREAM: u64 = 1 << 40;
/// The block of numbers of the light seen directly lies beyond those of all walks.
const EMISSION: u32 = 1 << 20;

/// Traces light paths `paths` of the replicate, and says whether it came to their end. What they find teaches of the lights.
///
/// The sum of the splats over N paths, divided by N, is the image.
pub fn trace_paths(
    c: &UnitContext<'_>,
    paths: Range<u64>,
    splats: &mut SplatSums,
    lessons: &mut LightLessons,
    counters: &mut Counters,
) -> bool {
    counters.samples += paths.end - paths.start;
    let tracer = c.tracer(Some(c.rr_depth));
    let mut film = Film { c, tracer, splats, lessons };
    let mut walk = Subpath::default();
    for path in paths {
        if path % 256 == 0 && (c.stopped)() {
            return false;
        }
        let mut sampler = SobolSampler::new(c.seed, c.replicate, LIGHT_STREAM + (path >> 32), path as u32);
        film.emission(&mut sampler);
        film.scattered(&mut walk, &mut sampler);
    }
    counters.add(&film.tracer.counters);
    true
}

struct Film<'a> {
    c: &'a UnitContext<'a>,
    tracer: Tracer<'a>,
    splats: &'a mut SplatSums,
    lessons: &'a mut LightLessons,
}

impl Film<'_> {
    /// The light seen directly: a point of the light (or a direction of the sky) drawn towards a point of the lens.
    fn emission(&mut self, sampler: &mut impl Sampler) {
        let view = self.c.view;
        if self.c.max_depth < 1 {
            return;
        }
        sampler.start_vertex(EMISSION);
        let (uc, u) = (sampler.next_1d(), sampler.next_2d());
        let lens_u = self.tracer.lens_numbers(sampler);
        let Some(choice) = self.c.selector.sample(uc) else { return };
        self.lessons.tried(choice.index, choice.pmf, 1);
        let light = &self.c.scene.lights[choice.index];
        let lens = view.camera.generate_ray(Vec2::ZERO, lens_u).o;
        let Some(li) = light.sample_li(&self.c.scene.light_context(), lens, choice.u, u) else { return };
        if li.delta {
            return;
        }
        let raster = view.camera.project_direction(li.wi, lens);
        let Some(raster) = raster.filter(|raster| view.camera.shows(*raster)) else { return };
        // Directions per raster area, from the density of uniform raster positions over the whole picture.
        let pixels = view.width as f32 * view.height as f32;
        let per_raster_area = view.camera.pdf_we(li.wi).1 * pixels;
        let value = li.radiance * (per_raster_area / (li.pdf * choice.pmf));
        let from = self.tracer.lens(lens);
        self.splat(choice.index, raster, value, |tracer| tracer.arriving(&from, li.wi, (&li).into()));
    }

    /// A walk from a light; each of its surfaces is connected to the camera. That adds an edge to those of the walk.
    fn scattered(&mut self, walk: &mut Subpath, sampler: &mut impl Sampler) {
        let limit = usize::try_from(self.c.max_depth).unwrap_or(usize::MAX);
        if limit < 2 {
            return;
        }
        let before = self.tracer.counters.rays;
        self.tracer.light_walk(walk, sampler, limit);
        let Some(start) = walk.light else { return };
        sampler.start_vertex(EMISSION + 1);
        let lens_u = self.tracer.lens_numbers(sampler);
        for s in 2..=walk.vertices.len() {
            if let Some(path) = self.tracer.to_lens(walk, s, lens_u)
                && let Some(raster) = path.raster
            {
                self.splat(start.index, raster, path.value, |tracer| tracer.is_free(&path).then_some(Rgb::ONE));
            }
        }
        self.lessons.tried(start.index, self.c.selector.pmf(start.index), 1 + self.tracer.counters.rays - before);
    }

    /// Adds a contribution at a raster position to all pixels whose filter covers it, or what of it `arrives`.
    fn splat(&mut self, light: usize, raster: Vec2, value: Rgb, arrives: impl FnOnce(&mut Tracer<'_>) -> Option<Rgb>) {
        if value.is_black() || !self.tracer.counters.admit(value) {
            return;
        }
        let footprint = self.c.view.filter.weights(raster);
        if footprint.is_empty() {
            return;
        }
        let Some(transmittance) = arrives(&mut self.tracer) else { return };
        let value = value * transmittance;
        let mut total = 0.0;
        for (x, y, weight) in footprint.iter() {
            self.splats.add(x, y, value * weight);
            total += weight;
        }
        self.lessons.gave(light, self.c.selector.pmf(light), value * total.sqrt());
    }
}
