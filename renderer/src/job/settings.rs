use super::auto::Choice;
use crate::film::Filter;
use crate::film::exr::Provenance;
use crate::integrator::IntegratorKind;
use crate::integrator::mmlt::MmltOptions;
use crate::scene::bundle::Digest;
use crate::scene::desc::{FilterDesc, RenderDefaults};
use serde::{Deserialize, Serialize};

/// When a job is done: at whichever of these comes first.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Budget {
    /// Samples per pixel (light paths per pixel), all groups together.
    pub spp: Option<u32>,
    /// Mutations per pixel, all groups together: what a Metropolis job has for samples.
    pub mpp: Option<u32>,
    /// Wall time in seconds; the job ends with the pass in which it runs out.
    pub time_s: Option<f64>,
    /// Relative error whose upper 95 % bound must be met at two checkpoints in a row.
    pub target_error: Option<f64>,
}

impl Budget {
    /// Whether nothing but the number of samples or mutations ends the job.
    pub fn is_counted(&self) -> bool {
        self.time_s.is_none() && self.target_error.is_none()
    }
}

/// Everything that decides a job's pixels, beside the scene.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct RenderSettings {
    /// The integrator.
    pub integrator: IntegratorKind,
    /// When to stop.
    pub budget: Budget,
    /// Width in pixels.
    pub width: u32,
    /// Height in pixels.
    pub height: u32,
    /// Reconstruction filter.
    pub filter: FilterDesc,
    /// Edges of the longest path; `None` = unbounded.
    pub max_depth: Option<u32>,
    /// Edges from which Russian roulette may end a path.
    pub rr_depth: u32,
    /// Seed.
    pub seed: u64,
    /// Independent replicate groups.
    pub replicates: u32,
    /// Whether `path` gives noisy tiles more samples.
    pub adaptive: bool,
    /// Whether paths of `path` share their second vertices with the pixels around, and first vertices take several samples of lights, where
    /// that pays.
    pub share: bool,
    /// How chains run.
    pub mmlt: MmltOptions,
}

/// What the command line says; `None` leaves it to the scene file or the default.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct RenderOptions {
    /// `--integrator`
    pub integrator: Option<IntegratorKind>,
    /// `--spp`
    pub spp: Option<u32>,
    /// `--mpp`
    pub mpp: Option<u32>,
    /// `--mmlt`
    pub mmlt: Option<MmltOptions>,
    /// `--time`, seconds
    pub time_s: Option<f64>,
    /// `--target-error`
    pub target_error: Option<f64>,
    /// `--adaptive`
    pub adaptive: Option<bool>,
    /// `--share`
    pub share: Option<bool>,
    /// `--size`
    pub size: Option<(u32, u32)>,
    /// `--max-depth`
    pub max_depth: Option<i32>,
    /// `--seed`
    pub seed: Option<u64>,
}

impl RenderOptions {
    /// An integrator with a budget of `n` samples per pixel, or mutations, if it makes those.
    pub fn counting(integrator: IntegratorKind, n: u32) -> Self {
        let chains = integrator == IntegratorKind::Mmlt;
        let (spp, mpp) = if chains { (None, Some(n)) } else { (Some(n), None) };
        Self { integrator: Some(integrator), spp, mpp, ..Self::default() }
    }

    /// Checks that they go together, and with the integrator that they or the scene chose.
    fn check(&self, integrator: IntegratorKind) -> Result<(), String> {
        check_counts(integrator, self.spp, self.mpp)?;
        if self.mmlt.is_some() && integrator != IntegratorKind::Mmlt {
            let name = integrator.name();
            let would = if integrator == IntegratorKind::Auto { "chooses" } else { "would render" };
            return Err(format!("--mmlt is for mmlt, but {name} {would}; leave it out, or give --integrator mmlt"));
        }
        if self.adaptive == Some(true) && !matches!(integrator, IntegratorKind::Path | IntegratorKind::Auto) {
            let name = integrator.name();
            return Err(format!(
                "--adaptive is for path, but {name} would render; leave it out, or give --integrator path"
            ));
        }
        if self.share == Some(true) && !matches!(integrator, IntegratorKind::Path | IntegratorKind::Auto) {
            let name = integrator.name();
            return Err(format!(
                "--share is for path, but {name} would render; leave it out, or give --integrator path"
            ));
        }
        self.mmlt.map_or(Ok(()), |o| o.validate())?;
        self.size.map_or(Ok(()), |(width, height)| check_size(width, height))
    }
}

