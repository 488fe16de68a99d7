//! Shapes: triangle meshes, spheres and disks, placed in the world; what is known at a hit.

mod mesh;

pub use mesh::{Mesh, MeshError};

use crate::math::{Ray, Transform, Vec2, Vec3};

/// Index of a mesh in [`Geometry::meshes`].
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct MeshId(pub u32);
/// Index of an object in [`Geometry::objects`].
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct ObjectId(pub u32);

/// What an object is, in its own space.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Shape {
    /// Triangles.
    Mesh(MeshId),
    /// The unit sphere around the origin; its transform may scale it uniformly only.
    Sphere,
    /// The unit disk in the xy plane around the origin, normal +z; any non-singular transform.
    Disk,
}

/// A shape in the world.
#[derive(Clone, Copy, Debug)]
pub struct Object {
    /// What it is.
    pub shape: Shape,
    /// Object to world.
    pub to_world: Transform,
    /// Turns its normals (geometric and shading) round.
    pub flip_normals: bool,
}

/// All objects of a scene.
#[derive(Clone, Debug, Default)]
pub struct Geometry {
    /// Shared by the objects that instance them.
    pub meshes: Vec<Mesh>,
    /// In the order of the scene description.
    pub objects: Vec<Object>,
}

/// Where a ray met an object. Independent of the acceleration tree: of equal `t`, the smaller (object, primitive) wins.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Hit {
    /// Ray parameter.
    pub t: f32,
    /// The object.
    pub object: ObjectId,
    /// Triangle index within the object's mesh; 0 for other shapes.
    pub primitive: u32,
    /// Barycentric weights of the triangle's second and third corner; for other shapes unused.
    pub b: [f32; 2],
}

/// What shading needs to know at a hit; world space.
#[derive(Clone, Copy, Debug)]
pub struct Interaction {
    /// The point, computed from the surface (not from `t`).
    pub p: Vec3,
    /// Absolute error bound of each coordinate of `p`.
    pub p_error: Vec3,
    /// Unit geometric normal: triangle winding (counter-clockwise = outward), sphere outward, disk +z; mirrored transforms keep
    /// "outward"; then `flip_normals`; turned into the hemisphere of `ns` if vertex normals disagree with the winding.
    pub ng: Vec3,
    /// Unit shading normal (interpolated, or `ng`).
    pub ns: Vec3,
    /// Texture coordinates.
    pub uv: Vec2,
    /// Derivative of `p` with `u`: the shading tangent; never zero.
    pub dpdu: Vec3,
    /// Derivative of `p` with `v`; never zero.
    pub dpdv: Vec3,
    /// The object.
    pub object: ObjectId,
    /// Triangle index within the object's mesh.
    pub primitive: u32,
}

impl Interaction {
    /// A ray that leaves the point in direction `w` (any side), clear of the surface.
    #[inline]
    pub fn spawn_ray(&self, w: Vec3) -> Ray {
        Ray::new(crate::math::rounding::offset_ray_origin(self.p, self.p_error, self.ng, w), w)
    }
}

/// A point drawn on an object's surface; world space.
#[derive(Clone, Copy, Debug)]
pub struct SurfaceSample {
    /// The point.
    pub p: Vec3,
    /// Absolute error bound of `p`.
    pub p_error: Vec3,
    /// Unit geometric normal, as in [`Interaction::ng`].
    pub ng: Vec3,
    /// Texture coordinates.
    pub uv: Vec2,
    /// Density with respect to surface area.
    pub pdf_area: f32,
}
