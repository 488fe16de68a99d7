use super::settings::RenderSettings;
use super::unit::{Unit, UnitKind};
use crate::film::{Rect, TileGrid};
use crate::integrator::mmlt::{ChainConstants, ChainStart};
use crate::scene::bundle::Digest;
use serde::{Deserialize, Serialize};
use std::ops::Range;

/// Samples (or light paths) that one unit aims at: some tens of milliseconds of work.
const UNIT_SAMPLES: u64 = 1 << 16;
/// Side of the largest tiles of ordinary samples, in pixels.
pub const LARGEST_TILE: u32 = 128;
/// Most samples of a pixel in a unit.
const SAMPLE_CHUNK: u32 = 256;
/// Bootstrap samples of a unit.
const UNIT_BOOTSTRAP: u32 = 1 << 12;
/// Mutations that a unit of chains aims at.
const UNIT_MUTATIONS: u64 = 1 << 18;

/// The samples of one replicate group in one pass.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct GroupRange {
    /// The group.
    pub replicate: u32,
    /// First sample index of the pass.
    pub start: u32,
    /// One past the last.
    pub end: u32,
    /// The group gets no samples after these.
    pub closes: bool,
}

/// How samples of a [`GroupRange`] become units.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Sampling {
    /// Tiles, whose samples count for the tile and for as far around as the filter reaches.
    Tiles,
    /// Tiles whose samples splat over the whole film as well.
    SplattingTiles,
    /// Light paths over the whole film.
    Paths,
}

/// How a pass deals samples to tiles, in a job that gives noisy tiles more of them.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Dealing {
    /// The tiles: units are these.
    pub grid: TileGrid,
    /// First sample index of the pass and one past the last, of each tile: for groups of even number, and for those of odd number. Empty
    /// where every tile gets what its [`GroupRange`] says.
    pub ranges: Vec<Vec<[u32; 2]>>,
}

impl Dealing {
    /// Samples of each tile in one group.
    fn tiles(&self, g: &GroupRange) -> impl Iterator<Item = (u32, u32, u32)> + use<'_> {
        let (start, end) = (g.start, g.end);
        let ranges = self.ranges.get(g.replicate as usize % 2);
        let range = move |tile: u32| ranges.and_then(|r| r.get(tile as usize)).map_or((start, end), |r| (r[0], r[1]));
        (0..self.grid.tiles()).map(move |tile| (tile, range(tile).0, range(tile).1))
    }

    /// Units of one group.
    fn units(&self, g: &GroupRange) -> u64 {
        self.tiles(g).map(|(_, start, end)| u64::from((end - start).div_ceil(SAMPLE_CHUNK))).sum()
    }

    /// Tile and samples of unit `i` of one group.
    fn unit(&self, g: &GroupRange, mut i: u64) -> Option<(Rect, u32, u32)> {
        for (tile, start, end) in self.tiles(g) {
            let chunks = u64::from((end - start).div_ceil(SAMPLE_CHUNK));
            if i < chunks {
                let start = start + i as u32 * SAMPLE_CHUNK;
                return Some((self.grid.rect(tile), start, (start + SAMPLE_CHUNK).min(end)));
            }
            i -= chunks;
        }
        None
    }
}

/// A part of a pass; its units follow from it by arithmetic.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case", deny_unknown_fields)]
pub enum Part {
    /// Ordinary samples.
    Samples(GroupRange),
    /// Independent samples: the pool from which chains start.
    Bootstrap {
        /// The group.
        replicate: u32,
        /// Number of samples.
        samples: u32,
    },
    /// Markov chains of one path length.
    Chains {
        /// The group.
        replicate: u32,
        /// Edges of the paths.
        edges: u32,
        /// Integral of the chains' target, as the pool estimates it.
        b: f32,
        /// Where the chains start.
        starts: Vec<ChainStart>,
        /// Mutations of each chain.
        mutations: u32,
    },
}

impl Part {
    /// The group that it belongs to.
    pub fn replicate(&self) -> u32 {
        match self {
            Self::Samples(g) => g.replicate,
            Self::Bootstrap { replicate, .. } | Self::Chains { replicate, .. } => *replicate,
        }
    }
}

