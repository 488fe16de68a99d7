//! Unit results as bytes: byte planes of f32 sums, LZ4. The identity of a result is the digest of these bytes.

use super::bytes::Reader;
use super::plan::PassPlan;
use super::unit::{Unit, UnitKind, UnitResult};
use crate::film::{Aov, BLOCK, Counters, SplatSums, TileSums};
use crate::integrator::Lesson;
use crate::integrator::mmlt::{BootstrapSums, ChainStats, Found};
use crate::spectrum::Rgb;
use std::ops::Range;

const MAGIC: &[u8; 4] = b"LFU4";
const BLOCK_FLOATS: usize = (BLOCK * BLOCK) as usize * 3;
/// Edges of the longest path that chains carry, at most.
const MAX_EDGES: u32 = 255;
/// Words of a path that a pool found.
const FOUND_WORDS: u64 = 5;
const AOV_FLOATS: usize = size_of::<Aov>() / 4;

/// Bytes that are not the result of the unit asked for.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("not a result of unit {unit}: {what}")]
pub struct DecodeError {
    /// The unit.
    pub unit: u32,
    /// What is wrong.
    pub what: &'static str,
}

impl UnitResult {
    /// The result as bytes; the same result always gives the same bytes.
    pub fn encode(&self) -> Vec<u8> {
        let mut head: Vec<u8> = MAGIC.to_vec();
        let c = &self.counters;
        for v in [self.paths, c.samples, c.rays, c.non_finite, c.negative] {
            head.extend(v.to_le_bytes());
        }
        head.extend((self.light_sums.len() as u32).to_le_bytes());
        self.light_sums.iter().for_each(|v| head.extend(v.to_le_bytes()));
        head.push(u8::from(self.sharing.is_some()));
        self.sharing.iter().flat_map(Lesson::numbers).for_each(|v| head.extend(v.to_le_bytes()));
        encode_chains(self, &mut head);
        let mut blocks: Vec<u32> = Vec::new();
        let mut floats: Vec<f32> = Vec::new();
        if let Some(tile) = &self.tile {
            floats.extend_from_slice(bytemuck::cast_slice(&tile.sums));
            floats.extend_from_slice(&tile.weights);
            floats.extend_from_slice(bytemuck::cast_slice(&tile.aovs));
        }
        for (block, sums) in self.splats.iter().flat_map(SplatSums::blocks) {
            blocks.push(block);
            floats.extend(sums.iter().flatten().map(|v| *v as f32));
        }
        head.extend((blocks.len() as u32).to_le_bytes());
        blocks.iter().for_each(|b| head.extend(b.to_le_bytes()));
        head.extend((floats.len() as u32).to_le_bytes());
        head.extend(lz4_flex::block::compress(&to_planes(&floats)));
        head
    }

    /// The most bytes that [`UnitResult::encode`] makes of a result of `unit`: all its numbers, LZ4's worst case, and the head.
    pub fn longest(plan: &PassPlan, unit: &Unit, lights: u32) -> u64 {
        let blocks = SplatSums::new(plan.width, plan.height).block_count() as u64;
        let film = blocks * (BLOCK_FLOATS as u64 + 1);
        let floats = match &unit.kind {
            UnitKind::Tile { .. } => film + of_tile(unit) as u64,
            UnitKind::Paths { .. } | UnitKind::Chains { .. } => film,
            UnitKind::Bootstrap { start, end } => {
                let depths = plan.chains.iter().flat_map(|c| &c.depths);
                let (lengths, sums) = depths.fold((0, 0), |(n, t), d| (n + 1, t + d.techniques.len() as u64 + 1));
                film + FOUND_WORDS * lengths * u64::from(end - start) + 2 * sums
            }
        };
        1024 + 16 * u64::from(lights) + 4 * floats + 4 * floats / 250
    }

