//! glTF: numbers of the JSON and of the data behind it.

use super::{Document, refused, replaced, text};
use crate::probe::Probe;
use base64::Engine;
use base64::prelude::BASE64_STANDARD;

/// Every number that is read, but for indices; DATA stands for the buffer.
const JSON: &str = r#"{
 "asset": { "version": "2.0" },
 "extensionsUsed": ["KHR_lights_punctual", "KHR_materials_ior", "KHR_materials_transmission", "KHR_materials_volume",
   "KHR_materials_emissive_strength", "KHR_texture_transform", "EXT_mesh_gpu_instancing"],
 "scene": 0,
 "scenes": [{ "nodes": [0, 1, 2, 3, 4, 5, 6] }],
 "nodes": [
  { "mesh": 0, "translation": [0.1, 0.2, 0.3], "rotation": [0.5, 0.5, 0.5, 0.5], "scale": [1.1, 1.2, 1.3] },
  { "mesh": 0, "matrix": [1.1, 0, 0, 0, 0, 1.2, 0, 0, 0, 0, 1.3, 0, 0.1, 0.2, 0.3, 1] },
  { "mesh": 0, "extensions": { "EXT_mesh_gpu_instancing": { "attributes": { "TRANSLATION": 3, "ROTATION": 4, "SCALE": 3 } } } },
  { "camera": 0, "translation": [0.5, 0.6, 5.5] },
  { "extensions": { "KHR_lights_punctual": { "light": 0 } }, "translation": [0.5, 1.6, 1.5] },
  { "extensions": { "KHR_lights_punctual": { "light": 1 } } },
  { "extensions": { "KHR_lights_punctual": { "light": 2 } } }
 ],
 "cameras": [{ "type": "perspective", "perspective": { "yfov": 0.75, "aspectRatio": 1.5, "znear": 0.125, "zfar": 100.5 } }],
 "extensions": { "KHR_lights_punctual": { "lights": [
  { "type": "point", "color": [0.1, 0.2, 0.3], "intensity": 10.5, "range": 20.5 },
  { "type": "spot", "intensity": 10.5, "spot": { "innerConeAngle": 0.25, "outerConeAngle": 0.5 } },
  { "type": "directional", "color": [0.4, 0.5, 0.6], "intensity": 1.5 }
 ] } },
 "meshes": [{ "primitives": [{ "attributes": { "POSITION": 0, "NORMAL": 1, "TEXCOORD_0": 2 }, "material": 0 }] }],
 "materials": [{
  "pbrMetallicRoughness": {
   "baseColorFactor": [0.8, 0.7, 0.6, 0.5], "metallicFactor": 0.25, "roughnessFactor": 0.75,
   "baseColorTexture": { "index": 0, "extensions": { "KHR_texture_transform": {
    "offset": [0.1, 0.2], "rotation": 0.3, "scale": [1.1, 1.2] } } } },
  "normalTexture": { "index": 0, "scale": 0.5 },
  "emissiveFactor": [0.1, 0.2, 0.3],
  "extensions": {
   "KHR_materials_emissive_strength": { "emissiveStrength": 2.5 },
   "KHR_materials_ior": { "ior": 1.4 },
   "KHR_materials_transmission": { "transmissionFactor": 0.5 },
   "KHR_materials_volume": { "thicknessFactor": 0.5, "attenuationDistance": 1.5, "attenuationColor": [0.5, 0.6, 0.7] } }
 }],
 "textures": [{ "source": 0 }],
 "images": [{ "uri": "data:image/png;base64,iVBORw0KGgoAAAANSUhEUgAAAAEAAAABCAIAAACQd1PeAAAADElEQVR4nGP4z8AAAAMBAQDJ/pLvAAAAAElFTkSuQmCC" }],
 "accessors": [
  { "bufferView": 0, "componentType": 5126, "count": 3, "type": "VEC3" },
  { "bufferView": 1, "componentType": 5126, "count": 3, "type": "VEC3" },
  { "bufferView": 2, "componentType": 5126, "count": 3, "type": "VEC2" },
  { "bufferView": 3, "componentType": 5126, "count": 2, "type": "VEC3" },
  { "bufferView": 4, "componentType": 5126, "count": 2, "type": "VEC4" }
 ],
 "bufferViews": [
  { "buffer": 0, "byteOffset": 0, "byteLength": 36 },
  { "buffer": 0, "byteOffset": 36, "byteLength": 36 },
  { "buffer": 0, "byteOffset": 72, "byteLength": 24 },
  { "buffer": 0, "byteOffset": 96, "byteLength": 24 },
  { "buffer": 0, "byteOffset": 120, "byteLength": 32 }
 ],
 "buffers": [{ "byteLength": 152, "uri": "data:application/octet-stream;base64,DATA" }]
}
"#;

/// Positions, normals, texture coordinates, translations (scales, too) and rotations.
const DATA: [f32; 38] = [
    0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0, //
    0.0, 0.0, 1.0, 0.0, 0.0, 1.0, 0.0, 0.0, 1.0, //
    0.0, 0.0, 1.0, 0.0, 0.0, 1.0, //
    1.0, 2.0, 3.0, 4.0, 5.0, 6.0, //
    0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.6, 0.8,
];

fn file(data: &[f32]) -> String {
    let bytes: Vec<u8> = data.iter().flat_map(|v| v.to_le_bytes()).collect();
    JSON.replace("DATA", &BASE64_STANDARD.encode(bytes))
}

pub(super) fn fields(probe: &mut Probe) {
    let name = "scene.gltf";
    let sound = file(&DATA);
    let numbers = text::outside_of_strings(&sound, None);
    let document =
        Document { name, text: &sound, numbers, bad: &["NaN", "Infinity", "1e39", "-1e39", "1e400", "-1e400"] };
    replaced(probe, &document, false);
    for i in 0..DATA.len() {
        for bad in [f32::NAN, f32::INFINITY, f32::NEG_INFINITY] {
            let mut data = DATA;
            data[i] = bad;
            let files = vec![(name, file(&data).into_bytes())];
            let place = if i < 24 { "meshes[0].primitives[0]" } else { "nodes[2]" };
            refused(probe, name, &format!("{bad} for number {i} of the buffer"), Some(place.into()), files);
        }
    }
}
