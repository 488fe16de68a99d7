//! The elementary maps that scene files compose, in double precision.

use crate::math::{DAffine3, DMat3, DVec3, cos64, sin64};

/// Rotation by `degrees` about `axis` (counter-clockwise seen from its tip); `None` for an axis without length.
pub(super) fn rotate(axis: DVec3, degrees: f64) -> Option<DAffine3> {
    let a = axis.try_normalize()?;
    let radians = degrees * (std::f64::consts::PI / 180.0);
    let (s, c) = (sin64(radians), cos64(radians));
    // Rodrigues: c I + s [a]x + (1 - c) a a^T, by columns.
    let outer = |i: usize| a * (a[i] * (1.0 - c));
    let m = DMat3::from_cols(
        outer(0) + DVec3::new(c, s * a.z, -s * a.y),
        outer(1) + DVec3::new(-s * a.z, c, s * a.x),
        outer(2) + DVec3::new(s * a.y, -s * a.x, c),
    );
    Some(DAffine3::from_mat3(m))
}

/// Mitsuba's look-at: +Z points from `origin` to `target`, +Y is near `up`, +X to the left; `None` when they don't span a frame.
pub(super) fn look_along_z(origin: DVec3, target: DVec3, up: DVec3) -> Option<DAffine3> {
    let forward = (target - origin).try_normalize()?;
    let left = up.cross(forward).try_normalize()?;
    let m = DMat3::from_cols(left, forward.cross(left), forward);
    Some(DAffine3::from_mat3_translation(m, origin))
}

/// Half a turn about Y: between a camera that looks along +Z with +X to the left and one along -Z with +X to the right.
pub(super) fn half_turn() -> DAffine3 {
    DAffine3::from_scale(DVec3::new(-1.0, 1.0, -1.0))
}

/// The map with its axes made of unit length; `None` when one has no length.
pub(super) fn without_scale(m: DAffine3) -> Option<DAffine3> {
    let axes = [m.matrix3.x_axis, m.matrix3.y_axis, m.matrix3.z_axis].map(DVec3::try_normalize);
    let [Some(x), Some(y), Some(z)] = axes else { return None };
    Some(DAffine3::from_mat3_translation(DMat3::from_cols(x, y, z), m.translation))
}

/// Whether the linear part is a rotation, reflection and uniform scale, within the rounding that a scene allows.
pub(super) fn is_similarity(m: &DMat3) -> bool {
    let scale = m.x_axis.length_squared();
    let near = |a: f64, b: f64| (a - b).abs() <= 1e-5 * scale;
    near(m.y_axis.length_squared(), scale)
        && near(m.z_axis.length_squared(), scale)
        && [m.x_axis.dot(m.y_axis), m.y_axis.dot(m.z_axis), m.z_axis.dot(m.x_axis)].iter().all(|&d| near(d, 0.0))
}
