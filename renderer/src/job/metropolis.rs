//! The plans of a Metropolis job, and what it has learned so far.
//!
//! * Pass 0 is the *pilot*: independent samples of every path length. It teaches the probabilities of the techniques and the target map,
//!   and is a preview; its samples count for nothing else, so nothing that it steers is biased by it.
//! * Pass 1 makes *pools*: independent samples again, now of the target that the chains will have. A pool's mean is `b`.
//! * Later passes run *chains* from starts drawn from the pools, and the ordinary samples of emission and direct light; where time or
//!   error is the budget, they also make the pools of the pass after. Every pass is a complete estimate of its own, whose weight is its
//!   number of mutations, fixed before anything of it is known.
//!
//! `b` and the starts of one chain always come from the same pool, which keeps `b` times the mean splat unbiased whatever the length of
//! the chains. Their *number* may depend on the pools: systematic resampling gives the same expectation for any number of starts.

use super::plan::{GroupRange, Part, PassPlan, Sampling};
use super::settings::RenderSettings;
use super::unit::UnitResult;
use crate::film::{GroupFilm, SplatSums};
use crate::integrator::mmlt::{BootstrapSums, ChainConstants, ChainStart, Depth, TARGET_CELL};
use crate::math::pow64;
use crate::sampling::{IndependentSampler, Sampler};
use std::collections::BTreeMap;

/// Names the random starts of a pool among all hashes.
const STARTS: u64 = 0x7374_6172_7473;
/// Shares of the mutations that pilot and pools may take.
const PILOT_SHARE: f64 = 0.02;
const POOL_SHARE: f64 = 0.08;
/// Samples of the pools of a pass, all groups and lengths together: bounds the coordinator's memory.
const MAX_POOLS: f64 = (1 << 24) as f64;
/// Edges up to which ordinary samples carry the light: emission and direct light.
pub const DIRECT_EDGES: u32 = 2;
/// Edges of the longest path of chains when the depth is unbounded.
const LONGEST_UNBOUNDED: u32 = 32;
/// Mutations per pixel of the first pass of chains of a job that time or error ends.
const FIRST_PASS: u32 = 16;

/// The path lengths that chains carry: 3 edges and more.
pub fn lengths(settings: &RenderSettings) -> std::ops::RangeInclusive<u32> {
    let longest = settings.mmlt.longest;
    3..=settings.max_depth.map_or(longest.min(LONGEST_UNBOUNDED), |n| n.min(longest))
}

/// A pool of one replicate and path length.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Pool {
    /// Number of samples.
    pub samples: u32,
    /// Those that found a path: index and target.
    pub found: Vec<(u32, f32)>,
}

impl Pool {
    /// Mean of the target.
    fn b(&self) -> f64 {
        let sum: f64 = self.found.iter().map(|f| f64::from(f.1)).sum();
        if self.samples == 0 { 0.0 } else { sum / f64::from(self.samples) }
    }

    /// `n` starts by systematic resampling: the expected number of starts at a sample is proportional to its target.
    fn starts(&self, n: u32, u: f32) -> Vec<ChainStart> {
        let total: f64 = self.found.iter().map(|f| f64::from(f.1)).sum();
        let mut starts = Vec::with_capacity(n as usize);
        let (mut sum, mut next) = (0.0, f64::from(u));
        for (index, target) in &self.found {
            sum += f64::from(*target) / total * f64::from(n);
            while next < sum && starts.len() < n as usize {
                starts.push(ChainStart(*index, *target));
                next += 1.0;
            }
        }
        // Rounding may leave the last one out.
        if let Some((index, target)) = self.found.last() {
            starts.resize(n as usize, ChainStart(*index, *target));
        }
        starts
    }
}

/// What a Metropolis job has learned.
#[derive(Clone, Debug, PartialEq, Default)]
pub struct Metropolis {
    /// The pilot's picture: mean radiance of the paths that chains carry.
    pub pilot: Vec<[f64; 3]>,
    /// The pilot's sums of targets by path length and technique.
    pub techniques: BTreeMap<u32, Vec<f64>>,
    /// The pools under way, by replicate and path length.
    pub pools: BTreeMap<(u32, u32), Pool>,
    /// Splats of the group and pass under way.
    pub pending: Vec<[f64; 3]>,
}

