//! Sampling a sphere by the solid angle it covers.

use crate::math::rounding::gamma;
use crate::math::{DVec3, Frame, Vec2, Vec3, sin_cos};
use std::f64::consts::PI;

/// A sphere in the world.
#[derive(Clone, Copy, Debug)]
pub(super) struct Sphere {
    pub centre: Vec3,
    pub radius: f32,
}

/// The near point of a sphere in a sampled direction.
pub(super) struct SphereSample {
    pub wi: Vec3,
    pub dist: f32,
    /// The point, from the centre: on the sphere to f64 accuracy (a normal rounded to f32 would put it beside).
    pub offset: DVec3,
    /// Per solid angle.
    pub pdf: f32,
}

/// The cone that a sphere covers, seen from a point outside. In f64: its parts differ by many orders of magnitude far away, and
/// cancel near the surface.
struct Cone {
    to_centre: DVec3,
    /// Squared distance of the centre.
    d2: f64,
    r2: f64,
    /// `1 - cos` of its half angle.
    omc_max: f64,
}

impl Cone {
    fn pdf(&self) -> f64 {
        1.0 / (2.0 * PI * self.omc_max)
    }
}

impl Sphere {
    fn cone(&self, p: Vec3) -> Option<Cone> {
        let to_centre = self.centre.as_dvec3() - p.as_dvec3();
        let d2 = to_centre.length_squared();
        let r = f64::from(self.radius);
        let r2 = r * r;
        // A point of the sphere itself may lie a rounding error outside, yet see its inner side.
        let rounding = f64::from(gamma(16) * (p.abs().max_element() + self.centre.abs().max_element() + self.radius));
        if !(d2 > (r + rounding) * (r + rounding)) {
            return None;
        }
        let sin2_max = r2 / d2;
        let omc_max = sin2_max / (1.0 + (1.0 - sin2_max).sqrt());
        Some(Cone { to_centre, d2, r2, omc_max })
    }

    /// Density of [`Sphere::sample`] per solid angle, the same for all directions that meet the sphere; `None` from inside.
    pub fn pdf(&self, p: Vec3) -> Option<f32> {
        self.cone(p).map(|cone| cone.pdf() as f32)
    }

    /// Samples the visible side uniformly in solid angle; `None` from inside.
    pub fn sample(&self, p: Vec3, u: Vec2) -> Option<SphereSample> {
        let cone = self.cone(p)?;
        // Choose a direction in the cone.
        let omc = f64::from(u.x) * cone.omc_max;
        let sin2 = omc * (2.0 - omc);
        let cos = 1.0 - omc;
        let (sin_phi, cos_phi) = sin_cos(std::f32::consts::TAU * u.y);
        let d = cone.d2.sqrt();
        let frame = Frame::from_normal((cone.to_centre / d).as_vec3());
        let sin = sin2.sqrt();
        let wi = frame.s.as_dvec3() * (sin * f64::from(cos_phi))
            + frame.t.as_dvec3() * (sin * f64::from(sin_phi))
            + cone.to_centre * (cos / d);
        // Find the near intersection; t^2 - 2 d cos t + (d^2 - r^2) = 0, its smaller root without cancellation.
        let root = (cone.r2 - cone.d2 * sin2).max(0.0).sqrt();
        let dist = (cone.d2 - cone.r2) / (d * cos + root);
        let offset = (wi * dist - cone.to_centre).normalize() * f64::from(self.radius);
        Some(SphereSample { wi: wi.normalize().as_vec3(), dist: dist as f32, offset, pdf: cone.pdf() as f32 })
    }
}
