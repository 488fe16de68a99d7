use super::{Metropolis, Pool};
use crate::integrator::mmlt::ChainStart;
use crate::job::bytes::Reader;
use std::collections::BTreeMap;

/// As bytes, for a merge that goes on later.
impl Metropolis {
    /// Appends everything.
    pub fn save(&self, out: &mut Vec<u8>) {
        for film in [&self.pilot, &self.pending] {
            out.extend((film.len() as u64).to_le_bytes());
            out.extend_from_slice(bytemuck::cast_slice(film));
        }
        [self.pilot_samples.0, self.pilot_samples.1].iter().for_each(|n| out.extend(u64::from(*n).to_le_bytes()));
        out.extend((self.techniques.len() as u64).to_le_bytes());
        for (edges, sums) in &self.techniques {
            out.extend(u64::from(*edges).to_le_bytes());
            out.extend((sums.len() as u64).to_le_bytes());
            sums.iter().for_each(|v| out.extend(v.to_le_bytes()));
        }
        out.extend((self.contributions.len() as u64).to_le_bytes());
        for (edges, b) in &self.contributions {
            out.extend(u64::from(*edges).to_le_bytes());
            out.extend(b.to_le_bytes());
        }
        out.extend((self.pools.len() as u64).to_le_bytes());
        for ((replicate, edges), pool) in &self.pools {
            [*replicate, *edges, pool.samples].iter().for_each(|v| out.extend(u64::from(*v).to_le_bytes()));
            out.extend((pool.found.len() as u64).to_le_bytes());
            for (ChainStart(index, technique, target), weight) in &pool.found {
                let words = [*index, *technique, target.to_bits(), weight.to_bits()];
                words.iter().for_each(|v| out.extend(v.to_le_bytes()));
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
        let mut count = || u32::try_from(r.length()?).ok();
        let pilot_samples = (count()?, count()?);
        let mut techniques = BTreeMap::new();
        for _ in 0..r.length()? {
            let (edges, n) = (u32::try_from(r.length()?).ok()?, r.length()?);
            let sums = (0..n).map(|_| r.u64().map(f64::from_bits)).collect::<Option<Vec<_>>>()?;
            techniques.insert(edges, sums);
        }
        let mut contributions = BTreeMap::new();
        for _ in 0..r.length()? {
            contributions.insert(u32::try_from(r.length()?).ok()?, f64::from_bits(r.u64()?));
        }
        let mut pools = BTreeMap::new();
        for _ in 0..r.length()? {
            let mut number = || u32::try_from(r.length()?).ok();
            let (key, samples) = ((number()?, number()?), number()?);
            let raw = r.length()?;
            let raw = r.take(raw.checked_mul(16)?)?;
            let entry = |b: &[u8]| {
                let [index, technique, target, weight]: [u32; 4] = bytemuck::pod_read_unaligned(b);
                (ChainStart(index, technique, f32::from_bits(target)), f32::from_bits(weight))
            };
            pools.insert(key, Pool { samples, found: raw.chunks_exact(16).map(entry).collect() });
        }
        *bytes = r.0;
        Some(Self { pilot, pilot_samples, techniques, contributions, pools, pending })
    }
}
