//! From shape descriptions to objects.

use super::desc::{ShapeDesc, ShapeKind};
use super::placed;
use crate::geometry::{Mesh, MeshId, Object, Shape};
use crate::math::{DAffine3, Transform, Vec2, Vec3};

/// Makes objects; rectangles and cubes share one mesh each.
pub struct ObjectBuilder {
    /// The scene's meshes and those made here.
    pub meshes: Vec<Mesh>,
    rectangle: Option<MeshId>,
    cube: Option<MeshId>,
}

impl ObjectBuilder {
    /// For the scene's meshes.
    pub fn new(meshes: Vec<Mesh>) -> Self {
        Self { meshes, rectangle: None, cube: None }
    }

    /// The object of a shape, or what is wrong with it.
    pub fn object(&mut self, desc: &ShapeDesc) -> Result<Object, String> {
        let to_world = Transform::new(desc.to_world)
            .ok_or("its transform is singular or not finite; every scale factor must differ from 0")?;
        let shape = match desc.kind {
            ShapeKind::Mesh(id) => Shape::Mesh(id),
            ShapeKind::Sphere if !scales_evenly(&desc.to_world) => {
                return Err("a sphere can only be scaled by the same factor along all axes; use a mesh instead".into());
            }
            ShapeKind::Sphere => Shape::Sphere,
            ShapeKind::Disk => Shape::Disk,
            ShapeKind::Rectangle => Shape::Mesh(Self::shared(&mut self.meshes, &mut self.rectangle, rectangle)),
            ShapeKind::Cube => Shape::Mesh(Self::shared(&mut self.meshes, &mut self.cube, cube)),
        };
        Ok(placed(shape, to_world, desc.flip_normals))
    }

    fn shared(meshes: &mut Vec<Mesh>, id: &mut Option<MeshId>, make: fn() -> Mesh) -> MeshId {
        *id.get_or_insert_with(|| {
            meshes.push(make());
            MeshId(meshes.len() as u32 - 1)
        })
    }
}

/// Whether a map is a rotation or mirroring times one factor, up to f32 rounding.
fn scales_evenly(m: &DAffine3) -> bool {
    let m = &m.matrix3;
    let size = m.x_axis.length_squared();
    let close = |a: f64, b: f64| (a - b).abs() <= 1e-5 * size;
    close(m.y_axis.length_squared(), size)
        && close(m.z_axis.length_squared(), size)
        && close(m.x_axis.dot(m.y_axis), 0.0)
        && close(m.y_axis.dot(m.z_axis), 0.0)
        && close(m.z_axis.dot(m.x_axis), 0.0)
}

/// The square [-1, 1]^2 in xy.
fn rectangle() -> Mesh {
    let corners = [(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)];
    Mesh {
        positions: corners.map(|(x, y)| Vec3::new(x, y, 0.0)).to_vec(),
        normals: Vec::new(),
        uvs: corners.map(|(x, y)| Vec2::new(0.5 * (x + 1.0), 0.5 * (y + 1.0))).to_vec(),
        triangles: vec![[0, 1, 2], [0, 2, 3]],
    }
}

/// The faces of the cube: outward normal, direction of u, direction of v. As in Mitsuba, so that its textured cubes look the same.
const FACES: [[Vec3; 3]; 6] = [
    [Vec3::NEG_Y, Vec3::Z, Vec3::X],
    [Vec3::Y, Vec3::NEG_X, Vec3::NEG_Z],
    [Vec3::X, Vec3::Y, Vec3::NEG_Z],
    [Vec3::Z, Vec3::Y, Vec3::X],
    [Vec3::NEG_X, Vec3::Y, Vec3::Z],
    [Vec3::NEG_Z, Vec3::NEG_Y, Vec3::X],
];

/// The cube [-1, 1]^3: six squares with their own corners.
fn cube() -> Mesh {
    let mut mesh = Mesh::default();
    for [outward, u, v] in FACES {
        let first = mesh.positions.len() as u32;
        for (a, b) in [(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)] {
            mesh.positions.push(outward + u * a + v * b);
            mesh.uvs.push(Vec2::new(0.5 * (a + 1.0), 0.5 * (b + 1.0)));
        }
        // (u, v, outward) is left-handed.
        mesh.triangles.extend([[first, first + 2, first + 1], [first, first + 3, first + 2]]);
    }
    mesh
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_faces_of_the_cube_and_the_rectangle_look_outward() {
        for (mesh, centre) in [(cube(), Vec3::ZERO), (rectangle(), -Vec3::Z)] {
            mesh.validate().unwrap();
            let mut area = 0.0;
            for t in &mesh.triangles {
                let [a, b, c] = t.map(|i| mesh.positions[i as usize]);
                let n = (b - a).cross(c - a);
                assert!(n.dot((a + b + c) / 3.0 - centre) > 0.0);
                area += 0.5 * n.length();
            }
            assert_eq!(area, 4.0 * (mesh.triangles.len() / 2) as f32);
        }
    }
}
