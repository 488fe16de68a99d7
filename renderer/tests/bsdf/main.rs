//! Every BSDF of `bsdf::roster()`: what it draws against what it says it draws, energy, reciprocity, grazing directions.

#![allow(clippy::disallowed_methods, reason = "the bits of expectations need not agree between machines")]

mod chi2;
mod furnace;
mod grazing;
mod quadrature;
mod reciprocity;
mod shading;

use renderer::math::{Vec3, sin_cos};
use renderer::sampling::mix64;

/// Chance of a false alarm of each test function here, all its comparisons together.
const SIGNIFICANCE: f64 = 0.01;

/// Unit vector at `theta` degrees from +z and azimuth `phi` in radians.
fn direction(theta: f32, phi: f32) -> Vec3 {
    let ((sin_t, cos_t), (sin_p, cos_p)) = (sin_cos(theta.to_radians()), sin_cos(phi));
    Vec3::new(sin_t * cos_p, sin_t * sin_p, cos_t)
}

/// Directions to look from: along the normal, slanting, grazing, and from below.
fn views() -> Vec<Vec3> {
    let angles =
        [(0.0, 0.0), (30.0, 0.4), (60.0, 2.1), (85.0, 4.0), (89.0, 5.5), (91.0, 1.0), (120.0, 3.0), (165.0, 0.2)];
    angles.iter().map(|&(theta, phi)| direction(theta, phi)).collect()
}

/// Key of an example's random numbers: other entries of the roster don't change it.
fn key(name: &str) -> u64 {
    name.bytes().fold(0, |key, byte| mix64(key ^ u64::from(byte)))
}
