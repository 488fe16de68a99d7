//! Points on a triangle of an object: interpolation of its corners, normals and texture coordinates, in the world.

use super::{Hit, Interaction, Mesh, Object};
use crate::math::rounding::gamma;
use crate::math::{DVec3, Frame, Transform, Vec2, Vec3};

/// A world-space point of a triangle and the surface around it.
#[derive(Clone, Copy, Debug)]
pub(super) struct SurfacePoint {
    pub p: Vec3,
    pub p_error: Vec3,
    pub ng: Vec3,
    pub frame: Frame,
    pub uv: Vec2,
    pub dpdu: Vec3,
    pub dpdv: Vec3,
}

impl SurfacePoint {
    /// What a ray that hits it sees.
    #[inline(always)]
    pub fn seen_as(self, hit: &Hit) -> Interaction {
        let Self { p, p_error, ng, frame, uv, dpdu, dpdv } = self;
        Interaction { p, p_error, ng, frame, uv, dpdu, dpdv, object: hit.object, primitive: hit.primitive }
    }
}

/// What is the same all over a triangle in the world.
#[derive(Clone, Copy, Debug)]
struct Face {
    /// Unit normal: by winding, outward under mirrored maps too, then as the object turns it.
    winding: Vec3,
    /// Texture coordinates of the corners.
    uvs: [Vec2; 3],
    /// Of the position with the texture coordinates; none where these make no map.
    derivatives: Option<(Vec3, Vec3)>,
}

impl Face {
    /// For the corners `corners` of the object's mesh, with edges `e1` and `e2` in the world.
    #[inline]
    fn new(mesh: &Mesh, object: &Object, corners: [usize; 3], e1: DVec3, e2: DVec3) -> Self {
        let turn = object.flip_normals != object.to_world.flips_handedness();
        let winding = normal_of(e1, e2);
        let winding = if turn { -winding } else { winding };
        let uvs = if mesh.uvs.is_empty() { [Vec2::ZERO, Vec2::X, Vec2::Y] } else { corners.map(|i| mesh.uvs[i]) };
        Self { winding, uvs, derivatives: derivatives(uvs, e1, e2) }
    }

    /// The derivatives of the position where the normal is `ng`.
    #[inline]
    fn tangents(&self, ng: Vec3) -> (Vec3, Vec3) {
        self.derivatives.unwrap_or_else(|| {
            let frame = Frame::from_normal(ng);
            (frame.s, frame.t)
        })
    }

    /// The shading frame without vertex normals.
    #[inline]
    fn flat_frame(&self) -> Frame {
        Frame::from_normal_tangent(self.winding, self.tangents(self.winding).0)
    }

    /// The point `p` with weights `b`; `ns` is its interpolated normal, `flat` the frame where there is none.
    #[inline(always)]
    fn point(
        &self,
        (p, p_error): (Vec3, Vec3),
        b: [f32; 2],
        ns: Option<Vec3>,
        flat: impl Fn() -> Frame,
    ) -> SurfacePoint {
        let turned = ns.is_some_and(|ns| ns.dot(self.winding) < 0.0);
        let ng = if turned { -self.winding } else { self.winding };
        let uv = self.uvs[0] * (1.0 - b[0] - b[1]) + self.uvs[1] * b[0] + self.uvs[2] * b[1];
        let (dpdu, dpdv) = self.tangents(ng);
        let frame = ns.map_or_else(flat, |ns| Frame::from_normal_tangent(ns, dpdu));
        SurfacePoint { p, p_error, ng, frame, uv, dpdu, dpdv }
    }
}

/// A triangle of an object in world space, with all that does not depend on the point worked out beforehand.
#[derive(Clone, Copy, Debug)]
pub(super) struct Facet {
    corner: DVec3,
    edges: [DVec3; 2],
    face: Face,
    frame: Frame,
}

impl Facet {
    /// For a triangle of `object`, whose transform is the identity.
    pub fn new(mesh: &Mesh, object: &Object, triangle: u32) -> Self {
        let corners = mesh.triangles[triangle as usize].map(|i| i as usize);
        let [p0, p1, p2] = corners.map(|i| mesh.positions[i].as_dvec3());
        let edges = [p1 - p0, p2 - p0];
        let face = Face::new(mesh, object, corners, edges[0], edges[1]);
        Self { corner: p0, edges, face, frame: face.flat_frame() }
    }

    /// What [`at`] gives.
    #[inline(always)]
    pub fn at(&self, mesh: &Mesh, object: &Object, triangle: u32, b: [f32; 2]) -> SurfacePoint {
        let p = (self.corner + self.edges[0] * f64::from(b[0]) + self.edges[1] * f64::from(b[1])).as_vec3();
        let ns = if mesh.normals.is_empty() {
            None
        } else {
            shading_normal(mesh, object, mesh.triangles[triangle as usize].map(|i| i as usize), b)
        };
        self.face.point((p, rounding(p)), b, ns, || self.frame)
    }
}

