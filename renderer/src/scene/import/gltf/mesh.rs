//! Mesh primitives to indexed triangles.

use super::Importer;
use super::accessor::{self, Accessor};
use super::buffers::lookup;
use super::report::{Checked, Fault};
use crate::geometry::{Mesh, MeshId};
use crate::math::{Vec2, Vec3};
use gltf::Semantic;
use gltf::json;
use gltf::json::mesh::Mode;
use gltf::json::validation::Checked as Valid;

/// Accessors and mode that make a mesh: primitives that agree in them share it.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(super) struct MeshKey {
    positions: usize,
    normals: Option<usize>,
    uvs: Uvs,
    indices: Option<usize>,
    mode: u32,
}

/// Where texture coordinates come from.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
enum Uvs {
    /// No texture wants them.
    None,
    /// The set is missing: zero everywhere.
    Zero,
    Accessor(usize),
}

/// Bytes of a mesh in memory.
fn size(vertices: usize, normals: bool, uvs: bool, triangles: usize) -> u64 {
    let vertex = size_of::<Vec3>() * (1 + usize::from(normals)) + if uvs { size_of::<Vec2>() } else { 0 };
    vertices as u64 * vertex as u64 + triangles as u64 * size_of::<[u32; 3]>() as u64
}

impl Importer<'_> {
    /// The mesh of one primitive, with the texture coordinates of `uv_set`; `None` where it has no triangles.
    pub(super) fn primitive(&mut self, mesh: usize, index: usize, uv_set: Option<u32>) -> Checked<Option<MeshId>> {
        let place = format!("meshes[{mesh}].primitives[{index}]");
        let primitives = &lookup(&self.root.meshes, mesh, &place, "meshes")?.primitives;
        let primitive = lookup(primitives, index, &place, "primitives")?;
        let Valid::Valid(mode) = primitive.mode else {
            return Err(Fault::new(format!("{place}.mode"), "not a primitive mode of glTF; expected 4, 5 or 6"));
        };
        if !matches!(mode, Mode::Triangles | Mode::TriangleStrip | Mode::TriangleFan) {
            self.report.sum("points and lines are not supported and are left out", "", place);
            return Ok(None);
        }
        let attribute = |s: Semantic| primitive.attributes.get(&Valid::Valid(s)).map(json::Index::value);
        let Some(positions) = attribute(Semantic::Positions) else {
            self.report.warn(Fault::new(place, "there is no POSITION attribute; the primitive is left out"));
            return Ok(None);
        };
        self.note_ignored(primitive, &place);
        let uvs = match uv_set.map(|set| (set, attribute(Semantic::TexCoords(set)))) {
            None => Uvs::None,
            Some((_, Some(accessor))) => Uvs::Accessor(accessor),
            Some((set, None)) => {
                let message = format!("there is no TEXCOORD_{set} for the material's textures; (0, 0) is used");
                self.report.warn(Fault::new(&place, message));
                Uvs::Zero
            }
        };
        let indices = primitive.indices.map(|i| i.value());
        let key = MeshKey { positions, normals: attribute(Semantic::Normals), uvs, indices, mode: mode.as_gl_enum() };
        if let Some(known) = self.mesh_ids.get(&key) {
            return known.clone();
        }
        let made = self.build_mesh(&key, mode, &place).and_then(|m| m.map(|mesh| self.add_mesh(mesh)).transpose());
        self.mesh_ids.insert(key, made.clone());
        made
    }

    /// Adds a mesh to the scene.
    pub(super) fn add_mesh(&mut self, mesh: Mesh) -> Checked<MeshId> {
        let id = u32::try_from(self.scene.meshes.len()).map_err(|_| Fault::new("meshes", "there are too many"))?;
        self.scene.meshes.push(mesh);
        Ok(MeshId(id))
    }

    /// Takes memory for a mesh from what the file may use: a small multiple of its own size, so that a few bytes that name the same
    /// accessors in ever new ways can't fill the memory.
    pub(super) fn charge_mesh(
        &mut self,
        vertices: usize,
        normals: bool,
        uvs: bool,
        triangles: usize,
        place: &str,
    ) -> Checked<()> {
        let bytes = size(vertices, normals, uvs, triangles);
        let left = self.mesh_bytes_left.checked_sub(bytes);
        self.mesh_bytes_left = left.ok_or_else(|| {
            Fault::new(place, format!("the meshes take far more memory than the file ({bytes} bytes more here)"))
                .help("the file repeats the same data in many meshes; use instances")
        })?;
        Ok(())
    }

    fn note_ignored(&mut self, primitive: &json::mesh::Primitive, place: &str) {
        if primitive.attributes.keys().any(|k| matches!(k, Valid::Valid(Semantic::Colors(_)))) {
            self.report.sum("vertex colours (COLOR_n) are not supported and are ignored", "", place);
        }
        if primitive.targets.as_ref().is_some_and(|t| !t.is_empty()) {
            self.report.sum("morph targets are not supported; the base mesh is used", "", place);
        }
    }

    fn build_mesh(&mut self, key: &MeshKey, mode: Mode, place: &str) -> Checked<Option<Mesh>> {
        let open = |index: usize, name: &str, expect| {
            Accessor::open(self.root, self.buffers, index, &format!("{place}.{name}"), expect)
        };
        let positions = open(key.positions, "attributes.POSITION", &accessor::POSITION)?;
        let normals = key.normals.map(|i| open(i, "attributes.NORMAL", &accessor::NORMAL)).transpose()?;
        let uvs = match key.uvs {
            Uvs::Accessor(i) => Some(open(i, "attributes.TEXCOORD", &accessor::TEXCOORD)?),
            _ => None,
        };
        let indices = key.indices.map(|i| open(i, "indices", &accessor::INDICES)).transpose()?;
        for (other, name) in [(&normals, "NORMAL"), (&uvs, "TEXCOORD")] {
            if let Some(other) = other.as_ref().filter(|o| o.count != positions.count) {
                let message = format!("{} {name} values for {} positions", other.count, positions.count);
                return Err(Fault::new(format!("{place}.attributes"), message));
            }
        }
        let corners = indices.as_ref().map_or(positions.count, |i| i.count);
        let triangles = if mode == Mode::Triangles { corners / 3 } else { corners.saturating_sub(2) };
        if mode == Mode::Triangles && !corners.is_multiple_of(3) {
            let message = format!("{corners} corners are not a whole number of triangles; the rest is left out");
            self.report.warn(Fault::new(place, message));
        }
        if triangles == 0 {
            self.report.warn(Fault::new(place, "there is no triangle in it"));
            return Ok(None);
        }
        let vertices = positions.count.min(corners);
        self.charge_mesh(vertices, normals.is_some(), key.uvs != Uvs::None, triangles, place)?;
        let corner = |i: usize| indices.as_ref().map_or(i as u32, |a| a.index(i));
        if let Some(i) = (0..corners).find(|i| corner(*i) as usize >= positions.count) {
            let message = format!("index {i} is {}, but there are only {} vertices", corner(i), positions.count);
            return Err(Fault::new(format!("{place}.indices"), message));
        }
        let mut triangles = assemble(mode, corners, corner);
        let used = compact(&mut triangles, positions.count, corners);
        let vertex = |i: usize| used.as_ref().map_or(i, |u| u[i] as usize);
        let count = used.as_ref().map_or(positions.count, Vec::len);
        let mut mesh = Mesh { triangles, ..Mesh::default() };
        mesh.positions = (0..count).map(|i| Vec3::from_array(positions.floats(vertex(i)))).collect();
        if let Some(a) = &normals {
            mesh.normals = (0..count).map(|i| unit(Vec3::from_array(a.floats(vertex(i))))).collect();
            if mesh.normals.contains(&Vec3::ZERO) {
                let message = "some normals have no direction; the face's is used there";
                self.report.warn(Fault::new(format!("{place}.attributes.NORMAL"), message));
            }
        }
        match (key.uvs, &uvs) {
            (Uvs::Zero, _) => mesh.uvs = vec![Vec2::ZERO; count],
            (_, Some(a)) => {
                mesh.uvs = (0..count).map(|i| Vec2::from_array(a.floats(vertex(i)))).collect();
                if mesh.uvs.iter().any(|uv| !uv.is_finite()) {
                    mesh.uvs.iter_mut().filter(|uv| !uv.is_finite()).for_each(|uv| *uv = Vec2::ZERO);
                    let message = "some coordinates are not finite; (0, 0) is used there";
                    self.report.warn(Fault::new(format!("{place}.attributes.TEXCOORD"), message));
                }
            }
            _ => {}
        }
        mesh.validate().map_err(|e| Fault::new(place, e.to_string()))?;
        Ok(Some(mesh))
    }
}

