use super::Vec3;

/// A ray `o + t d`, `0 <= t < t_max`. Origins are already offset off their surface (`rounding::offset_ray_origin`),
/// so there is no minimal distance.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Ray {
    /// Origin, world space.
    pub o: Vec3,
    /// Direction; need not be of unit length. Negative zeros are canonicalised by [`Ray::new`].
    pub d: Vec3,
    /// Exclusive end of the ray's parameter interval.
    pub t_max: f32,
}

impl Ray {
    /// A ray without end.
    #[inline]
    pub fn new(o: Vec3, d: Vec3) -> Self {
        Self::segment(o, d, f32::INFINITY)
    }

    /// A ray that ends before `t_max`. `-0.0` components of `d` become `0.0`.
    #[inline]
    pub fn segment(o: Vec3, d: Vec3, t_max: f32) -> Self {
        Self { o, d: d + Vec3::ZERO, t_max }
    }

    /// The point at parameter `t`.
    #[inline]
    pub fn at(&self, t: f32) -> Vec3 {
        self.o + self.d * t
    }
}
