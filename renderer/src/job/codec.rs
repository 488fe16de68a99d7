//! Unit results as bytes: byte planes of f32 sums, LZ4. The identity of a result is the digest of these bytes.

use super::unit::{Unit, UnitKind, UnitResult};
use crate::film::{Aov, BLOCK, Counters, SplatSums, TileSums};
use crate::spectrum::Rgb;

const MAGIC: &[u8; 4] = b"LFU1";
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
        let mut blocks: Vec<u32> = Vec::new();
        let mut floats: Vec<f32> = Vec::new();
        if let Some(tile) = &self.tile {
            floats.extend_from_slice(bytemuck::cast_slice(&tile.sums));
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
        if n > lights {
            return Err(fail("more light sums than the scene has lights"));
        }
        let light_sums =
            (0..n).map(|_| r.u64().map(f64::from_bits)).collect::<Option<Vec<_>>>().ok_or(fail("too short"))?;
        if light_sums.iter().any(|v| !(v.is_finite() && *v >= 0.0)) {
            return Err(fail("a light's sum is not a finite, non-negative number"));
        }
        let empty = SplatSums::new(width, height);
        let n = r.u32().ok_or(fail("too short"))? as usize;
        if n > empty.block_count() {
            return Err(fail("more splat blocks than the film has"));
        }
        let blocks = (0..n).map(|_| r.u32()).collect::<Option<Vec<_>>>().ok_or(fail("too short"))?;
        let count = r.u32().ok_or(fail("too short"))? as usize;
        let floats = match &unit.kind {
            UnitKind::Tile { rect, .. } => {
                let with_aovs = if unit.replicate == 0 { 3 + AOV_FLOATS } else { 3 };
                (blocks.is_empty() && count == rect.area() * with_aovs).then_some(count)
            }
            UnitKind::Paths { .. } => (count == n * (BLOCK * BLOCK) as usize * 3).then_some(count),
        };
        let floats = floats.ok_or(fail("the number of sums does not fit the unit"))?;
        let planes = lz4_flex::block::decompress(r.0, floats * 4).map_err(|_| fail("damaged compression"))?;
        let floats = from_planes(&planes, floats).ok_or(fail("the number of sums does not fit the unit"))?;
        if floats.iter().any(|v| !v.is_finite()) {
            return Err(fail("a sum is not finite"));
        }
        let mut result = Self { tile: None, splats: None, paths, light_sums, counters };
        match &unit.kind {
            UnitKind::Tile { rect, start, end } => {
                let (sums, aovs) = floats.split_at(rect.area() * 3);
                let sums = sums.chunks_exact(3).map(|v| Rgb::new(v[0], v[1], v[2])).collect();
                let aovs = aovs
                    .chunks_exact(AOV_FLOATS)
                    .map(|v| bytemuck::pod_read_unaligned(bytemuck::cast_slice(v)))
                    .collect();
                result.tile = Some(TileSums { rect: *rect, samples: end - start, sums, aovs });
            }
            UnitKind::Paths { .. } => {
                let mut splats = empty;
                for (block, sums) in blocks.iter().zip(floats.chunks_exact((BLOCK * BLOCK) as usize * 3)) {
                    let sums: Vec<[f32; 3]> = sums.chunks_exact(3).map(|v| [v[0], v[1], v[2]]).collect();
                    splats.set_block(*block, &sums).ok_or(fail("a splat block lies outside the film"))?;
                }
                result.splats = Some(splats);
            }
        }
        Ok(result)
    }
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

/// Takes numbers off the front of a byte slice.
struct Reader<'a>(&'a [u8]);

impl<'a> Reader<'a> {
    fn take(&mut self, n: usize) -> Option<&'a [u8]> {
        let (head, tail) = self.0.split_at_checked(n)?;
        self.0 = tail;
        Some(head)
    }

    fn u32(&mut self) -> Option<u32> {
        self.take(4)?.try_into().ok().map(u32::from_le_bytes)
    }

    fn u64(&mut self) -> Option<u64> {
        self.take(8)?.try_into().ok().map(u64::from_le_bytes)
    }
}
