use super::auto::{Auto, Choice};
use super::bytes::Reader;
use super::plan::PassPlan;
use super::rendering::{FoldError, Rendering};
use super::settings::RenderSettings;
use super::unit::UnitResult;
use crate::film::{Counters, GroupFilm, MergedImage};
use crate::integrator::IntegratorKind;
use crate::integrator::mmlt::ChainStats;
use std::io::{self, Write};

/// Folds the unit results of a job in the order of their numbers, and plans its passes. A job by `auto` is several renders one after the
/// other: trials, of which nothing gets into the image, and the render that they chose.
#[derive(Clone, Debug)]
pub struct Merger {
    settings: RenderSettings,
    /// The pass under way, as the job numbers it.
    plan: PassPlan,
    /// The job's number of the first pass of the render under way.
    first: u32,
    /// The render under way.
    now: Rendering,
    /// What a job by `auto` has tried; `None` for any other job.
    auto: Option<Auto>,
}

impl Merger {
    /// An empty film and the first pass.
    pub fn new(settings: RenderSettings) -> Self {
        let mut auto = (settings.integrator == IntegratorKind::Auto).then(Auto::default);
        let now = Rendering::new(auto.as_mut().map_or_else(|| settings.clone(), |a| a.next(&settings)));
        let plan = plan_of(&now, 0, auto.is_some());
        Self { settings, plan, first: 0, now, auto }
    }

    /// The job's settings.
    pub fn settings(&self) -> &RenderSettings {
        &self.settings
    }

    /// The pass under way.
    pub fn plan(&self) -> &PassPlan {
        &self.plan
    }

    /// What `auto` chose, once it has; `None` for any other job.
    pub fn choice(&self) -> Option<&Choice> {
        self.auto.as_ref().and_then(Auto::choice)
    }

    /// The integrator that renders the image; `Auto` while trials are under way.
    pub fn integrator(&self) -> IntegratorKind {
        if self.tries() { IntegratorKind::Auto } else { self.now.settings().integrator }
    }

    /// Whether a trial is under way: there is no image yet.
    fn tries(&self) -> bool {
        self.auto.as_ref().is_some_and(|a| a.choice().is_none())
    }

    /// The unit whose turn it is; equals the plan's unit count when the pass is complete.
    pub fn next_unit(&self) -> u32 {
        self.now.next_unit()
    }

    /// Whether every unit of the pass is folded.
    pub fn pass_complete(&self) -> bool {
        self.now.pass_complete()
    }

    /// Folds the next unit's result.
    pub fn fold(&mut self, unit: u32, result: &UnitResult) -> Result<(), FoldError> {
        self.now.fold(unit, result)
    }

    /// Folds a later unit of the pass although earlier ones are missing: only to save what an interrupted job has finished.
    /// Each unit at most once; no [`Merger::fold`] or [`Merger::advance`] afterwards.
    pub fn fold_interrupted(&mut self, unit: u32, result: &UnitResult) -> Result<(), FoldError> {
        self.now.fold_interrupted(unit, result)
    }

    /// After the last unit of a pass: plans the next, or ends the job. `time_up` says that the wall time is used up; a job that is still
    /// trying integrators goes on to its first samples all the same.
    pub fn advance(&mut self, time_up: bool) -> Option<&PassPlan> {
        let tries = self.tries();
        if self.now.advance(time_up && !tries).is_none() {
            let auto = self.auto.as_mut().filter(|_| tries)?;
            self.first = self.plan.pass + 1;
            auto.go_on(&self.settings, &mut self.now);
        }
        self.plan = plan_of(&self.now, self.first, self.auto.is_some());
        Some(&self.plan)
    }

    /// Samples per pixel folded in completed passes.
    pub fn done_spp(&self) -> u32 {
        if self.tries() { 0 } else { self.now.done_spp() }
    }

    /// Share of the job's samples that are folded when the budget is in samples, else of the pass; 1 at the end. Trials are not counted.
    pub fn fraction(&self) -> f64 {
        if self.tries() { 0.0 } else { self.now.fraction() }
    }

    /// Whether the job has ended.
    pub fn finished(&self) -> bool {
        !self.tries() && self.now.finished()
    }

    /// Sum of the folded units' counters. Trials count with their rays and with what they had to drop, not with their samples, which are
    /// in no image.
    pub fn counters(&self) -> Counters {
        let mut counters = self.auto.as_ref().map_or_else(Counters::default, Auto::counters);
        counters.samples = 0;
        if !self.tries() {
            counters.add(&self.now.counters());
        }
        counters
    }

    /// The image so far.
    pub fn image(&self) -> MergedImage {
        let mut image = if self.tries() {
            MergedImage::from_groups(self.settings.width, self.settings.height, &[], &[], Counters::default())
        } else {
            self.now.image()
        };
        image.counters = self.counters();
        image
    }

    /// The replicate groups: independent pictures of the same, whose scatter tells the error.
    pub fn groups(&self) -> &[GroupFilm] {
        if self.tries() { &[] } else { self.now.groups() }
    }

    /// How the mutations of a Metropolis job fared.
    pub fn chain_stats(&self) -> ChainStats {
        if self.tries() { ChainStats::default() } else { self.now.chain_stats() }
    }

    /// Writes the whole state: a merger that is loaded from these bytes goes on with the same bits. Returns how many they are; at no
    /// time is more than one film of the render under way in memory twice.
    pub fn save(&self, out: &mut impl Write) -> io::Result<u64> {
        let mut head = Vec::new();
        // Plain structs of numbers always serialise.
        let settings = serde_json::to_vec(&(&self.settings, self.first)).unwrap_or_default();
        head.extend((settings.len() as u64).to_le_bytes());
        head.extend(settings);
        head.push(u8::from(self.auto.is_some()));
        if let Some(auto) = &self.auto {
            auto.save(&mut head)?;
        }
        out.write_all(&(head.len() as u64).to_le_bytes())?;
        out.write_all(&head)?;
        out.write_all(blake3::hash(&head).as_bytes())?;
        Ok(8 + (head.len() + blake3::OUT_LEN) as u64 + self.now.save(out)?)
    }

    /// Reads what [`Merger::save`] wrote; `None` when the bytes are damaged or of another version.
    pub fn load(bytes: &[u8]) -> Option<Self> {
        let mut r = Reader(bytes);
        let n = r.length()?;
        let head = r.take(n)?;
        if blake3::hash(head).as_bytes() != r.take(blake3::OUT_LEN)? {
            return None;
        }
        let now = Rendering::load(r.0)?;
        let mut r = Reader(head);
        let n = r.length()?;
        let (settings, first): (RenderSettings, u32) = serde_json::from_slice(r.take(n)?).ok()?;
        settings.validate().ok()?;
        let auto = match r.take(1)? {
            [0] => None,
            _ => Some(Auto::load(&mut r)?),
        };
        let plan = plan_of(&now, first, auto.is_some());
        Some(Self { settings, plan, first, now, auto })
    }
}

/// The pass under way of a render, as the job numbers it.
fn plan_of(now: &Rendering, first: u32, of_several: bool) -> PassPlan {
    let plan = now.plan();
    let settings = of_several.then(|| Box::new(now.settings().clone()));
    PassPlan { pass: plan.pass + first, first, settings, ..plan.clone() }
}
