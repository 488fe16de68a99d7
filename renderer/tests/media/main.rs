//! Participating media against closed forms, quadrature and tables.

#![allow(clippy::unwrap_used, clippy::panic, reason = "test helpers")]

mod analytic;
mod bidirectional;
#[path = "../common/mod.rs"]
mod common;
mod extremes;
mod flight;
mod furnace;
mod layers;
mod scenes;
