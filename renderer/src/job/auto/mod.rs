//! `auto`: small trials of `path`, `bdpt` and `mmlt` decide which of them renders.
//!
//! A trial is a render like any other, with a film of its own and a seed of its own. Nothing of it gets into the image, so whatever it
//! decides leaves the image unbiased; and it is planned by counts alone, so that the same job decides alike everywhere. What is compared
//! is the relative error that an integrator would leave for the same work: the variance between a trial's replicate groups, times the
//! rays and samples that it took.
//!
//! What lights are worth selecting every render learns from its first samples. Trials are too short for that: where there is a choice, the
//! first of them is rendered again, and it and all others begin with what it has taught.
//!
//! A short trial of `path` can miss light altogether, such as a caustic, and look clean. So its picture is compared with that of `bdpt`,
//! block by block: light that n samples have not found has a probability of at most about 1 / n, which bounds its variance from below.

mod judge;
mod measure;

use super::bytes::Reader;
use super::rendering::Rendering;
use super::settings::{Budget, RenderSettings};
use crate::film::Counters;
use crate::integrator::IntegratorKind;
use crate::sampling::hash_words;
use judge::{choose, outcomes, work_of};
use serde::{Deserialize, Serialize};
use std::io::{self, Write};

/// Names the seeds of trials among all hashes.
const TRIAL: u64 = 0x7472_6961_6c73;
/// Samples that `path` makes in its trial, of those that the job has: the other trials cost about three times as much together.
const SHARE: f64 = 0.005;
/// Bounds of their number.
const SAMPLES: (f64, f64) = ((1 << 14) as f64, (1 << 18) as f64);
/// Jobs of fewer samples are rendered by `path`: trials would cost more than they save.
const WORTH_IT: f64 = (1 << 17) as f64;
/// Samples a second that a time budget is taken for.
const RATE: f64 = 5e5;
/// Samples that a job is taken for that nothing but its error ends.
const UNKNOWN: f64 = (1 << 25) as f64;
/// Replicate groups of a trial.
const GROUPS: u32 = 4;
/// Mutations per pixel of a trial: few, so that its film is large, since steps within one pixel are not as good as steps between them.
const MUTATIONS: u32 = 4;
/// Relative variance of one sample per pixel below which chains can't be better: a pixel of n mutations that were all independent
/// would have 1 / n for the light that chains carry.
const EASY: f64 = 0.2;

/// What is tried, in this order.
const TRIED: [Tried; 6] = [Tried::Path, Tried::Alone, Tried::Bdpt, Tried::Moments, Tried::Direct, Tried::Mmlt];
/// Trials that tell of path and bdpt.
const WITHOUT_CHAINS: usize = 4;

/// A trial.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Tried {
    /// By `path`.
    Path,
    /// The same, knowing the lights.
    Again,
    /// By `path` whose pixels share nothing, to be compared with what it would find seldom.
    Alone,
    /// By `bdpt`.
    Bdpt,
    /// What `path` would find seldom.
    Moments,
    /// By `path`, the short paths that ordinary samples carry where chains carry the others.
    Direct,
    /// By `mmlt`.
    Mmlt,
}

impl Tried {
    fn integrator(self) -> IntegratorKind {
        match self {
            Self::Path | Self::Again | Self::Alone | Self::Direct => IntegratorKind::Path,
            Self::Bdpt => IntegratorKind::Bdpt,
            Self::Moments => IntegratorKind::Moments,
            Self::Mmlt => IntegratorKind::Mmlt,
        }
    }
}

/// What a job by `auto` chose, and why.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Choice {
    /// The integrator that renders.
    pub integrator: IntegratorKind,
    /// Why, in a sentence.
    pub why: String,
    /// What the trials showed.
    pub trials: Vec<Outcome>,
    /// What the trials cost, as a share of what the job was given; `None` where that is not counted.
    pub share: Option<f64>,
}

/// What a trial showed.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Outcome {
    /// The integrator.
    pub integrator: IntegratorKind,
    /// Relative variance that one sample (mutation) per pixel leaves.
    pub variance: f64,
    /// How much of that is owed to light that the trial did not find, but that of `bdpt` did.
    pub unseen: f64,
    /// Work of a sample (of a mutation, with all that goes with it), in samples of `path`.
    pub work: f64,
}

impl Outcome {
    /// Relative variance for the work of one sample of `path` per pixel: the time to a given error is in proportion.
    pub fn cost(&self) -> f64 {
        self.variance * self.work
    }
}

/// The state of a job by `auto`.
#[derive(Clone, Debug, Default)]
pub struct Auto {
    /// Trials that are complete.
    trials: Vec<Rendering>,
    /// What they met.
    met: Counters,
    /// What the first trial has taught of the lights, and the work that it took: it is not among those above.
    lights: Option<Lights>,
    choice: Option<Choice>,
}

/// What a trial has taught of the lights.
#[derive(Clone, Debug, Serialize, Deserialize)]
struct Lights {
    /// Bits of the numbers, see [`Rendering::light_sums`].
    sums: Vec<u64>,
    work: f64,
}

impl Auto {
    /// What was chosen.
    pub fn choice(&self) -> Option<&Choice> {
        self.choice.as_ref()
    }

    /// What the trials met.
    pub fn counters(&self) -> Counters {
        self.met
    }

    /// The settings of the first render.
    pub fn next(&mut self, job: &RenderSettings) -> RenderSettings {
        if work(job) >= WORTH_IT {
            return trial(job, Tried::Path);
        }
        let why = "the job is too small for trials".into();
        self.choice = Some(Choice { integrator: IntegratorKind::Path, why, trials: Vec::new(), share: Some(0.0) });
        job.rendered_by(IntegratorKind::Path, job.budget.spp)
    }

