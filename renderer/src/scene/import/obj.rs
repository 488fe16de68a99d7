//! Wavefront OBJ. Written here, not taken from a crate, because every fault must name its line.

use super::mesh_file::MeshFileError;
use crate::geometry::Mesh;
use crate::math::{Vec2, Vec3};
use std::collections::HashMap;

/// Position, texture coordinate and normal of a corner; `None` where the file leaves one out.
type Corner = (u32, Option<u32>, Option<u32>);

#[derive(Default)]
struct Reader {
    line: usize,
    positions: Vec<Vec3>,
    uvs: Vec<Vec2>,
    normals: Vec<Vec3>,
    /// Vertices of the mesh by corner. Only ever looked up, so that its order does not matter.
    vertices: HashMap<Corner, u32>,
    corners: Vec<Corner>,
    triangles: Vec<[u32; 3]>,
    face: Vec<u32>,
}

/// All faces of a file as one mesh; groups, materials, lines and points are ignored. Polygons become fans.
pub(super) fn parse(bytes: &[u8]) -> Result<Mesh, MeshFileError> {
    let mut reader = Reader::default();
    let mut joined = Vec::new();
    for line in bytes.split(|&b| b == b'\n') {
        reader.line += 1;
        let line = line.strip_suffix(b"\r").unwrap_or(line);
        // A backslash at the end goes on in the next line.
        if let Some(start) = line.strip_suffix(b"\\") {
            joined.extend_from_slice(start);
            joined.push(b' ');
        } else if joined.is_empty() {
            reader.statement(line)?;
        } else {
            joined.extend_from_slice(line);
            reader.statement(&joined)?;
            joined.clear();
        }
    }
    reader.statement(&joined)?;
    reader.finish()
}

impl Reader {
    fn error<T>(&self, message: impl Into<String>) -> Result<T, MeshFileError> {
        Err(MeshFileError::line(self.line, message))
    }

    fn statement(&mut self, line: &[u8]) -> Result<(), MeshFileError> {
        let mut words = line.split(u8::is_ascii_whitespace).filter(|w| !w.is_empty());
        match words.next() {
            Some(b"v") => {
                let [x, y, z] = self.numbers(&mut words, "a vertex position")?;
                self.positions.push(Vec3::new(x, y, z));
            }
            Some(b"vt") => {
                // A texture coordinate may have one, two or three numbers.
                let [u] = self.numbers(&mut words, "a texture coordinate")?;
                let v = if let Some(word) = words.next() { self.number(word, "a texture coordinate")? } else { 0.0 };
                self.uvs.push(Vec2::new(u, v));
            }
            Some(b"vn") => {
                let [x, y, z] = self.numbers(&mut words, "a vertex normal")?;
                self.normals.push(Vec3::new(x, y, z));
            }
            Some(b"f") => self.face(words)?,
            _ => {}
        }
        Ok(())
    }

    fn numbers<'l, const N: usize>(
        &self,
        words: &mut impl Iterator<Item = &'l [u8]>,
        what: &str,
    ) -> Result<[f32; N], MeshFileError> {
        let mut out = [0.0; N];
        for (i, slot) in out.iter_mut().enumerate() {
            let Some(word) = words.next() else {
                return self.error(format!("{what} needs {N} numbers, found {i}"));
            };
            *slot = self.number(word, what)?;
        }
        Ok(out)
    }

    fn number(&self, word: &[u8], what: &str) -> Result<f32, MeshFileError> {
        match std::str::from_utf8(word).ok().and_then(|w| w.parse::<f32>().ok()) {
            Some(v) if v.is_finite() => Ok(v),
            _ => self.error(format!("{:?} in {what} is not a finite number", shown(word))),
        }
    }

    fn face<'l>(&mut self, words: impl Iterator<Item = &'l [u8]>) -> Result<(), MeshFileError> {
        self.face.clear();
        for word in words.take_while(|w| !w.starts_with(b"#")) {
            let corner = self.corner(word)?;
            let next = self.corners.len();
            let vertex = *self.vertices.entry(corner).or_insert(next as u32);
            if vertex as usize == next {
                if next >= u32::MAX as usize {
                    return self.error("the mesh has more vertices than 32 bits can count");
                }
                self.corners.push(corner);
            }
            self.face.push(vertex);
        }
        if self.face.len() < 3 {
            return self.error(format!("a face needs 3 corners or more, found {}", self.face.len()));
        }
        for pair in self.face[1..].windows(2) {
            self.triangles.push([self.face[0], pair[0], pair[1]]);
        }
        Ok(())
    }

    /// `p`, `p/t`, `p//n` or `p/t/n`; negative numbers count back from the last one so far.
    fn corner(&self, word: &[u8]) -> Result<Corner, MeshFileError> {
        let mut parts = word.split(|&b| b == b'/');
        let position = self.index(parts.next().unwrap_or(b""), self.positions.len(), "vertex", word)?;
        let mut optional = |count: usize, what: &str| match parts.next() {
            None | Some(b"") => Ok(None),
            Some(part) => self.index(part, count, what, word).map(Some),
        };
        let corner =
            (position, optional(self.uvs.len(), "texture coordinate")?, optional(self.normals.len(), "normal")?);
        if parts.next().is_some() {
            return self.error(format!("the corner {:?} has more than three indices", shown(word)));
        }
        Ok(corner)
    }

    fn index(&self, part: &[u8], count: usize, what: &str, word: &[u8]) -> Result<u32, MeshFileError> {
        let number = std::str::from_utf8(part).ok().and_then(|p| p.parse::<i64>().ok());
        let index = match number {
            Some(n) if n > 0 => n - 1,
            Some(n) if n < 0 => n.saturating_add(count as i64),
            _ => return self.error(format!("the corner {:?} has no {what} index other than 0", shown(word))),
        };
        if index < 0 || index >= count as i64 {
            return self
                .error(format!("the corner {:?} names a {what} that is not there: {count} so far", shown(word)));
        }
        u32::try_from(index).or_else(|_| self.error("an index does not fit into 32 bits"))
    }

    fn finish(self) -> Result<Mesh, MeshFileError> {
        if self.triangles.is_empty() {
            return self.error("the file has no faces: it is not an OBJ mesh");
        }
        let any_uv = self.corners.iter().any(|c| c.1.is_some());
        let any_normal = self.corners.iter().any(|c| c.2.is_some());
        let mut mesh = Mesh { triangles: self.triangles, ..Mesh::default() };
        mesh.positions = self.corners.iter().map(|c| self.positions[c.0 as usize]).collect();
        if any_uv {
            let uv = |c: &Corner| c.1.map_or(Vec2::ZERO, |i| self.uvs[i as usize]);
            mesh.uvs = self.corners.iter().map(uv).collect();
        }
        if any_normal {
            let normal = |c: &Corner| c.2.map_or(Vec3::ZERO, |i| self.normals[i as usize]);
            mesh.normals = self.corners.iter().map(normal).collect();
        }
        Ok(mesh)
    }
}

/// The start of a word for a message.
fn shown(word: &[u8]) -> String {
    String::from_utf8_lossy(&word[..word.len().min(40)]).into_owned()
}
