use super::rounding::gamma;
use super::{DAffine3, DMat3, DMat4, DVec3, Vec3};

/// An affine map with its inverse; composed in f64, applied in f32.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Transform {
    m: [Vec3; 4],
    inv: [Vec3; 4],
    flips: bool,
    /// Told in one word, since every hit asks.
    identity: bool,
}

/// Columns of the identity.
const IDENTITY: [Vec3; 4] = [Vec3::X, Vec3::Y, Vec3::Z, Vec3::ZERO];

impl Transform {
    /// The identity.
    pub const IDENTITY: Self = Self { m: IDENTITY, inv: IDENTITY, flips: false, identity: true };

    /// From an affine map; `None` when it is singular or not finite.
    pub fn new(a: DAffine3) -> Option<Self> {
        let det = a.matrix3.determinant();
        if !a.is_finite() || !(det.abs() > 0.0) {
            return None;
        }
        let inv = a.inverse();
        let columns =
            |a: &DAffine3| [a.matrix3.x_axis, a.matrix3.y_axis, a.matrix3.z_axis, a.translation].map(DVec3::as_vec3);
        let (m, inv) = (columns(&a), columns(&inv));
        let t = Self { m, inv, flips: det < 0.0, identity: m == IDENTITY && inv == IDENTITY };
        (t.m.iter().chain(&t.inv).all(|c| c.is_finite())).then_some(t)
    }

    /// From a column-vector matrix whose last row is (0, 0, 0, 1); `None` when it is singular, projective or not finite.
    pub fn from_matrix(m: DMat4) -> Option<Self> {
        (m.row(3).abs_diff_eq(glam::DVec4::W, 1e-9)).then(|| Self::new(DAffine3::from_mat4(m))).flatten()
    }

    /// The map exactly as it is applied, in double precision.
    #[inline]
    pub fn matrix(&self) -> DAffine3 {
        let [x, y, z, translation] = self.m.map(Vec3::as_dvec3);
        DAffine3 { matrix3: DMat3::from_cols(x, y, z), translation }
    }

    /// Whether it is the identity.
    #[inline]
    pub fn is_identity(&self) -> bool {
        self.identity
    }

    /// Whether the map mirrors (negative determinant).
    #[inline]
    pub fn flips_handedness(&self) -> bool {
        self.flips
    }

    /// The inverse map.
    #[inline]
    pub fn inverse(&self) -> Self {
        Self { m: self.inv, inv: self.m, ..*self }
    }

    /// Maps a point.
    #[inline]
    pub fn point(&self, p: Vec3) -> Vec3 {
        self.m[0] * p.x + self.m[1] * p.y + self.m[2] * p.z + self.m[3]
    }

    /// Bound of the absolute error of [`Transform::point`], given the absolute error `e` of `p`.
    #[inline]
    pub fn point_error(&self, p: Vec3, e: Vec3) -> Vec3 {
        let abs = |v: Vec3| self.m[0].abs() * v.x + self.m[1].abs() * v.y + self.m[2].abs() * v.z;
        abs(e) * (gamma(3) + 1.0) + (abs(p.abs()) + self.m[3].abs()) * gamma(3)
    }

    /// Maps a vector.
    #[inline]
    pub fn vector(&self, v: Vec3) -> Vec3 {
        self.m[0] * v.x + self.m[1] * v.y + self.m[2] * v.z
    }

    /// Maps a normal (inverse transpose); the result is not of unit length.
    #[inline]
    pub fn normal(&self, n: Vec3) -> Vec3 {
        Vec3::new(self.inv[0].dot(n), self.inv[1].dot(n), self.inv[2].dot(n))
    }

    /// Maps a point by the inverse map.
    #[inline]
    pub fn inverse_point(&self, p: Vec3) -> Vec3 {
        self.inv[0] * p.x + self.inv[1] * p.y + self.inv[2] * p.z + self.inv[3]
    }

    /// Maps a vector by the inverse map.
    #[inline]
    pub fn inverse_vector(&self, v: Vec3) -> Vec3 {
        self.inv[0] * v.x + self.inv[1] * v.y + self.inv[2] * v.z
    }
}
