use super::bootstrap::sample_key;
use super::constants::{ChainConstants, MmltOptions};
use super::evaluate::{Evaluator, Proposal};
use crate::film::{Counters, SplatSums};
use crate::integrator::UnitContext;
use crate::sampling::{IndependentSampler, PrimarySpace, Sampler, hash_words};
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
    for (i, start) in (task.first..).zip(task.starts) {
        // Replay the start.
        let mut space = PrimarySpace::new(task.edges as usize);
        let key = sample_key(c.seed, task.pool, c.replicate, start.0);
        let current = evaluator.replay(&mut space, key, start.1);
        if current.target.to_bits() != start.2.to_bits() || current.technique != start.1 {
            return Err(Mismatch { edges: task.edges, index: start.0, expected: start.2, found: current.target });
        }
        space.accept();
        let key =
            hash_words(&[c.seed, CHAIN, u64::from(pass), u64::from(c.replicate), u64::from(task.edges), u64::from(i)]);
        let mut chain = Chain { c, options, b: task.b, current, waiting: 0.0, splats };
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
            let proposal = evaluator.evaluate(&mut space);
            let accepted = chain.step(&proposal, large, u);
            if accepted {
                space.accept();
            }
            stats.count(large, accepted);
        }
        chain.leave();
    }
    counters.samples += task.starts.len() as u64 * u64::from(task.mutations);
    counters.add(&evaluator.tracer.counters);
    Ok(Some(stats))
}

/// A chain's place, and the splat that grows while it stays there.
struct Chain<'a, 'b> {
    c: &'a UnitContext<'a>,
    options: &'a MmltOptions,
    b: f32,
    current: Proposal,
    /// Weight of the current path that is not splatted yet.
    waiting: f64,
    splats: &'b mut SplatSums,
}

impl Chain<'_, '_> {
    /// One mutation: both paths are splatted with their expected share of it. Whether the chain moves.
    fn step(&mut self, proposal: &Proposal, large: bool, u: f32) -> bool {
        let accept = if proposal.target > 0.0 { (proposal.target / self.current.target).min(1.0) } else { 0.0 };
        self.waiting += f64::from(1.0 - accept) * self.weight(self.current.target);
        if !(proposal.target > 0.0) {
            return false;
        }
        let bonus = if large && self.options.kelemen { 1.0 } else { 0.0 };
        let weight = f64::from(accept + bonus) * self.weight(proposal.target);
        if u < accept {
            self.leave();
            self.current = *proposal;
            self.waiting = weight;
            return true;
        }
        splat(self.c, self.splats, proposal, weight);
        false
    }

    /// What a unit of probability at a path is worth: `1 / (c + p_L b)`, or `1 / c` without weights for large steps.
    fn weight(&self, target: f32) -> f64 {
        let independent = if self.options.kelemen { self.options.large_step * self.b } else { 0.0 };
        1.0 / f64::from(target + independent)
    }

    /// Splats what has gathered at the current path.
    fn leave(&mut self) {
        splat(self.c, self.splats, &self.current, self.waiting);
        self.waiting = 0.0;
    }
}

fn splat(c: &UnitContext<'_>, splats: &mut SplatSums, path: &Proposal, weight: f64) {
    if weight == 0.0 {
        return;
    }
    // In f64: one over a target near the end of f32's range is beyond it, their product is not.
    let value = path.value.map(|v| (f64::from(v) * weight) as f32);
    splats.splat(&c.view.filter, path.raster, value);
}
