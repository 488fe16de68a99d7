use crate::math::{Vec2, Vec3};

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
}