/// Settings that can't be rendered.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum SettingsError {
    /// What the command line says makes no sense, by itself or with the integrator.
    #[error("{0}")]
    Options(String),
    /// Anything else.
    #[error("{0}")]
    Settings(String),
}

/// The largest film, in pixels: 2^28 (16384 x 16384).
pub const MAX_PIXELS: u64 = 1 << 28;
/// Replicate groups of a job that has samples for them.
const REPLICATES: u32 = 8;
/// Replicate groups of an integrator that splats: its samples gain nothing from long sequences.
const SPLAT_REPLICATES: u32 = 16;

impl RenderSettings {
    /// Command line over scene file over defaults.
    pub fn resolve(options: &RenderOptions, scene: &RenderDefaults) -> Result<Self, SettingsError> {
        let from_scene = || scene.integrator.as_deref().map(str::parse::<IntegratorKind>);
        let integrator = match options.integrator {
            Some(k) => k,
            None => from_scene().transpose().map_err(SettingsError::Settings)?.unwrap_or(IntegratorKind::Path),
        };
        options.check(integrator).map_err(SettingsError::Options)?;
        let budget = budget(options, scene, integrator);
        let (width, height) = options.size.or(scene.size).unwrap_or((768, 432));
        let depth = options.max_depth.or(scene.max_depth).unwrap_or(-1);
        let settings = Self {
            integrator,
            budget,
            width,
            height,
            filter: scene.filter.unwrap_or(FilterDesc::Gaussian { stddev: 0.5 }),
            max_depth: if depth == -1 { None } else { Some(u32::try_from(depth).map_err(|_| bad_depth(depth))?) },
            rr_depth: scene.rr_depth.unwrap_or(5),
            seed: options.seed.or(scene.seed).unwrap_or(0),
            replicates: groups(integrator, &budget),
            adaptive: options.adaptive.unwrap_or(budget.target_error.is_some() || budget.time_s.is_some()),
            share: options.share.unwrap_or(true),
            mmlt: options.mmlt.unwrap_or_default(),
        };
        settings.validate()?;
        Ok(settings)
    }

    /// Whether samples go to the tiles that need them; only those of `path` do.
    pub fn adapts(&self) -> bool {
        self.adaptive && self.integrator == IntegratorKind::Path
    }

    /// Pixels beyond its own for which a sample counts.
    pub fn reach(&self) -> u32 {
        Filter::new(&self.filter, self.width, self.height).reach()
    }

    /// The same by another integrator, with `count` samples (mutations) per pixel in place of the samples that these allow.
    pub fn rendered_by(&self, integrator: IntegratorKind, count: Option<u32>) -> Self {
        let (spp, mpp) = if integrator == IntegratorKind::Mmlt { (None, count) } else { (count, None) };
        let budget = Budget { spp, mpp, ..self.budget };
        Self { integrator, budget, replicates: groups(integrator, &budget), ..self.clone() }
    }

    /// Pixels of the film.
    pub fn pixels(&self) -> f64 {
        f64::from(self.width) * f64::from(self.height)
    }

    /// What an image made with these settings says of itself; by `auto`, what was chosen as well.
    pub fn provenance(&self, scene: Digest, choice: Option<&Choice>) -> Provenance {
        // Plain structs of numbers always serialise.
        let settings = serde_json::to_value(self).unwrap_or_default();
        let choice = choice.map(|c| serde_json::to_value(c).unwrap_or_default());
        Provenance { scene, seed: self.seed, settings, choice }
    }

