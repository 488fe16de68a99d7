use super::rounding::{gamma, offset_ray_origin};
use super::{Ray, Vec3};

/// A point where a ray starts or ends: on a surface, or in free space.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Anchor {
    /// The point, world space.
    pub p: Vec3,
    /// Absolute error bound of each coordinate of `p`.
    pub p_error: Vec3,
    /// Unit geometric normal of the surface; zero in free space.
    pub ng: Vec3,
}

impl Anchor {
    /// A point that lies on no surface (a camera, a point light, a point in a medium).
    #[inline]
    pub fn free(p: Vec3) -> Self {
        Self { p, p_error: Vec3::ZERO, ng: Vec3::ZERO }
    }

    /// Where rays in direction `w` begin: clear of the surface on the side of `w`.
    #[inline]
    pub fn start(&self, w: Vec3) -> Vec3 {
        offset_ray_origin(self.p, self.p_error, self.ng, w)
    }

    /// Where segments end that come from the side of `w`, from points whose coordinates differ by at most `distance`.
    ///
    /// A fixed share of the length is not enough to stay clear of the surface at the end, and too much elsewhere. So the end is
    /// moved along its normal by the error of the point, plus what the rounding of the direction and of the intersection test
    /// (relative to the distance) can move the ray across the surface there. Measured, gamma(2) is hardly enough and gamma(4) is.
    #[inline]
    pub fn end(&self, w: Vec3, distance: f32) -> Vec3 {
        offset_ray_origin(self.p, self.p_error + Vec3::splat(distance * gamma(6)), self.ng, w)
    }

    /// A ray without end in direction `w`, clear of the surface on the side of `w`.
    #[inline]
    pub fn ray(&self, w: Vec3) -> Ray {
        Ray::new(self.start(w), w)
    }

    /// The segment to `end` (parameter 0 to 1, not of unit length), clear of both surfaces on the sides that face each other.
    #[inline]
    pub fn segment_to(&self, end: &Anchor) -> Ray {
        let towards = end.p - self.p;
        let (o, q) = (self.start(towards), end.end(-towards, towards.abs().max_element()));
        Ray::segment(o, q - o, 1.0)
    }
}
