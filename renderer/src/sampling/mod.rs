//! Random numbers, low-discrepancy points, warps and discrete distributions.

mod sampler;

pub use sampler::Sampler;
