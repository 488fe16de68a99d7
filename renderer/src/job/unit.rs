use crate::film::{Counters, Rect, SplatSums, TileSums};
use crate::integrator::Lesson;
use crate::integrator::mmlt::{BootstrapSums, ChainStats};
use serde::{Deserialize, Serialize};

/// One piece of work: a pure function of (scene, settings, plan, unit).
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Unit {
    /// The pass that it belongs to.
    pub pass: u32,
    /// Its number in the pass.
    pub id: u32,
    /// Its replicate group.
    pub replicate: u32,
    /// What to do.
    pub kind: UnitKind,
}

/// What a unit does.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case", deny_unknown_fields)]
pub enum UnitKind {
    /// Samples `start..end` of each pixel of a tile.
    Tile {
        /// The tile.
        rect: Rect,
        /// The pixels that its samples count for.
        covered: Rect,
        /// First sample index.
        start: u32,
        /// One past the last.
        end: u32,
    },
    /// Light paths `start..end` of the replicate, splatted over the whole film.
    Paths {
        /// First path.
        start: u64,
        /// One past the last.
        end: u64,
    },
    /// Samples `start..end` of the replicate's pool.
    Bootstrap {
        /// First sample.
        start: u32,
        /// One past the last.
        end: u32,
    },
    /// Chains `first..end` of a part of the plan.
    Chains {
        /// Number of the part.
        part: u32,
        /// First chain.
        first: u32,
        /// One past the last.
        end: u32,
    },
}

/// What a unit found: unnormalised sums and counts.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct UnitResult {
    /// Sums of a tile, if the unit has one.
    pub tile: Option<TileSums>,
    /// Splats, if the unit makes any; already rounded to f32.
    pub splats: Option<SplatSums>,
    /// Light paths behind `splats`.
    pub paths: u64,
    /// What the next pass's selection weights come from: see `integrator::light::selection_weights`. Empty for tiles.
    pub light_sums: Vec<f64>,
    /// What its samples teach of sharing paths.
    pub sharing: Option<Lesson>,
    /// What a bootstrap unit found.
    pub bootstrap: Option<BootstrapSums>,
    /// How the mutations of chains fared.
    pub chains: Option<ChainStats>,
    /// What was met.
    pub counters: Counters,
}

impl UnitResult {
    /// Bytes of memory that its sums take, about.
    pub fn memory(&self) -> usize {
        let tile = self
            .tile
            .as_ref()
            .map_or(0, |t| size_of_val(&t.sums[..]) + size_of_val(&t.weights[..]) + size_of_val(&t.aovs[..]));
        let splats = self.splats.as_ref().map_or(0, SplatSums::memory);
        let found = self.bootstrap.as_ref().map_or(0, |b| size_of_val(&b.found[..]));
        tile + splats + found
    }
}