    /// Puts the next render in the place of a trial, which is kept for what it can be compared with; once there is a choice, none is needed.
    pub fn go_on(&mut self, job: &RenderSettings, now: &mut Rendering) {
        self.met.add(&now.counters());
        if self.lights.is_none() && self.trials.is_empty() && !now.light_sums().is_empty() {
            let work = work_of(&now.spent().samples, IntegratorKind::Path);
            let sums = now.light_sums().iter().map(|v| v.to_bits()).collect();
            self.lights = Some(Lights { sums, work });
            *now = self.begin(trial(job, Tried::Again));
            return;
        }
        let next = self.settings_after(job, now);
        let trial = std::mem::replace(now, self.begin(next));
        if self.choice.is_some() {
            self.trials.clear();
        } else {
            self.trials.push(trial);
        }
    }

    /// Begins a trial, which knows the lights, or the render that was chosen, which learns of them by itself.
    fn begin(&self, settings: RenderSettings) -> Rendering {
        match &self.lights {
            Some(lights) if self.choice.is_none() => {
                let sums: Vec<f64> = lights.sums.iter().map(|v| f64::from_bits(*v)).collect();
                Rendering::knowing(settings, &sums)
            }
            _ => Rendering::new(settings),
        }
    }

    /// The settings of the render after a trial that is compared with others.
    fn settings_after(&mut self, job: &RenderSettings, trial_done: &Rendering) -> RenderSettings {
        let trials: Vec<&Rendering> = self.trials.iter().chain([trial_done]).collect();
        let outcomes = outcomes(&trials);
        let easy = trials.len() == WITHOUT_CHAINS && outcomes.iter().any(|o| o.cost() < EASY);
        if trials.len() < TRIED.len() && !easy {
            return trial(job, TRIED[trials.len()]);
        }
        let learning = self.lights.as_ref().map_or(0.0, |lights| lights.work);
        let (choice, settings) = choose(job, &trials, outcomes, learning);
        self.choice = Some(choice);
        settings
    }

    /// Appends the whole state.
    pub fn save(&self, out: &mut Vec<u8>) -> io::Result<()> {
        // Plain structs of numbers and names always serialise.
        let head = serde_json::to_vec(&(&self.choice, self.met, &self.lights)).unwrap_or_default();
        out.extend((head.len() as u64).to_le_bytes());
        out.write_all(&head)?;
        out.extend((self.trials.len() as u64).to_le_bytes());
        for trial in &self.trials {
            let mut bytes = Vec::new();
            trial.save(&mut bytes)?;
            out.extend((bytes.len() as u64).to_le_bytes());
            out.write_all(&bytes)?;
        }
        Ok(())
    }

    /// Takes what [`Auto::save`] wrote off the front; `None` when it is not that.
    pub fn load(r: &mut Reader) -> Option<Self> {
        let n = r.length()?;
        let (choice, met, lights) = serde_json::from_slice(r.take(n)?).ok()?;
        let mut trials = Vec::new();
        for _ in 0..r.length().filter(|n| *n <= TRIED.len())? {
            let n = r.length()?;
            trials.push(Rendering::load(r.take(n)?)?);
        }
        Some(Self { trials, met, lights, choice })
    }
}

/// Samples of `path` that the job is worth, as far as that can be told from its settings.
fn work(job: &RenderSettings) -> f64 {
    let b = &job.budget;
    let counted = b.spp.map(|n| f64::from(n) * job.pixels());
    let timed = b.time_s.map(|t| t * RATE);
    counted.into_iter().chain(timed).min_by(f64::total_cmp).unwrap_or(UNKNOWN)
}

/// The settings of a trial.
fn trial(job: &RenderSettings, tried: Tried) -> RenderSettings {
    let integrator = tried.integrator();
    let samples = (SHARE * work(job)).clamp(SAMPLES.0, SAMPLES.1);
    // As many samples in each group as the job will have, as far as that is affordable: stratification shows.
    let of_group = job.budget.spp.unwrap_or(u32::MAX).div_ceil(8).clamp(2, 4);
    let spp = match integrator {
        IntegratorKind::Bdpt => (of_group / 2).max(2) * GROUPS,
        IntegratorKind::Moments => GROUPS,
        _ => of_group * GROUPS,
    };
    let per_pixel = if integrator == IntegratorKind::Mmlt { MUTATIONS } else { of_group * GROUPS };
    let pixels = (samples / f64::from(per_pixel)).min(job.pixels());
    let scale = (pixels / job.pixels()).sqrt();
    let side = |of: u32| ((f64::from(of) * scale).round() as u32).clamp(1, of);
    let seed = hash_words(&[job.seed, TRIAL, tried as u64]);
    let mut settings = RenderSettings {
        width: side(job.width),
        height: side(job.height),
        seed,
        replicates: GROUPS,
        ..job.rendered_by(integrator, Some(spp))
    };
    settings.share &= tried != Tried::Alone;
    if tried == Tried::Direct {
        let direct = job.mmlt.direct_edges;
        settings.max_depth = Some(job.max_depth.map_or(direct, |n| n.min(direct)));
    }
    if integrator == IntegratorKind::Mmlt {
        // A render that a time ends keeps what ordinary samples found apart from what chains found.
        settings.budget = Budget { mpp: Some(MUTATIONS), time_s: Some(f64::MAX), ..Budget::default() };
    } else {
        settings.budget = Budget { spp: Some(spp), ..Budget::default() };
    }
    settings
}