/// The plan of one pass: a pure function of the settings and of what the passes before it merged to. Its units follow from it by
/// arithmetic, numbered from 0, part after part.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct PassPlan {
    /// Number of the pass.
    pub pass: u32,
    /// Film width in pixels.
    pub width: u32,
    /// Film height in pixels.
    pub height: u32,
    /// Pixels beyond a tile for which its samples count.
    pub reach: u32,
    /// What units of samples are.
    pub sampling: Sampling,
    /// How its samples are dealt to tiles; `None` = to all alike.
    pub dealing: Option<Dealing>,
    /// What is done, in the order of the units.
    pub parts: Vec<Part>,
    /// Plan constant: selection weights of the lights, learned from earlier passes; empty = by power.
    pub light_weights: Vec<f32>,
    /// Plan constant: how pixels begin to share paths in each cell of 128 x 128, row by row, learned from earlier passes: side of blocks
    /// and samples of lights, for groups of even number and for those of odd number; zeros = not known. Empty = nowhere.
    pub sharing: Vec<[[u8; 2]; 2]>,
    /// Plan constant: contributions of connections below this are tested for visibility by chance only.
    pub threshold: f32,
    /// Plan constant of Metropolis jobs.
    pub chains: Option<ChainConstants>,
    /// Weight of the pass's chains among those of other passes; 0 when it has none.
    pub chain_weight: u32,
    /// The job ends with this pass.
    pub last: bool,
    /// The pass of the job with which the render began that this pass belongs to: a job by `auto` is several, one after the other.
    pub first: u32,
    /// What the pass renders with in place of the job's settings: one of the renders of a job by `auto`.
    pub settings: Option<Box<RenderSettings>>,
}

impl PassPlan {
    /// Names the plan: results of one plan can't be folded into another.
    pub fn digest(&self) -> Digest {
        // A plain struct of numbers always serialises.
        Digest::of(&serde_json::to_vec(self).unwrap_or_default())
    }

    /// What it renders with, in a job of these settings.
    pub fn settings<'a>(&'a self, job: &'a RenderSettings) -> &'a RenderSettings {
        self.settings.as_deref().unwrap_or(job)
    }

    /// Its number in the render that it belongs to.
    pub fn own_pass(&self) -> u32 {
        self.pass - self.first
    }

    /// Samples per pixel of the pass; of a Metropolis job, mutations per pixel.
    pub fn spp(&self) -> u64 {
        let mut samples = 0;
        for part in &self.parts {
            match part {
                Part::Samples(g) => samples += u64::from(g.end - g.start),
                Part::Bootstrap { .. } | Part::Chains { .. } => {}
            }
        }
        if self.chains.is_some() { u64::from(self.chain_weight) } else { samples }
    }

    /// Weight of the chains of one of its groups among those of the same group in other passes, in a job of `replicates` groups.
    pub fn group_weight(&self, replicates: u32) -> f64 {
        let groups = self.parts.iter().filter(|p| matches!(p, Part::Samples(_))).count().max(1);
        f64::from(self.chain_weight) * f64::from(replicates) / groups as f64
    }

    fn pixels(&self) -> u64 {
        u64::from(self.width) * u64::from(self.height)
    }

    /// Samples that a unit aims at: more where its result is a whole film.
    fn unit_samples(&self) -> u64 {
        match self.sampling {
            Sampling::Tiles => UNIT_SAMPLES,
            Sampling::SplattingTiles | Sampling::Paths => UNIT_SAMPLES.max(self.pixels() / 4),
        }
    }

    /// Side of a tile: the fewer samples a pixel gets, the larger, so that units cost about the same.
    fn tile_side(&self) -> u32 {
        let samples = |p: &Part| if let Part::Samples(g) = p { g.end - g.start } else { 0 };
        let n = u64::from(self.parts.iter().map(samples).max().unwrap_or(1).clamp(1, SAMPLE_CHUNK));
        let fits = |s: &u32| u64::from(s * s) * n <= self.unit_samples();
        [1024u32, 512, 256, 128, 64, 32]
            .into_iter()
            .filter(|s| self.sampling != Sampling::Tiles || *s <= LARGEST_TILE)
            .find(fits)
            .unwrap_or(16)
    }

    /// Sample indices per unit: so many of a pixel at most, so that long renders keep small units.
    fn sample_chunks(g: &GroupRange) -> u32 {
        (g.end - g.start).div_ceil(SAMPLE_CHUNK)
    }

    /// Chains per unit: at least some tenths of a second of work, and more on large films, whose results are larger.
    fn unit_chains(&self, mutations: u32) -> u32 {
        let target = UNIT_MUTATIONS.max(2 * self.pixels());
        u32::try_from(target.div_ceil(u64::from(mutations.max(1)))).unwrap_or(u32::MAX).max(1)
    }

