use super::adaptive;
use super::metropolis;
use super::plan::{GroupRange, Part, PassPlan, Sampling};
use super::settings::RenderSettings;
use crate::integrator::IntegratorKind;

/// Most samples per pixel of a job.
const MAX_SPP: u32 = 1 << 24;
/// Samples that the first passes of a job aim at that time or error ends: seconds of work on few cores.
const PASS_SAMPLES: u64 = 1 << 19;
/// Samples per pixel (mutations) of each group before its error is believed.
pub const CHECKPOINT_SAMPLES: u32 = 8;

/// Samples per pixel (mutations) of the pass after `done`, of which `left` are left, in a job that time or error ends.
///
/// A tenth of what is done, so that passes stay below a tenth of a time budget, and checkpoints are declared before anything is
/// measured. On large films the first passes have fewer samples than there are groups, which get theirs in turn (see [`dealt`]): a
/// sample for each of them could take minutes. Above their number, all groups get the same.
pub fn pass_size(settings: &RenderSettings, done: u32, left: u32) -> u32 {
    let g = settings.replicates;
    let pixels = u64::from(settings.width) * u64::from(settings.height);
    // At most the number of groups, which is small.
    let first = (PASS_SAMPLES / pixels).clamp(1, u64::from(g)) as u32;
    let least = if done < CHECKPOINT_SAMPLES * g { first } else { g };
    let size = (done / 10).max(least).min(left);
    if size > g { size / g * g } else { size }
}

/// How many of `total` samples per pixel fall to a group.
pub fn dealt(settings: &RenderSettings, total: u32, group: u32) -> u32 {
    let g = settings.replicates;
    total / g + u32::from(group < total % g)
}

/// Groups that begin with a sample per pixel, of which all others learn: one of even number and one of odd number.
const TEACHERS: u32 = 2;

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
    /// of the first two groups; a tracer from the lights, which learns from its pilot, does an eighth of its groups first.
    pub fn first(&self) -> PassPlan {
        if self.settings.integrator == IntegratorKind::Mmlt {
            return metropolis::pilot(&self.settings);
        }
        let Some(spp) = self.sample_budget() else {
            return self.pass(0, 0, self.size(0), Learned::default());
        };
        let groups = self.shares(spp);
        let first: Vec<GroupRange> = if self.learns_first() {
            groups[..(groups.len() / 8).max(1)].to_vec()
        } else {
            groups.iter().take(TEACHERS as usize).map(|g| GroupRange { end: 1, closes: g.end == 1, ..*g }).collect()
        };
        let last = first == groups;
        self.plan(0, first, Learned::default(), last)
    }

    /// The pass after one that ended at `done` samples per pixel in all; `None` when the sample budget is used up. Not for Metropolis
    /// jobs, which `metropolis` plans.
    pub fn next(&self, pass: u32, done: u32, learned: Learned) -> Option<PassPlan> {
        if let Some(spp) = self.sample_budget() {
            let groups = self.shares(spp);
            let rest = if self.learns_first() {
                groups[(groups.len() / 8).max(1)..].to_vec()
            } else {
                let rest = (0..).zip(groups).map(|(i, g)| GroupRange { start: u32::from(i < TEACHERS), ..g });
                rest.filter(|g| g.start < g.end).collect()
            };
            return (pass == 1).then(|| self.plan(pass, rest, learned, true));
        }
        let size = self.size(done);
        (size > 0).then(|| self.pass(pass, done, size, learned))
    }

    /// Samples per pixel of the pass after `done`, in a job that is not planned as a whole; 0 when there are none left. Where samples go by
    /// what was found, all groups get as many as soon as that is believed.
    pub fn size(&self, done: u32) -> u32 {
        let left = self.settings.budget.spp.map_or(MAX_SPP, |n| n.min(MAX_SPP)).saturating_sub(done);
        let g = self.settings.replicates;
        if done == 0 && self.settings.integrator == IntegratorKind::Path {
            return g.min(TEACHERS).min(left);
        }
        if !self.settings.adapts() {
            return pass_size(&self.settings, done, left);
        }
        // A tile's samples should come together: what each of them shares is found out better then.
        let pilot = adaptive::pilot(&self.settings);
        let counted = self.settings.budget.is_counted();
        if done < pilot {
            let size = if counted { pilot } else { pass_size(&self.settings, done, left) };
            return size.min(left).min(pilot - done);
        }
        let size = if counted { (done / 2).min(left) } else { pass_size(&self.settings, done, left) };
        if size > 0 { (done + size).next_multiple_of(g) - done } else { 0 }
    }

    /// The samples per pixel of a job that nothing but their number ends, and that goes to all pixels alike.
    fn sample_budget(&self) -> Option<u32> {
        self.settings.budget.spp.filter(|_| self.settings.budget.is_counted() && !self.settings.adapts())
    }

    /// Whether the first pass is a pilot of whole groups.
    fn learns_first(&self) -> bool {
        self.settings.integrator == IntegratorKind::Light
    }

    fn sampling(&self) -> Sampling {
        match self.settings.integrator {
            IntegratorKind::Light => Sampling::Paths,
            IntegratorKind::Bdpt | IntegratorKind::Moments => Sampling::SplattingTiles,
            IntegratorKind::Path | IntegratorKind::Mmlt | IntegratorKind::Auto => Sampling::Tiles,
        }
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
    fn pass(&self, pass: u32, from: u32, size: u32, learned: Learned) -> PassPlan {
        let upto = |total: u32, r: u32| dealt(&self.settings, total, r);
        let groups = (0..self.settings.replicates)
            .map(|r| GroupRange { replicate: r, start: upto(from, r), end: upto(from + size, r), closes: false })
            .filter(|r| r.end > r.start)
            .collect();
        let last = self.settings.budget.spp.is_some_and(|n| from + size >= n);
        self.plan(pass, groups, learned, last)
    }

    fn plan(&self, pass: u32, groups: Vec<GroupRange>, learned: Learned, last: bool) -> PassPlan {
        PassPlan {
            pass,
            width: self.settings.width,
            height: self.settings.height,
            reach: self.settings.reach(),
            sampling: self.sampling(),
            dealing: adaptive::dealing(&self.settings, learned.ranges.unwrap_or_default()),
            parts: groups.into_iter().map(Part::Samples).collect(),
            light_weights: learned.light_weights,
            sharing: learned.sharing,
            threshold: learned.threshold,
            chains: None,
            chain_weight: 0,
            last,
            first: 0,
            settings: None,
        }
    }
}

/// What earlier passes teach the next.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Learned {
    /// Selection weights of the lights; empty = by power.
    pub light_weights: Vec<f32>,
    /// How pixels begin to share: see [`PassPlan::sharing`].
    pub sharing: Vec<[[u8; 2]; 2]>,
    /// Contributions of connections below this are tested for visibility by chance only.
    pub threshold: f32,
    /// Where samples go by what was found: see [`Dealing::ranges`](super::Dealing::ranges). `None` = to all pixels alike.
    pub ranges: Option<Vec<Vec<[u32; 2]>>>,
}
