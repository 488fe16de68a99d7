//! Meshes, from files or written out.

use super::Builder;
use super::table::{Item, Table};
use crate::geometry::{Mesh, MeshId};
use crate::math::{DMat3, DVec3, Vec2, Vec3};
use crate::scene::import::importer::{Importer, Place};
use crate::scene::import::mesh_file::{MeshOptions, Normals, smooth_normals};

/// Where vertex normals come from.
#[derive(Clone, Copy)]
enum Shading {
    /// From the file, or flat.
    File,
    Smooth,
    Flat,
}

const SHADINGS: [(&str, Shading); 3] = [("file", Shading::File), ("smooth", Shading::Smooth), ("flat", Shading::Flat)];

impl<'t> Builder<'t, '_, '_> {
    /// Builds the meshes, in the order of their names.
    pub(super) fn meshes(&mut self, table: &Table<'t>) {
        for (name, _, item) in table.all() {
            let table = item.table(self.importer, &format!("the mesh {name:?}"));
            let id = table.and_then(|t| mesh(self.importer, t));
            self.meshes.insert(name, id);
        }
    }
}

fn mesh(importer: &mut Importer, mut table: Table) -> Option<MeshId> {
    let shading = table.choice(importer, "shading", &SHADINGS);
    let id = match table.string(importer, "file") {
        Some((name, at)) => file(importer, at, name, shading),
        None => written(importer, &mut table, shading).map(|mesh| importer.add_mesh(mesh)),
    };
    table.finish(importer);
    id
}

/// A file with the normals that it has, or flat.
pub(super) fn plain_file(importer: &mut Importer, at: Place, name: &str) -> Option<MeshId> {
    file(importer, at, name, Shading::File)
}

/// OBJ's v counts from the bottom of a picture; PLY's is taken as it is.
fn file(importer: &mut Importer, at: Place, name: &str, shading: Shading) -> Option<MeshId> {
    let flip_v = name.to_ascii_lowercase().ends_with(".obj");
    let normals = match shading {
        Shading::File => Normals::File,
        Shading::Smooth => Normals::smooth(DMat3::IDENTITY),
        Shading::Flat => Normals::Flat,
    };
    importer.mesh(at, name, MeshOptions { flip_v, normals })
}

/// From `positions`, `triangles`, and if given `normals` and `uvs`.
fn written(importer: &mut Importer, table: &mut Table, shading: Shading) -> Option<Mesh> {
    let positions = table.require(importer, "positions", "a list of [x, y, z], or `file`")?;
    let triangles = table.require(importer, "triangles", "a list of three vertex indices each")?;
    let (normals, uvs) = (table.get("normals"), table.get("uvs"));
    let vectors = |importer: &mut Importer, name, item: Item| {
        let points = item.points(importer, name)?;
        Some(points.into_iter().map(|p| DVec3::from_array(p).as_vec3()).collect::<Vec<Vec3>>())
    };
    let mut mesh = Mesh { positions: vectors(importer, "positions", positions)?, ..Mesh::default() };
    let last = mesh.positions.len() as i64 - 1;
    for item in triangles.list(importer, "triangles", "a list of three vertex indices each")? {
        let corners: [Item; 3] = item.exactly(importer, "triangles", "three vertex indices")?;
        let [a, b, c] = corners.map(|c| c.integer(importer, "triangles", 0, last));
        mesh.triangles.push([a? as u32, b? as u32, c? as u32]);
    }
    if mesh.triangles.is_empty() {
        importer.error(triangles.at, "the mesh has no triangles", "");
        return None;
    }
    if let Some(item) = normals {
        let unit = |n: Vec3| n.as_dvec3().normalize_or_zero().as_vec3();
        mesh.normals = vectors(importer, "normals", item)?.into_iter().map(unit).collect();
    }
    if let Some(item) = uvs {
        mesh.uvs = item.points(importer, "uvs")?.into_iter().map(|[u, v]| Vec2::new(u as f32, v as f32)).collect();
    }
    if let Err(e) = mesh.validate() {
        importer.error(table.at, e.to_string(), "");
        return None;
    }
    match shading {
        Shading::Flat => mesh.normals = Vec::new(),
        Shading::Smooth if mesh.normals.is_empty() => mesh.normals = smooth_normals(&mesh, DMat3::IDENTITY),
        Shading::File | Shading::Smooth => {}
    }
    Some(mesh)
}
