//! The plans of a Metropolis job, and what it has learned so far.
//!
//! * Pass 0 is the *pilot*: independent samples of every path length. It teaches which lights to select, the probabilities of the
//!   techniques, the target map and how many ordinary samples pay, and is a preview; its samples count for nothing else, so nothing that it
//!   steers is biased by it.
//! * Pass 1 makes *pools*: independent samples again, now of the target that the chains will have. A pool's mean is `b`.
//! * Later passes run *chains* from starts drawn from the pools, and the ordinary samples of emission and direct light; where time or
//!   error is the budget, they also make the pools of the pass after. What a pass does for a group is a complete estimate of its own,
//!   whose weight is its number of mutations, fixed before anything of it is known. The first passes may leave groups out.
//!
//! `b` and the starts of one chain always come from the same pool, which keeps `b` times the mean splat unbiased whatever the length of
//! the chains. Their *number* may depend on the pools: systematic resampling gives the same expectation for any number of starts.

mod learn;
mod pool;
mod state;

use crate::film::{GroupFilm, SplatSums};
use crate::integrator::mmlt::{ChainConstants, ChainStart, Depth, TARGET_CELL};
use crate::job::plan::{GroupRange, Part, PassPlan, Sampling};
use crate::job::planner::{dealt, pass_size};
use crate::job::settings::RenderSettings;
use crate::job::unit::{Unit, UnitKind, UnitResult};
use crate::light::selection_weights;
use crate::sampling::{IndependentSampler, Sampler};
pub(in crate::job) use learn::{LEAST_SHARE, MOST_SHARE};
use pool::Pool;
use std::collections::BTreeMap;

/// Names the random starts of a pool among all hashes.
const STARTS: u64 = 0x7374_6172_7473;
/// Share of the work that the pilot may take.
const PILOT_SHARE: f64 = 0.02;
/// Samples of a pilot, at least.
const MIN_PILOT: f64 = 2048.0;
/// Samples of a pool, at least.
const MIN_POOL: f64 = 256.0;
/// Edges of the path of a typical mutation, and up to which walks of a pool's samples typically last.
const TYPICAL_EDGES: f64 = 5.0;
const TYPICAL_LONGEST: f64 = 16.0;
/// Samples of the pools of a pass, all groups and lengths together: bounds the coordinator's memory.
const MAX_POOLS: f64 = (1 << 20) as f64;
/// Edges of the longest path of chains when the depth is unbounded.
const LONGEST_UNBOUNDED: u32 = 32;
/// Mutations per pixel that the pilot of a job is meant for that time or error ends.
const FIRST_MUTATIONS: u32 = 16;

/// The path lengths that chains carry: beyond emission and direct light.
pub fn lengths(settings: &RenderSettings) -> std::ops::RangeInclusive<u32> {
    let longest = settings.mmlt.longest;
    settings.mmlt.direct_edges + 1..=settings.max_depth.map_or(longest.min(LONGEST_UNBOUNDED), |n| n.min(longest))
}

/// What a Metropolis job has learned. In memory, beside the groups' films: 24 bytes a pixel for the pilot's picture (until chains have
/// made a better one), 24 for what is pending, 16 a found path of the pools (at most 2^20 samples, some paths each).
#[derive(Clone, Debug, PartialEq, Default)]
pub struct Metropolis {
    /// The pilot's picture: mean radiance of the paths that chains carry.
    pub pilot: Vec<[f64; 3]>,
    /// Samples of the pilot that are in its picture, and how many it has.
    pub pilot_samples: (u32, u32),
    /// The pilot's sums of targets by path length and technique.
    pub techniques: BTreeMap<u32, Vec<f64>>,
    /// What paths of a length contribute: the sum of `b` over all pools of the job.
    pub contributions: BTreeMap<u32, f64>,
    /// The pools under way, by replicate and path length.
    pub pools: BTreeMap<(u32, u32), Pool>,
    /// Splats of the group and pass under way.
    pub pending: Vec<[f64; 3]>,
}

