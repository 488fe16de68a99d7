//! Guided primary sample space: a piecewise-constant density over the numbers of a walk, learned from samples that found light, in whose
//! place uniform numbers are drawn (Guo, Bauszat, Bikker and Eisemann 2018, "Primary Sample Space Path Guiding").
//!
//! A binary tree halves the unit cube, one coordinate at a time. Its coordinates come in *blocks* (the start of a walk, its first vertex,
//! its second, ...), and a block's splits lie below all splits of the blocks before, so that the density of the first n blocks alone is
//! the product over the upper part of the tree: a path that needs fewer vertices of a walk has a density of its own.

use serde::{Deserialize, Serialize};

/// Coordinates that a guide may have.
pub const MAX_GUIDED: usize = 16;
/// Share of every block's density that stays uniform: no density is below this to the power of the number of blocks.
const UNIFORM: f64 = 0.25;
/// A cell with fewer samples than this is not split, nor one whose samples weigh as much as fewer equal ones.
const MIN_SAMPLES: usize = 12;
const MIN_EFFECTIVE: f64 = 6.0;
/// Splits must lower the root of the second moment of what the cell holds by this share.
const MIN_GAIN: f64 = 0.03;
/// Nodes of a tree.
const MAX_NODES: usize = 4096;
/// Volume of the smallest cell that is split.
const MIN_VOLUME: f64 = 1e-6;

/// A cell's split in two halves.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
struct Split {
    /// The coordinate.
    axis: u8,
    /// Probability of the lower half.
    lower: f32,
    /// The splits of the halves: numbers of later nodes, 0 = none.
    halves: [u16; 2],
}

/// A density over the coordinates of a walk. Without splits: uniform.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(try_from = "Vec<Split>", into = "Vec<Split>")]
pub struct Guide {
    splits: Vec<Split>,
}

impl From<Guide> for Vec<Split> {
    fn from(guide: Guide) -> Self {
        guide.splits
    }
}

impl TryFrom<Vec<Split>> for Guide {
    type Error = &'static str;

    /// Checks what came over the wire: a path down the tree must end, and no density may be 0.
    fn try_from(splits: Vec<Split>) -> Result<Self, Self::Error> {
        let fits = |(i, s): (usize, &Split)| {
            let later = |n: &u16| *n == 0 || (usize::from(*n) > i && usize::from(*n) < splits.len());
            usize::from(s.axis) < MAX_GUIDED && s.lower > 0.0 && s.lower < 1.0 && s.halves.iter().all(later)
        };
        if splits.len() > MAX_NODES || !splits.iter().enumerate().all(fits) {
            return Err("a guide's tree is malformed");
        }
        Ok(Self { splits })
    }
}

/// A sample to learn from: the numbers of its walk and what it found.
#[derive(Clone, Copy, Debug)]
pub struct GuideSample {
    /// The numbers.
    pub u: [f32; MAX_GUIDED],
    /// What it found.
    pub value: f64,
}

impl Guide {
    /// Number of splits.
    pub fn len(&self) -> usize {
        self.splits.len()
    }

    /// Whether it changes nothing.
    pub fn is_uniform(&self) -> bool {
        self.splits.is_empty()
    }

    /// Turns uniform numbers into guided ones, for the first blocks, which end at `ends`. Sets `densities[n]` to the density of the
    /// first n blocks.
    #[inline]
    pub fn warp(&self, u: &mut [f32; MAX_GUIDED], ends: &[usize], densities: &mut [f32]) {
        densities.fill(1.0);
        let Some(end) = ends.last().filter(|_| !self.is_uniform()) else { return };
        let (mut low, mut side) = ([0.0f32; MAX_GUIDED], [1.0f32; MAX_GUIDED]);
        let (mut density, mut block) = (1.0f32, 0);
        let mut next = self.splits.first();
        while let Some(split) = next.filter(|s| usize::from(s.axis) < *end) {
            let axis = usize::from(split.axis);
            while axis >= ends[block] {
                block += 1;
                densities[block] = density;
            }
            side[axis] *= 0.5;
            let half = usize::from(u[axis] >= split.lower);
            if half == 0 {
                u[axis] /= split.lower;
                density *= 2.0 * split.lower;
            } else {
                let upper = 1.0 - split.lower;
                u[axis] = (u[axis] - split.lower) / upper;
                low[axis] += side[axis];
                density *= 2.0 * upper;
            }
            u[axis] = u[axis].min(crate::math::ONE_MINUS_EPSILON);
            next = match split.halves[half] {
                0 => None,
                n => self.splits.get(usize::from(n)),
            };
        }
        densities[block + 1..=ends.len()].fill(density);
        for axis in 0..*end {
            // Rounding must not lead out of the cube.
            u[axis] = (low[axis] + u[axis] * side[axis]).min(crate::math::ONE_MINUS_EPSILON);
        }
    }

