use super::metropolis;
use super::plan::{Part, PassPlan, Sampling};
use super::settings::RenderSettings;
use super::sharing;
use super::unit::{Unit, UnitKind, UnitResult};
use crate::film::{Rect, SplatSums};
use crate::integrator::mmlt::{self, ChainTask, Mismatch};
use crate::integrator::strategies::{self, Strategies};
use crate::integrator::{self, Carried, IntegratorKind, Lessons, UnitContext, View};
use crate::light::LightLessons;
use crate::scene::Scene;
use std::ops::Range;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::atomic::{AtomicBool, Ordering};

/// Asks units to end early; a stopped unit has no result.
#[derive(Debug, Default)]
pub struct Stop(AtomicBool);

impl Stop {
    /// Not stopped.
    pub const fn new() -> Self {
        Self(AtomicBool::new(false))
    }

    /// Stops.
    pub fn stop(&self) {
        self.0.store(true, Ordering::Relaxed);
    }

    /// Whether to stop.
    #[inline]
    pub fn stopped(&self) -> bool {
        self.0.load(Ordering::Relaxed)
    }
}

/// Why a unit has no result.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum UnitError {
    /// It was asked to stop.
    #[error("stopped")]
    Stopped,
    /// What it was given does not agree with what it finds.
    #[error("unit {unit} of pass {pass} can't be run: {source}")]
    Mismatch {
        /// The pass.
        pass: u32,
        /// The unit.
        unit: u32,
        /// What differs.
        source: Mismatch,
    },
    /// It panicked: a fault of the renderer.
    #[error("unit {unit} of pass {pass} failed: {message}")]
    Panicked {
        /// The pass.
        pass: u32,
        /// The unit.
        unit: u32,
        /// What the panic said.
        message: String,
    },
}

/// Runs one unit. The result depends on nothing but the arguments: not on the thread, the machine, the time or the order.
pub fn run_unit(
    scene: &Scene,
    settings: &RenderSettings,
    plan: &PassPlan,
    unit: &Unit,
    stop: &Stop,
) -> Result<UnitResult, UnitError> {
    match catch_unwind(AssertUnwindSafe(|| run(scene, settings, plan, unit, stop))) {
        Ok(result) => result?.ok_or(UnitError::Stopped),
        Err(payload) => {
            let text = payload.downcast_ref::<String>().map(String::as_str).or(payload.downcast_ref::<&str>().copied());
            let message = text.unwrap_or("a panic without a message").to_string();
            Err(UnitError::Panicked { pass: unit.pass, unit: unit.id, message })
        }
    }
}

fn run(
    scene: &Scene,
    settings: &RenderSettings,
    plan: &PassPlan,
    unit: &Unit,
    stop: &Stop,
) -> Result<Option<UnitResult>, UnitError> {
    let (settings, pass) = (plan.settings(settings), plan.own_pass());
    let Some(view) = View::new(scene, settings.width, settings.height, settings.filter) else { return Ok(None) };
    let learned = (plan.light_weights.len() == scene.lights.len() && !scene.lights.is_empty())
        .then(|| scene.selector.mixed(&plan.light_weights));
    let (max_depth, carried) = depths(settings);
    let context = UnitContext {
        scene,
        view: &view,
        seed: settings.seed,
        replicate: unit.replicate,
        max_depth,
        carried,
        rr_depth: settings.rr_depth,
        threshold: plan.threshold,
        share: settings.share,
        begin: sharing::begin(plan, unit),
        selector: learned.as_ref().unwrap_or(&scene.selector),
        stopped: &|| stop.stopped(),
    };
    let mut result = UnitResult::default();
    // The last pass has nobody to teach, and all passes of chains keep what the pilot's pool taught.
    let learns = match unit.kind {
        UnitKind::Tile { .. } | UnitKind::Paths { .. } => !plan.last && plan.chains.is_none(),
        UnitKind::Bootstrap { .. } => pass == 0,
        UnitKind::Chains { .. } => false,
    };
    let lights = if learns { LightLessons::new(scene.lights.len()) } else { LightLessons::default() };
    let mut lessons = Lessons { lights, sharing: None };
    let done = match unit.kind {
        UnitKind::Tile { rect, start, end, .. } => {
            run_tile(&context, (plan, settings.integrator), (rect, start..end), &mut lessons, &mut result)
        }
        UnitKind::Paths { start, end } => {
            let mut splats = SplatSums::new(settings.width, settings.height);
            let counters = &mut result.counters;
            let done = integrator::light::trace_paths(&context, start..end, &mut splats, &mut lessons.lights, counters);
            result.paths = end - start;
            result.splats = Some(splats);
            done
        }
        UnitKind::Bootstrap { start, end } => {
            let Some(constants) = &plan.chains else { return Ok(None) };
            // The pilot's samples are a preview.
            let mut splats = (pass == 0).then(|| SplatSums::new(settings.width, settings.height));
            let pool =
                mmlt::PoolTask { pass, samples: start..end, splats: splats.as_mut(), lessons: &mut lessons.lights };
            result.bootstrap = mmlt::run_bootstrap(&context, constants, &settings.mmlt, pool, &mut result.counters);
            result.splats = splats;
            result.bootstrap.is_some()
        }
        UnitKind::Chains { part, first, end } => {
            let (Some(constants), Some(Part::Chains { edges, b, starts, mutations, .. })) =
                (&plan.chains, plan.parts.get(part as usize))
            else {
                return Ok(None);
            };
            let Some(starts) = starts.get(first as usize..end as usize) else { return Ok(None) };
            let task =
                ChainTask { pool: pass.saturating_sub(1), edges: *edges, first, starts, mutations: *mutations, b: *b };
            let mut splats = SplatSums::new(settings.width, settings.height);
            let (splat, counters) = (&mut splats, &mut result.counters);
            result.chains = mmlt::run_chains(&context, constants, &settings.mmlt, pass, &task, splat, counters)
                .map_err(|source| UnitError::Mismatch { pass: unit.pass, unit: unit.id, source })?;
            result.splats = Some(splats);
            result.chains.is_some()
        }
    };
    if let Some(splats) = &mut result.splats {
        splats.round();
    }
    result.light_sums = lessons.lights.into_sums();
    result.sharing = lessons.sharing.filter(|_| learns);
    Ok(done.then_some(result))
}

