//! Transcendental functions with pinned bits: the pure-Rust port of musl's (`libm`, version fixed in the workspace).
//!
//! std's versions call the platform's libm, whose last bits differ between machines; clippy bans them in this crate.

use std::f32::consts::PI;

/// 1 / pi.
pub const INV_PI: f32 = std::f32::consts::FRAC_1_PI;
/// 1 / (2 pi).
pub const INV_2PI: f32 = 0.5 * std::f32::consts::FRAC_1_PI;
/// 1 / (4 pi).
pub const INV_4PI: f32 = 0.25 * std::f32::consts::FRAC_1_PI;
/// The largest f32 below one: uniform variates are clamped to it.
pub const ONE_MINUS_EPSILON: f32 = 1.0 - f32::EPSILON / 2.0;

macro_rules! pinned {
    ($($(#[$doc:meta])* $name:ident, $name64:ident = $f32:ident, $f64:ident;)*) => {$(
        $(#[$doc])*
        #[inline]
        pub fn $name(x: f32) -> f32 { libm::$f32(x) }
        $(#[$doc])*
        #[inline]
        pub fn $name64(x: f64) -> f64 { libm::$f64(x) }
    )*};
}

pinned! {
    /// Sine of an angle in radians.
    sin, sin64 = sinf, sin;
    /// Cosine of an angle in radians.
    cos, cos64 = cosf, cos;
    /// Tangent of an angle in radians.
    tan, tan64 = tanf, tan;
    /// Arc tangent.
    atan, atan64 = atanf, atan;
    /// Natural exponential.
    exp, exp64 = expf, exp;
    /// Natural logarithm.
    ln, ln64 = logf, log;
    /// `ln(1 + x)`.
    ln_1p, ln_1p64 = log1pf, log1p;
    /// `exp(x) - 1`.
    exp_m1, exp_m164 = expm1f, expm1;
    /// Error function, `2 / sqrt(pi)` times the integral of `exp(-t^2)` from 0 to `x`.
    erf, erf64 = erff, erf;
}

/// Arc cosine; the argument is clamped to [-1, 1].
#[inline]
pub fn safe_acos(x: f32) -> f32 {
    libm::acosf(x.clamp(-1.0, 1.0))
}

/// Arc sine; the argument is clamped to [-1, 1].
#[inline]
pub fn safe_asin(x: f32) -> f32 {
    libm::asinf(x.clamp(-1.0, 1.0))
}

/// Angle of the vector (x, y) in (-pi, pi].
#[inline]
pub fn atan2(y: f32, x: f32) -> f32 {
    libm::atan2f(y, x)
}

/// `x` to the power `y`.
#[inline]
pub fn pow(x: f32, y: f32) -> f32 {
    libm::powf(x, y)
}

/// `x` to the power `y` in double precision.
#[inline]
pub fn pow64(x: f64, y: f64) -> f64 {
    libm::pow(x, y)
}

/// Sine and cosine of an angle in radians.
#[inline]
pub fn sin_cos(x: f32) -> (f32, f32) {
    libm::sincosf(x)
}

/// Degrees to radians.
#[inline]
pub fn radians(degrees: f32) -> f32 {
    degrees * (PI / 180.0)
}
