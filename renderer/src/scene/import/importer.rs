//! What all importers share: the scene under construction, the files read, and every fault found so far.

use super::image::{ImageKind, decode_image};
use super::mesh_file::{self, MeshKey, MeshOptions};
use crate::bsdf::{Material, MaterialId};
use crate::diagnostics::{Diagnostics, SceneError, Severity};
use crate::geometry::{Mesh, MeshId};
use crate::math::{DAffine3, Transform};
use crate::scene::bundle::{FileSource, resolve};
use crate::scene::desc::{SceneDesc, ShapeDesc};
use crate::texture::{Image, Texels, Texture, TextureId};
use std::collections::BTreeMap;
use std::io::ErrorKind;
use std::sync::Arc;

/// More diagnostics than this are counted, not kept.
const MAX_DIAGNOSTICS: usize = 200;
/// Longer messages are cut: what they quote comes from the file.
const MAX_MESSAGE: usize = 2000;
/// Bytes of text that one scene may consist of, over all its files.
const MAX_TEXT: usize = 32 << 20;
/// Versions of one mesh file, with normals computed for different scales, that are kept.
const MAX_VERSIONS: usize = 64;
/// Characters of an object's name that are kept.
const MAX_NAME: usize = 60;
/// Placed objects that one scene may expand to; a group of n shapes instanced m times counts n m.
const MAX_SHAPES: usize = 1 << 21;

/// Order of diagnostics without a place in a text: after all others.
const ELSEWHERE: (usize, usize) = (usize::MAX, 0);

/// A place in a text file that was read.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Place {
    /// Index among the texts read.
    pub file: usize,
    /// Byte offset.
    pub offset: usize,
}

/// The state of an import.
pub(super) struct Importer<'a> {
    files: &'a dyn FileSource,
    texts: Vec<(String, Arc<[u8]>)>,
    diagnostics: Diagnostics,
    /// Of each diagnostic: the text and byte it belongs to.
    order: Vec<(usize, usize)>,
    unlisted: usize,
    /// What was imported so far.
    pub scene: SceneDesc,
    text_left: usize,
    /// By path, kind, and whether texels were replaced by their luminance.
    images: BTreeMap<(String, ImageKind, bool), Option<Arc<Image>>>,
    meshes: BTreeMap<MeshKey, Option<MeshId>>,
    /// Whether a mesh file brings its own normals, and how many versions of it there are; known once it was read.
    mesh_files: BTreeMap<String, (bool, usize)>,
    full: bool,
}

impl<'a> Importer<'a> {
    /// Nothing read yet.
    pub fn new(files: &'a dyn FileSource) -> Self {
        Self {
            files,
            texts: Vec::new(),
            diagnostics: Diagnostics::default(),
            order: Vec::new(),
            unlisted: 0,
            scene: SceneDesc::default(),
            text_left: MAX_TEXT,
            images: BTreeMap::new(),
            meshes: BTreeMap::new(),
            mesh_files: BTreeMap::new(),
            full: false,
        }
    }