/// The pictures of the strategies of bidirectional path tracing at `spp` samples per pixel, on `threads` threads; `None` when stopped.
/// The samples' shares are fixed, so that the pictures do not depend on the threads.
pub fn render_strategies(
    scene: &Scene,
    settings: &RenderSettings,
    spp: u32,
    threads: usize,
    stop: &Stop,
) -> Option<Strategies> {
    let view = View::new(scene, settings.width, settings.height, settings.filter)?;
    let view = &view;
    let sample = move |index| {
        let max_depth = settings.max_depth.unwrap_or(strategies::MAX_EDGES);
        let all = UnitContext::of_all_paths(scene, view, max_depth);
        let context = UnitContext { seed: settings.seed, stopped: &|| stop.stopped(), ..all };
        Strategies::render(&context, index..index + 1)
    };
    let mut sum: Option<Strategies> = None;
    for first in (0..spp).step_by(threads.max(1)) {
        let last = spp.min(first + threads.max(1) as u32);
        let rendered: Vec<Option<Strategies>> = std::thread::scope(|scope| {
            let start = |index| scope.spawn(move || sample(index));
            let handles: Vec<_> = (first..last).map(start).collect();
            handles.into_iter().map(|h| h.join().ok().flatten()).collect()
        });
        for one in rendered {
            let one = one?;
            match &mut sum {
                Some(sum) => sum.add(&one),
                None => sum = Some(one),
            }
        }
    }
    sum
}

/// A tile of the job's ordinary samples.
fn run_tile(
    c: &UnitContext<'_>,
    (plan, integrator): (&PassPlan, IntegratorKind),
    (rect, samples): (Rect, Range<u32>),
    lessons: &mut Lessons,
    result: &mut UnitResult,
) -> bool {
    let counters = &mut result.counters;
    if plan.sampling == Sampling::SplattingTiles {
        let mut splats = SplatSums::new(c.view.width, c.view.height);
        result.paths = rect.area() as u64 * u64::from(samples.end - samples.start);
        result.tile = if integrator == IntegratorKind::Moments {
            integrator::moments::render_tile(c, rect, samples, &mut splats, counters)
        } else {
            integrator::bdpt::render_tile(c, rect, samples, &mut splats, &mut lessons.lights, counters)
        };
        result.splats = Some(splats);
    } else {
        result.tile = integrator::path::render_tile(c, rect, samples, lessons, counters);
    }
    result.tile.is_some()
}

/// Edges of the longest path, and which lengths ordinary samples carry.
fn depths(settings: &RenderSettings) -> (u32, Carried) {
    let all = settings.max_depth.unwrap_or(u32::MAX);
    if settings.integrator != IntegratorKind::Mmlt {
        return (all, Carried::ALL);
    }
    let longest = *metropolis::lengths(settings).end();
    let direct = settings.mmlt.direct_edges;
    let carried = Carried { up_to: direct, beyond: longest.max(direct) };
    // Where chains carry all that is longer, ordinary walks end early.
    (if all <= longest { all.min(direct) } else { all }, carried)
}
