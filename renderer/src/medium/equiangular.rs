//! Points of a ray chosen by how near they are to a lamp.

use crate::math::{Vec3, atan2, sin_cos};

/// Distances along a ray without end with a density in proportion to `1 / r^2`, r the distance from a point: equal angles seen from
/// there (Kulla and Fajardo 2012, "Importance Sampling Techniques for Path Tracing in Participating Media").
#[derive(Clone, Copy, Debug)]
pub struct Equiangular {
    /// Where the ray comes nearest to the point, from its origin on.
    nearest: f32,
    /// How near that is.
    height: f32,
    /// The angle that the ray takes up, seen from the point.
    angle: f32,
}

impl Equiangular {
    /// For the ray from `o` in the unit direction `d`; `None` when it passes through the point, as rays hardly ever do.
    #[inline]
    pub fn new(o: Vec3, d: Vec3, point: Vec3) -> Option<Self> {
        let towards = point - o;
        let height = d.cross(towards).length();
        let nearest = d.dot(towards);
        let angle = atan2(height, -nearest);
        (height > 0.0 && height.is_finite() && angle > 0.0).then_some(Self { nearest, height, angle })
    }

    /// Draws a distance: `u` in [0, 1).
    #[inline]
    pub fn sample(&self, u: f32) -> f32 {
        // The angle from straight ahead, all of it at the origin.
        let (sin, cos) = sin_cos(self.angle * (1.0 - u));
        (self.nearest + self.height * (cos / sin)).max(0.0)
    }

    /// Density per length of the distance `t`.
    #[inline]
    pub fn pdf(&self, t: f32) -> f32 {
        let ahead = t - self.nearest;
        let r2 = self.height * self.height + ahead * ahead;
        self.height / (r2 * self.angle)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::exp64;

    #[test]
    fn distances_follow_the_density() {
        let o = Vec3::new(0.3, -1.0, 2.0);
        for point in [Vec3::ZERO, Vec3::new(0.31, 5.0, 2.0), Vec3::new(0.3, -7.0, 2.5), Vec3::new(900.0, 0.0, 0.0)] {
            let e = Equiangular::new(o, Vec3::Y, point).unwrap();
            // The distribution function, by quadrature of the density in the logarithm of the distance: it must be u at sample(u).
            let (low, n) = (1e-6f64, 400_000);
            for u in [0.01f32, 0.2, 0.5, 0.9, 0.999] {
                let t = f64::from(e.sample(u));
                let range = libm::log(t.max(2.0 * low) / low);
                let at = |i: i32| low * exp64((f64::from(i) + 0.5) / f64::from(n) * range);
                let sum: f64 = (0..n).map(|i| f64::from(e.pdf(at(i) as f32)) * at(i)).sum();
                let below = sum * range / f64::from(n) + low * f64::from(e.pdf(0.0));
                assert!((below - f64::from(u)).abs() < 2e-4, "{point}, u {u}, t {t}: {below}");
            }
        }
    }

    #[test]
    fn rays_through_the_point_are_refused_and_extremes_stay_in_range() {
        assert!(Equiangular::new(Vec3::ZERO, Vec3::Y, Vec3::Y * 3.0).is_none());
        assert!(Equiangular::new(Vec3::ZERO, Vec3::Y, Vec3::ZERO).is_none());
        for point in [Vec3::new(1e-20, 1.0, 0.0), Vec3::new(1e15, -1e15, 0.0), Vec3::new(1e-3, -1e15, 0.0)] {
            let Some(e) = Equiangular::new(Vec3::ZERO, Vec3::Y, point) else { continue };
            for u in [0.0, 0.5, crate::math::ONE_MINUS_EPSILON] {
                assert!(e.sample(u) >= 0.0 && e.pdf(e.sample(u)) >= 0.0, "{point}: {} {}", e.sample(u), e.pdf(1.0));
            }
        }
    }
}
