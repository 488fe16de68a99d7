//! Random numbers, low-discrepancy points, warps and discrete distributions.

mod primary;
mod rng;
mod sampler;
mod sobol;
mod table;
pub mod warp;

pub use primary::{PrimarySpace, PrimaryStream, StepSizes, Stream};
pub use rng::{IndependentSampler, hash_words, mix64};
pub use sampler::Sampler;
pub use sobol::SobolSampler;
pub use table::{Cell1D, Cell2D, Choice, Discrete, Distribution1D, Distribution2D};
