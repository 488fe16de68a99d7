//! The disk (in the world: an ellipse): intersection and surface points, in double precision.

use super::Object;
use super::surface::{SurfacePoint, rounding};
use crate::math::{DVec3, Frame, Ray, Vec2, Vec3, atan2, sin_cos};
use std::f32::consts::PI;

/// A disk in the world: the points `centre + x a + y b` with `x^2 + y^2 <= 1`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct WorldDisk {
    /// Centre.
    pub centre: Vec3,
    /// Half axes.
    pub axes: [Vec3; 2],
}

impl WorldDisk {
    /// Where `object` has its disk.
    pub fn of(object: &Object) -> Self {
        let m = object.to_world.matrix();
        Self { centre: m.translation.as_vec3(), axes: [m.matrix3.x_axis.as_vec3(), m.matrix3.y_axis.as_vec3()] }
    }

    /// Area: pi times that of the half axes' parallelogram.
    pub(super) fn area(&self) -> f32 {
        let [a, b] = self.axes.map(Vec3::as_dvec3);
        (std::f64::consts::PI * a.cross(b).length()) as f32
    }

    /// Parameter at which a ray meets the disk, in (0, `t_max`].
    #[inline]
    pub fn intersect(&self, ray: &Ray) -> Option<f32> {
        let n = self.axes[0].as_dvec3().cross(self.axes[1].as_dvec3());
        let o = ray.o.as_dvec3() - self.centre.as_dvec3();
        let t = -n.dot(o) / n.dot(ray.d.as_dvec3());
        let t32 = t as f32;
        if !(t > 0.0 && t32 <= ray.t_max && t32.is_finite()) {
            return None;
        }
        let (x, y) = self.coordinates(o + ray.d.as_dvec3() * t);
        (x * x + y * y <= 1.0).then_some(t32)
    }

    /// Coordinates (x, y) of a point of the plane, given relative to the centre.
    #[inline]
    fn coordinates(&self, q: DVec3) -> (f64, f64) {
        let [a, b] = self.axes.map(Vec3::as_dvec3);
        let (aa, ab, bb) = (a.dot(a), a.dot(b), b.dot(b));
        let (qa, qb) = (q.dot(a), q.dot(b));
        let inv = 1.0 / (aa * bb - ab * ab);
        ((qa * bb - qb * ab) * inv, (qb * aa - qa * ab) * inv)
    }
}

/// The surface point that a ray meets at about parameter `t`.
pub(super) fn at_hit(object: &Object, ray: &Ray, t: f32) -> SurfacePoint {
    let disk = WorldDisk::of(object);
    let q = ray.o.as_dvec3() + ray.d.as_dvec3() * f64::from(t) - disk.centre.as_dvec3();
    let (x, y) = disk.coordinates(q);
    at(object, x, y)
}

/// The surface point with object-space coordinates (x, y). u = radius, v = azimuth / 2 pi (Mitsuba 3, `disk.cpp`).
pub(super) fn at(object: &Object, x: f64, y: f64) -> SurfacePoint {
    let disk = WorldDisk::of(object);
    let [a, b] = disk.axes.map(Vec3::as_dvec3);
    let p = (disk.centre.as_dvec3() + a * x + b * y).as_vec3();
    // The normal is the image of +z: on the side of a x b also under mirrored maps, where the map of +z lies on the other side.
    let n = a.cross(b).normalize_or(DVec3::Z).as_vec3();
    let turn = object.flip_normals != object.to_world.flips_handedness();
    let ng = if turn { -n } else { n };
    let (x, y) = (x as f32, y as f32);
    let radius = (x * x + y * y).sqrt();
    let phi = atan2(y, x) / (2.0 * PI);
    let uv = Vec2::new(radius, if phi < 0.0 { phi + 1.0 } else { phi });
    let (dpdu, dpdv) = if radius > 0.0 {
        let (cos, sin) = (x / radius, y / radius);
        (object.to_world.vector(Vec3::new(cos, sin, 0.0)), object.to_world.vector(Vec3::new(-y, x, 0.0) * (2.0 * PI)))
    } else {
        let frame = Frame::from_normal(ng);
        (frame.s, frame.t)
    };
    let frame = Frame::from_normal_tangent(ng, dpdu);
    SurfacePoint { p, p_error: rounding(p), ng, frame, uv, dpdu, dpdv }
}

/// Uniform point of the unit disk (Shirley and Chiu 1997, concentric map).
pub(super) fn uniform_point(u: Vec2) -> (f64, f64) {
    let o = u * 2.0 - Vec2::ONE;
    if o == Vec2::ZERO {
        return (0.0, 0.0);
    }
    let (r, theta) =
        if o.x.abs() > o.y.abs() { (o.x, PI / 4.0 * (o.y / o.x)) } else { (o.y, PI / 2.0 - PI / 4.0 * (o.x / o.y)) };
    let (sin, cos) = sin_cos(theta);
    (f64::from(r * cos), f64::from(r * sin))
}
