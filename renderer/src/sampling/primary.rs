//! Points of primary sample space and their mutations (Kelemen et al. 2002, "A Simple and Robust Mutation Strategy for the Metropolis
//! Light Transport Algorithm").

use super::Sampler;
use super::rng::{GOLDEN, mix64, unit_f32};
use crate::math::Vec2;

/// Coordinates of a fixed block that belongs to one vertex of a walk: {lobe, direction, direction, distance}.
const VERTEX_BLOCK: usize = 4;
/// From one vertex of a walk to the next: the walks from camera and light take turns, so that no place depends on their lengths.
const STRIDE: usize = 2 * VERTEX_BLOCK;
/// The light's block: {choice, point, point, direction, direction}, and what is left of it.
const START_BLOCK: usize = 8;
/// Coordinates before those of the walks: technique, raster, lens, connection.
const FIRST_WALK: usize = 8;

/// The coordinate of the technique.
const TECHNIQUE: usize = 0;

/// Where the numbers of a path lie. Blocks are fixed, so that what one vertex needs does not shift the numbers of another.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Stream {
    /// One number: the technique.
    Technique,
    /// Four numbers: raster position, lens.
    Lens,
    /// Three numbers: the light chosen at a connection.
    Connection,
    /// The walk from the camera.
    Camera,
    /// The walk from the light.
    Light,
}

/// A step size table: log-uniform between the two sizes of Kelemen et al., `s2 exp(-ln(s2 / s1) u)`.
#[derive(Clone, Debug)]
pub struct StepSizes {
    sizes: Vec<f32>,
}

impl StepSizes {
    const CELLS: usize = 1024;

    /// Between `smallest` and `largest`, parts of the unit interval.
    pub fn new(smallest: f64, largest: f64) -> Self {
        let size = |i: usize| largest * crate::math::pow64(smallest / largest, (i as f64 + 0.5) / Self::CELLS as f64);
        Self { sizes: (0..Self::CELLS).map(|i| size(i) as f32).collect() }
    }

    /// A signed step from 32 random bits.
    #[inline]
    fn step(&self, bits: u32) -> f32 {
        let size = self.sizes[(bits >> 1) as usize % Self::CELLS];
        if bits & 1 == 0 { size } else { -size }
    }
}

/// A coordinate of the chain's state.
#[derive(Clone, Copy, Debug, Default, PartialEq, bytemuck::Pod, bytemuck::Zeroable)]
#[repr(C)]
struct Coordinate {
    value: f32,
    /// When it was last accepted; before the last large step it counts as not drawn.
    time: u32,
}

/// A chain's point of primary sample space, evaluated lazily: coordinates that a path does not use catch up when one does.
///
/// Every number is a hash of its place (key, coordinate), so the order in which they are asked for does not matter.
#[derive(Clone, Debug)]
pub struct PrimarySpace {
    current: Vec<Coordinate>,
    proposed: Vec<f32>,
    /// The mutation for which `proposed` was drawn.
    drawn_at: Vec<u32>,
    touched: Vec<u32>,
    /// Accepted mutations.
    time: u32,
    /// When the last large step was accepted, and its key.
    large_time: u32,
    large_key: u64,
    /// The proposal under way.
    mutation: u32,
    key: u64,
    large: bool,
}

impl PrimarySpace {
    /// For paths of at most `edges` edges.
    pub fn new(edges: usize) -> Self {
        let n = FIRST_WALK + START_BLOCK + STRIDE * (edges + 1);
        Self {
            current: vec![Coordinate::default(); n],
            proposed: vec![0.0; n],
            drawn_at: vec![0; n],
            touched: Vec::with_capacity(n),
            time: 1,
            large_time: 1,
            large_key: 0,
            mutation: 0,
            key: 0,
            large: false,
        }
    }

    /// Proposes the independent point that `key` names.
    #[inline]
    pub fn propose_large(&mut self, key: u64) {
        self.begin(key, true);
    }

    /// Proposes a point near the current one.
    #[inline]
    pub fn propose_small(&mut self, key: u64) {
        self.begin(key, false);
    }

