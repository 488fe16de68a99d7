//! The lightfarm renderer: scene in, units out; the whole of the physics.
//!
//! Layers import only downward (`tests/layers.rs` enforces it):
//! `math, sampling -> spectrum -> geometry, accel -> texture -> bsdf -> medium -> light, camera -> scene -> path -> film -> integrator -> job`.
//! The crate knows no network and no clock: a unit's result is a pure function of (scene digest, settings, plan, unit).

pub mod accel;
pub mod bsdf;
pub mod camera;
pub mod diagnostics;
pub mod film;
pub mod geometry;
pub mod integrator;
pub mod job;
pub mod light;
pub mod math;
pub mod medium;
pub mod path;
pub mod sampling;
pub mod scene;
pub mod spectrum;
pub mod texture;

/// Fingerprint of everything that decides a unit's bits: workers and coordinators refuse each other when it differs.
pub const FINGERPRINT: &str = concat!("lightfarm-", env!("CARGO_PKG_VERSION"), "-units-3");
