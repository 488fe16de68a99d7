use crate::math::{Vec2, Vec3};
use std::collections::HashMap;

/// An indexed triangle mesh in object space.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Mesh {
    /// Corners.
    pub positions: Vec<Vec3>,
    /// Unit vertex normals, as many as `positions`; empty = flat.
    pub normals: Vec<Vec3>,
    /// Texture coordinates, as many as `positions`; empty = barycentric.
    pub uvs: Vec<Vec2>,
    /// Corner indices; counter-clockwise seen from outside.
    pub triangles: Vec<[u32; 3]>,
}

/// Why a mesh was refused.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum MeshError {
    /// An index points past the vertices.
    #[error("triangle {triangle} names vertex {index}, but there are only {count} vertices")]
    Index {
        /// The triangle.
        triangle: usize,
        /// What it names.
        index: u32,
        /// How many there are.
        count: usize,
    },
    /// A number is NaN or infinite.
    #[error("vertex {vertex} has a {what} that is not a finite number")]
    NotFinite {
        /// The vertex.
        vertex: usize,
        /// `coordinate`, `normal` or `texture coordinate`.
        what: &'static str,
    },
    /// Attribute arrays of different lengths.
    #[error("{positions} positions, but {other} {what}")]
    Length {
        /// Number of positions.
        positions: usize,
        /// `normals` or `texture coordinates`.
        what: &'static str,
        /// Number of the others.
        other: usize,
    },
}

impl Mesh {
    /// Checks indices, lengths and finiteness; drops degenerate normals to the face normal later, never fails on zero area.
    pub fn validate(&self) -> Result<(), MeshError> {
        let count = self.positions.len();
        for (what, other) in [("normals", self.normals.len()), ("texture coordinates", self.uvs.len())] {
            if other != 0 && other != count {
                return Err(MeshError::Length { positions: count, what, other });
            }
        }
        let bad = |list: &[Vec3]| list.iter().position(|p| !p.is_finite());
        let bad_uv = self.uvs.iter().position(|uv| !uv.is_finite());
        let found =
            [(bad(&self.positions), "coordinate"), (bad(&self.normals), "normal"), (bad_uv, "texture coordinate")];
        if let Some((Some(vertex), what)) = found.into_iter().find(|(at, _)| at.is_some()) {
            return Err(MeshError::NotFinite { vertex, what });
        }
        for (triangle, corners) in self.triangles.iter().enumerate() {
            if let Some(&index) = corners.iter().find(|&&i| i as usize >= count) {
                return Err(MeshError::Index { triangle, index, count });
            }
        }
        Ok(())
    }

    /// Whether the surface has no border: no edge belongs to an odd number of triangles. Corners at the same place are one.
    pub fn is_closed(&self) -> bool {
        let mut places = HashMap::new();
        let place = |p: &Vec3| {
            let next = places.len() as u32;
            // Both zeros are the same place.
            *places.entry((*p + Vec3::ZERO).to_array().map(f32::to_bits)).or_insert(next)
        };
        let places: Vec<u32> = self.positions.iter().map(place).collect();
        let edges = self.triangles.iter().flat_map(|&[a, b, c]| [[a, b], [b, c], [c, a]]);
        let placed = edges.map(|edge| edge.map(|corner| places[corner as usize]));
        let mut edges: Vec<[u32; 2]> = placed.filter(|[a, b]| a != b).map(|[a, b]| [a.min(b), a.max(b)]).collect();
        edges.sort_unstable();
        edges.chunk_by(|a, b| a == b).all(|same| same.len() % 2 == 0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A tetrahedron whose sides have corners of their own.
    fn tetrahedron() -> Mesh {
        let corners = [Vec3::ZERO, Vec3::X, Vec3::Y, Vec3::Z];
        let sides = [[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]];
        Mesh {
            positions: sides.iter().flatten().map(|i: &usize| corners[*i]).collect(),
            triangles: (0..4).map(|i| [3 * i, 3 * i + 1, 3 * i + 2]).collect(),
            ..Mesh::default()
        }
    }

    #[test]
    fn a_surface_is_closed_unless_an_edge_has_one_side() {
        let mut mesh = tetrahedron();
        assert!(mesh.is_closed());
        // Other zeros, and triangles without an area.
        mesh.positions[0] = -Vec3::ZERO;
        mesh.triangles.push([0, 0, 5]);
        mesh.triangles.push([1, 1, 1]);
        assert!(mesh.is_closed());
        mesh.positions[4].x += f32::EPSILON;
        assert!(!mesh.is_closed());
        let mut open = tetrahedron();
        open.triangles.pop();
        assert!(!open.is_closed());
        assert!(Mesh::default().is_closed());
    }
}
