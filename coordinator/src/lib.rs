//! The coordinator: plans, leases, merges and stores; the farm's one source of truth.

pub mod blobs;
mod convert;
pub mod farm;
mod files;
mod grpc;
mod http;
mod hub;
pub mod ids;
mod image;
pub mod job;
pub mod lease;
mod merge;
mod merging;
mod mismatch;
pub mod outcome;
pub mod registry;
mod serve;
pub mod store;
mod submit;
pub mod sync;
pub mod units;

pub use farm::Tuning;
pub use serve::{Config, Coordinator, ServeError};
