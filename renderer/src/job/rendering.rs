use super::adaptive;
use super::bytes::Reader;
use super::metropolis::Metropolis;
use super::plan::{Part, PassPlan, Sampling};
use super::planner::{CHECKPOINT_SAMPLES, Learned, Planner};
use super::settings::RenderSettings;
use super::sharing::Sharing;
use super::unit::{UnitKind, UnitResult};
use crate::film::{AovSum, Counters, GroupFilm, MergedImage, SplatSums};
use crate::integrator::mmlt::ChainStats;
use crate::integrator::{IntegratorKind, Lesson};
use crate::light::selection_weights;
use std::io::{self, Write};

/// A result that can't be folded.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum FoldError {
    /// Not the unit whose turn it is.
    #[error("unit {got} can't be folded now; the next is unit {want} of {count}")]
    Order {
        /// The unit offered.
        got: u32,
        /// The unit whose turn it is.
        want: u32,
        /// Units of the pass.
        count: u32,
    },
    /// The result is not that of the unit it claims to be.
    #[error("the result does not fit unit {0} of the plan")]
    Mismatch(u32),
}

/// Contributions of a bidirectional connection below this share of the image's mean are left to chance.
const CONNECTION_SHARE: f64 = 0.02;

/// A render by one integrator: folds unit results in the order of their numbers: sums of floats depend on their order, so there is just
/// this one.
#[derive(Clone, Debug)]
pub struct Rendering {
    settings: RenderSettings,
    planner: Planner,
    plan: PassPlan,
    next: u32,
    done_spp: u32,
    groups: Vec<GroupFilm>,
    aovs: Vec<AovSum>,
    light_sums: Vec<f64>,
    sharing: Sharing,
    /// What a Metropolis job has learned.
    metropolis: Metropolis,
    chain_stats: ChainStats,
    spent: Spent,
    checkpoints_met: u32,
    finished: bool,
}

/// What was met, by what was done.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
pub struct Spent {
    /// By ordinary samples and light paths.
    pub samples: Counters,
    /// By pools.
    pub pools: Counters,
    /// By chains.
    pub chains: Counters,
}

impl Spent {
    /// All of it.
    pub fn total(&self) -> Counters {
        let mut sum = self.samples;
        sum.add(&self.pools);
        sum.add(&self.chains);
        sum
    }
}

impl Rendering {
    /// An empty film and the first pass.
    pub fn new(settings: RenderSettings) -> Self {
        let planner = Planner::new(settings.clone());
        let plan = planner.first();
        let uniform = || vec![GroupFilm::Empty; settings.replicates as usize];
        let groups = adaptive::films(&settings).unwrap_or_else(uniform);
        Self {
            settings,
            planner,
            plan,
            next: 0,
            done_spp: 0,
            groups,
            aovs: Vec::new(),
            light_sums: Vec::new(),
            sharing: Sharing::default(),
            metropolis: Metropolis::default(),
            chain_stats: ChainStats::default(),
            spent: Spent::default(),
            checkpoints_met: 0,
            finished: false,
        }
    }

    /// A render that begins with what samples of others have taught of the lights ([`Rendering::light_sums`]).
    pub fn knowing(settings: RenderSettings, light_sums: &[f64]) -> Self {
        let mut new = Self::new(settings);
        new.plan.light_weights = selection_weights(light_sums);
        new.light_sums = light_sums.to_vec();
        new
    }

    /// What samples have taught of the lights; empty where there is no choice.
    pub fn light_sums(&self) -> &[f64] {
        &self.light_sums
    }

    /// The job's settings.
    pub fn settings(&self) -> &RenderSettings {
        &self.settings
    }

    /// The pass under way.
    pub fn plan(&self) -> &PassPlan {
        &self.plan
    }

    /// The unit whose turn it is; equals the plan's unit count when the pass is complete.
    pub fn next_unit(&self) -> u32 {
        self.next
    }

    /// Whether every unit of the pass is folded.
    pub fn pass_complete(&self) -> bool {
        self.next >= self.plan.unit_count()
    }

