//! Comparing pictures: error measures, perceptual difference, and tests of whether two estimates agree.

pub mod exact;
pub mod flip;
pub mod map;
pub mod metrics;
pub mod pair;
pub mod significance;
