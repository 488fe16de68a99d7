use super::settings::RenderSettings;
use super::unit::{Unit, UnitKind};
use crate::film::Rect;
use crate::integrator::IntegratorKind;
use crate::scene::bundle::Digest;
use serde::{Deserialize, Serialize};

/// Samples (or light paths) that one unit aims at: some tens of milliseconds of work.
const UNIT_SAMPLES: u64 = 1 << 16;
/// Most samples per pixel of a job.
const MAX_SPP: u32 = 1 << 24;

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
    /// What each group renders, in the order of the units.
    pub groups: Vec<GroupRange>,
    /// Plan constant: selection weights of the lights, learned from earlier passes; empty = by power.
    pub light_weights: Vec<f32>,
    /// The job ends with this pass.
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

    /// The group whose last unit of this pass is `id`.
    pub fn ends_group(&self, id: u32) -> Option<&GroupRange> {
        let mut end = 0;
        for g in &self.groups {
            end += self.units_of(g);
            if u64::from(id) + 1 == end {
                return Some(g);
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

    /// The first pass: small, so that there is a preview (and a pilot) soon.
    ///
    /// A budget in samples is worked off group after group, so that few films are open at once. Its first pass is one sample per pixel
    /// of the first group; a tracer from the lights, which learns from its pilot, does an eighth of its groups first.
    pub fn first(&self) -> PassPlan {
        let Some(spp) = self.sample_budget() else { return self.pass(0, 0, self.settings.replicates, Vec::new()) };
        let groups = self.shares(spp);
        let first = if self.splats() {
            groups[..(groups.len() / 8).max(1)].to_vec()
        } else if groups[0].end > 1 {
            vec![GroupRange { end: 1, closes: false, ..groups[0] }]
        } else {
            groups.clone()
        };
        let last = first == groups;
        self.plan(0, first, Vec::new(), last)
    }

    /// The pass after one that ended at `done` samples per pixel in all; `None` when the sample budget is used up.
    pub fn next(&self, pass: u32, done: u32, light_weights: Vec<f32>) -> Option<PassPlan> {
        if let Some(spp) = self.sample_budget() {
            let groups = self.shares(spp);
            let rest = if self.splats() {
                groups[(groups.len() / 8).max(1)..].to_vec()
            } else {
                let mut rest = groups;
                rest[0].start = 1;
                rest
            };
            return (pass == 1).then(|| self.plan(pass, rest, light_weights, true));
        }
        // A tenth of what is done, in whole samples per group: passes stay below a tenth of a time budget, and checkpoints are
        // declared before anything is measured.
        let g = self.settings.replicates;
        let left = self.settings.budget.spp.map_or(MAX_SPP, |n| n.min(MAX_SPP)).saturating_sub(done);
        let size = (done / 10 / g * g).max(g).min(left);
        (size > 0).then(|| self.pass(pass, done, size, light_weights))
    }

    /// The samples per pixel of a job that nothing but their number ends.
    fn sample_budget(&self) -> Option<u32> {
        let b = &self.settings.budget;
        b.spp.filter(|_| b.time_s.is_none() && b.target_error.is_none())
    }

    fn splats(&self) -> bool {
        self.settings.integrator == IntegratorKind::Light
    }

    /// What each group renders of a whole sample budget.
    fn shares(&self, spp: u32) -> Vec<GroupRange> {
        let g = self.settings.replicates;
        (0..g)
            .map(|r| GroupRange { replicate: r, start: 0, end: spp / g + u32::from(r < spp % g), closes: true })
            .filter(|r| r.end > 0)
            .collect()
    }

    /// Samples `from .. from + size` of the job, dealt to the groups as evenly as can be.
    fn pass(&self, pass: u32, from: u32, size: u32, light_weights: Vec<f32>) -> PassPlan {
        let g = self.settings.replicates;
        let upto = |total: u32, r: u32| total / g + u32::from(r < total % g);
        let groups = (0..g)
            .map(|r| GroupRange { replicate: r, start: upto(from, r), end: upto(from + size, r), closes: false })
            .filter(|r| r.end > r.start)
            .collect();
        let last = self.settings.budget.spp.is_some_and(|n| from + size >= n);
        self.plan(pass, groups, light_weights, last)
    }

    fn plan(&self, pass: u32, groups: Vec<GroupRange>, light_weights: Vec<f32>, last: bool) -> PassPlan {
        let (width, height) = (self.settings.width, self.settings.height);
        PassPlan { pass, width, height, splats: self.splats(), groups, light_weights, last }
    }
}