    /// Folds the next unit's result.
    pub fn fold(&mut self, unit: u32, result: &UnitResult) -> Result<(), FoldError> {
        if unit != self.next {
            return Err(FoldError::Order { got: unit, want: self.next, count: self.plan.unit_count() });
        }
        self.forget_pilot(unit);
        self.fold_any(unit, result)?;
        self.next += 1;
        if let Some(&Part::Samples(part)) = self.plan.ends_part(unit) {
            let group = &mut self.groups[part.replicate as usize];
            let pixels = self.settings.width as usize * self.settings.height as usize;
            if self.plan.chain_weight > 0 {
                let radiance = std::mem::take(&mut self.metropolis.pending);
                group.add_chains(&radiance, pixels, self.plan.group_weight(self.settings.replicates));
                if part.closes || part.replicate > 0 {
                    self.metropolis.forget_preview();
                }
            }
            if part.closes {
                group.close(pixels);
            }
        }
        Ok(())
    }

    /// The pilot's ordinary samples give way to those of the first chains' pass: they decide on how many these are.
    fn forget_pilot(&mut self, unit: u32) {
        let first = self.plan.chain_weight > 0 && self.done_spp == 0;
        if first && matches!(self.plan.begins_part(unit), Some(Part::Samples(part)) if part.replicate == 0) {
            self.groups[0] = GroupFilm::Empty;
        }
    }

    /// Folds a later unit of the pass although earlier ones are missing: only to save what an interrupted job has finished.
    /// Each unit at most once; no [`Rendering::fold`] or [`Rendering::advance`] afterwards.
    pub fn fold_interrupted(&mut self, unit: u32, result: &UnitResult) -> Result<(), FoldError> {
        self.fold_any(unit, result)
    }

    fn fold_any(&mut self, id: u32, result: &UnitResult) -> Result<(), FoldError> {
        let (w, h) = (self.settings.width, self.settings.height);
        let unit = self.plan.unit(id).ok_or(FoldError::Mismatch(id))?;
        let group = &mut self.groups[unit.replicate as usize];
        let fits = |splats: &SplatSums| splats.size() == (w, h);
        match (&unit.kind, &result.tile, &result.splats) {
            (UnitKind::Tile { rect, covered, start, end }, Some(tile), splats)
                if tile.rect == *rect
                    && tile.covered == *covered
                    && tile.samples == end - start
                    && tile.sums.len() == covered.area()
                    && tile.weights.len() == covered.area()
                    && tile.aovs.len() == if unit.replicate == 0 { rect.area() } else { 0 }
                    && splats.is_some() == (self.plan.sampling == Sampling::SplattingTiles)
                    && splats.as_ref().is_none_or(fits) =>
            {
                group.add_tile(w, h, tile, result.counters.rays);
                if let Some(splats) = splats {
                    group.add_splats(splats, rect.area() as u64 * u64::from(tile.samples));
                }
                self.add_aovs(tile);
                if let Some(lesson) = &result.sharing {
                    self.sharing.add(&self.settings, rect, unit.replicate, lesson);
                }
            }
            (UnitKind::Paths { start, end }, None, Some(splats)) if fits(splats) && result.paths == end - start => {
                group.add_splats(splats, result.paths);
            }
            (UnitKind::Bootstrap { .. }, None, splats) if splats.as_ref().is_none_or(fits) => {
                let added = self.metropolis.add_bootstrap(&self.settings, &self.plan, &unit, result);
                added.ok_or(FoldError::Mismatch(id))?;
            }
            (UnitKind::Chains { part, .. }, None, Some(splats)) if fits(splats) => {
                let Some(Part::Chains { b, starts, mutations, .. }) = self.plan.parts.get(*part as usize) else {
                    return Err(FoldError::Mismatch(id));
                };
                group.await_chains(w as usize * h as usize);
                let scale = f64::from(*b) / (starts.len() as f64 * f64::from(*mutations));
                self.metropolis.add_chains(w, h, splats, scale);
                if let Some(stats) = &result.chains {
                    self.chain_stats.add(stats);
                }
            }
            _ => return Err(FoldError::Mismatch(id)),
        }
        let spent = match unit.kind {
            UnitKind::Tile { .. } | UnitKind::Paths { .. } => &mut self.spent.samples,
            UnitKind::Bootstrap { .. } => &mut self.spent.pools,
            UnitKind::Chains { .. } => &mut self.spent.chains,
        };
        spent.add(&result.counters);
        self.light_sums.resize(self.light_sums.len().max(result.light_sums.len()), 0.0);
        self.light_sums.iter_mut().zip(&result.light_sums).for_each(|(to, from)| *to += from);
        Ok(())
    }

