use super::constants::{ChainConstants, MmltOptions};
use crate::film::{Counters, SplatSums};
use crate::integrator::UnitContext;
use crate::light::LightLessons;
use crate::math::Vec2;
use crate::path::{Always, Connection, Subpath, Tracer};
use crate::sampling::{Discrete, IndependentSampler, PrimarySpace, Sampler, StepSizes, Stream, hash_words};
use crate::spectrum::Rgb;
use std::ops::Range;

/// Names the samples of pools among all hashes.
const POOL: u64 = 0x706f_6f6c;
/// Names the choices among a sample's paths.
const CHOICE: u64 = 0x6368_6f69;

/// A path that a sample of a pool found.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Found {
    /// Edges of the path.
    pub edges: u32,
    /// The sample.
    pub index: u32,
    /// Vertices from the light.
    pub technique: u32,
    /// Sum of the targets of all paths of this length that the sample found, each times the probability of its technique: what the
    /// sample is worth in the pool. One of them, drawn in proportion, stands for all.
    pub weight: f32,
    /// Target of the one that was drawn, which a replay must find again.
    pub target: f32,
}

/// What the samples of a pool found.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct BootstrapSums {
    /// At most one path for each length and sample, by sample, then by length.
    pub found: Vec<Found>,
    /// For each length of the plan and each technique, the sum of what it found.
    pub techniques: Vec<Vec<f64>>,
}

/// The key of a sample of the pool that `pass` makes for a replicate.
pub fn sample_key(seed: u64, pass: u32, replicate: u32, index: u32) -> u64 {
    hash_words(&[seed, POOL, u64::from(pass), u64::from(replicate), u64::from(index)])
}

/// Samples of a pool.
pub struct PoolTask<'a> {
    /// Number of the pass whose pool it is.
    pub pass: u32,
    /// Which of its samples.
    pub samples: Range<u32>,
    /// Where they are splatted, if at all.
    pub splats: Option<&'a mut SplatSums>,
    /// What they teach of the lights.
    pub lessons: &'a mut LightLessons,
}

/// Makes samples of the pool of a pass and the replicate; `None` when stopped.
pub fn run_bootstrap(
    c: &UnitContext<'_>,
    constants: &ChainConstants,
    options: &MmltOptions,
    task: PoolTask<'_>,
    counters: &mut Counters,
) -> Option<BootstrapSums> {
    let PoolTask { pass, samples, splats, lessons } = task;
    counters.samples += u64::from(samples.end - samples.start);
    let mut pool = Pool::new(c, constants, options, splats, lessons);
    for index in samples {
        if index % 64 == 0 && (c.stopped)() {
            return None;
        }
        pool.sample(index, sample_key(c.seed, pass, c.replicate, index));
    }
    counters.add(&pool.tracer.counters);
    Some(pool.sums)
}

/// What the paths of one length of one sample came to so far.
#[derive(Clone, Copy, Default)]
struct Length {
    weight: f64,
    technique: u32,
    target: f32,
}

/// Makes whole bidirectional samples of primary sample space.
struct Pool<'a, 'b> {
    c: &'a UnitContext<'a>,
    constants: &'a ChainConstants,
    tracer: Tracer<'a>,
    sizes: StepSizes,
    /// Probabilities of the techniques, by length of the plan; `None` for a length that no technique makes.
    tables: Vec<Option<Discrete>>,
    size: Vec2,
    space: PrimarySpace,
    camera: Subpath,
    light: Subpath,
    lengths: Vec<Length>,
    sums: BootstrapSums,
    splats: Option<&'b mut SplatSums>,
    lessons: &'b mut LightLessons,
    /// Chooses among the paths of a sample.
    choices: IndependentSampler,
}

impl<'a, 'b> Pool<'a, 'b> {
    fn new(
        c: &'a UnitContext<'a>,
        constants: &'a ChainConstants,
        options: &MmltOptions,
        splats: Option<&'b mut SplatSums>,
        lessons: &'b mut LightLessons,
    ) -> Self {
        let longest = constants.depths.iter().map(|d| d.edges).max().unwrap_or(0) as usize;
        let techniques = constants.depths.iter().map(|d| vec![0.0; d.edges as usize + 1]).collect();
        Self {
            c,
            constants,
            tracer: c.tracer(None),
            sizes: options.step_sizes(),
            tables: constants.depths.iter().map(|d| d.table(c.scene)).collect(),
            size: Vec2::new(c.view.width as f32, c.view.height as f32),
            space: PrimarySpace::new(longest),
            camera: Subpath::default(),
            light: Subpath::default(),
            lengths: vec![Length::default(); constants.depths.len()],
            sums: BootstrapSums { found: Vec::new(), techniques },
            splats,
            lessons,
            choices: IndependentSampler::new([0]),
        }
    }