    /// Reads what [`UnitResult::encode`] wrote, for `unit` on a film of `width * height` pixels and a scene of `lights` lights.
    /// Every length is checked against the unit before anything is allocated.
    pub fn decode(bytes: &[u8], unit: &Unit, width: u32, height: u32, lights: usize) -> Result<Self, DecodeError> {
        let fail = |what| DecodeError { unit: unit.id, what };
        let mut r = Reader(bytes);
        if r.take(4).ok_or(fail("too short"))? != MAGIC {
            return Err(fail("wrong magic number"));
        }
        let mut next = || r.u64().ok_or(fail("too short"));
        let paths = next()?;
        let counters = Counters { samples: next()?, rays: next()?, non_finite: next()?, negative: next()? };
        let n = r.u32().ok_or(fail("too short"))? as usize;
        if n > 2 * lights {
            return Err(fail("more light sums than two for each of the scene's lights"));
        }
        let light_sums =
            (0..n).map(|_| r.u64().map(f64::from_bits)).collect::<Option<Vec<_>>>().ok_or(fail("too short"))?;
        if light_sums.iter().any(|v| !(v.is_finite() && *v >= 0.0)) {
            return Err(fail("a light's sum is not a finite, non-negative number"));
        }
        let sharing = decode_sharing(&mut r).map_err(fail)?;
        let splats = r.take(1).ok_or(fail("too short"))? == [1];
        let (bootstrap, chains) = decode_chains(&mut r, unit)?;
        let empty = SplatSums::new(width, height);
        let n = r.u32().ok_or(fail("too short"))? as usize;
        if n > empty.block_count() {
            return Err(fail("more splat blocks than the film has"));
        }
        let blocks = (0..n).map(|_| r.u32()).collect::<Option<Vec<_>>>().ok_or(fail("too short"))?;
        let count = r.u32().ok_or(fail("too short"))? as usize;
        let of_tile = of_tile(unit);
        if count != of_tile + n * BLOCK_FLOATS {
            return Err(fail("the number of sums does not fit the unit"));
        }
        let planes = lz4_flex::block::decompress(r.0, count * 4).map_err(|_| fail("damaged compression"))?;
        let floats = from_planes(&planes, count).ok_or(fail("the number of sums does not fit the unit"))?;
        if floats.iter().any(|v| !v.is_finite()) {
            return Err(fail("a sum is not finite"));
        }
        let (tile, splatted) = floats.split_at(of_tile);
        let mut result = Self { paths, light_sums, sharing, bootstrap, chains, counters, ..Self::default() };
        if let UnitKind::Tile { rect, covered, start, end } = &unit.kind {
            let (sums, rest) = tile.split_at(covered.area() * 3);
            let (weights, aovs) = rest.split_at(covered.area());
            let weights = weights.to_vec();
            let sums = sums.chunks_exact(3).map(|v| Rgb::new(v[0], v[1], v[2])).collect();
            let aovs =
                aovs.chunks_exact(AOV_FLOATS).map(|v| bytemuck::pod_read_unaligned(bytemuck::cast_slice(v))).collect();
            result.tile = Some(TileSums { rect: *rect, covered: *covered, samples: end - start, sums, weights, aovs });
        }
        if splats {
            let mut splats = empty;
            for (block, sums) in blocks.iter().zip(splatted.chunks_exact(BLOCK_FLOATS)) {
                let sums: Vec<[f32; 3]> = sums.chunks_exact(3).map(|v| [v[0], v[1], v[2]]).collect();
                splats.set_block(*block, &sums).ok_or(fail("a splat block lies outside the film"))?;
            }
            result.splats = Some(splats);
        } else if n > 0 {
            return Err(fail("splats where there are none"));
        }
        Ok(result)
    }
}

/// Floats of the tile that a unit renders.
fn of_tile(unit: &Unit) -> usize {
    match &unit.kind {
        UnitKind::Tile { rect, covered, .. } => {
            4 * covered.area() + if unit.replicate == 0 { AOV_FLOATS * rect.area() } else { 0 }
        }
        UnitKind::Paths { .. } | UnitKind::Bootstrap { .. } | UnitKind::Chains { .. } => 0,
    }
}

/// Reads what the samples teach of sharing.
fn decode_sharing(r: &mut Reader) -> Result<Option<Lesson>, &'static str> {
    const SHORT: &str = "too short";
    if r.take(1).ok_or(SHORT)? != [1] {
        return Ok(None);
    }
    let mut numbers = [0.0; Lesson::NUMBERS];
    for to in &mut numbers {
        *to = f64::from_bits(r.u64().ok_or(SHORT)?);
    }
    Lesson::of_numbers(numbers).map(Some).ok_or("what is taught of sharing is no finite, non-negative number")
}

