//! Points of primary sample space and their mutations (Kelemen et al. 2002, "A Simple and Robust Mutation Strategy for the Metropolis
//! Light Transport Algorithm").

use super::Sampler;
use super::rng::{GOLDEN, mix64, unit_f32};
use crate::math::Vec2;

/// Coordinates of a fixed block that belongs to one vertex of a walk: {distance, where there are media; lobe, direction, direction}.
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

/// A table of the sizes of small steps, equally likely.
#[derive(Clone, Debug)]
pub struct StepSizes {
    sizes: Vec<f32>,
}

impl StepSizes {
    const CELLS: usize = 1024;

    /// Log-uniform between `smallest` and `largest`, parts of the unit interval: `s2 exp(-ln(s2 / s1) u)` of Kelemen et al.
    pub fn log_uniform(smallest: f64, largest: f64) -> Self {
        let size = |i: usize| largest * crate::math::pow64(smallest / largest, (i as f64 + 0.5) / Self::CELLS as f64);
        Self { sizes: (0..Self::CELLS).map(|i| size(i) as f32).collect() }
    }

    /// Normally distributed, with standard deviation `sigma` (Pharr, Jakob and Humphreys 2016, section 16.4).
    pub fn gaussian(sigma: f64) -> Self {
        // The size that a share `p` of all steps does not exceed, by bisection.
        let size = |p: f64| {
            let (mut low, mut high) = (0.0, 8.0);
            for _ in 0..60 {
                let middle = 0.5 * (low + high);
                if crate::math::erf64(middle * std::f64::consts::FRAC_1_SQRT_2) < p {
                    low = middle;
                } else {
                    high = middle;
                }
            }
            sigma * low
        };
        Self { sizes: (0..Self::CELLS).map(|i| size((i as f64 + 0.5) / Self::CELLS as f64) as f32).collect() }
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn step_sizes_have_their_distributions() {
        let gaussian = StepSizes::gaussian(0.01).sizes;
        let n = gaussian.len() as f64;
        let variance = gaussian.iter().map(|s| f64::from(*s) * f64::from(*s)).sum::<f64>() / n;
        // Midpoints of equal shares lose a little of the tails.
        assert!((variance / 1e-4 - 1.0).abs() < 5e-3, "{variance}");
        // Half of all steps are smaller than the probable error.
        let median = f64::from(gaussian[511] + gaussian[512]) / 2.0;
        assert!((median / 0.006_744_897_5 - 1.0).abs() < 1e-4, "{median}");
        let (small, large) = (1.0 / 1024.0, 1.0 / 64.0);
        let sizes = StepSizes::log_uniform(small, large).sizes;
        let mean = sizes.iter().map(|s| libm::log(f64::from(*s))).sum::<f64>() / n;
        assert!((mean - libm::log(small * large) / 2.0).abs() < 1e-6, "{mean}");
        assert!(sizes.iter().all(|s| (small..=large).contains(&f64::from(*s))));
    }
}