    fn units_of(&self, part: &Part) -> u64 {
        match part {
            Part::Samples(g) if self.sampling == Sampling::Paths => {
                (u64::from(g.end - g.start) * self.pixels()).div_ceil(self.unit_samples())
            }
            Part::Samples(g) if let Some(dealing) = &self.dealing => dealing.units(g),
            Part::Samples(g) => {
                let side = self.tile_side();
                u64::from(Self::sample_chunks(g))
                    * u64::from(self.width.div_ceil(side))
                    * u64::from(self.height.div_ceil(side))
            }
            Part::Bootstrap { samples, .. } => u64::from(samples.div_ceil(UNIT_BOOTSTRAP)),
            Part::Chains { starts, mutations, .. } => {
                (starts.len() as u64).div_ceil(u64::from(self.unit_chains(*mutations)))
            }
        }
    }

    /// Number of units.
    pub fn unit_count(&self) -> u32 {
        u32::try_from(self.parts.iter().map(|p| self.units_of(p)).sum::<u64>()).unwrap_or(u32::MAX)
    }

    /// Unit `id`; `None` past the last.
    pub fn unit(&self, id: u32) -> Option<Unit> {
        let mut i = u64::from(id);
        for (number, part) in (0..).zip(&self.parts) {
            let n = self.units_of(part);
            if i < n {
                let kind = self.unit_of_part(number, part, i);
                return Some(Unit { pass: self.pass, id, replicate: part.replicate(), kind });
            }
            i -= n;
        }
        None
    }

    fn unit_of_part(&self, number: u32, part: &Part, i: u64) -> UnitKind {
        match part {
            Part::Samples(g) if self.sampling == Sampling::Paths => {
                let (first, last) = (u64::from(g.start) * self.pixels(), u64::from(g.end) * self.pixels());
                let start = first + i * self.unit_samples();
                UnitKind::Paths { start, end: (start + self.unit_samples()).min(last) }
            }
            Part::Samples(g) if let Some(dealing) = &self.dealing => {
                // Its callers have counted the units.
                let (rect, start, end) = dealing.unit(g, i).unwrap_or((dealing.grid.rect(0), g.start, g.start));
                UnitKind::Tile { rect, covered: rect.grown(self.reach, self.width, self.height), start, end }
            }
            Part::Samples(g) => {
                let side = self.tile_side();
                let (across, down) = (self.width.div_ceil(side), self.height.div_ceil(side));
                let tiles = u64::from(across) * u64::from(down);
                let (chunk, tile) = ((i / tiles) as u32, (i % tiles) as u32);
                let (x0, y0) = (tile % across * side, tile / across * side);
                let rect = Rect { x0, y0, x1: (x0 + side).min(self.width), y1: (y0 + side).min(self.height) };
                let start = g.start + chunk * SAMPLE_CHUNK;
                let covered = rect.grown(self.reach, self.width, self.height);
                UnitKind::Tile { rect, covered, start, end: (start + SAMPLE_CHUNK).min(g.end) }
            }
            Part::Bootstrap { samples, .. } => {
                let start = i as u32 * UNIT_BOOTSTRAP;
                UnitKind::Bootstrap { start, end: (start + UNIT_BOOTSTRAP).min(*samples) }
            }
            Part::Chains { starts, mutations, .. } => {
                let chains = self.unit_chains(*mutations);
                let first = i as u32 * chains;
                UnitKind::Chains { part: number, first, end: (first + chains).min(starts.len() as u32) }
            }
        }
    }

    /// The parts, and where the units of each begin and end.
    fn ranges(&self) -> impl Iterator<Item = (&Part, Range<u64>)> {
        self.parts.iter().scan(0, |end, part| {
            let start = *end;
            *end += self.units_of(part);
            Some((part, start..*end))
        })
    }

    /// The part whose first unit is `id`.
    pub fn begins_part(&self, id: u32) -> Option<&Part> {
        self.ranges().find(|(_, range)| !range.is_empty() && range.start == u64::from(id)).map(|(part, _)| part)
    }

    /// The part whose last unit is `id`.
    pub fn ends_part(&self, id: u32) -> Option<&Part> {
        self.ranges().find(|(_, range)| !range.is_empty() && range.end == u64::from(id) + 1).map(|(part, _)| part)
    }

    /// Whether unit `id` is the last one of ordinary samples of a group: every pixel has samples then.
    pub fn covers_film(&self, id: u32) -> bool {
        matches!(self.ends_part(id), Some(Part::Samples(_)))
    }
}
