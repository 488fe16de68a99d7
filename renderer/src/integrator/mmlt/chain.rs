use super::bootstrap::sample_key;
use super::constants::{ChainConstants, MmltOptions};
use super::evaluate::{Evaluator, Proposal};
use super::neighbours::{Neighbours, Period, Tail};
use crate::film::{Counters, SplatSums};
use crate::integrator::UnitContext;
use crate::math::Vec2;
use crate::sampling::{IndependentSampler, PrimarySpace, Sampler, hash_words};
use crate::spectrum::Rgb;
use serde::{Deserialize, Serialize};

/// Names the mutations of chains among all hashes.
const CHAIN: u64 = 0x0063_6861_696e;

/// Where a chain starts: a sample of its pool, the technique of the path it found, and the target of that path.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct ChainStart(pub u32, pub u32, pub f32);

/// Some chains of one path length and replicate.
#[derive(Clone, Copy, Debug)]
pub struct ChainTask<'a> {
    /// The pass that made the pool.
    pub pool: u32,
    /// Edges of the paths.
    pub edges: u32,
    /// Number of the first chain among those of its length, replicate and pass.
    pub first: u32,
    /// Where they start.
    pub starts: &'a [ChainStart],
    /// Mutations of each.
    pub mutations: u32,
    /// Integral of the target, as the pool estimates it.
    pub b: f32,
}

/// A start that is not what the pool said: one of two machines is wrong.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
#[error(
    "sample {index} of the pool for paths of {edges} edges gives {found:?} here and gave {expected:?} to the machine that made the pool"
)]
pub struct Mismatch {
    /// Edges of the path.
    pub edges: u32,
    /// The sample.
    pub index: u32,
    /// Its target in the plan.
    pub expected: f32,
    /// Its target here.
    pub found: f32,
}

/// How the mutations fared.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ChainStats {
    /// Small steps.
    pub small: u64,
    /// Small steps accepted.
    pub small_accepted: u64,
    /// Large steps.
    pub large: u64,
    /// Large steps accepted.
    pub large_accepted: u64,
}

impl ChainStats {
    /// Adds another unit's counts.
    pub fn add(&mut self, o: &Self) {
        self.small += o.small;
        self.small_accepted += o.small_accepted;
        self.large += o.large;
        self.large_accepted += o.large_accepted;
    }

    fn count(&mut self, large: bool, accepted: bool) {
        let (all, taken) = if large {
            (&mut self.large, &mut self.large_accepted)
        } else {
            (&mut self.small, &mut self.small_accepted)
        };
        *all += 1;
        *taken += u64::from(accepted);
    }
}

/// Runs chains; the sum of the splats times `b` over the number of mutations is their part of the image. `Ok(None)` when stopped.
pub fn run_chains(
    c: &UnitContext<'_>,
    constants: &ChainConstants,
    options: &MmltOptions,
    pass: u32,
    task: &ChainTask<'_>,
    splats: &mut SplatSums,
    counters: &mut Counters,
) -> Result<Option<ChainStats>, Mismatch> {
    let mut stats = ChainStats::default();
    let Some(mut evaluator) = Evaluator::new(c, constants, options, task.edges) else { return Ok(Some(stats)) };
    // A vertex in a medium is not joined to others' camera rays.
    let period = Period::new(options.neighbours, task.mutations).filter(|_| !c.scene.features.has_media());
    let mut neighbours = Neighbours::new(c, constants);
    for (i, start) in (task.first..).zip(task.starts) {
        // Replay the start.
        let mut space = PrimarySpace::new(task.edges as usize);
        let key = sample_key(c.seed, task.pool, c.replicate, start.0);
        let current = evaluator.replay(&mut space, key, start.1);
        if current.target.to_bits() != start.2.to_bits() || current.technique != start.1 {
            return Err(Mismatch { edges: task.edges, index: start.0, expected: start.2, found: current.target });
        }
        space.accept();
        let place = Place::new(current, &evaluator, period);
        let neighbours = &mut neighbours;
        let mut chain = Chain { c, options, b: task.b, period, neighbours, splats, place, waiting: Waiting::default() };
        let key =
            hash_words(&[c.seed, CHAIN, u64::from(pass), u64::from(c.replicate), u64::from(task.edges), u64::from(i)]);
        for mutation in 0..task.mutations {
            if mutation % 256 == 0 && (c.stopped)() {
                return Ok(None);
            }
            let mut numbers = IndependentSampler::new([key, u64::from(mutation)]);
            let large = numbers.next_1d() < options.large_step;
            let u = numbers.next_1d();
            if large {
                space.propose_large(numbers.next_bits());
            } else {
                space.propose_small(numbers.next_bits());
            }
            let together = period.filter(|p| p.has(mutation)).map(|_| numbers.next_bits());
            let proposal = evaluator.evaluate(&mut space);
            let accepted = chain.step(proposal, &evaluator, &Step { large, u, together });
            if accepted {
                space.accept();
            }
            stats.count(large, accepted);
        }
        chain.leave();
    }
    counters.samples += task.starts.len() as u64 * u64::from(task.mutations);
    counters.add(&evaluator.tracer.counters);
    counters.rays += neighbours.rays;
    Ok(Some(stats))
}