/// The point with barycentric weights `b` (of the second and third corner) of `triangle`.
///
/// Computed in double precision: an affine combination of the corners lies in their plane to 1e-16, so that the only error of `p`
/// is its rounding to f32 (and, for an instance, the rounding of the ray origin that will be mapped back to object space).
pub(super) fn at(mesh: &Mesh, object: &Object, triangle: u32, b: [f32; 2]) -> SurfacePoint {
    let corners = mesh.triangles[triangle as usize].map(|i| i as usize);
    let [p0, p1, p2] = corners.map(|i| mesh.positions[i].as_dvec3());
    let [b1, b2] = b.map(f64::from);
    let local = p0 + (p1 - p0) * b1 + (p2 - p0) * b2;
    // Place the point and the edges in the world.
    let placed = !object.to_world.is_identity();
    let (p, e1, e2, p_error) = if placed {
        let m = object.to_world.matrix();
        let p = m.transform_point3(local);
        (
            p,
            m.matrix3 * (p1 - p0),
            m.matrix3 * (p2 - p0),
            rounding(p.as_vec3()) + mapped_rounding(&object.to_world, local),
        )
    } else {
        (local, p1 - p0, p2 - p0, rounding(local.as_vec3()))
    };
    let face = Face::new(mesh, object, corners, e1, e2);
    face.point((p.as_vec3(), p_error), b, shading_normal(mesh, object, corners, b), || face.flat_frame())
}

/// Area of a triangle in the world.
pub(super) fn area(mesh: &Mesh, object: &Object, triangle: u32) -> f32 {
    let [p0, p1, p2] = mesh.triangles[triangle as usize].map(|i| mesh.positions[i as usize].as_dvec3());
    let m = object.to_world.matrix().matrix3;
    (0.5 * (m * (p1 - p0)).cross(m * (p2 - p0)).length()) as f32
}

/// Bound of the error of a double-precision point that was rounded to `p`.
#[inline]
pub(super) fn rounding(p: Vec3) -> Vec3 {
    p.abs() * gamma(2)
}

/// Bound of the world-space error made when a ray origin near the image of `local` is mapped to object space and rounded there.
fn mapped_rounding(to_world: &Transform, local: DVec3) -> Vec3 {
    let m = to_world.matrix().matrix3;
    let l = local.abs() * f64::from(gamma(2));
    (m.x_axis.abs() * l.x + m.y_axis.abs() * l.y + m.z_axis.abs() * l.z).as_vec3()
}

/// The unit vector along `e1 x e2`; some unit vector when the triangle has no area.
#[inline]
fn normal_of(e1: DVec3, e2: DVec3) -> Vec3 {
    let n = e1.cross(e2);
    let length2 = n.length_squared();
    if length2 > 1e-280 && length2 < 1e280 { (n * (1.0 / length2.sqrt())).as_vec3() } else { scaled_normal(e1, e2) }
}

/// The same for edges so short or long that their products leave the range of numbers.
#[cold]
fn scaled_normal(e1: DVec3, e2: DVec3) -> Vec3 {
    let scale = e1.abs().max_element().max(e2.abs().max_element());
    if !(scale > 0.0) {
        return Vec3::Z;
    }
    let n = (e1 / scale).cross(e2 / scale);
    let length = n.length();
    if length > 0.0 { (n / length).as_vec3() } else { Frame::from_normal((e1 + e2).normalize_or(DVec3::X).as_vec3()).s }
}

/// The interpolated vertex normal in the world; `None` without vertex normals and where they are useless (zero, NaN).
fn shading_normal(mesh: &Mesh, object: &Object, corners: [usize; 3], b: [f32; 2]) -> Option<Vec3> {
    if mesh.normals.is_empty() {
        return None;
    }
    let [n0, n1, n2] = corners.map(|i| mesh.normals[i]);
    let n = object.to_world.normal(n0 * (1.0 - b[0] - b[1]) + n1 * b[0] + n2 * b[1]).as_dvec3();
    let length = n.length();
    let n = (n * (1.0 / length)).as_vec3();
    (length > 0.0 && n.is_finite()).then_some(if object.flip_normals { -n } else { n })
}

/// `dp/du` and `dp/dv` of the linear map with the given texture coordinates at the corners; `None` where they make no map.
fn derivatives(uvs: [Vec2; 3], e1: DVec3, e2: DVec3) -> Option<(Vec3, Vec3)> {
    let (d1, d2) = ((uvs[1] - uvs[0]).as_dvec2(), (uvs[2] - uvs[0]).as_dvec2());
    let det = d1.x * d2.y - d1.y * d2.x;
    let scale = 1.0 / det;
    let dpdu = ((e1 * d2.y - e2 * d1.y) * scale).as_vec3();
    let dpdv = ((e2 * d1.x - e1 * d2.x) * scale).as_vec3();
    let usable = |v: Vec3| v.length_squared() > 0.0 && v.length_squared() < f32::INFINITY;
    (det != 0.0 && usable(dpdu) && usable(dpdv) && dpdu.cross(dpdv) != Vec3::ZERO).then_some((dpdu, dpdv))
}
