//! Shapes: triangle meshes, spheres and disks, placed in the world; what is known at a hit.

mod bake;
mod disk;
mod mesh;
pub mod sphere;
mod surface;
pub mod triangle;

pub use disk::WorldDisk;
pub use mesh::{Mesh, MeshError};

use crate::math::{Anchor, DVec3, Frame, Ray, Transform, Vec2, Vec3};
use surface::{Facet, SurfacePoint};

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

/// All objects of a scene. Call [`Geometry::bake`] once before the acceleration tree is built.
#[derive(Clone, Debug, Default)]
pub struct Geometry {
    /// Shared by the objects that instance them.
    pub meshes: Vec<Mesh>,
    /// In the order of the scene description.
    pub objects: Vec<Object>,
    /// By object, the triangles of small meshes in world space; as `bake` left them, so that they must stay where they are.
    facets: Vec<Vec<Facet>>,
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
    /// "outward"; then `flip_normals`; turned into the hemisphere of the shading normal if vertex normals disagree with the winding.
    pub ng: Vec3,
    /// The shading frame: around the unit shading normal (interpolated, or `ng`), x along `dpdu`.
    pub frame: Frame,
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
        self.anchor().ray(w)
    }

    /// Where rays start from or end at.
    #[inline]
    pub fn anchor(&self) -> Anchor {
        Anchor { p: self.p, p_error: self.p_error, ng: self.ng }
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
}

/// A sphere that contains a scene.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BoundingSphere {
    /// Centre, world space.
    pub centre: Vec3,
    /// Radius; 0 for an empty scene.
    pub radius: f32,
}

impl Geometry {
    /// Objects of these meshes.
    pub fn new(meshes: Vec<Mesh>, objects: Vec<Object>) -> Self {
        Self { meshes, objects, facets: Vec::new() }
    }

    /// What is known of the surface at `hit`, found with `ray`.
    pub fn interaction(&self, ray: &Ray, hit: &Hit) -> Interaction {
        let object = self.object(hit.object);
        match object.shape {
            Shape::Mesh(mesh) => {
                let mesh = self.mesh(mesh);
                // Apart from the others, which come through memory and are copied.
                match self.facet(hit.object, hit.primitive) {
                    Some(facet) => facet.at(mesh, object, hit.primitive, hit.b).seen_as(hit),
                    None => surface::at(mesh, object, hit.primitive, hit.b).seen_as(hit),
                }
            }
            Shape::Sphere => sphere::at_hit(object, ray, hit.t).seen_as(hit),
            Shape::Disk => disk::at_hit(object, ray, hit.t).seen_as(hit),
        }
    }

    #[inline]
    fn facet(&self, object: ObjectId, triangle: u32) -> Option<&Facet> {
        self.facets.get(object.0 as usize)?.get(triangle as usize)
    }

    /// The point with weights `b` of a mesh's triangle.
    #[inline]
    fn on_mesh(&self, mesh: MeshId, id: ObjectId, triangle: u32, b: [f32; 2]) -> SurfacePoint {
        let (mesh, object) = (self.mesh(mesh), self.object(id));
        match self.facet(id, triangle) {
            Some(facet) => facet.at(mesh, object, triangle, b),
            None => surface::at(mesh, object, triangle, b),
        }
    }

    /// A point uniform by area on one primitive: a triangle of a mesh object, or the whole sphere or disk.
    #[inline]
    pub fn sample_area(&self, id: ObjectId, primitive: u32, u: Vec2) -> SurfaceSample {
        let object = self.object(id);
        let s = match object.shape {
            Shape::Mesh(mesh) => {
                // Turk 1990, "Generating Random Points in Triangles".
                let root = u.x.sqrt();
                self.on_mesh(mesh, id, primitive, [root * (1.0 - u.y), root * u.y])
            }
            Shape::Sphere => sphere::at(object, sphere::uniform_direction(u)),
            Shape::Disk => {
                let (x, y) = disk::uniform_point(u);
                disk::at(object, x, y)
            }
        };
        SurfaceSample { p: s.p, p_error: s.p_error, ng: s.ng, uv: s.uv }
    }

    /// World-space area of a primitive.
    pub fn area(&self, id: ObjectId, primitive: u32) -> f32 {
        let object = self.object(id);
        match object.shape {
            Shape::Mesh(mesh) => surface::area(self.mesh(mesh), object, primitive),
            Shape::Sphere => {
                let r = f64::from(sphere::world(object).1);
                (4.0 * std::f64::consts::PI * r * r) as f32
            }
            Shape::Disk => WorldDisk::of(object).area(),
        }
    }

    /// Number of primitives of an object: triangles of its mesh, 1 for other shapes.
    pub fn primitive_count(&self, object: ObjectId) -> u32 {
        match self.object(object).shape {
            Shape::Mesh(mesh) => self.mesh(mesh).triangles.len() as u32,
            Shape::Sphere | Shape::Disk => 1,
        }
    }

    /// World-space centre and radius of a sphere object; `None` for other shapes.
    pub fn sphere_world(&self, object: ObjectId) -> Option<(Vec3, f32)> {
        let object = self.object(object);
        (object.shape == Shape::Sphere).then(|| sphere::world(object))
    }

    /// A sphere around all objects: that of their box.
    pub fn bounds(&self) -> BoundingSphere {
        let (mut low, mut high) = (DVec3::INFINITY, DVec3::NEG_INFINITY);
        let mut grow = |p: DVec3, reach: DVec3| {
            low = low.min(p - reach);
            high = high.max(p + reach);
        };
        for object in &self.objects {
            let m = object.to_world.matrix();
            match object.shape {
                Shape::Mesh(mesh) => {
                    let mesh = self.mesh(mesh);
                    for &i in mesh.triangles.as_flattened() {
                        grow(m.transform_point3(mesh.positions[i as usize].as_dvec3()), DVec3::ZERO);
                    }
                }
                Shape::Sphere => grow(m.translation, DVec3::splat(f64::from(sphere::world(object).1))),
                Shape::Disk => {
                    let (a, b) = (m.matrix3.x_axis, m.matrix3.y_axis);
                    grow(m.translation, DVec3::from_array([0, 1, 2].map(|i| (a[i] * a[i] + b[i] * b[i]).sqrt())));
                }
            }
        }
        if !(low.x <= high.x) {
            return BoundingSphere { centre: Vec3::ZERO, radius: 0.0 };
        }
        let centre = (0.5 * (low + high)).as_vec3();
        let reach = (high - centre.as_dvec3()).max(centre.as_dvec3() - low);
        BoundingSphere { centre, radius: (reach.length() as f32).next_up() }
    }

    #[inline]
    fn object(&self, id: ObjectId) -> &Object {
        &self.objects[id.0 as usize]
    }

    #[inline]
    fn mesh(&self, id: MeshId) -> &Mesh {
        &self.meshes[id.0 as usize]
    }
}
