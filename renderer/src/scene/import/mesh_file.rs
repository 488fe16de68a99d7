//! Mesh files: PLY and OBJ to [`Mesh`], with the normals that the scene format asks for.

use super::transform::is_similarity;
use super::{obj, ply};
use crate::geometry::Mesh;
use crate::math::{DMat3, DVec3, Vec3, safe_asin};
use std::f32::consts::PI;

/// Where vertex normals come from.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Normals {
    /// From the file; a file without them gives a flat mesh.
    File,
    /// None: a flat mesh.
    Flat,
    /// From the file; a file without them gets smooth normals, computed as the mesh looks through this linear map.
    Smooth(DMat3),
}

impl Normals {
    /// Smooth normals of a mesh seen through `linear`. A similarity gives the same as the identity or a reflection.
    pub fn smooth(linear: DMat3) -> Self {
        let mirror = if linear.determinant() < 0.0 { -1.0 } else { 1.0 };
        let seen = if is_similarity(&linear) { DMat3::from_diagonal(DVec3::new(1.0, 1.0, mirror)) } else { linear };
        Self::Smooth(seen)
    }

    /// The same for a mesh that is not scaled, only mirrored if it was.
    pub fn without_scale(self) -> Self {
        match self {
            Self::Smooth(m) => Self::smooth(DMat3::from_diagonal(DVec3::new(1.0, 1.0, m.determinant().signum()))),
            other => other,
        }
    }
}

/// How a mesh file is read.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct MeshOptions {
    /// Texture coordinates become (u, 1 - v).
    pub flip_v: bool,
    /// Where vertex normals come from.
    pub normals: Normals,
}

/// What makes two readings of a file the same mesh.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(super) struct MeshKey {
    path: String,
    flip_v: bool,
    flat: bool,
    computed: Option<[u64; 9]>,
}

impl MeshKey {
    /// `own_normals`: whether the file brings normals.
    pub fn new(path: &str, options: &MeshOptions, own_normals: bool) -> Self {
        let computed = match options.normals {
            Normals::Smooth(m) if !own_normals => Some(m.to_cols_array().map(f64::to_bits)),
            _ => None,
        };
        Self { path: path.to_string(), flip_v: options.flip_v, flat: options.normals == Normals::Flat, computed }
    }
}

/// Why a mesh file was refused.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct MeshFileError {
    /// `line 3` or `byte 120`.
    pub place: String,
    /// What is wrong and what was expected.
    pub message: String,
}

impl MeshFileError {
    /// In a line, counted from 1.
    pub fn line(line: usize, message: impl Into<String>) -> Self {
        Self { place: format!("line {line}"), message: message.into() }
    }

    /// At a byte, counted from 0.
    pub fn byte(byte: usize, message: impl Into<String>) -> Self {
        Self { place: format!("byte {byte}"), message: message.into() }
    }
}

/// A mesh file's content.
#[derive(Debug)]
pub(super) struct LoadedMesh {
    /// The triangles.
    pub mesh: Mesh,
    /// Whether the file has vertex normals (used or not).
    pub own_normals: bool,
}

/// Reads PLY (told by its first line) or OBJ. The mesh is valid: indices in range, every number finite.
pub(super) fn parse(bytes: &[u8], path: &str, options: &MeshOptions) -> Result<LoadedMesh, MeshFileError> {
    let is_ply = bytes.starts_with(b"ply\n") || bytes.starts_with(b"ply\r") || path.to_lowercase().ends_with(".ply");
    let mut mesh = if is_ply { ply::parse(bytes)? } else { obj::parse(bytes)? };
    if options.flip_v {
        mesh.uvs.iter_mut().for_each(|uv| uv.y = 1.0 - uv.y);
    }
    let own_normals = !mesh.normals.is_empty();
    mesh.normals.iter_mut().for_each(|n| *n = n.as_dvec3().normalize_or_zero().as_vec3());
    match options.normals {
        Normals::Flat => mesh.normals = Vec::new(),
        Normals::Smooth(linear) if !own_normals => mesh.normals = smooth_normals(&mesh, linear),
        Normals::File | Normals::Smooth(_) => {}
    }
    Ok(LoadedMesh { mesh, own_normals })
}

/// Vertex normals as the mean of the normals of the faces around, weighted by the faces' angles there (Thürmer and Wüthrich
/// 1998, "Computing Vertex Normals from Polygonal Facets"). Faces and angles are those of the mesh mapped by `linear`; the
/// result is in the mesh's own space. Zero where no face has an area.
pub(super) fn smooth_normals(mesh: &Mesh, linear: DMat3) -> Vec<Vec3> {
    let mut sums = vec![DVec3::ZERO; mesh.positions.len()];
    for triangle in &mesh.triangles {
        let corners = triangle.map(|i| linear * mesh.positions[i as usize].as_dvec3());
        let normal = (corners[1] - corners[0]).cross(corners[2] - corners[0]).normalize_or_zero();
        for (i, &vertex) in triangle.iter().enumerate() {
            let a = (corners[(i + 1) % 3] - corners[i]).normalize_or_zero();
            let b = (corners[(i + 2) % 3] - corners[i]).normalize_or_zero();
            sums[vertex as usize] += normal * f64::from(angle(a, b));
        }
    }
    // A normal maps by the inverse transpose; its inverse is the transpose.
    sums.iter().map(|&n| (linear.transpose() * n.normalize_or_zero()).normalize_or_zero().as_vec3()).collect()
}

/// The angle between unit vectors, accurate for small ones too (Kahan).
fn angle(a: DVec3, b: DVec3) -> f32 {
    if a.dot(b) < 0.0 {
        PI - 2.0 * safe_asin((0.5 * (a + b).length()) as f32)
    } else {
        2.0 * safe_asin((0.5 * (b - a).length()) as f32)
    }
}
