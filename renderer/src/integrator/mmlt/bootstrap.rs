use super::constants::{ChainConstants, MmltOptions};
use super::evaluate::Evaluator;
use crate::film::{Counters, SplatSums};
use crate::integrator::UnitContext;
use crate::sampling::{PrimarySpace, hash_words};
use std::ops::Range;

/// Names the samples of bootstrap pools among all hashes.
const POOL: u64 = 0x706f_6f6c;

/// What independent samples of one path length found.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct BootstrapSums {
    /// Index and target of every sample that found a path, by index.
    pub found: Vec<(u32, f32)>,
    /// Sum of the targets, by technique.
    pub techniques: Vec<f64>,
}

/// The key of a sample of a pool: `pass` names the pool of a replicate and path length.
pub fn sample_key(seed: u64, pass: u32, replicate: u32, edges: u32, index: u32) -> u64 {
    hash_words(&[seed, POOL, u64::from(pass), u64::from(replicate), u64::from(edges), u64::from(index)])
}

/// Makes the samples `samples` of the pool of this pass, replicate and path length; splats them, if asked to. `None` when stopped.
pub fn run_bootstrap(
    c: &UnitContext<'_>,
    constants: &ChainConstants,
    options: &MmltOptions,
    (pass, edges): (u32, u32),
    samples: Range<u32>,
    mut splats: Option<&mut SplatSums>,
    counters: &mut Counters,
) -> Option<BootstrapSums> {
    counters.samples += u64::from(samples.end - samples.start);
    let mut sums = BootstrapSums { found: Vec::new(), techniques: vec![0.0; edges as usize + 1] };
    let Some(mut evaluator) = Evaluator::new(c, constants, options, edges) else { return Some(sums) };
    let mut space = PrimarySpace::new(edges as usize);
    for index in samples {
        if index % 256 == 0 && (c.stopped)() {
            return None;
        }
        space.propose_large(sample_key(c.seed, pass, c.replicate, edges, index));
        let found = evaluator.evaluate(&mut space);
        if found.target > 0.0 {
            sums.found.push((index, found.target));
            sums.techniques[found.technique as usize] += f64::from(found.target);
            if let Some(splats) = splats.as_deref_mut() {
                for (x, y, weight) in c.view.filter.weights(found.raster).iter() {
                    splats.add(x, y, found.value * weight);
                }
            }
        }
    }
    counters.add(&evaluator.tracer.counters);
    Some(sums)
}
