//! Vectors, frames, transforms, rounding-error bounds and pinned transcendental functions.
//!
//! Only glam's scalar types are used (`Vec2`, `Vec3`, `DVec3`, `DMat4`): its SIMD types (`Vec3A`, `Vec4`, `Quat`, `Affine3A`)
//! change bits when the compiler may use FMA, and the same job must give the same bytes on every x86-64 machine.

mod anchor;
pub mod fns;
mod frame;
mod ray;
pub mod rounding;
mod transform;

pub use anchor::Anchor;
pub use fns::*;
pub use frame::Frame;
pub use glam::{DAffine3, DMat3, DMat4, DQuat, DVec2, DVec3, Vec2, Vec3};
pub use ray::Ray;
pub use transform::Transform;

/// Square of `x`.
#[inline]
pub fn sqr(x: f32) -> f32 {
    x * x
}

/// `sqrt(max(x, 0))`: for radicands that rounding can push below zero.
#[inline]
pub fn safe_sqrt(x: f32) -> f32 {
    x.max(0.0).sqrt()
}

/// Linear interpolation `(1 - t) a + t b`.
#[inline]
pub fn lerp(t: f32, a: f32, b: f32) -> f32 {
    (1.0 - t) * a + t * b
}