    fn add_aovs(&mut self, tile: &crate::film::TileSums) {
        if tile.aovs.is_empty() {
            return;
        }
        let width = self.settings.width as usize;
        if self.aovs.is_empty() {
            self.aovs = vec![AovSum::default(); width * self.settings.height as usize];
        }
        for ((x, y), aov) in tile.rect.pixels().zip(&tile.aovs) {
            self.aovs[y as usize * width + x as usize].add(aov);
        }
    }

    /// After the last unit of a pass: plans the next, or ends the job. `time_up` says that the wall time is used up.
    pub fn advance(&mut self, time_up: bool) -> Option<&PassPlan> {
        if self.finished {
            return None;
        }
        if !self.pass_complete() {
            return Some(&self.plan);
        }
        self.done_spp += self.plan.spp() as u32;
        let ends = time_up || self.plan.last || self.target_met();
        let next = if ends { None } else { self.next_plan() };
        let Some(plan) = next else {
            self.finished = true;
            return None;
        };
        self.plan = plan;
        self.next = 0;
        Some(&self.plan)
    }

    fn next_plan(&mut self) -> Option<PassPlan> {
        if self.settings.integrator == IntegratorKind::Mmlt {
            return self.metropolis.next(&self.settings, &self.plan, self.done_spp, &self.groups, &self.light_sums);
        }
        let share = self.planner.size(self.done_spp) / self.settings.replicates;
        let learned = Learned {
            light_weights: selection_weights(&self.light_sums),
            sharing: self.sharing.choices(&self.settings),
            threshold: self.learned_threshold(),
            ranges: adaptive::deal(&self.settings, &self.groups, self.done_spp, share),
        };
        self.planner.next(self.plan.pass + 1, self.done_spp, learned)
    }

    /// A small part of the image's mean: connections that carry less are left to chance.
    fn learned_threshold(&self) -> f32 {
        if self.settings.integrator != IntegratorKind::Bdpt {
            return 0.0;
        }
        let mean = self.image().mean;
        let sum: f64 = mean.iter().flatten().map(|v| f64::from(*v)).sum();
        (CONNECTION_SHARE * sum / (3 * mean.len()).max(1) as f64) as f32
    }

    /// A target is met when the error's upper bound is below it at two checkpoints (ends of passes) in a row.
    fn target_met(&mut self) -> bool {
        let Some(target) = self.settings.budget.target_error else { return false };
        // Pilots and pools are no checkpoints, and groups of a few samples can't tell what all of them have missed, such as pixels on
        // the rim of a lamp.
        if self.plan.spp() == 0 || self.done_spp < CHECKPOINT_SAMPLES * self.settings.replicates {
            return false;
        }
        let met = self.image().error.is_some_and(|e| e.upper95 <= target);
        self.checkpoints_met = if met { self.checkpoints_met + 1 } else { 0 };
        self.checkpoints_met >= 2
    }

    /// Samples per pixel folded in completed passes.
    pub fn done_spp(&self) -> u32 {
        self.done_spp
    }

    /// Share of the job's samples that are folded when the budget is in samples, else of the pass; 1 at the end.
    pub fn fraction(&self) -> f64 {
        let in_pass = f64::from(self.next) / f64::from(self.plan.unit_count().max(1));
        let b = &self.settings.budget;
        match b.spp.or(b.mpp) {
            _ if self.finished => 1.0,
            Some(n) => (f64::from(self.done_spp) + self.plan.spp() as f64 * in_pass) / f64::from(n),
            None => in_pass,
        }
    }

    /// Whether the job has ended.
    pub fn finished(&self) -> bool {
        self.finished
    }

    /// Sum of the folded units' counters.
    pub fn counters(&self) -> Counters {
        self.spent.total()
    }

    /// The same, by what was done.
    pub fn spent(&self) -> &Spent {
        &self.spent
    }

    /// The image so far.
    pub fn image(&self) -> MergedImage {
        let (w, h) = (self.settings.width, self.settings.height);
        let preview = (self.done_spp == 0).then(|| self.metropolis.preview(w, h, &self.groups)).flatten();
        let groups = preview.as_ref().map_or(&self.groups[..], std::slice::from_ref);
        MergedImage::from_groups(w, h, groups, &self.aovs, self.counters())
    }