    /// One sample: both walks, and all paths of all lengths that their vertices make.
    fn sample(&mut self, index: u32, key: u64) {
        let Some(longest) = self.constants.depths.last().map(|d| d.edges as usize) else { return };
        self.space.propose_large(key);
        self.choices = IndependentSampler::new([CHOICE, key]);
        self.lengths.fill(Length::default());

        // Walk from both ends. No roulette: the lengths of a chain's paths are given.
        let mut lens = self.space.stream(Stream::Lens, &self.sizes);
        let raster = lens.next_2d() * self.size;
        let lens_u = self.tracer.lens_numbers(&mut lens);
        let ray = self.tracer.camera.generate_ray(raster, lens_u);
        let mut numbers = self.space.stream(Stream::Camera, &self.sizes);
        self.tracer.camera_walk(&mut self.camera, &mut numbers, ray, longest + 1);
        self.tracer.light_walk(&mut self.light, &mut self.space.stream(Stream::Light, &self.sizes), longest);
        let mut numbers = self.space.stream(Stream::Connection, &self.sizes);
        let (uc, u) = (numbers.next_1d(), numbers.next_2d());

        if let Some(start) = &self.light.light {
            let rays = self.light.vertices.len() as u64;
            self.lessons.tried(start.index, self.c.selector.pmf(start.index), rays);
        }

        // All ways to join them.
        let (from_camera, from_light) = (self.camera.vertices.len(), self.light.vertices.len());
        for t in 2..=from_camera {
            if let Some(path) = self.length(t - 1).and_then(|_| self.tracer.hit(&self.camera, t)) {
                self.add((0, t), path.weighted(), raster);
            }
        }
        if from_camera <= longest && self.length(from_camera).is_some() {
            let value = self.tracer.escaped(&self.camera).fold(Rgb::ZERO, |sum, path| sum + path.weighted());
            self.add((0, from_camera + 1), value, raster);
        }
        for t in 2..=from_camera.min(longest) {
            if self.length(t).is_some() {
                self.lessons.tried_any(1);
                let path = self.tracer.next_event(&self.camera, t, uc, u, &mut Always);
                self.join((1, t), path, raster);
            }
            for s in (2..=from_light.min(longest + 1 - t)).filter(|s| s + t > 3) {
                let path =
                    self.length(s + t - 1).and_then(|_| self.tracer.join(&self.light, s, &self.camera, t, &mut Always));
                self.join((s, t), path, raster);
            }
        }
        for s in 2..=from_light {
            if let Some(path) = self.length(s).and_then(|_| self.tracer.to_lens(&self.light, s, lens_u)) {
                self.join((s, 1), Some(path), path.raster.unwrap_or_default());
            }
        }

        for (length, depth) in self.lengths.iter().zip(&self.constants.depths) {
            let weight = length.weight as f32;
            if weight > 0.0 && weight.is_finite() {
                let Length { technique, target, .. } = *length;
                self.sums.found.push(Found { edges: depth.edges, index, technique, weight, target });
            }
        }
    }

    /// The place of a length in the plan.
    fn length(&self, edges: usize) -> Option<usize> {
        let first = self.constants.depths.first()?.edges as usize;
        edges.checked_sub(first).filter(|i| *i < self.lengths.len())
    }

    /// Tests a path for visibility, unless it carries so little that it is left to chance, and adds it.
    fn join(&mut self, (s, t): (usize, usize), path: Option<Connection>, raster: Vec2) {
        let Some(path) = path else { return };
        let value = path.weighted();
        let pixels = if t == 1 { 1.0 } else { self.size.x * self.size.y };
        let share = self.constants.target_of(value * pixels, raster, self.size) / self.constants.threshold;
        if !(share > 0.0) {
            return;
        }
        let q = share.min(1.0);
        if q < 1.0 && self.choices.next_1d() >= q {
            return;
        }
        if self.tracer.is_free(&path) {
            if let Some(light) = path.light {
                let found = value * (pixels / q);
                self.lessons.gave(light, self.c.selector.pmf(light), found);
            }
            self.add_with((s, t), value, raster, q);
        }
    }

    fn add(&mut self, strategy: (usize, usize), value: Rgb, raster: Vec2) {
        self.add_with(strategy, value, raster, 1.0);
    }

    /// Adds a path whose weighted contribution is `value` (of t > 1: per pixel) and which survived with probability `q`.
    fn add_with(&mut self, (s, t): (usize, usize), value: Rgb, raster: Vec2, q: f32) {
        let Some(length) = self.length(s + t - 1) else { return };
        let Some(table) = &self.tables[length] else { return };
        let pmf = table.pmf(s);
        let value = if t == 1 { value } else { value * (self.size.x * self.size.y) };
        // As a chain has it, to the bit.
        let as_chain = value / pmf;
        if !(pmf > 0.0) || !self.tracer.counters.admit(as_chain) {
            return;
        }
        let target = self.constants.target_of(as_chain, raster, self.size);
        if !(target > 0.0) {
            return;
        }
        let weight = f64::from(target) * f64::from(pmf) / f64::from(q);
        self.sums.techniques[length][s] += weight;
        let all = &mut self.lengths[length];
        all.weight += weight;
        if f64::from(self.choices.next_1d()) * all.weight < weight {
            (all.technique, all.target) = (s as u32, target);
        }
        if let Some(splats) = self.splats.as_deref_mut() {
            splats.splat(&self.c.view.filter, raster, value / q);
        }
    }
}