/// How a mutation is decided, and how it counts.
struct Step {
    large: bool,
    u: f32,
    /// Where the lattices lie, if it counts for the neighbours too.
    together: Option<u64>,
}

/// A path, and what it has in common with its neighbours.
#[derive(Clone, Copy)]
struct Place {
    path: Proposal,
    tail: Option<Tail>,
}

impl Place {
    /// The path that `evaluator` made last.
    fn new(path: Proposal, evaluator: &Evaluator<'_>, period: Option<Period>) -> Self {
        Self { path, tail: period.and_then(|_| evaluator.tail(&path)) }
    }
}

/// Weight of the current path that is not splatted yet.
#[derive(Clone, Copy, Default)]
struct Waiting {
    alone: f64,
    together: f64,
    /// Where the lattices lie.
    grid: u64,
}

/// A chain's place, and the splat that grows while it stays there.
struct Chain<'a, 'b> {
    c: &'a UnitContext<'a>,
    options: &'a MmltOptions,
    b: f32,
    period: Option<Period>,
    neighbours: &'b mut Neighbours<'a>,
    splats: &'b mut SplatSums,
    place: Place,
    waiting: Waiting,
}

impl Chain<'_, '_> {
    /// One mutation: both paths are splatted with their expected share of it. Whether the chain moves.
    fn step(&mut self, proposal: Proposal, evaluator: &Evaluator<'_>, step: &Step) -> bool {
        let current = self.place;
        let accept = if proposal.target > 0.0 { (proposal.target / current.path.target).min(1.0) } else { 0.0 };
        self.wait(&current, f64::from(1.0 - accept), step);
        if !(proposal.target > 0.0) {
            return false;
        }
        let proposed = Place::new(proposal, evaluator, self.period);
        let bonus = if step.large && self.options.kelemen { 1.0 } else { 0.0 };
        let share = f64::from(accept + bonus);
        if step.u < accept {
            self.leave();
            self.place = proposed;
            self.wait(&proposed, share, step);
            return true;
        }
        let kept = std::mem::take(&mut self.waiting);
        self.wait(&proposed, share, step);
        self.splat(&proposed);
        self.waiting = kept;
        false
    }

    /// Adds `share` of a mutation to what waits for a place. A unit of probability is worth `1 / (c + p_L b)` there, or `1 / c` without
    /// weights for large steps.
    fn wait(&mut self, place: &Place, share: f64, step: &Step) {
        let independent = if self.options.kelemen { self.options.large_step * self.b } else { 0.0 };
        let weight = share / f64::from(place.path.target + independent);
        match (place.tail.and(self.period), step.together) {
            (None, _) => self.waiting.alone += weight,
            (Some(period), None) => self.waiting.alone += weight * period.weight(false),
            (Some(period), Some(grid)) => {
                self.waiting.together += weight * period.weight(true);
                self.waiting.grid = grid;
            }
        }
    }

    /// Splats what has gathered at the current path.
    fn leave(&mut self) {
        let place = self.place;
        self.splat(&place);
    }

    /// Splats what waits, at `place`.
    fn splat(&mut self, place: &Place) {
        let waiting = std::mem::take(&mut self.waiting);
        splat(self.c, self.splats, place.path.value, place.path.raster, waiting.alone);
        if let (Some(tail), true) = (&place.tail, waiting.together > 0.0) {
            self.neighbours.splat(&place.path, tail, waiting.together, waiting.grid, self.splats);
        }
    }
}

/// Splats `weight` times a contribution.
pub(super) fn splat(c: &UnitContext<'_>, splats: &mut SplatSums, value: Rgb, raster: Vec2, weight: f64) {
    if weight == 0.0 {
        return;
    }
    // In f64: one over a target near the end of f32's range is beyond it, their product is not.
    let value = value.map(|v| (f64::from(v) * weight) as f32);
    splats.splat(&c.view.filter, raster, value);
}
