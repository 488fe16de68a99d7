//! A job: settings, passes, units, results and their merge. The same code runs in `lightfarm render` and on the farm.

mod bytes;
mod codec;
pub mod document;
mod local;
mod merger;
mod metropolis;
mod plan;
mod run;
mod settings;
mod unit;

pub use codec::DecodeError;
pub use local::{LocalEvent, LocalOptions, LocalOutcome, render_local};
pub use merger::{FoldError, Merger};
pub use plan::{GroupRange, Learned, Part, PassPlan, Planner, Sampling};
pub use run::{Stop, UnitError, render_strategies, run_unit};
pub use settings::{Budget, RenderOptions, RenderSettings, SettingsError};
pub use unit::{Unit, UnitKind, UnitResult};