/// What bootstrap and chain units have beside sums.
fn encode_chains(result: &UnitResult, out: &mut Vec<u8>) {
    out.push(u8::from(result.splats.is_some()));
    if let Some(b) = &result.bootstrap {
        out.extend((b.techniques.len() as u32).to_le_bytes());
        for sums in &b.techniques {
            out.extend((sums.len() as u32).to_le_bytes());
            sums.iter().for_each(|v| out.extend(v.to_le_bytes()));
        }
        out.extend((b.found.len() as u32).to_le_bytes());
        for f in &b.found {
            let words: [u32; FOUND_WORDS as usize] =
                [f.edges, f.index, f.technique, f.weight.to_bits(), f.target.to_bits()];
            words.iter().for_each(|v| out.extend(v.to_le_bytes()));
        }
    }
    if let Some(c) = &result.chains {
        [c.small, c.small_accepted, c.large, c.large_accepted].iter().for_each(|v| out.extend(v.to_le_bytes()));
    }
}

/// Reads what [`encode_chains`] wrote, for this unit.
fn decode_chains(r: &mut Reader, unit: &Unit) -> Result<(Option<BootstrapSums>, Option<ChainStats>), DecodeError> {
    let fail = |what| DecodeError { unit: unit.id, what };
    let short = || fail("too short");
    match unit.kind {
        UnitKind::Tile { .. } | UnitKind::Paths { .. } => Ok((None, None)),
        UnitKind::Chains { .. } => {
            let mut next = || r.u64().ok_or_else(short);
            let stats = ChainStats { small: next()?, small_accepted: next()?, large: next()?, large_accepted: next()? };
            Ok((None, Some(stats)))
        }
        UnitKind::Bootstrap { start, end } => decode_bootstrap(r, start..end).map(|b| (Some(b), None)).map_err(fail),
    }
}

fn decode_bootstrap(r: &mut Reader, samples: Range<u32>) -> Result<BootstrapSums, &'static str> {
    const SHORT: &str = "too short";
    let lengths = r.u32().filter(|n| *n <= MAX_EDGES).ok_or("too many path lengths")?;
    let mut techniques = Vec::new();
    for _ in 0..lengths {
        let n = r.u32().filter(|n| *n <= MAX_EDGES + 1).ok_or("too many techniques")?;
        let sums = (0..n).map(|_| r.u64().map(f64::from_bits)).collect::<Option<Vec<_>>>().ok_or(SHORT)?;
        if !sums.iter().all(|v| v.is_finite() && *v >= 0.0) {
            return Err("the sum of a technique is not a finite, non-negative number");
        }
        techniques.push(sums);
    }
    let n = r.u32().ok_or(SHORT)?;
    if u64::from(n) > u64::from(lengths) * u64::from(samples.end - samples.start) {
        return Err("more paths found than there were samples");
    }
    let mut found: Vec<Found> = Vec::new();
    for _ in 0..n {
        let mut next = || r.u32().ok_or(SHORT);
        let (edges, index, technique) = (next()?, next()?, next()?);
        let (weight, target) = (f32::from_bits(next()?), f32::from_bits(next()?));
        let sound = |v: f32| v > 0.0 && v.is_finite();
        let in_order = found.last().is_none_or(|f| (f.index, f.edges) < (index, edges));
        if !(samples.contains(&index) && technique <= edges && sound(weight) && sound(target) && in_order) {
            return Err("a path of the pool is out of range or out of order");
        }
        found.push(Found { edges, index, technique, weight, target });
    }
    Ok(BootstrapSums { found, techniques })
}

/// Byte planes: all lowest bytes, then all second bytes, ...: exponents compress well side by side.
fn to_planes(floats: &[f32]) -> Vec<u8> {
    let mut out = vec![0; floats.len() * 4];
    for (i, v) in floats.iter().enumerate() {
        for (plane, byte) in v.to_le_bytes().into_iter().enumerate() {
            out[plane * floats.len() + i] = byte;
        }
    }
    out
}

fn from_planes(planes: &[u8], count: usize) -> Option<Vec<f32>> {
    let byte = |plane: usize, i: usize| planes[plane * count + i];
    (planes.len() == count * 4)
        .then(|| (0..count).map(|i| f32::from_le_bytes(std::array::from_fn(|p| byte(p, i)))).collect())
}
