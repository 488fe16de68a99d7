//! A job: settings, passes, units, results and their merge. The same code runs in `lightfarm render` and on the farm.

mod adaptive;
mod auto;
mod bytes;
mod codec;
pub mod document;
mod local;
mod merger;
mod metropolis;
mod plan;
mod planner;
mod rendering;
mod run;
mod settings;
mod sharing;
mod skips;
mod unit;

pub use auto::{Choice, Outcome};
pub use codec::DecodeError;
pub use local::{LocalEvent, LocalOptions, LocalOutcome, render_local};
pub use merger::Merger;
pub use plan::{Dealing, GroupRange, Part, PassPlan, Sampling};
pub use planner::{Learned, Planner};
pub use rendering::FoldError;
pub use run::{Stop, UnitError, render_strategies, run_unit};
pub use settings::{Budget, RenderOptions, RenderSettings, SettingsError};
pub use skips::skipped;
pub use unit::{Unit, UnitKind, UnitResult};