/// The pilot's plan.
pub fn pilot(settings: &RenderSettings) -> PassPlan {
    let lengths: Vec<u32> = lengths(settings).collect();
    let samples =
        pool_samples(settings, PILOT_SHARE, first_mutations(settings)).clamp(MIN_PILOT, f64::from(1 << 22)) as u32;
    let first = GroupRange { replicate: 0, start: 0, end: 1, closes: false };
    let mut parts = vec![Part::Samples(first)];
    if !lengths.is_empty() {
        parts.push(Part::Bootstrap { replicate: 0, samples });
    }
    let depths = lengths.iter().map(|k| Depth { edges: *k, techniques: vec![1.0; *k as usize + 1] }).collect();
    let columns = settings.width.div_ceil(TARGET_CELL);
    let direct_share = Some(settings.mmlt.direct_share).filter(|s| *s > 0.0).unwrap_or(learn::KNOWN_SHARE);
    let chains = ChainConstants { depths, columns, target: Vec::new(), threshold: 0.0, direct_share };
    plan(settings, 0, parts, chains, 0, false)
}

/// Samples of the pilot and of the pools for each mutation of a long job.
pub fn pools_per_mutation(settings: &RenderSettings) -> f64 {
    pool_samples(settings, PILOT_SHARE + f64::from(settings.mmlt.pool_share), 1) / pixels(settings)
}

/// Share of the work of a job that chains do.
pub fn chain_share(settings: &RenderSettings) -> f64 {
    1.0 - PILOT_SHARE - f64::from(settings.mmlt.pool_share)
}

/// Pool samples that cost the given share of so many mutations per pixel. A sample traces both walks, and a path of every length in
/// about every second way; a mutation, one path of a short length.
fn pool_samples(settings: &RenderSettings, share: f64, mpp: u32) -> f64 {
    let longest = f64::from(*lengths(settings).end()).clamp(1.0, TYPICAL_LONGEST);
    let cost = (2.0 * longest + 0.25 * longest * longest) / TYPICAL_EDGES;
    share * f64::from(mpp) * pixels(settings) / cost
}

fn pixels(settings: &RenderSettings) -> f64 {
    f64::from(settings.width) * f64::from(settings.height)
}

/// Mutations per pixel that nothing but their number ends.
fn fixed_budget(settings: &RenderSettings) -> Option<u32> {
    let b = &settings.budget;
    b.mpp.filter(|_| b.is_counted())
}

fn first_mutations(settings: &RenderSettings) -> u32 {
    fixed_budget(settings).unwrap_or(FIRST_MUTATIONS).min(settings.budget.mpp.unwrap_or(u32::MAX))
}

fn plan(
    settings: &RenderSettings,
    pass: u32,
    parts: Vec<Part>,
    chains: ChainConstants,
    chain_weight: u32,
    last: bool,
) -> PassPlan {
    PassPlan {
        pass,
        width: settings.width,
        height: settings.height,
        reach: settings.reach(),
        sampling: Sampling::Tiles,
        dealing: None,
        parts,
        light_weights: Vec::new(),
        sharing: Vec::new(),
        threshold: 0.0,
        chains: Some(chains),
        chain_weight,
        last,
        first: 0,
        settings: None,
    }
}

/// What a pass of chains does of the job.
struct Share {
    /// Mutations per pixel that were made before, all groups together.
    done: u32,
    /// Mutations per pixel of the pass, all groups together.
    size: u32,
    /// The groups that take part, all with as many mutations.
    groups: Vec<u32>,
    /// Mutations per pixel that the pass would have if all groups took part.
    density: u32,
    /// They get no more after it.
    closes: bool,
}

impl Share {
    /// Of the pass of chains after `done` mutations per pixel; `None` when there are enough.
    fn after(settings: &RenderSettings, done: u32) -> Option<Self> {
        let all = settings.replicates;
        if let Some(size) = fixed_budget(settings) {
            let groups = (0..all).collect();
            return (done == 0).then_some(Self { done, size, groups, density: size, closes: true });
        }
        let left = settings.budget.mpp.unwrap_or(u32::MAX).saturating_sub(done);
        let size = pass_size(settings, done, left);
        let takes_part = |r: &u32| dealt(settings, done + size, *r) > dealt(settings, done, *r);
        let groups = (0..all).filter(takes_part).collect();
        (size > 0).then_some(Self { done, size, groups, density: size.max(all), closes: false })
    }

