use crate::film::{Counters, Rect, SplatSums, TileSums};
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
}

/// What a unit found: unnormalised sums and counts.
#[derive(Clone, Debug, PartialEq)]
pub struct UnitResult {
    /// Sums of a tile, if the unit has one.
    pub tile: Option<TileSums>,
    /// Splats, if the unit makes any; already rounded to f32.
    pub splats: Option<SplatSums>,
    /// Light paths behind `splats`.
    pub paths: u64,
    /// Per light, the luminance that its paths splatted: the next pass's selection weights come from it. Empty for tiles.
    pub light_sums: Vec<f64>,
    /// What was met.
    pub counters: Counters,
}
