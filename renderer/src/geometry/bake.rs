//! Meshes in world space where that costs no memory worth speaking of; the others stay shared and are instanced.

use super::surface::Facet;
use super::{Geometry, Mesh, MeshId, Object, Shape};
use crate::math::{Transform, Vec3};

/// Meshes with fewer triangles are copied rather than instanced: an instance costs a transform of every ray that meets its box.
const INSTANCE_TRIANGLES: usize = 64;
/// What hits need of so many triangles of a mesh, and of so many altogether, is worked out beforehand: more would not stay in caches.
const MESH_FACETS: usize = 1 << 13;
const ALL_FACETS: usize = 1 << 16;

impl Geometry {
    /// Moves every mesh that a single object uses to world space, gives every object of a small shared mesh its own copy, and
    /// sets the transforms of these objects to the identity. Objects keep their indices, triangles theirs; meshes do not. Meshes and
    /// objects must not change afterwards.
    ///
    /// Without it everything works, but every mesh with a transform is traversed as an instance.
    pub fn bake(&mut self) {
        let mut uses = vec![0u32; self.meshes.len()];
        for object in &self.objects {
            if let Shape::Mesh(mesh) = object.shape {
                uses[mesh.0 as usize] += 1;
            }
        }
        for object in &mut self.objects {
            let Shape::Mesh(id) = object.shape else { continue };
            if object.to_world.is_identity() {
                continue;
            }
            let index = id.0 as usize;
            if uses[index] == 1 {
                place(&mut self.meshes[index], &object.to_world);
            } else if self.meshes[index].triangles.len() < INSTANCE_TRIANGLES {
                let mut copy = self.meshes[index].clone();
                place(&mut copy, &object.to_world);
                uses[index] -= 1;
                uses.push(1);
                object.shape = Shape::Mesh(MeshId(self.meshes.len() as u32));
                self.meshes.push(copy);
            } else {
                continue;
            }
            object.to_world = Transform::IDENTITY;
        }
        self.prepare();
    }

    /// Works out the facets of small meshes.
    fn prepare(&mut self) {
        let mut left = ALL_FACETS;
        let meshes = &self.meshes;
        let facets = |object: &Object| {
            let Shape::Mesh(id) = object.shape else { return Vec::new() };
            let mesh = &meshes[id.0 as usize];
            let count = mesh.triangles.len();
            if !object.to_world.is_identity() || count > left.min(MESH_FACETS) {
                return Vec::new();
            }
            left -= count;
            (0..count as u32).map(|triangle| Facet::new(mesh, object, triangle)).collect()
        };
        self.facets = self.objects.iter().map(facets).collect();
    }
}

/// Applies `to_world` to a mesh; the winding stays outward under a mirrored map.
fn place(mesh: &mut Mesh, to_world: &Transform) {
    let m = to_world.matrix();
    for p in &mut mesh.positions {
        *p = m.transform_point3(p.as_dvec3()).as_vec3();
    }
    for n in &mut mesh.normals {
        *n = to_world.normal(*n).normalize_or(Vec3::ZERO);
    }
    if to_world.flips_handedness() {
        for t in &mut mesh.triangles {
            t.swap(1, 2);
        }
    }
}
