//! Integrators. One file and one line of [`IntegratorKind`] each.

pub mod bdpt;
mod context;
mod gauge;
pub mod light;
pub mod mmlt;
pub mod moments;
pub mod path;
mod share;
pub mod strategies;
mod tile;

pub use context::{Carried, Lessons, UnitContext, View};
pub use gauge::{Choice, Gains, JOIN_RAY, Lesson};

use serde::{Deserialize, Serialize};

macro_rules! integrators {
    ($($(#[$doc:meta])* $variant:ident = $name:literal,)*) => {
        /// Which integrator renders.
        #[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
        pub enum IntegratorKind {
            $($(#[$doc])* #[serde(rename = $name)] $variant,)*
            /// No integrator of its own: trials choose `path`, `bdpt` or `mmlt`.
            #[serde(rename = "auto")]
            Auto,
            /// Not of the image, but of the scatter of `path`'s samples: a trial of `auto`.
            #[serde(rename = "moments")]
            Moments,
        }

        impl IntegratorKind {
            /// All that render, by name.
            pub const ALL: &[(&str, Self)] = &[$(($name, Self::$variant)),*];

            /// Its name on the command line and in scene files.
            pub fn name(self) -> &'static str {
                match self { $(Self::$variant => $name,)* Self::Auto => "auto", Self::Moments => "moments" }
            }
        }
    };
}

integrators! {
    /// Unidirectional path tracing with next-event estimation and BSDF sampling, combined by multiple importance sampling.
    Path = "path",
    /// Light tracing: paths from the lights, each vertex connected to the camera.
    Light = "light",
    /// Bidirectional path tracing: all ways to join a walk from the camera and one from a light.
    Bdpt = "bdpt",
    /// Multiplexed Metropolis light transport: Markov chains over the paths of bidirectional path tracing.
    Mmlt = "mmlt",
}

impl IntegratorKind {
    /// All names that can be asked for.
    pub fn names() -> impl Iterator<Item = &'static str> {
        Self::ALL.iter().map(|(n, _)| *n).chain(["auto"])
    }

    /// What its images count in each pixel: of chains, nearly all are mutations.
    pub fn sample_name(self) -> &'static str {
        match self {
            Self::Mmlt => "samples and mutations",
            Self::Auto => "samples or mutations",
            _ => "samples",
        }
    }
}

impl std::str::FromStr for IntegratorKind {
    type Err = String;
    fn from_str(s: &str) -> Result<Self, String> {
        let known = || Self::names();
        Self::ALL.iter().chain(&[("auto", Self::Auto)]).find(|(n, _)| *n == s).map(|(_, k)| *k).ok_or_else(|| {
            let list = known().collect::<Vec<_>>().join(", ");
            match crate::diagnostics::nearest(s, known()) {
                Some(n) => format!("there is no integrator {s:?}; did you mean {n:?}? (known: {list})"),
                None => format!("there is no integrator {s:?} (known: {list})"),
            }
        })
    }
}