    /// Learns from samples whose numbers were drawn uniformly. `ends` are the ends of the blocks, the last one at most
    /// [`MAX_GUIDED`].
    pub fn learn(samples: &[GuideSample], ends: &[usize]) -> Self {
        let mut guide = Self::default();
        guide.add_block(samples.iter().collect(), ends, 0);
        guide
    }

    /// Adds the tree of a block and of all blocks after it; its number, 0 where there is nothing to split. (The first tree has number 0
    /// too: it is nobody's child.)
    fn add_block(&mut self, samples: Vec<&GuideSample>, ends: &[usize], block: usize) -> u16 {
        let Some(end) = ends.get(block) else { return 0 };
        let start = if block == 0 { 0 } else { ends[block - 1] };
        let cell = Cell { low: [0.0; MAX_GUIDED], side: [1.0; MAX_GUIDED], volume: 1.0, axes: start..*end };
        let tree = cell.grow(samples);
        let total = tree.mass;
        self.add_tree(tree, total, ends, block)
    }

    fn add_tree(&mut self, tree: Grown<'_>, total: f64, ends: &[usize], block: usize) -> u16 {
        let (axis, halves) = match tree.content {
            Content::Samples(samples) => return self.add_block(samples, ends, block + 1),
            Content::Halves(axis, halves) => (axis, halves),
        };
        if self.splits.len() >= MAX_NODES {
            return 0;
        }
        let number = self.splits.len();
        let probability = |t: &Grown<'_>| (1.0 - UNIFORM) * t.mass / total + UNIFORM * t.volume;
        let (lower, upper) = (probability(&halves[0]), probability(&halves[1]));
        // Rounding must leave both halves a chance.
        let lower = ((lower / (lower + upper)) as f32).clamp(1e-6, 1.0 - 1e-6);
        self.splits.push(Split { axis: axis as u8, lower, halves: [0; 2] });
        for (i, half) in halves.into_iter().enumerate() {
            self.splits[number].halves[i] = self.add_tree(half, total, ends, block);
        }
        number as u16
    }
}

/// A box of one block's coordinates.
#[derive(Clone)]
struct Cell {
    low: [f32; MAX_GUIDED],
    side: [f32; MAX_GUIDED],
    volume: f64,
    /// The coordinates of the block.
    axes: std::ops::Range<usize>,
}

/// A block's tree while it grows.
struct Grown<'a> {
    volume: f64,
    /// What the probability of the cell is to be proportional to: the root of its volume times the second moment of what it holds, which
    /// gives the least variance (Muller, Gross and Novak 2017, section 3, discuss the choice for trees).
    mass: f64,
    content: Content<'a>,
}

enum Content<'a> {
    Samples(Vec<&'a GuideSample>),
    Halves(usize, Box<[Grown<'a>; 2]>),
}

fn env(n: &str, d: f64) -> f64 {
    std::env::var(n).ok().and_then(|v| v.parse().ok()).unwrap_or(d)
}

impl Cell {
    /// Splits the cell as long as halves differ.
    fn grow<'a>(&self, samples: Vec<&'a GuideSample>) -> Grown<'a> {
        let second: f64 = samples.iter().map(|s| s.value * s.value).sum();
        let Some(axis) = self.best_split(&samples, second) else {
            return Grown { volume: self.volume, mass: (self.volume * second).sqrt(), content: Content::Samples(samples) };
        };
        let middle = self.low[axis] + 0.5 * self.side[axis];
        let (lower, upper): (Vec<_>, Vec<_>) = samples.into_iter().partition(|s| s.u[axis] < middle);
        let mut half = self.clone();
        half.side[axis] *= 0.5;
        half.volume *= 0.5;
        let lower = half.grow(lower);
        half.low[axis] = middle;
        let upper = half.grow(upper);
        let mass = lower.mass + upper.mass;
        Grown { volume: self.volume, mass, content: Content::Halves(axis, Box::new([lower, upper])) }
    }

    /// The coordinate whose halves differ most, if they differ enough and there is enough to tell by.
    fn best_split(&self, samples: &[&GuideSample], second: f64) -> Option<usize> {
        let fourth: f64 = samples.iter().map(|s| s.value.powi(4)).sum();
        if samples.len() < MIN_SAMPLES || self.volume < MIN_VOLUME {
            return None;
        }
        let mut best = None;
        let mut least = (1.0 - env("CHI", 12.0) / 8.0 * fourth / (second * second)) * second.sqrt();
        for axis in self.axes.clone() {
            let middle = self.low[axis] + 0.5 * self.side[axis];
            let lower: f64 = samples.iter().filter(|s| s.u[axis] < middle).map(|s| s.value * s.value).sum();
            let halves = (0.5 * lower).sqrt() + (0.5 * (second - lower).max(0.0)).sqrt();
            if halves < least {
                (least, best) = (halves, Some(axis));
            }
        }
        best
    }
}
