use super::plan::PassPlan;
use super::settings::RenderSettings;
use super::unit::{Unit, UnitKind, UnitResult};
use crate::film::SplatSums;
use crate::integrator::{self, UnitContext, View};
use crate::light::LightSelector;
use crate::scene::Scene;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::atomic::{AtomicBool, Ordering};

/// Share of the light paths that learned selection still deals to all lights alike.
const UNIFORM_SHARE: f32 = 0.2;

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
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum UnitError {
    /// It was asked to stop.
    #[error("stopped")]
    Stopped,
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
        Ok(result) => result.ok_or(UnitError::Stopped),
        Err(payload) => {
            let text = payload.downcast_ref::<String>().map(String::as_str).or(payload.downcast_ref::<&str>().copied());
            let message = text.unwrap_or("a panic without a message").to_string();
            Err(UnitError::Panicked { pass: unit.pass, unit: unit.id, message })
        }
    }
}

fn run(scene: &Scene, settings: &RenderSettings, plan: &PassPlan, unit: &Unit, stop: &Stop) -> Option<UnitResult> {
    let view = View::new(scene, settings.width, settings.height, settings.filter)?;
    let learned = (plan.light_weights.len() == scene.lights.len() && !scene.lights.is_empty())
        .then(|| LightSelector::defensive(&plan.light_weights, UNIFORM_SHARE));
    let context = UnitContext {
        scene,
        view: &view,
        seed: settings.seed,
        replicate: unit.replicate,
        max_depth: settings.max_depth.unwrap_or(u32::MAX),
        rr_depth: settings.rr_depth,
        selector: learned.as_ref().unwrap_or(&scene.selector),
        stopped: &|| stop.stopped(),
    };
    let mut result =
        UnitResult { tile: None, splats: None, paths: 0, light_sums: Vec::new(), counters: Default::default() };
    match unit.kind {
        UnitKind::Tile { rect, start, end } => {
            result.tile = Some(integrator::path::render_tile(&context, rect, start..end, &mut result.counters)?);
        }
        UnitKind::Paths { start, end } => {
            let mut splats = SplatSums::new(settings.width, settings.height);
            result.light_sums =
                integrator::light::trace_paths(&context, start..end, &mut splats, &mut result.counters)?;
            splats.round();
            result.splats = Some(splats);
            result.paths = end - start;
        }
    }
    Some(result)
}