    fn begin(&mut self, key: u64, large: bool) {
        self.mutation = self.mutation.wrapping_add(1);
        if self.mutation == 0 {
            // The stamps of 2^32 mutations ago must not be taken for today's.
            self.drawn_at.fill(0);
            self.mutation = 1;
        }
        self.touched.clear();
        self.key = key;
        self.large = large;
    }

    /// Gives the proposal's technique, in place of the number that its key gives.
    #[inline]
    pub fn set_technique(&mut self, value: f32) {
        self.proposed[TECHNIQUE] = value;
        if self.drawn_at[TECHNIQUE] != self.mutation {
            self.drawn_at[TECHNIQUE] = self.mutation;
            self.touched.push(TECHNIQUE as u32);
        }
    }

    /// The proposal becomes the current point.
    #[inline]
    pub fn accept(&mut self) {
        self.time += 1;
        if self.large {
            self.large_time = self.time;
            self.large_key = self.key;
        }
        for &i in &self.touched {
            self.current[i as usize] = Coordinate { value: self.proposed[i as usize], time: self.time };
        }
    }

    /// Numbers of the proposal.
    #[inline]
    pub fn stream<'a>(&'a mut self, stream: Stream, sizes: &'a StepSizes) -> PrimaryStream<'a> {
        let (at, walk) = match stream {
            Stream::Technique => (TECHNIQUE, 0),
            Stream::Lens => (1, 0),
            Stream::Connection => (5, 0),
            Stream::Light => (FIRST_WALK, FIRST_WALK + START_BLOCK),
            Stream::Camera => (FIRST_WALK, FIRST_WALK + START_BLOCK + VERTEX_BLOCK),
        };
        PrimaryStream { space: self, sizes, start: at, walk, at }
    }

    #[inline]
    fn coordinate(&mut self, i: usize, sizes: &StepSizes) -> f32 {
        if self.drawn_at[i] == self.mutation {
            return self.proposed[i];
        }
        let value = if self.large { uniform(self.key, i) } else { self.small(i, sizes) };
        self.drawn_at[i] = self.mutation;
        self.proposed[i] = value;
        self.touched.push(i as u32);
        value
    }

    #[inline]
    fn small(&self, i: usize, sizes: &StepSizes) -> f32 {
        let c = self.current[i];
        let (from, since) =
            if c.time < self.large_time { (uniform(self.large_key, i), self.large_time) } else { (c.value, c.time) };
        // The steps missed so far are made in one.
        let missed = self.time + 1 - since;
        let step = sizes.step((coordinate_bits(self.key, i) >> 32) as u32);
        let moved = from + if missed > 1 { step * (missed as f32).sqrt() } else { step };
        let wrapped = moved - moved.floor();
        if wrapped < 1.0 { wrapped } else { 0.0 }
    }
}

#[inline]
fn coordinate_bits(key: u64, i: usize) -> u64 {
    mix64(key.wrapping_add((i as u64 + 1).wrapping_mul(GOLDEN)))
}

#[inline]
fn uniform(key: u64, i: usize) -> f32 {
    unit_f32((coordinate_bits(key, i) >> 32) as u32)
}

/// The numbers of one part of a path.
#[derive(Debug)]
pub struct PrimaryStream<'a> {
    space: &'a mut PrimarySpace,
    sizes: &'a StepSizes,
    /// The block of a walk's start.
    start: usize,
    /// The block of its first vertex after that.
    walk: usize,
    at: usize,
}

impl Sampler for PrimaryStream<'_> {
    #[inline]
    fn next_1d(&mut self) -> f32 {
        self.at += 1;
        self.space.coordinate(self.at - 1, self.sizes)
    }

    #[inline]
    fn next_2d(&mut self) -> Vec2 {
        let x = self.next_1d();
        Vec2::new(x, self.next_1d())
    }

    #[inline]
    fn start_vertex(&mut self, vertex: u32) {
        self.at = match vertex {
            0 => self.start,
            v => self.walk + STRIDE * (v as usize - 1),
        };
    }
}