    /// The ordinary samples of a group that go with its mutations.
    fn direct(&self, settings: &RenderSettings, share: f32, replicate: u32, film: &GroupFilm) -> GroupRange {
        let share = f64::from(share) / f64::from(settings.replicates);
        // The film knows how many it has, at least one of every pass. Those of the pilot, the first group's, are no longer among them.
        let pilot = u32::from(replicate == 0);
        let start = if self.done == 0 { 0 } else { film.pixel(0).1 as u32 };
        let done = dealt(settings, self.done, replicate) * settings.replicates;
        let end = ((f64::from(done + self.density) * share).ceil() as u32).max(start + 1);
        GroupRange { replicate, start: start + pilot, end: end + pilot, closes: self.closes }
    }
}

impl Metropolis {
    /// Takes in a bootstrap unit of a pass; `None` when it does not fit.
    pub fn add_bootstrap(
        &mut self,
        settings: &RenderSettings,
        plan: &PassPlan,
        unit: &Unit,
        result: &UnitResult,
    ) -> Option<()> {
        let (replicate, UnitKind::Bootstrap { start, end }) = (unit.replicate, unit.kind) else { return None };
        let sums = result.bootstrap.as_ref()?;
        let samples = plan.parts.iter().find_map(|p| match p {
            Part::Bootstrap { replicate: r, samples } if *r == replicate => Some(*samples),
            _ => None,
        })?;
        let chains = plan.chains.as_ref()?;
        let fits = sums.techniques.len() == chains.depths.len()
            && sums.techniques.iter().zip(&chains.depths).all(|(t, d)| t.len() == d.techniques.len())
            && sums.found.iter().all(|f| chains.depth(f.edges).is_some());
        if !fits {
            return None;
        }
        if plan.pass > 0 {
            for depth in &chains.depths {
                self.pools.entry((replicate, depth.edges)).or_default().samples = samples;
            }
            for f in &sums.found {
                let start = ChainStart(f.index, f.technique, f.target);
                self.pools.entry((replicate, f.edges)).or_default().found.push((start, f.weight));
            }
            return Some(());
        }
        // The pilot.
        for (depth, sums) in chains.depths.iter().zip(&sums.techniques) {
            let totals = self.techniques.entry(depth.edges).or_insert_with(|| vec![0.0; sums.len()]);
            totals.iter_mut().zip(sums).for_each(|(to, from)| *to += from / f64::from(samples));
        }
        self.pilot_samples = (self.pilot_samples.0 + (end - start), samples);
        if let Some(splats) = &result.splats {
            let width = settings.width as usize;
            self.pilot.resize(width * settings.height as usize, [0.0; 3]);
            for (x, y, v) in splats.pixels() {
                let to = &mut self.pilot[y as usize * width + x as usize];
                (0..3).for_each(|c| to[c] += v[c] / f64::from(samples));
            }
        }
        Some(())
    }

    /// The pass after `before`, which is complete, at `done` mutations per pixel in all. `groups` are the films so far.
    pub fn next(
        &mut self,
        settings: &RenderSettings,
        before: &PassPlan,
        done: u32,
        groups: &[GroupFilm],
        light_sums: &[f64],
    ) -> Option<PassPlan> {
        let pass = before.pass + 1;
        // A depth limit may leave nothing to chains.
        let empty = lengths(settings).is_empty();
        if pass == 1 && !empty {
            // Before there are chains, the first group's film is that of ordinary samples.
            let chains = self.learn(settings, |i| groups[0].pixel(i).0);
            let parts = Self::pools_of(settings, &Share::after(settings, 0)?);
            let light_weights = selection_weights(light_sums);
            return Some(PassPlan { light_weights, ..plan(settings, pass, parts, chains, 0, false) });
        }
        let chains = before.chains.clone()?;
        let share = Share::after(settings, done)?;
        for ((_, edges), pool) in &self.pools {
            *self.contributions.entry(*edges).or_default() += pool.b();
        }
        let mut parts = self.chains_of(settings, pass, &share, &chains, groups);
        self.pools.clear();
        let next = Share::after(settings, done + share.size);
        if let Some(next) = next.as_ref().filter(|_| !empty) {
            parts.extend(Self::pools_of(settings, next));
        }
        // Those of the pools, whose samples are replayed.
        let light_weights = before.light_weights.clone();
        Some(PassPlan { light_weights, ..plan(settings, pass, parts, chains, share.size, next.is_none()) })
    }

