//! glTF 2.0: .gltf and .glb files.
//!
//! The crate `gltf` gives the typed JSON; everything that it names by index, offset or count is checked here, and the crate's own
//! readers, which trust it, are not used. Conventions, where glTF leaves them open or lightfarm departs:
//!
//! * Materials are seen from both sides, also where `doubleSided` is false: path tracers have no back-face culling. Only the
//!   emission heeds it: a surface that is not double-sided emits from its front.
//! * `KHR_materials_unlit` makes a black surface that emits its base colour: seen directly it has that colour, as the extension asks;
//!   being light, it also lights other surfaces.
//! * Candela and lux of `KHR_lights_punctual` are taken as W/sr and W/m^2, emissive factor times strength as W/(sr m^2); the `range`
//!   of a light is ignored.
//! * A transmitting material is thin unless `KHR_materials_volume` gives it a thickness; then it refracts, and attenuates
//!   by an absorbing medium inside.
//! * The camera is the first perspective one of the scene, a pinhole; `aspectRatio` proposes the picture's width at 720 lines.
//! * Without a camera, one that frames the scene stands in; without light, soft light from all around. Both are said.
//! * Nodes hidden by `KHR_node_visibility` are left out with all below them.
//! * Skins, morph targets, animations and vertex colours are ignored, alpha is taken as opaque; each is said.
//! * Tangents follow the texture coordinates; a TANGENT attribute is not read.

mod accessor;
mod buffers;
mod document;
mod material;
mod mesh;
mod nodes;
mod report;
mod texture;
mod view;

use self::buffers::Buffers;
use self::material::Surface;
use self::mesh::MeshKey;
use self::report::{Checked, Fault, Report};
use self::texture::TextureKey;
use super::image::ImageKind;
use crate::bsdf::MaterialId;
use crate::diagnostics::Diagnostics;
use crate::geometry::MeshId;
use crate::math::DVec3;
use crate::scene::bundle::FileSource;
use crate::scene::desc::SceneDesc;
use crate::texture::{Image, TextureId};
use ::gltf::json::Root;
use std::collections::BTreeMap;
use std::sync::Arc;

/// Bytes that the decoded images of one file may take together.
const IMAGE_BYTES: u64 = 8 << 30;
/// Bytes that the meshes of one file may take together, beside [`MESH_SHARE`] times the bytes of its buffers.
const MESH_BYTES: u64 = 256 << 20;
/// Indices of one byte become four, strips three corners per index, and several primitives may share their vertices.
const MESH_SHARE: u64 = 32;

/// A file on its way into a scene.
struct Importer<'a> {
    root: &'a Root,
    buffers: &'a Buffers<'a>,
    files: &'a dyn FileSource,
    file: &'a str,
    report: Report<'a>,
    scene: SceneDesc,
    mesh_ids: BTreeMap<MeshKey, Checked<Option<MeshId>>>,
    mesh_boxes: BTreeMap<MeshId, (DVec3, DVec3)>,
    mesh_bytes_left: u64,
    images: BTreeMap<(usize, ImageKind), Checked<Arc<Image>>>,
    image_bytes_left: u64,
    texture_ids: BTreeMap<TextureKey, TextureId>,
    surfaces: BTreeMap<Option<usize>, Surface>,
    has_camera: bool,
    /// Placed primitives so far, also those that came to nothing.
    placed: usize,
    /// Of all placed meshes, world space.
    bounds: (DVec3, DVec3),
}

/// A file that goes into another scene.
#[derive(Default)]
pub(super) struct Part {
    /// What it contains.
    pub scene: SceneDesc,
    /// Whether it has a camera of its own.
    pub has_camera: bool,
    /// Its named materials.
    pub materials: Vec<(String, MaterialId)>,
}

/// Loads the .gltf or .glb file `root` of `files`. `None` with errors in `diagnostics` where it can't be shown.
pub(super) fn load_gltf(files: &dyn FileSource, root: &str, diagnostics: &mut Diagnostics) -> Option<SceneDesc> {
    load(files, root, diagnostics, true).map(|part| part.scene)
}

/// The same for a file that goes into another scene: nothing stands in for a camera or light that it lacks.
pub(super) fn load_part(files: &dyn FileSource, root: &str, diagnostics: &mut Diagnostics) -> Option<Part> {
    load(files, root, diagnostics, false)
}

fn load(files: &dyn FileSource, root: &str, diagnostics: &mut Diagnostics, stand_ins: bool) -> Option<Part> {
    let mut report = Report::new(root, diagnostics);
    let bytes = files.read(root).map_err(|e| Fault::new("", format!("can't be read: {e}")));
    let document = report.check(bytes.and_then(|bytes| document::parse(&bytes)))?;
    document::check_header(&document.root, &mut report);
    let buffers = Buffers::read(&document, files, root);
    let mut importer = Importer {
        root: &document.root,
        mesh_bytes_left: MESH_BYTES.saturating_add(buffers.total().saturating_mul(MESH_SHARE)),
        buffers: &buffers,
        files,
        file: root,
        report,
        scene: SceneDesc::default(),
        mesh_ids: BTreeMap::new(),
        mesh_boxes: BTreeMap::new(),
        images: BTreeMap::new(),
        image_bytes_left: IMAGE_BYTES,
        texture_ids: BTreeMap::new(),
        surfaces: BTreeMap::new(),
        has_camera: false,
        placed: 0,
        bounds: (DVec3::INFINITY, DVec3::NEG_INFINITY),
    };
    if !importer.report.failed() {
        let walked = importer.nodes();
        importer.report.check(walked);
    }
    importer.finish(stand_ins)
}

impl Importer<'_> {
    fn finish(mut self, stand_ins: bool) -> Option<Part> {
        if !self.root.animations.is_empty() {
            let message = "animations are not supported; the nodes are shown at rest";
            self.report.warn(Fault::new("animations", message));
        }
        if !self.report.failed() && self.scene.shapes.is_empty() {
            let fault = Fault::new("", "there is nothing to show: no triangles in the scene");
            self.report.fault(fault.help("give a node of the default scene a mesh of triangles"));
        }
        let failed = self.report.failed();
        if !failed && stand_ins {
            self.stand_ins();
        }
        self.report.finish();
        let named = self.surfaces.iter().filter_map(|(index, surface)| {
            let name = self.root.materials.get((*index)?)?.name.clone()?;
            Some((name, surface.material))
        });
        let materials = named.collect();
        (!failed).then_some(Part { scene: self.scene, has_camera: self.has_camera, materials })
    }
}

#[cfg(test)]
mod tests;