    /// Checks what came over the wire or from a user.
    pub fn validate(&self) -> Result<(), SettingsError> {
        let fail = |m: String| Err(SettingsError::Settings(m));
        check_size(self.width, self.height).or_else(fail)?;
        let b = &self.budget;
        if b.spp.is_none() && b.mpp.is_none() && b.time_s.is_none() && b.target_error.is_none() {
            return fail(
                "nothing says when the job is done; give --spp (--mpp for mmlt), --time or --target-error".into(),
            );
        }
        if b.spp == Some(0) || b.spp.is_some_and(|n| n > 1 << 24) {
            return fail(format!("--spp {} is out of range; it goes from 1 to {}", b.spp.unwrap_or(0), 1 << 24));
        }
        if b.mpp == Some(0) || b.mpp.is_some_and(|n| n > 1 << 24) {
            return fail(format!("--mpp {} is out of range; it goes from 1 to {}", b.mpp.unwrap_or(0), 1 << 24));
        }
        check_counts(self.integrator, b.spp, b.mpp).or_else(fail)?;
        self.mmlt.validate().or_else(fail)?;
        if b.time_s.is_some_and(|t| !(t > 0.0 && t.is_finite())) {
            return fail("--time must be a positive number of seconds".into());
        }
        if b.target_error.is_some_and(|t| !(t > 0.0 && t.is_finite())) {
            return fail("--target-error must be a positive number, such as 0.02".into());
        }
        if self.replicates == 0 || self.replicates > 64 {
            return fail(format!("{} replicate groups are out of range; they go from 1 to 64", self.replicates));
        }
        self.filter.validate().or_else(fail)
    }
}

/// Replicate groups of an integrator.
fn groups(integrator: IntegratorKind, budget: &Budget) -> u32 {
    let sobol = matches!(integrator, IntegratorKind::Path | IntegratorKind::Bdpt);
    let groups = if sobol { REPLICATES } else { SPLAT_REPLICATES };
    budget.spp.map_or(groups, |n| groups.min(n.max(1)))
}

/// Checks the size of a film.
fn check_size(width: u32, height: u32) -> Result<(), String> {
    let pixels = u64::from(width) * u64::from(height);
    if pixels == 0 || pixels > MAX_PIXELS || width > 1 << 16 || height > 1 << 16 {
        return Err(format!(
            "a picture of {width} x {height} pixels can't be rendered; sides go from 1 to 65536, the area to {MAX_PIXELS}"
        ));
    }
    Ok(())
}

/// Checks that a budget counts what the integrator makes.
fn check_counts(integrator: IntegratorKind, spp: Option<u32>, mpp: Option<u32>) -> Result<(), String> {
    let chains = integrator == IntegratorKind::Mmlt;
    if chains && spp.is_some() {
        return Err("mmlt makes mutations, not samples; give --mpp in place of --spp".into());
    }
    if integrator == IntegratorKind::Auto && mpp.is_some() {
        return Err("auto counts in samples of path, whatever it chooses; give --spp in place of --mpp".into());
    }
    if !chains && mpp.is_some() {
        return Err(format!("{} makes samples, not mutations; give --spp in place of --mpp", integrator.name()));
    }
    Ok(())
}

/// What ends the job: the command line, else the scene's samples per pixel (as mutations, where the integrator makes those).
fn budget(options: &RenderOptions, scene: &RenderDefaults, integrator: IntegratorKind) -> Budget {
    let mut budget =
        Budget { spp: options.spp, mpp: options.mpp, time_s: options.time_s, target_error: options.target_error };
    if budget == Budget::default() {
        let count = Some(scene.spp.unwrap_or(64));
        if integrator == IntegratorKind::Mmlt {
            budget.mpp = count;
        } else {
            budget.spp = count;
        }
    }
    budget
}

fn bad_depth(depth: i32) -> SettingsError {
    SettingsError::Settings(format!(
        "--max-depth {depth} is out of range; it counts edges from 0, and -1 means unbounded"
    ))
}