/// The pilot's plan.
pub fn pilot(settings: &RenderSettings) -> PassPlan {
    let lengths: Vec<u32> = lengths(settings).collect();
    let mutations = f64::from(first_mutations(settings)) * pixels(settings);
    // Short paths matter more: their shares fall with their length.
    let shares: f64 = lengths.iter().map(|k| 1.0 / f64::from(*k)).sum();
    let parts = lengths.iter().map(|k| {
        let samples = (PILOT_SHARE * mutations / f64::from(*k) / shares).clamp(1024.0, f64::from(1 << 22)) as u32;
        Part::Bootstrap { replicate: 0, edges: *k, samples }
    });
    let first = GroupRange { replicate: 0, start: 0, end: 1, closes: false };
    let depths = lengths.iter().map(|k| Depth { edges: *k, techniques: vec![1.0; *k as usize + 1] }).collect();
    let chains = ChainConstants { depths, columns: settings.width.div_ceil(TARGET_CELL), target: Vec::new() };
    plan(settings, 0, std::iter::once(Part::Samples(first)).chain(parts).collect(), chains, 0, false)
}

fn pixels(settings: &RenderSettings) -> f64 {
    f64::from(settings.width) * f64::from(settings.height)
}

/// Mutations per pixel that nothing but their number ends.
fn fixed_budget(settings: &RenderSettings) -> Option<u32> {
    let b = &settings.budget;
    b.mpp.filter(|_| b.time_s.is_none() && b.target_error.is_none())
}

fn first_mutations(settings: &RenderSettings) -> u32 {
    fixed_budget(settings).unwrap_or(FIRST_PASS).min(settings.budget.mpp.unwrap_or(u32::MAX))
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
        sampling: Sampling::Tiles,
        parts,
        light_weights: Vec::new(),
        threshold: 0.0,
        chains: Some(chains),
        chain_weight,
        last,
    }
}

impl Metropolis {
    /// Takes in a bootstrap unit of a pass.
    pub fn add_bootstrap(
        &mut self,
        settings: &RenderSettings,
        plan: &PassPlan,
        id: u32,
        edges: u32,
        result: &UnitResult,
    ) {
        let (Some(unit), Some(sums)) = (plan.unit(id), &result.bootstrap) else { return };
        let of_part = |p: &&Part| matches!(p, Part::Bootstrap { replicate, edges: k, .. } if *replicate == unit.replicate && *k == edges);
        let Some(Part::Bootstrap { samples, .. }) = plan.parts.iter().find(of_part) else { return };
        if plan.pass > 0 {
            let pool = self.pools.entry((unit.replicate, edges)).or_default();
            pool.samples = *samples;
            pool.found.extend_from_slice(&sums.found);
            return;
        }
        self.add_pilot(settings, edges, f64::from(*samples), sums, result);
    }

    fn add_pilot(
        &mut self,
        settings: &RenderSettings,
        edges: u32,
        samples: f64,
        sums: &BootstrapSums,
        result: &UnitResult,
    ) {
        let totals = self.techniques.entry(edges).or_insert_with(|| vec![0.0; sums.techniques.len()]);
        totals.iter_mut().zip(&sums.techniques).for_each(|(to, from)| *to += from / samples);
        if let Some(splats) = &result.splats {
            let width = settings.width as usize;
            self.pilot.resize(width * settings.height as usize, [0.0; 3]);
            for (x, y, v) in splats.pixels() {
                let to = &mut self.pilot[y as usize * width + x as usize];
                (0..3).for_each(|c| to[c] += v[c] / samples);
            }
        }
    }

    /// The pass after `before`, which is complete, at `done` mutations per pixel in all. `direct` is the picture of what ordinary samples
    /// carry, as far as it is known.
    pub fn next(
        &mut self,
        settings: &RenderSettings,
        before: &PassPlan,
        done: u32,
        direct: impl Fn(usize) -> [f64; 3],
    ) -> Option<PassPlan> {
        let pass = before.pass + 1;
        if pass == 1 {
            let chains = self.learn(settings, direct);
            let parts = self.pools_of(settings, &chains, first_mutations(settings));
            return Some(plan(settings, pass, parts, chains, 0, false));
        }
        let chains = before.chains.clone()?;
        let (size, last) = match fixed_budget(settings) {
            Some(_) if done > 0 => return None,
            Some(mpp) => (mpp, true),
            None => {
                let left = settings.budget.mpp.unwrap_or(u32::MAX).saturating_sub(done);
                let size = (done / 10).max(FIRST_PASS).min(left);
                (size, size == left)
            }
        };
        if size == 0 {
            return None;
        }
        let mut parts = self.chains_of(settings, pass, size, done, last && fixed_budget(settings).is_some());
        self.pools.clear();
        if !last {
            parts.extend(self.pools_of(settings, &chains, ((done + size) / 10).max(FIRST_PASS)));
        }
        Some(plan(settings, pass, parts, chains, size, last))
    }

