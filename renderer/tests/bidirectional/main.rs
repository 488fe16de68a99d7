//! Bidirectional path tracing against a slow oracle of path space, strategy by strategy.

#![allow(clippy::unwrap_used, clippy::panic, reason = "test helpers")]

mod chance;
#[path = "../common/mod.rs"]
mod common;
mod oracle;
mod scenes;
mod strategies;
mod weights;
