use super::settings::RenderSettings;
use super::unit::{Unit, UnitKind};
use crate::film::Rect;
use crate::integrator::IntegratorKind;
use crate::scene::bundle::Digest;
use serde::{Deserialize, Serialize};

/// Samples (or light paths) that one unit aims at: some tens of milliseconds of work.
const UNIT_SAMPLES: u64 = 1 << 16;

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
}

/// The plan of one pass: a pure function of the settings and of what the passes before it merged to. Its units follow from it by
/// arithmetic, numbered from 0, group after group.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct PassPlan {
    /// Number of the pass.
    pub pass: u32,
    /// Film width in pixels.
    pub width: u32,
    /// Film height in pixels.
    pub height: u32,
    /// Whether units are light paths over the whole film rather than tiles.
    pub splats: bool,
    /// What each group renders, in the order of the units. Sample ranges differ by at most one in length.
    pub groups: Vec<GroupRange>,
    /// Plan constant: selection weights of the lights, learned from earlier passes; empty = by power.
    pub light_weights: Vec<f32>,
    /// No group gets samples after this pass.
    pub last: bool,
}

impl PassPlan {
    /// Names the plan: results of one plan can't be folded into another.
    pub fn digest(&self) -> Digest {
        // A plain struct of numbers always serialises.
        Digest::of(&serde_json::to_vec(self).unwrap_or_default())
    }

    /// Samples per pixel of the pass.
    pub fn spp(&self) -> u64 {
        self.groups.iter().map(|g| u64::from(g.end - g.start)).sum()
    }

    fn pixels(&self) -> u64 {
        u64::from(self.width) * u64::from(self.height)
    }

    /// Side of a tile: the fewer samples a pixel gets, the larger, so that units cost about the same.
    fn tile_side(&self) -> u32 {
        let n = self.groups.iter().map(|g| g.end - g.start).max().unwrap_or(1).max(1);
        [128u32, 64, 32].into_iter().find(|s| u64::from(s * s) * u64::from(n) <= UNIT_SAMPLES).unwrap_or(16)
    }

    /// Sample indices per unit: at most 256 of a pixel, so that long renders keep small units.
    fn sample_chunks(g: &GroupRange) -> u32 {
        (g.end - g.start).div_ceil(256)
    }

    /// Paths per unit of a splatting integrator: more on large films, whose results are larger.
    fn unit_paths(&self) -> u64 {
        UNIT_SAMPLES.max(self.pixels() / 4)
    }

    fn units_of(&self, g: &GroupRange) -> u64 {
        if self.splats {
            (u64::from(g.end - g.start) * self.pixels()).div_ceil(self.unit_paths())
        } else {
            let side = self.tile_side();
            u64::from(Self::sample_chunks(g))
                * u64::from(self.width.div_ceil(side))
                * u64::from(self.height.div_ceil(side))
        }
    }

    /// Number of units.
    pub fn unit_count(&self) -> u32 {
        u32::try_from(self.groups.iter().map(|g| self.units_of(g)).sum::<u64>()).unwrap_or(u32::MAX)
    }

    /// Unit `id`; `None` past the last.
    pub fn unit(&self, id: u32) -> Option<Unit> {
        let mut i = u64::from(id);
        for g in &self.groups {
            let n = self.units_of(g);
            if i < n {
                return Some(Unit { pass: self.pass, id, replicate: g.replicate, kind: self.unit_of_group(g, i) });
            }
            i -= n;
        }
        None
    }

    fn unit_of_group(&self, g: &GroupRange, i: u64) -> UnitKind {
        if self.splats {
            let (first, last) = (u64::from(g.start) * self.pixels(), u64::from(g.end) * self.pixels());
            let start = first + i * self.unit_paths();
            return UnitKind::Paths { start, end: (start + self.unit_paths()).min(last) };
        }
        let side = self.tile_side();
        let (across, down) = (self.width.div_ceil(side), self.height.div_ceil(side));
        let tiles = u64::from(across) * u64::from(down);
        let (chunk, tile) = ((i / tiles) as u32, (i % tiles) as u32);
        let (x0, y0) = (tile % across * side, tile / across * side);
        let rect = Rect { x0, y0, x1: (x0 + side).min(self.width), y1: (y0 + side).min(self.height) };
        let start = g.start + chunk * 256;
        UnitKind::Tile { rect, start, end: (start + 256).min(g.end) }
    }

    /// Whether unit `id` is the last of its group in this pass.
    pub fn ends_group(&self, id: u32) -> Option<u32> {
        let mut end = 0;
        for g in &self.groups {
            end += self.units_of(g);
            if u64::from(id) + 1 == end {
                return Some(g.replicate);
            }
        }
        None
    }
}

/// Makes the passes of a job, one after the other.
#[derive(Clone, Debug)]
pub struct Planner {
    settings: RenderSettings,
}

impl Planner {
    /// For settings that were validated.
    pub fn new(settings: RenderSettings) -> Self {
        Self { settings }
    }

    /// The first pass: a sample or a few per group, so that there is a preview (and a pilot) soon.
    pub fn first(&self) -> PassPlan {
        let splats = self.settings.integrator == IntegratorKind::Light;
        let pilot = match self.settings.budget.spp {
            // A tracer from the lights learns from its pilot: an eighth of the budget.
            Some(n) if splats => (n / 8).max(self.settings.replicates).min(n),
            Some(n) => self.settings.replicates.min(n),
            None => self.settings.replicates,
        };
        self.pass(0, 0, pilot, Vec::new())
    }

    /// The pass after one that ended at `done` samples per pixel in all; `None` when the sample budget is used up.
    pub fn next(&self, pass: u32, done: u32, light_weights: Vec<f32>) -> Option<PassPlan> {
        let b = &self.settings.budget;
        let left = b.spp.map(|n| n.saturating_sub(done));
        let size = if b.time_s.is_none() && b.target_error.is_none() {
            left?
        } else {
            // A tenth of what is done, in whole samples per group: passes stay below a tenth of a time budget, and checkpoints
            // are declared before anything is measured.
            let g = self.settings.replicates;
            (done / 10 / g * g).max(g).min(left.unwrap_or(u32::MAX)).min((1 << 24) - done.min(1 << 24))
        };
        (size > 0).then(|| self.pass(pass, done, size, light_weights))
    }

    /// Samples `from .. from + size` of the job, dealt to the groups as evenly as can be.
    fn pass(&self, pass: u32, from: u32, size: u32, light_weights: Vec<f32>) -> PassPlan {
        let s = &self.settings;
        let g = s.replicates;
        let upto = |total: u32, r: u32| total / g + u32::from(r < total % g);
        let groups = (0..g)
            .map(|r| GroupRange { replicate: r, start: upto(from, r), end: upto(from + size, r) })
            .filter(|r| r.end > r.start)
            .collect();
        let last = s.budget.spp == Some(from + size);
        let splats = s.integrator == IntegratorKind::Light;
        PassPlan { pass, width: s.width, height: s.height, splats, groups, light_weights, last }
    }
}