    /// Where the scene's files come from.
    pub fn files(&self) -> &'a dyn FileSource {
        self.files
    }

    /// Takes over what was said of another file.
    pub fn absorb(&mut self, diagnostics: Diagnostics) {
        for d in diagnostics.list {
            self.report(d.severity, ELSEWHERE, &d.file, d.place, d.message, d.help);
        }
    }

    /// Reads the text file `path` (already resolved); `from` names the place that asked for it.
    pub fn read_text(&mut self, from: Option<Place>, path: &str) -> Option<(usize, Arc<[u8]>)> {
        let bytes = self.read(from, path)?;
        let left = self.text_left.checked_sub(bytes.len());
        let Some(left) = left else {
            let message = format!("the scene has more than {} MiB of text", MAX_TEXT >> 20);
            let help = "move meshes to PLY files, pictures to image files";
            self.report(Severity::Error, ELSEWHERE, path, String::new(), message, help.into());
            return None;
        };
        self.text_left = left;
        if let Err(e) = std::str::from_utf8(&bytes) {
            let place = format!("byte {}", e.valid_up_to());
            let help = "save it in the encoding UTF-8";
            self.report(Severity::Error, ELSEWHERE, path, place, "the file is not UTF-8 text".into(), help.into());
            return None;
        }
        self.texts.push((path.to_string(), bytes.clone()));
        Some((self.texts.len() - 1, bytes))
    }

    /// Reads any file, `path` already resolved.
    pub fn read(&mut self, from: Option<Place>, path: &str) -> Option<Arc<[u8]>> {
        match self.files.read(path) {
            Ok(bytes) => Some(bytes),
            Err(e) => {
                let why = match e.kind() {
                    ErrorKind::NotFound => "there is no such file".to_string(),
                    _ => e.to_string(),
                };
                let message = format!("{path:?} can't be read: {why}");
                match from {
                    Some(at) => self.error(at, message, "paths are relative to the file that names them"),
                    None => self.report(Severity::Error, ELSEWHERE, path, String::new(), message, String::new()),
                }
                None
            }
        }
    }

    /// `written` in the file of `at`, as a path of the file source.
    pub fn resolve(&self, at: Place, written: &str) -> String {
        resolve(&self.texts[at.file].0, written)
    }

    /// Adds an error.
    pub fn error(&mut self, at: Place, message: impl Into<String>, help: impl Into<String>) {
        self.report_at(Severity::Error, at, message.into(), help.into());
    }

    /// Adds a warning.
    pub fn warn(&mut self, at: Place, message: impl Into<String>, help: impl Into<String>) {
        self.report_at(Severity::Warning, at, message.into(), help.into());
    }

    /// Adds a fault of a file that is no text of the scene description.
    pub fn file_error(&mut self, path: &str, place: &str, message: &str) {
        self.report(Severity::Error, ELSEWHERE, path, place.to_string(), message.to_string(), String::new());
    }

    /// Whether one more diagnostic would only be counted.
    fn is_list_full(&self, severity: Severity) -> bool {
        let first_error = severity == Severity::Error && !self.diagnostics.has_errors();
        self.diagnostics.list.len() >= MAX_DIAGNOSTICS && !first_error
    }

    fn report_at(&mut self, severity: Severity, at: Place, message: String, help: String) {
        if self.is_list_full(severity) {
            self.unlisted += 1;
            return;
        }
        let (path, text) = &self.texts[at.file];
        let (path, place) = (path.clone(), line_and_column(text, at.offset));
        self.report(severity, (at.file, at.offset), &path, place, message, help);
    }

    fn report(
        &mut self,
        severity: Severity,
        order: (usize, usize),
        path: &str,
        place: String,
        message: String,
        help: String,
    ) {
        if self.is_list_full(severity) {
            self.unlisted += 1;
            return;
        }
        let (message, help) = (shortened(message), shortened(help));
        self.order.push(order);
        match severity {
            Severity::Error => self.diagnostics.error(path, place, message, help),
            Severity::Warning => self.diagnostics.warn(path, place, message, help),
        }
    }

    /// The decoded picture `written` at `at`, if asked for with its luminance in all channels; decoded once however often it is
    /// named.
    pub fn image(&mut self, at: Place, written: &str, kind: ImageKind, luminance: bool) -> Option<Arc<Image>> {
        let key = (self.resolve(at, written), kind, luminance);
        if let Some(known) = self.images.get(&key) {
            return known.clone();
        }
        let image =
            if luminance { self.image(at, written, kind, false).map(grey) } else { self.decode(at, &key.0, kind) };
        self.images.insert(key, image.clone());
        image
    }

    fn decode(&mut self, at: Place, path: &str, kind: ImageKind) -> Option<Arc<Image>> {
        let bytes = self.read(Some(at), path)?;
        match decode_image(&bytes, path, kind) {
            Ok(decoded) => {
                if let Some(note) = decoded.note {
                    self.warn(at, note, "");
                }
                Some(Arc::new(decoded.image))
            }
            Err(message) => {
                self.error(at, message, "");
                None
            }
        }
    }

    /// The mesh file `written` at `at`, read as `options` say; read once however often it is named so.
    pub fn mesh(&mut self, at: Place, written: &str, mut options: MeshOptions) -> Option<MeshId> {
        let path = self.resolve(at, written);
        let (own_normals, versions) = self.mesh_files.get(&path).copied().unwrap_or_default();
        if versions >= MAX_VERSIONS {
            options.normals = options.normals.without_scale();
        }
        let key = MeshKey::new(&path, &options, own_normals);
        if let Some(&known) = self.meshes.get(&key) {
            return known;
        }
        let loaded = self.read(Some(at), &path).and_then(|bytes| match mesh_file::parse(&bytes, &path, &options) {
            Ok(loaded) => Some(loaded),
            Err(e) => {
                self.file_error(&path, &e.place, &e.message);
                None
            }
        });
        let Some(loaded) = loaded else {
            self.meshes.insert(key, None);
            return None;
        };
        self.mesh_files.insert(path.clone(), (loaded.own_normals, versions + 1));
        if versions + 1 == MAX_VERSIONS {
            let message = format!(
                "{path:?} has no normals and is scaled in many ways: from here on normals are computed unscaled"
            );
            self.warn(at, message, "give the mesh vertex normals");
        }
        let id = self.add_mesh(loaded.mesh);
        self.meshes.insert(MeshKey::new(&path, &options, loaded.own_normals), Some(id));
        Some(id)
    }

    /// Adds a mesh.
    pub fn add_mesh(&mut self, mesh: Mesh) -> MeshId {
        self.scene.meshes.push(mesh);
        MeshId((self.scene.meshes.len() - 1) as u32)
    }

    /// Adds a texture.
    pub fn add_texture(&mut self, texture: Texture) -> TextureId {
        self.scene.textures.push(texture);
        TextureId((self.scene.textures.len() - 1) as u32)
    }

    /// Adds a material.
    pub fn add_material(&mut self, material: Material) -> MaterialId {
        self.scene.materials.push(material);
        MaterialId((self.scene.materials.len() - 1) as u32)
    }

    /// Places an object, unless the scene is full.
    pub fn add_shape(&mut self, at: Place, shape: ShapeDesc) {
        if self.scene.shapes.len() < MAX_SHAPES {
            self.scene.shapes.push(shape);
        } else if !self.full {
            self.full = true;
            self.error(
                at,
                format!("the scene has more than {MAX_SHAPES} placed shapes"),
                "join small shapes to meshes",
            );
        }
    }

    /// Whether no more shapes fit.
    pub fn is_full(&self) -> bool {
        self.full
    }

    /// Refuses a map that can't place anything.
    pub fn check_placement(&mut self, at: Place, to_world: DAffine3) -> bool {
        let fine = Transform::new(to_world).is_some();
        if !fine {
            self.error(
                at,
                "the transform is singular, or too large or small for single precision",
                "no axis may be scaled to zero",
            );
        }
        fine
    }

    /// The scene, or everything that is wrong with it, in the order of the text.
    pub fn finish(self) -> Result<(SceneDesc, Diagnostics), SceneError> {
        let mut listed: Vec<_> = self.order.into_iter().zip(self.diagnostics.list).collect();
        listed.sort_by_key(|(order, _)| *order);
        let mut diagnostics = Diagnostics { list: listed.into_iter().map(|(_, d)| d).collect() };
        if self.unlisted > 0 {
            let path = self.texts.first().map_or("", |t| &t.0);
            diagnostics.warn(path, "", format!("{} more faults are not listed", self.unlisted), "");
        }
        if diagnostics.has_errors() { Err(SceneError(diagnostics.list)) } else { Ok((self.scene, diagnostics)) }
    }
}

fn shortened(mut text: String) -> String {
    if text.len() > MAX_MESSAGE {
        text.truncate(text.floor_char_boundary(MAX_MESSAGE));
        text.push_str(" ...");
    }
    text
}

/// A name of an object for messages: not longer than its start.
pub(super) fn short_name(name: &str) -> String {
    name.chars().take(MAX_NAME).collect()
}

fn grey(image: Arc<Image>) -> Arc<Image> {
    Arc::new(Image { width: image.width, height: image.height, texels: Texels::Luminance(image) })
}

/// `line 3, column 14` of the byte at `offset`, both counted from 1, columns in characters.
fn line_and_column(text: &[u8], offset: usize) -> String {
    let before = &text[..offset.min(text.len())];
    let line = 1 + before.iter().filter(|&&b| b == b'\n').count();
    let start = before.iter().rposition(|&b| b == b'\n').map_or(0, |i| i + 1);
    // Continuation bytes of UTF-8 start no character.
    let column = 1 + before[start..].iter().filter(|&&b| b & 0xc0 != 0x80).count();
    format!("line {line}, column {column}")
}
