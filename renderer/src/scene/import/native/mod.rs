//! lightfarm's own scene format: TOML. The reference is `scenes/REFERENCE.md`.

mod light;
mod material;
mod mesh;
mod shape;
mod table;
mod texture;
mod transform;
mod view;

#[cfg(test)]
mod tests;

use super::gltf;
use super::importer::{Importer, Place};
use crate::bsdf::MaterialId;
use crate::diagnostics::Diagnostics;
use crate::geometry::MeshId;
use crate::texture::TextureId;
use material::Entry;
use std::collections::BTreeMap;
use table::Table;
use toml::de::DeTable;

/// Larger scene files are refused.
const MAX_BYTES: usize = 64 << 20;

/// Imports the scene file `root`.
pub(super) fn import(importer: &mut Importer, root: &str) {
    let Some((file, bytes)) = importer.read_text(None, root) else { return };
    if bytes.len() > MAX_BYTES {
        let at = Place { file, offset: 0 };
        let message = format!("the scene file is larger than {} MiB", MAX_BYTES >> 20);
        return importer.error(at, message, "move meshes to PLY files");
    }
    let text = String::from_utf8_lossy(&bytes);
    let (entries, errors) = DeTable::parse_recoverable(&text);
    // Of the errors in one line all but the first follow from it.
    let mut last = usize::MAX;
    for e in &errors {
        let at = Place { file, offset: e.span().map_or(0, |s| s.start) };
        let line = bytes[..at.offset.min(bytes.len())].iter().filter(|&&b| b == b'\n').count();
        if line == std::mem::replace(&mut last, line) {
            continue;
        }
        importer.error(at, format!("this is not TOML: {}", e.message().trim().replace('\n', ", ")), "");
    }
    if !errors.is_empty() {
        return;
    }
    let mut root = Table::root(file, entries.get_ref());
    let part = gltf_part(importer, &mut root);
    // A glTF file that can't be read might have had a camera.
    let part = part.unwrap_or_else(|| gltf::Part { has_camera: root.has("gltf"), ..gltf::Part::default() });
    let known = part.materials.iter().map(|(name, id)| (name.as_str(), Entry::Built(Some(*id))));
    let builder = Builder {
        importer,
        textures: BTreeMap::new(),
        materials: known.collect(),
        meshes: BTreeMap::new(),
        grey: None,
    };
    builder.scene(root, &part);
}

/// Starts the scene with the glTF file that `gltf` names, if any.
fn gltf_part(importer: &mut Importer, root: &mut Table) -> Option<gltf::Part> {
    let (name, at) = root.string(importer, "gltf")?;
    let path = importer.resolve(at, name);
    let mut diagnostics = Diagnostics::default();
    let part = gltf::load_part(importer.files(), &path, &mut diagnostics);
    importer.absorb(diagnostics);
    let mut part = part?;
    importer.scene = std::mem::take(&mut part.scene);
    Some(part)
}

/// Turns tables into the scene. Names are those of the file; `None` stands for what could not be built.
struct Builder<'t, 'i, 'a> {
    importer: &'i mut Importer<'a>,
    textures: BTreeMap<&'t str, Option<TextureId>>,
    materials: BTreeMap<&'t str, Entry<'t>>,
    meshes: BTreeMap<&'t str, Option<MeshId>>,
    /// The material of shapes that name none.
    grey: Option<MaterialId>,
}

impl<'t> Builder<'t, '_, '_> {
    fn scene(mut self, mut root: Table<'t>, part: &gltf::Part) {
        if let Some(table) = root.table(self.importer, "render") {
            view::render(self.importer, table);
        }
        match root.table(self.importer, "camera") {
            Some(table) => view::camera(self.importer, table),
            None if root.has("camera") || part.has_camera => {}
            None => self.importer.error(root.at, "the scene has no camera", "add a table [camera] with from and to"),
        }
        if let Some(table) = root.table(self.importer, "textures") {
            self.textures(&table);
        }
        if let Some(table) = root.table(self.importer, "materials") {
            self.materials(&table);
            self.replace_materials(&part.materials);
        }
        if let Some(table) = root.table(self.importer, "meshes") {
            self.meshes(&table);
        }
        if let Some(item) = root.get("shapes") {
            self.shapes(item);
        }
        if let Some(item) = root.get("lights") {
            self.lights(item);
        }
        root.finish(self.importer);
    }

    /// Gives the shapes of the glTF file the materials of this file where the names are the same; what they emit stays.
    fn replace_materials(&mut self, names: &[(String, MaterialId)]) {
        for (name, old) in names {
            if let Some(Entry::Built(Some(new))) = self.materials.get(name.as_str()) {
                let shapes = self.importer.scene.shapes.iter_mut().filter(|s| s.material == *old);
                shapes.for_each(|s| s.material = *new);
            }
        }
    }
}
