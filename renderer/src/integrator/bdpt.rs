//! Bidirectional path tracing (Lafortune and Willems 1993; Veach 1997, chapter 10): every way to make a path from a walk from the
//! camera and one from a light, combined by multiple importance sampling.

use super::{UnitContext, tile};
use crate::film::{Counters, Rect, SplatSums, TileSums};
use crate::light::LightLessons;
use crate::math::Ray;
use crate::path::mis::Heuristic;
use crate::path::{Always, Chance, Connection, Subpath, Tracer, VertexKind};
use crate::sampling::{Sampler, SobolSampler};
use crate::spectrum::Rgb;
use std::ops::Range;

/// Streams of the walks from the lights lie beyond all pixel numbers.
pub(super) const LIGHT_STREAM: u64 = 1 << 41;
/// Blocks of numbers for the connections of vertex i lie beyond those of all walks.
const CONNECTIONS: u32 = 1 << 20;

/// Receives the paths of a sample, each with the strategy (s, t) that made it; visibility is tested already.
pub trait Sink {
    /// A path that counts.
    fn add(&mut self, s: usize, t: usize, path: &Connection);
}

/// Leaves to chance what contributes less than a threshold.
struct Roulette<'a, S> {
    threshold: f32,
    numbers: &'a mut S,
}

impl<S: Sampler> Chance for Roulette<'_, S> {
    #[inline]
    fn keep(&mut self, estimate: impl FnOnce() -> f32) -> Option<f32> {
        let q = estimate() / self.threshold;
        // Also where the threshold is 0.
        if !(q < 1.0) {
            return Some(1.0);
        }
        (self.numbers.next_1d() < q).then_some(q)
    }
}

/// Makes samples: a walk from each end and all connections between them.
pub struct Bidirectional<'a> {
    tracer: Tracer<'a>,
    /// Edges of the longest path.
    max_depth: usize,
    /// Contributions below this are tested by chance only; 0 = never.
    threshold: f32,
    camera: Subpath,
    light: Subpath,
    /// Lights that were selected for vertices of walks from the camera.
    selected: u64,
}

impl<'a> Bidirectional<'a> {
    /// For a unit.
    pub fn new(c: &UnitContext<'a>, heuristic: Heuristic) -> Self {
        let tracer = c.tracer_weighing(Some(c.rr_depth), heuristic);
        let max_depth = c.max_depth as usize;
        let (camera, light) = (Subpath::default(), Subpath::default());
        Self { tracer, max_depth, threshold: c.threshold, camera, light, selected: 0 }
    }

    /// What was met so far.
    pub fn counters(&self) -> Counters {
        self.tracer.counters
    }

    /// Whether a contribution may be added to a sum; counts those that may not.
    pub fn admit(&mut self, value: Rgb) -> bool {
        self.tracer.counters.admit(value)
    }

    /// The walk from the camera of the last sample.
    pub fn camera_walk(&self) -> &Subpath {
        &self.camera
    }

    /// One sample: the camera walk along `ray`, a walk from a light, and what their vertices make together.
    pub fn sample<S: Sampler>(
        &mut self,
        ray: Ray,
        camera_numbers: &mut S,
        light_numbers: &mut S,
        sink: &mut impl Sink,
    ) {
        let limit = self.max_depth.saturating_add(1);
        self.tracer.camera_walk(&mut self.camera, camera_numbers, ray, limit);
        self.tracer.light_walk(&mut self.light, light_numbers, self.max_depth);
        let (from_camera, from_light) = (self.camera.vertices.len(), self.light.vertices.len());

        // Light that the camera walk ran into.
        for t in 2..=from_camera {
            if let Some(path) = self.tracer.hit(&self.camera, t) {
                sink_if_valid(&mut self.tracer.counters, sink, (0, t), &path);
            }
        }
        if from_camera < limit {
            let mut escaped = self.tracer.counters;
            for path in self.tracer.escaped(&self.camera) {
                sink_if_valid(&mut escaped, sink, (0, from_camera + 1), &path);
            }
            self.tracer.counters = escaped;
        }

        // Walk's vertices joined to lights and to each other.
        for t in 2..=from_camera.min(self.max_depth) {
            camera_numbers.start_vertex(CONNECTIONS + t as u32);
            let (uc, u) = (camera_numbers.next_1d(), camera_numbers.next_2d());
            let mut chance = Roulette { threshold: self.threshold, numbers: camera_numbers };
            self.selected += 1;
            let path = self.tracer.next_event(&self.camera, t, uc, u, &mut chance);
            self.finish(path, &mut chance, (1, t), sink);
            for s in 2..=from_light.min(limit - t) {
                light_numbers.start_vertex(CONNECTIONS + (t * 64 + s) as u32);
                let mut chance = Roulette { threshold: self.threshold, numbers: light_numbers };
                let path = self.tracer.join(&self.light, s, &self.camera, t, &mut chance);
                self.finish(path, &mut chance, (s, t), sink);
            }
        }

        // The walk from the light, seen by the camera.
        for s in 2..=from_light {
            light_numbers.start_vertex(CONNECTIONS + s as u32);
            let lens_u = self.tracer.lens_numbers(light_numbers);
            let path = self.tracer.to_lens(&self.light, s, lens_u);
            self.finish(path, &mut Always, (s, 1), sink);
        }
    }

