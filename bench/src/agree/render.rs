//! Rendering until the image mean is known well enough.

use super::picture::Picture;
use renderer::film::{Filter, MergedImage};
use renderer::integrator::IntegratorKind;
use renderer::job::{LocalOptions, RenderOptions, RenderSettings, Stop, render_local};
use renderer::scene::Scene;
use std::time::Instant;

/// Least number of replicate groups where pixels share paths.
const SHARED_GROUPS: u32 = 16;

/// How much is rendered. It follows from what is in the pictures, never from a clock, so that the verdict does not either.
#[derive(Clone, Copy, Debug)]
pub struct Effort {
    /// Samples per pixel of the pilot, which tells how many more are needed.
    pub pilot_spp: u32,
    /// Half width of the 99 % interval of the image mean to aim at, relative.
    pub aim: f64,
    /// Limits of integrators that make independent samples.
    pub samples: Limits,
    /// Limits of Markov chains, whose image mean is that of the independent samples from which they start, and these are few.
    pub chains: Limits,
    /// Samples that a pixel needs for its error to be told at all.
    pub least_spp: u32,
}

/// How far to go.
#[derive(Clone, Copy, Debug)]
pub struct Limits {
    /// Half width that must be reached.
    pub required: f64,
    /// Most rays of a picture, unless it would then have fewer than the least number of samples.
    pub rays: f64,
}

impl Effort {
    /// The limits of an integrator.
    pub fn limits(&self, kind: IntegratorKind) -> Limits {
        if kind == IntegratorKind::Mmlt { self.chains } else { self.samples }
    }
}

/// A picture and what it took.
#[derive(Debug)]
pub struct Rendering {
    /// The picture.
    pub image: MergedImage,
    /// What made it.
    pub kind: IntegratorKind,
    /// How its pixels share samples, if that is all that they share.
    pub filter: Option<Filter>,
    /// Samples (mutations) per pixel.
    pub spp: u32,
    /// Seconds, the pilot not counted.
    pub seconds: f64,
}

impl Rendering {
    /// As something to compare.
    pub fn picture(&self) -> Picture<'_> {
        Picture::Rendered(&self.image, self.filter.as_ref())
    }
}

/// What to render.
#[derive(Clone, Copy, Debug)]
pub struct Task<'a> {
    /// The scene.
    pub scene: &'a Scene,
    /// The integrator.
    pub kind: IntegratorKind,
    /// Whether pixels of `path` share their paths.
    pub share: bool,
    /// Size of the picture.
    pub size: (u32, u32),
    /// Depth limit, if not that of the scene.
    pub max_depth: Option<u32>,
    /// Seed; that of the pilot follows from it.
    pub seed: u64,
    /// Threads.
    pub threads: usize,
}

impl Task<'_> {
    /// Renders a pilot, and then with as many samples as the pilot says are needed.
    ///
    /// The pilot is thrown away: samples that decide how many more there will be would bias the picture.
    pub fn run(&self, effort: &Effort) -> Result<Rendering, String> {
        let pilot = self.render(effort.pilot_spp, !self.seed)?;
        let half = pilot.picture().half_width();
        let rays_per_spp = pilot.image.counters.rays as f64 / f64::from(effort.pilot_spp);
        let needed = f64::from(effort.pilot_spp) * (half / effort.aim) * (half / effort.aim);
        // NaN, where the pilot could not tell, takes all that is allowed.
        let spp = needed.min(effort.limits(self.kind).rays / rays_per_spp.max(1.0)).max(f64::from(effort.least_spp));
        // Whole samples for each group.
        let groups = f64::from(SHARED_GROUPS);
        self.render((spp / groups).ceil().min(1e6) as u32 * SHARED_GROUPS, self.seed)
    }

    fn render(&self, spp: u32, seed: u64) -> Result<Rendering, String> {
        let options = RenderOptions {
            size: Some(self.size),
            max_depth: self.max_depth.map(|n| i32::try_from(n).unwrap_or(-1)),
            seed: Some(seed),
            ..RenderOptions::counting(self.kind, spp)
        };
        let mut settings = RenderSettings::resolve(&options, &self.scene.defaults).map_err(|e| e.to_string())?;
        settings.share = self.share;
        let apart = self.kind == IntegratorKind::Path && !self.share;
        if !apart {
            // The errors of areas whose pixels share paths have no more degrees of freedom than there are groups.
            settings.replicates = settings.replicates.max(SHARED_GROUPS);
        }
        let started = Instant::now();
        let options = LocalOptions { threads: self.threads };
        let outcome =
            render_local(self.scene, &settings, &options, &Stop::new(), &mut |_| {}).map_err(|e| e.to_string())?;
        let filter = apart.then(|| Filter::new(&settings.filter, settings.width, settings.height));
        Ok(Rendering { image: outcome.image, kind: self.kind, filter, spp, seconds: started.elapsed().as_secs_f64() })
    }
}
