//! Small glTF files made in the test, with their data in data URIs.

mod faults;
mod geometry;
mod materials;
mod nodes;
mod view;

use super::load_gltf;
use crate::diagnostics::{Diagnostics, Severity};
use crate::scene::bundle::MemorySource;
use crate::scene::desc::SceneDesc;
use base64::Engine;
use base64::prelude::BASE64_STANDARD;
use serde_json::{Value, json};

pub(super) const F32: u32 = 5126;
pub(super) const U32: u32 = 5125;
pub(super) const U16: u32 = 5123;
pub(super) const I16: u32 = 5122;
pub(super) const U8: u32 = 5121;
pub(super) const I8: u32 = 5120;

/// A glTF file being made: JSON with one buffer.
pub(super) struct File {
    pub json: Value,
    pub bytes: Vec<u8>,
}

impl File {
    /// An empty one.
    pub(super) fn new() -> Self {
        let empty = json!([]);
        let json = json!({
            "asset": { "version": "2.0" }, "scene": 0, "scenes": [{ "nodes": [] }],
            "nodes": empty, "meshes": empty, "accessors": empty, "bufferViews": empty, "buffers": empty,
            "materials": empty, "textures": empty, "images": empty, "samplers": empty, "cameras": empty,
        });
        Self { json, bytes: Vec::new() }
    }

    /// One triangle in the plane z = 0, without normals, of `materials[0]` if there is one, at `nodes[0]`.
    pub(super) fn triangle() -> Self {
        let mut file = Self::new();
        let positions = file.floats("VEC3", &[0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0]);
        let uvs = file.floats("VEC2", &[0.0, 1.0, 1.0, 1.0, 0.0, 0.0]);
        let mesh = file
            .add("meshes", json!({ "primitives": [{ "attributes": { "POSITION": positions, "TEXCOORD_0": uvs } }] }));
        file.root(json!({ "mesh": mesh, "name": "corner" }));
        file
    }

    /// [`File::triangle`] with a material and one 1 x 1 texture: sRGB (188, 128, 0).
    pub(super) fn with_material(material: Value) -> Self {
        let mut file = Self::triangle();
        let image = png(&[188, 128, 0]);
        file.add("images", json!({ "uri": format!("data:image/png;base64,{}", BASE64_STANDARD.encode(image)) }));
        file.add("textures", json!({ "source": 0 }));
        file.add("materials", material);
        file.json["meshes"][0]["primitives"][0]["material"] = json!(0);
        file
    }

    /// Appends to a list of the file; gives the index.
    pub(super) fn add(&mut self, list: &str, value: Value) -> usize {
        let list = self.json[list].as_array_mut().unwrap();
        list.push(value);
        list.len() - 1
    }

    /// Adds a node to the scene's roots.
    pub(super) fn root(&mut self, node: Value) -> usize {
        let index = self.add("nodes", node);
        self.json["scenes"][0]["nodes"].as_array_mut().unwrap().push(json!(index));
        index
    }

    /// A buffer view of these bytes.
    pub(super) fn view(&mut self, bytes: &[u8]) -> usize {
        let offset = self.bytes.len();
        self.bytes.extend(bytes);
        self.add("bufferViews", json!({ "buffer": 0, "byteOffset": offset, "byteLength": bytes.len() }))
    }

    /// An accessor of any kind, tightly packed.
    pub(super) fn accessor(&mut self, kind: &str, component: u32, count: usize, bytes: &[u8]) -> usize {
        let view = self.view(bytes);
        self.add("accessors", json!({ "bufferView": view, "componentType": component, "count": count, "type": kind }))
    }

    /// An accessor of floats.
    pub(super) fn floats(&mut self, kind: &str, values: &[f32]) -> usize {
        let width = match kind {
            "VEC2" => 2,
            "VEC3" => 3,
            "VEC4" => 4,
            _ => 1,
        };
        let bytes: Vec<u8> = values.iter().flat_map(|v| v.to_le_bytes()).collect();
        self.accessor(kind, F32, values.len() / width, &bytes)
    }

    /// An accessor of u32 indices.
    pub(super) fn indices(&mut self, values: &[u32]) -> usize {
        let bytes: Vec<u8> = values.iter().flat_map(|v| v.to_le_bytes()).collect();
        self.accessor("SCALAR", U32, values.len(), &bytes)
    }

    /// The .gltf file.
    pub(super) fn text(&self) -> Vec<u8> {
        let mut json = self.json.clone();
        if json["buffers"] == json!([]) {
            let uri = format!("data:application/octet-stream;base64,{}", BASE64_STANDARD.encode(&self.bytes));
            json["buffers"] = json!([{ "byteLength": self.bytes.len(), "uri": uri }]);
        }
        serde_json::to_vec(&json).unwrap()
    }

    /// Loads it; warnings as text.
    pub(super) fn load(&self) -> (SceneDesc, Vec<String>) {
        self.load_with(MemorySource::default())
    }

    /// Loads it with further files beside it.
    pub(super) fn load_with(&self, mut source: MemorySource) -> (SceneDesc, Vec<String>) {
        source.files.insert("dir/t.gltf".into(), self.text().into());
        let mut diagnostics = Diagnostics::default();
        let scene = load_gltf(&source, "dir/t.gltf", &mut diagnostics);
        let texts = diagnostics.list.iter().map(ToString::to_string).collect();
        assert!(!diagnostics.has_errors(), "{texts:?}");
        (scene.unwrap(), texts)
    }

    /// Loads it and gives the errors, of which there must be some.
    pub(super) fn errors(&self) -> Vec<String> {
        errors_of(&self.text())
    }
}

/// The errors of a file that must not load.
pub(super) fn errors_of(bytes: &[u8]) -> Vec<String> {
    let mut source = MemorySource::default();
    source.files.insert("t.glb".into(), bytes.into());
    let mut diagnostics = Diagnostics::default();
    assert!(load_gltf(&source, "t.glb", &mut diagnostics).is_none());
    let errors = diagnostics.list.iter().filter(|d| d.severity == Severity::Error);
    let texts: Vec<String> = errors.map(ToString::to_string).collect();
    assert!(!texts.is_empty());
    texts
}

/// A one-row PNG of RGB texels.
pub(super) fn png(texels: &[u8]) -> Vec<u8> {
    let image = image::RgbImage::from_raw(texels.len() as u32 / 3, 1, texels.to_vec()).unwrap();
    let mut out = std::io::Cursor::new(Vec::new());
    image.write_to(&mut out, image::ImageFormat::Png).unwrap();
    out.into_inner()
}

/// Whether some text holds all the words.
pub(super) fn says(texts: &[String], words: &[&str]) -> bool {
    texts.iter().any(|t| words.iter().all(|w| t.contains(w)))
}