    /// Tests visibility, unless the path carries so little that it is left to chance, and hands it on.
    fn finish(
        &mut self,
        path: Option<Connection>,
        chance: &mut impl Chance,
        strategy: (usize, usize),
        sink: &mut impl Sink,
    ) {
        let Some(mut path) = path else { return };
        let weighted = path.weighted();
        if weighted.is_black() {
            return;
        }
        // Through media it was decided before the way was followed.
        if path.shadow.is_some() {
            let Some(q) = chance.keep(|| weighted.max_component()) else { return };
            path.value /= q;
        }
        if self.tracer.is_free(&path) {
            sink_if_valid(&mut self.tracer.counters, sink, strategy, &path);
        }
    }
}

fn sink_if_valid(counters: &mut Counters, sink: &mut impl Sink, (s, t): (usize, usize), path: &Connection) {
    if counters.admit(path.weighted()) {
        sink.add(s, t, path);
    }
}

/// Adds paths up: those of t = 1 to the pixels that they fall on, all others to the sample's own.
struct Film<'a> {
    c: &'a UnitContext<'a>,
    pixel: Rgb,
    splats: &'a mut SplatSums,
    lessons: &'a mut LightLessons,
}

impl Sink for Film<'_> {
    fn add(&mut self, _s: usize, _t: usize, path: &Connection) {
        let view = self.c.view;
        match path.raster {
            None => self.pixel += path.weighted(),
            Some(raster) => self.splats.splat(&view.filter, raster, path.weighted()),
        }
        if let Some(light) = path.light.filter(|_| self.lessons.learns()) {
            // As many walks start at lights as pixels have samples together.
            let share = path.raster.map_or(1.0, |_| 1.0 / (view.width as f32 * view.height as f32));
            self.lessons.gave(light, self.c.selector.pmf(light), path.weighted() * share);
        }
    }
}

/// Renders samples `samples` of each pixel of a tile, and the splats of their walks from the lights over the whole film; `None` when
/// stopped. What is found teaches of the lights. As many walks start at lights as at the camera: the sum of the splats over their
/// number is their part of the image.
pub fn render_tile(
    c: &UnitContext<'_>,
    rect: Rect,
    samples: Range<u32>,
    splats: &mut SplatSums,
    lessons: &mut LightLessons,
    counters: &mut Counters,
) -> Option<TileSums> {
    let mut bdpt = Bidirectional::new(c, Heuristic::Power);
    let mut film = Film { c, pixel: Rgb::ZERO, splats, lessons };
    counters.samples += rect.area() as u64 * u64::from(samples.end - samples.start);
    let tile = tile::render(c, rect, samples, |mut s| {
        let mut light_sampler = SobolSampler::new(c.seed, c.replicate, LIGHT_STREAM + s.pixel, s.index);
        film.pixel = Rgb::ZERO;
        bdpt.sample(s.ray, &mut s.sampler, &mut light_sampler, &mut film);
        if let Some(start) = &bdpt.light.light {
            let rays = bdpt.light.vertices.len() as u64;
            film.lessons.tried(start.index, c.selector.pmf(start.index), rays);
        }
        if let (Some(aov), [lens, first, ..]) = (s.aov, bdpt.camera_walk().vertices.as_slice())
            && let VertexKind::Inner(at) = &first.kind
        {
            aov.add(&tile::shown(at, &lens.anchor, &first.anchor));
        }
        film.pixel
    })?;
    counters.add(&bdpt.counters());
    lessons.tried_any(bdpt.selected);
    Some(tile)
}
