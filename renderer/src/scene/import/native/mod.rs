//! lightfarm's own scene format: TOML. The reference is `scenes/REFERENCE.md`.

mod light;
mod material;
mod medium;
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
use crate::medium::MediumId;
use crate::texture::TextureId;
use material::Entry;
use std::collections::BTreeMap;
use table::Table;
use toml::de::DeTable;

/// Larger scene files are refused: the parser takes some hundred bytes for each of theirs.
const MAX_BYTES: usize = 8 << 20;
/// Of larger files only the first error of the TOML itself is found: the parser keeps all that it finds, one for each byte at worst.
const MAX_BYTES_FOR_ALL: usize = 1 << 20;
/// Errors of the TOML itself beyond these are not listed.
const MAX_SYNTAX_ERRORS: usize = 50;

/// Imports the scene file `root`.
pub(super) fn import(importer: &mut Importer, root: &str) {
    let Some((file, bytes)) = importer.read_text(None, root) else { return };
    if bytes.len() > MAX_BYTES {
        let at = Place { file, offset: 0 };
        let message = format!("the scene file is larger than {} MiB", MAX_BYTES >> 20);
        return importer.error(at, message, "move meshes to PLY files");
    }
    let text = String::from_utf8_lossy(&bytes);
    let entries = match DeTable::parse(&text) {
        Ok(entries) => entries,
        Err(_) if bytes.len() <= MAX_BYTES_FOR_ALL => {
            return syntax_errors(importer, file, &bytes, &DeTable::parse_recoverable(&text).1);
        }
        Err(first) => return syntax_errors(importer, file, &bytes, &[first]),
    };
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
        media: BTreeMap::new(),
        grey: None,
    };
    builder.scene(root, &part);
}

/// Lists one error for each line: the others follow from it.
fn syntax_errors(importer: &mut Importer, file: usize, text: &[u8], errors: &[toml::de::Error]) {
    let mut last: Option<usize> = None;
    let mut listed = 0;
    for e in errors {
        let offset = e.span().map_or(0, |s| s.start).min(text.len());
        let between = last.map(|last| &text[last.min(offset)..last.max(offset)]);
        if listed < MAX_SYNTAX_ERRORS && between.is_none_or(|b| b.contains(&b'\n')) {
            listed += 1;
            let message = format!("this is not TOML: {}", e.message().trim().replace('\n', ", "));
            importer.error(Place { file, offset }, message, "");
        }
        last = Some(offset);
    }
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
    media: BTreeMap<&'t str, Option<MediumId>>,
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
        if let Some(table) = root.table(self.importer, "media") {
            self.media(&table);
        }
        if let Some(item) = root.get("medium") {
            self.importer.scene.global_medium = self.medium("medium", item);
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