    /// Technique probabilities and the target map from the pilot.
    fn learn(&self, settings: &RenderSettings, direct: impl Fn(usize) -> [f64; 3]) -> ChainConstants {
        let depths = lengths(settings).map(|edges| {
            let n = edges as usize + 1;
            let sums = self.techniques.get(&edges).cloned().unwrap_or_default();
            let total: f64 = sums.iter().sum();
            let learned = settings.mmlt.learn && total > 0.0 && sums.len() == n;
            // A third for all techniques alike: what the pilot missed keeps its chance.
            let share = |s: usize| (1.0 / 3.0 / n as f64 + 2.0 / 3.0 * sums[s] / total) as f32;
            Depth { edges, techniques: (0..n).map(|s| if learned { share(s) } else { 1.0 }).collect() }
        });
        let depths = depths.collect();
        let (columns, target) = self.target_map(settings, direct);
        ChainConstants { depths, columns, target }
    }

    /// `(I^2 + 0.01)^(-lift / 2)` by cell, I being the mean of what the pilot saw in and around the cell.
    fn target_map(&self, settings: &RenderSettings, direct: impl Fn(usize) -> [f64; 3]) -> (u32, Vec<f32>) {
        let (width, height) = (settings.width, settings.height);
        let (columns, rows) = (width.div_ceil(TARGET_CELL), height.div_ceil(TARGET_CELL));
        if settings.mmlt.lift == 0.0 || self.pilot.is_empty() {
            return (columns, Vec::new());
        }
        let cells = (columns * rows) as usize;
        let (mut sums, mut counts) = (vec![0.0f64; cells], vec![0.0f64; cells]);
        for (i, v) in self.pilot.iter().enumerate() {
            let (x, y) = (i as u32 % width, i as u32 / width);
            let cell = (y / TARGET_CELL * columns + x / TARGET_CELL) as usize;
            let d = direct(i);
            sums[cell] += (0..3).map(|c| (v[c] + d[c]) / 3.0).sum::<f64>();
            counts[cell] += 1.0;
        }
        // Cells share with their neighbours: the pilot is noisy.
        let at = |x: i64, y: i64| {
            let inside = x >= 0 && y >= 0 && x < i64::from(columns) && y < i64::from(rows);
            inside.then(|| (y * i64::from(columns) + x) as usize)
        };
        let target = (0..cells as i64).map(|cell| {
            let (x, y) = (cell % i64::from(columns), cell / i64::from(columns));
            let around =
                (-1..=1).flat_map(|dy| (-1..=1).map(move |dx| (dx, dy))).filter_map(|(dx, dy)| at(x + dx, y + dy));
            let (sum, count) = around.fold((0.0, 0.0), |(s, n), i| (s + sums[i], n + counts[i]));
            let mean = sum / count;
            pow64(mean * mean + 0.01, -0.5 * f64::from(settings.mmlt.lift)) as f32
        });
        let target = target.collect();
        (columns, target)
    }

    /// The pools for a pass of `mpp` mutations per pixel.
    fn pools_of(&self, settings: &RenderSettings, chains: &ChainConstants, mpp: u32) -> Vec<Part> {
        let budget = (POOL_SHARE * f64::from(mpp) * pixels(settings)).min(MAX_POOLS) / f64::from(settings.replicates);
        // Half of it by what the pilot found, half by length.
        let inverse: f64 = chains.depths.iter().map(|d| 1.0 / f64::from(d.edges)).sum();
        let found = |edges: u32| self.techniques.get(&edges).map_or(0.0, |t| t.iter().sum::<f64>());
        let total: f64 = chains.depths.iter().map(|d| found(d.edges)).sum();
        let samples = |edges: u32| {
            let by_length = 1.0 / f64::from(edges) / inverse;
            let by_light = if total > 0.0 { found(edges) / total } else { by_length };
            (budget * 0.5 * (by_length + by_light)).clamp(256.0, f64::from(1 << 24)) as u32
        };
        let groups = 0..settings.replicates;
        let lengths = |r| chains.depths.iter().map(move |d| (r, d.edges));
        groups
            .flat_map(lengths)
            .map(|(replicate, edges)| Part::Bootstrap { replicate, edges, samples: samples(edges) })
            .collect()
    }

    /// The chains of a pass of `mpp` mutations per pixel, and its ordinary samples, group after group.
    fn chains_of(&self, settings: &RenderSettings, pass: u32, mpp: u32, done: u32, closes: bool) -> Vec<Part> {
        let groups = f64::from(settings.replicates);
        let budget = f64::from(mpp) * pixels(settings) * (1.0 - PILOT_SHARE - POOL_SHARE) / groups;
        let lengths: Vec<u32> = lengths(settings).collect();
        // Mutations by what a length contributes, over the root of what one costs; a tenth for all alike.
        let mean_b = |edges: u32| {
            (0..settings.replicates).filter_map(|r| self.pools.get(&(r, edges))).map(Pool::b).sum::<f64>() / groups
        };
        let weights: Vec<f64> = lengths.iter().map(|k| mean_b(*k) / f64::from(*k).sqrt()).collect();
        let total: f64 = weights.iter().sum();
        // The length of a chain depends on nothing that the pools found.
        let length =
            (budget / (8 * lengths.len().max(1)) as f64).clamp(1.0, f64::from(settings.mmlt.chain_length)) as u32;
        let mut parts = Vec::new();
        for replicate in 0..settings.replicates {
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
            parts.push(Part::Samples(self.direct_of(settings, replicate, done, mpp, closes)));
        }
        parts
    }

