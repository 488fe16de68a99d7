//! The coordinator: plans, leases, merges and stores; the farm's one source of truth.

pub mod blobs;
pub mod farm;
mod files;
pub mod ids;
pub mod job;
pub mod lease;
pub mod outcome;
pub mod registry;
pub mod store;
pub mod sync;
pub mod units;