/// A vector of unit length; zero where it has no direction.
fn unit(v: Vec3) -> Vec3 {
    let n = v.normalize_or_zero();
    if n.is_finite() { n } else { Vec3::ZERO }
}

/// Triangles of a list, strip or fan (glTF 2.0, 3.7.2.1); those of strips and fans that repeat a corner are left out.
fn assemble(mode: Mode, corners: usize, corner: impl Fn(usize) -> u32) -> Vec<[u32; 3]> {
    match mode {
        Mode::TriangleStrip => (0..corners.saturating_sub(2))
            .map(|i| [corner(i), corner(i + 1 + i % 2), corner(i + 2 - i % 2)])
            .filter(|t| t[0] != t[1] && t[1] != t[2] && t[2] != t[0])
            .collect(),
        Mode::TriangleFan => (0..corners.saturating_sub(2))
            .map(|i| [corner(i + 1), corner(i + 2), corner(0)])
            .filter(|t| t[0] != t[1] && t[1] != t[2] && t[2] != t[0])
            .collect(),
        _ => (0..corners / 3).map(|i| [corner(3 * i), corner(3 * i + 1), corner(3 * i + 2)]).collect(),
    }
}

/// Renumbers the corners where more vertices are stored than used (many primitives in one vertex buffer); gives the old numbers.
fn compact(triangles: &mut [[u32; 3]], vertices: usize, corners: usize) -> Option<Vec<u32>> {
    if vertices <= corners {
        return None;
    }
    let mut used: Vec<u32> = triangles.iter().flatten().copied().collect();
    used.sort_unstable();
    used.dedup();
    for corner in triangles.iter_mut().flatten() {
        *corner = used.partition_point(|u| u < corner) as u32;
    }
    Some(used)
}