    /// The ordinary samples of a group that go with mutations `done .. done + mpp` per pixel.
    fn direct_of(&self, settings: &RenderSettings, replicate: u32, done: u32, mpp: u32, closes: bool) -> GroupRange {
        let share = f64::from(settings.mmlt.direct_share) / f64::from(settings.replicates);
        let upto = |mpp: u32| (f64::from(mpp) * share).ceil() as u32 + 1;
        // The pilot took the first sample of group 0.
        let first = u32::from(replicate == 0);
        let start = if done == 0 { first } else { upto(done).max(1) };
        GroupRange { replicate, start, end: upto(done + mpp).max(start + 1), closes }
    }

    /// Adds splats of chains, scaled to radiance, to what is pending.
    pub fn add_chains(&mut self, width: u32, height: u32, splats: &SplatSums, scale: f64) {
        self.pending.resize(width as usize * height as usize, [0.0; 3]);
        for (x, y, v) in splats.pixels() {
            let to = &mut self.pending[y as usize * width as usize + x as usize];
            (0..3).for_each(|c| to[c] += scale * v[c]);
        }
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
        film.replace_chains(&self.pilot, width as usize * height as usize);
        Some(film)
    }
}

/// As bytes, for a merge that goes on later.
impl Metropolis {
    /// Appends everything.
    pub fn save(&self, out: &mut Vec<u8>) {
        for film in [&self.pilot, &self.pending] {
            out.extend((film.len() as u64).to_le_bytes());
            out.extend_from_slice(bytemuck::cast_slice(film));
        }
        out.extend((self.techniques.len() as u64).to_le_bytes());
        for (edges, sums) in &self.techniques {
            out.extend(u64::from(*edges).to_le_bytes());
            out.extend((sums.len() as u64).to_le_bytes());
            sums.iter().for_each(|v| out.extend(v.to_le_bytes()));
        }
        out.extend((self.pools.len() as u64).to_le_bytes());
        for ((replicate, edges), pool) in &self.pools {
            [*replicate, *edges, pool.samples].iter().for_each(|v| out.extend(u64::from(*v).to_le_bytes()));
            out.extend((pool.found.len() as u64).to_le_bytes());
            for (index, target) in &pool.found {
                out.extend(index.to_le_bytes());
                out.extend(target.to_le_bytes());
            }
        }
    }

    /// Takes what [`Metropolis::save`] wrote off the front of `bytes`; `None` when it is not that.
    pub fn load(bytes: &mut &[u8], pixels: usize) -> Option<Self> {
        let mut r = Reader(bytes);
        let mut film = || {
            let n = r.length().filter(|n| *n == 0 || *n == pixels)?;
            let raw = r.take(n.checked_mul(24)?)?;
            Some(raw.chunks_exact(24).map(bytemuck::pod_read_unaligned).collect::<Vec<[f64; 3]>>())
        };
        let (pilot, pending) = (film()?, film()?);
        let mut techniques = BTreeMap::new();
        for _ in 0..r.length()? {
            let (edges, n) = (u32::try_from(r.length()?).ok()?, r.length()?);
            let sums = (0..n).map(|_| r.word().map(f64::from_bits)).collect::<Option<Vec<_>>>()?;
            techniques.insert(edges, sums);
        }
        let mut pools = BTreeMap::new();
        for _ in 0..r.length()? {
            let mut number = || u32::try_from(r.length()?).ok();
            let (key, samples) = ((number()?, number()?), number()?);
            let raw = r.length()?;
            let raw = r.take(raw.checked_mul(8)?)?;
            let entry = |b: &[u8]| {
                let word: u64 = bytemuck::pod_read_unaligned(b);
                (word as u32, f32::from_bits((word >> 32) as u32))
            };
            pools.insert(key, Pool { samples, found: raw.chunks_exact(8).map(entry).collect() });
        }
        *bytes = r.0;
        Some(Self { pilot, techniques, pools, pending })
    }
}

/// Takes numbers off the front of a byte slice.
struct Reader<'a>(&'a [u8]);

impl<'a> Reader<'a> {
    fn take(&mut self, n: usize) -> Option<&'a [u8]> {
        let (head, tail) = self.0.split_at_checked(n)?;
        self.0 = tail;
        Some(head)
    }

    fn word(&mut self) -> Option<u64> {
        self.take(8)?.try_into().ok().map(u64::from_le_bytes)
    }

    fn length(&mut self) -> Option<usize> {
        usize::try_from(self.word()?).ok()
    }
}
