//! Bounds of floating-point rounding errors and ray origins that clear them (Pharr, Jakob, Humphreys 2023, section 6.8).

use super::Vec3;

/// Half a unit in the last place: the relative error of one correctly rounded f32 operation.
pub const MACHINE_EPSILON: f32 = f32::EPSILON * 0.5;

/// Conservative bound `n e / (1 - n e)` of the relative error after `n` operations.
#[inline]
pub const fn gamma(n: i32) -> f32 {
    (n as f32 * MACHINE_EPSILON) / (1.0 - n as f32 * MACHINE_EPSILON)
}

/// Moves `p` along the geometric normal `ng`, to the side of `w`, out of the box `p +- p_error`, then one float further.
///
/// `p_error` is the absolute error of each coordinate of `p`; `ng` is a unit vector; `w` the direction that will be traced.
#[inline]
pub fn offset_ray_origin(p: Vec3, p_error: Vec3, ng: Vec3, w: Vec3) -> Vec3 {
    let d = ng.abs().dot(p_error);
    let offset = if w.dot(ng) < 0.0 { -ng * d } else { ng * d };
    let po = p + offset;
    Vec3::new(step_away(po.x, offset.x), step_away(po.y, offset.y), step_away(po.z, offset.z))
}

/// The float after `x` in the direction of `towards`. Without jumps, since directions are as good as random.
#[inline]
fn step_away(x: f32, towards: f32) -> f32 {
    let direction = i32::from(towards > 0.0) - i32::from(towards < 0.0);
    if x == 0.0 {
        return if direction == 0 { x } else { f32::from_bits(1).copysign(towards) };
    }
    // The bits of negative numbers count downwards.
    let sign = 1 - 2 * (x.to_bits() >> 31) as i32;
    f32::from_bits(x.to_bits().wrapping_add_signed(direction * sign))
}