    /// The pools for a pass.
    fn pools_of(settings: &RenderSettings, share: &Share) -> Vec<Part> {
        let samples = pool_samples(settings, f64::from(settings.mmlt.pool_share), share.density).min(MAX_POOLS)
            / f64::from(settings.replicates);
        let samples = samples.max(MIN_POOL) as u32;
        share.groups.iter().map(|replicate| Part::Bootstrap { replicate: *replicate, samples }).collect()
    }

    /// The chains of a pass and its ordinary samples, group after group.
    fn chains_of(
        &self,
        settings: &RenderSettings,
        pass: u32,
        of_pass: &Share,
        constants: &ChainConstants,
        films: &[GroupFilm],
    ) -> Vec<Part> {
        let groups = f64::from(settings.replicates);
        let budget = f64::from(of_pass.density) * pixels(settings) * chain_share(settings) / groups;
        let lengths: Vec<u32> = lengths(settings).collect();
        // Mutations by what a length contributes, over the root of what one costs; a tenth for all alike.
        let contribution = |edges: &u32| self.contributions.get(edges).copied().unwrap_or_default();
        let weights: Vec<f64> = lengths.iter().map(|k| contribution(k) / f64::from(*k).sqrt()).collect();
        let total: f64 = weights.iter().sum();
        // The length of a chain depends on nothing that the pools found.
        let length =
            (budget / (8 * lengths.len().max(1)) as f64).clamp(1.0, f64::from(settings.mmlt.chain_length)) as u32;
        let mut parts = Vec::new();
        for &replicate in &of_pass.groups {
            for (edges, weight) in lengths.iter().zip(&weights) {
                let Some(pool) = self.pools.get(&(replicate, *edges)) else { continue };
                let b = pool.b() as f32;
                if !(b > 0.0 && b.is_finite()) {
                    continue;
                }
                let share = 0.9 * weight / total + 0.1 / lengths.len() as f64;
                let chains = (budget * share / f64::from(length)).round().max(1.0) as u32;
                let words = [settings.seed, STARTS, u64::from(pass), u64::from(replicate), u64::from(*edges)];
                let u = IndependentSampler::new(words).next_1d();
                let starts = pool.starts(chains, u);
                parts.push(Part::Chains { replicate, edges: *edges, b, starts, mutations: length });
            }
            let (share, film) = (constants.direct_share, &films[replicate as usize]);
            parts.push(Part::Samples(of_pass.direct(settings, share, replicate, film)));
        }
        parts
    }

    /// Adds splats of chains, scaled to radiance, to what is pending.
    pub fn add_chains(&mut self, width: u32, height: u32, splats: &SplatSums, scale: f64) {
        self.pending.resize(width as usize * height as usize, [0.0; 3]);
        for (x, y, v) in splats.pixels() {
            let to = &mut self.pending[y as usize * width as usize + x as usize];
            (0..3).for_each(|c| to[c] += scale * v[c]);
        }
    }

    /// The pilot's picture is of no use once there is a better one.
    pub fn forget_preview(&mut self) {
        self.pilot = Vec::new();
    }

    /// What is known before the first chains are done: the pilot over the first group's ordinary samples. `None` once a group is complete.
    pub fn preview(&self, width: u32, height: u32, groups: &[GroupFilm]) -> Option<GroupFilm> {
        let incomplete = |g: &GroupFilm| matches!(g, GroupFilm::Empty) || g.pixel(0).1 == 0.0;
        if self.techniques.is_empty() || groups.iter().skip(1).any(|g| !incomplete(g)) {
            return None;
        }
        let mut film = groups.first()?.clone();
        if matches!(film, GroupFilm::Closed { .. }) {
            return None;
        }
        // While the pilot is under way (or was stopped), its picture is that of the samples it has.
        let (done, all) = self.pilot_samples;
        let scale = f64::from(all) / f64::from(done.max(1));
        let scaled: Vec<[f64; 3]> = self.pilot.iter().map(|v| v.map(|c| c * scale)).collect();
        film.replace_chains(&scaled, width as usize * height as usize);
        Some(film)
    }
}