    /// The replicate groups: independent pictures of the same, whose scatter tells the error.
    pub fn groups(&self) -> &[GroupFilm] {
        &self.groups
    }

    /// How the mutations of a Metropolis job fared.
    pub fn chain_stats(&self) -> ChainStats {
        self.chain_stats
    }

    /// Writes the whole state: a merger that is loaded from these bytes goes on with the same bits. Returns how many they are; at no
    /// time is more than one film of them in memory.
    pub fn save(&self, out: &mut impl Write) -> io::Result<u64> {
        let head = Head {
            settings: self.settings.clone(),
            plan: self.plan.clone(),
            next: self.next,
            done_spp: self.done_spp,
            light_sums: self.light_sums.iter().map(|v| v.to_bits()).collect(),
            sharing: self.sharing.to_bits(),
            chain_stats: self.chain_stats,
            spent: self.spent,
            checkpoints_met: self.checkpoints_met,
            finished: self.finished,
        };
        // A plain struct of numbers always serialises.
        let head = serde_json::to_vec(&head).unwrap_or_default();
        let (mut digest, mut len) = (blake3::Hasher::new(), 0);
        let mut put = |part: &[u8]| {
            digest.update(part);
            len += part.len() as u64;
            out.write_all(part)
        };
        put(&(head.len() as u64).to_le_bytes())?;
        put(&head)?;
        put(&(self.aovs.len() as u64).to_le_bytes())?;
        put(bytemuck::cast_slice(&self.aovs))?;
        let mut film = Vec::new();
        for group in &self.groups {
            film.clear();
            group.save(&mut film);
            put(&film)?;
        }
        film.clear();
        self.metropolis.save(&mut film);
        put(&film)?;
        out.write_all(digest.finalize().as_bytes())?;
        Ok(len + blake3::OUT_LEN as u64)
    }

    /// Reads what [`Rendering::save`] wrote; `None` when the bytes are damaged or of another version.
    pub fn load(bytes: &[u8]) -> Option<Self> {
        let (body, digest) = bytes.split_at_checked(bytes.len().checked_sub(blake3::OUT_LEN)?)?;
        if blake3::hash(body).as_bytes() != digest {
            return None;
        }
        let mut r = Reader(body);
        let head_len = r.length()?;
        let head: Head = serde_json::from_slice(r.take(head_len)?).ok()?;
        head.settings.validate().ok()?;
        let (w, h) = (head.settings.width, head.settings.height);
        let pixels = w as usize * h as usize;
        let aovs = r.length()?;
        let aovs = r.take(aovs.checked_mul(size_of::<AovSum>())?)?;
        let aovs: Vec<AovSum> = aovs.chunks_exact(size_of::<AovSum>()).map(bytemuck::pod_read_unaligned).collect();
        if !aovs.is_empty() && aovs.len() != pixels {
            return None;
        }
        let groups = (0..head.settings.replicates).map(|_| GroupFilm::load(&mut r.0, w, h)).collect::<Option<_>>()?;
        let metropolis = Metropolis::load(&mut r.0, pixels)?;
        Some(Self {
            planner: Planner::new(head.settings.clone()),
            settings: head.settings,
            plan: head.plan,
            next: head.next,
            done_spp: head.done_spp,
            groups,
            aovs,
            light_sums: head.light_sums.into_iter().map(f64::from_bits).collect(),
            sharing: Sharing::of_bits(&head.sharing)?,
            metropolis,
            chain_stats: head.chain_stats,
            spent: head.spent,
            checkpoints_met: head.checkpoints_met,
            finished: head.finished,
        })
    }
}

/// The small part of a saved merger; floats that must keep their bits are stored as bits.
#[derive(serde::Serialize, serde::Deserialize)]
struct Head {
    settings: RenderSettings,
    plan: PassPlan,
    next: u32,
    done_spp: u32,
    light_sums: Vec<u64>,
    sharing: Vec<[u64; Lesson::NUMBERS]>,
    chain_stats: ChainStats,
    spent: Spent,
    checkpoints_met: u32,
    finished: bool,
}
