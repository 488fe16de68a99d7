//! Small valid files, damaged in thousands of ways that need no collection: bits flipped, ends cut off, numbers replaced.

use crate::guard::{Outcome, alone, guarded};
use crate::whole::{decode, load_scene};
use base64::Engine;
use base64::prelude::BASE64_STANDARD;
use exr::prelude::{Compression, Encoding, Image, Layer, LayerAttributes, LineOrder, SpecificChannels, WritableImage};
use image::{DynamicImage, ImageFormat};
use renderer::scene::bundle::MemorySource;
use serde_json::{Value, json};
use std::io::Cursor;

const JPEG: &[u8] = include_bytes!("../data/ramps.jpg");

/// A sequence of numbers without a seed to choose: Weyl's, mixed (SplitMix64).
struct Numbers(u64);

impl Numbers {
    fn below(&mut self, bound: usize) -> usize {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let z = (self.0 ^ (self.0 >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        let z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        ((z ^ (z >> 31)) % bound as u64) as usize
    }
}

/// `count` damaged copies: one to four bytes changed, or the end cut off, or both.
fn damaged(good: &[u8], count: usize) -> impl Iterator<Item = Vec<u8>> {
    let mut numbers = Numbers(good.len() as u64);
    (0..count).map(move |i| {
        let mut bytes = good.to_vec();
        if i % 4 == 3 {
            bytes.truncate(numbers.below(good.len()));
        }
        for _ in 0..i % 5 {
            let at = numbers.below(good.len());
            let value = match i % 3 {
                0 => 1 << numbers.below(8),
                1 => good[at],
                _ => numbers.below(256) as u8,
            };
            bytes.get_mut(at).into_iter().for_each(|b| *b ^= value);
        }
        bytes
    })
}

/// Runs all copies in one guarded thread per hundred; gives how many loaded.
fn try_all(name: &str, copies: impl Iterator<Item = Vec<u8>>, read: fn(Vec<u8>, &str) -> Outcome) -> usize {
    let copies: Vec<Vec<u8>> = copies.collect();
    let mut loaded = 0;
    for (i, batch) in copies.chunks(100).enumerate() {
        let (batch, own) = (batch.to_vec(), name.to_string());
        let (send, receive) = std::sync::mpsc::channel();
        guarded(&format!("{name}, batch {i}"), move || {
            for bytes in batch {
                let outcome = read(bytes, &own);
                // The receiver outlives this thread.
                let _ = send.send(matches!(outcome, Outcome::Loaded));
            }
            Outcome::Loaded
        });
        loaded += receive.iter().filter(|l| *l).count();
    }
    println!("{name}: {loaded} of {} damaged copies loaded", copies.len());
    loaded
}

fn read_scene(bytes: Vec<u8>, name: &str) -> Outcome {
    let mut files = MemorySource::default();
    files.files.insert("a.glb".into(), bytes.into());
    load_scene(&files, "a.glb", name)
}

fn read_picture(bytes: Vec<u8>, name: &str) -> Outcome {
    decode(&bytes, name)
}

fn picture(format: ImageFormat) -> Vec<u8> {
    let pixels: Vec<u8> = (0..16 * 8 * 3).map(|i| (i * 5 % 256) as u8).collect();
    let mut out = Cursor::new(Vec::new());
    match format {
        ImageFormat::Hdr => {
            let pixels: Vec<image::Rgb<f32>> = (0..128).map(|i| image::Rgb([i as f32, 0.5, 1e-3])).collect();
            image::codecs::hdr::HdrEncoder::new(&mut out).encode(&pixels, 16, 8).unwrap();
        }
        _ => {
            let image = image::RgbImage::from_raw(16, 8, pixels).unwrap();
            DynamicImage::ImageRgb8(image).write_to(&mut out, ImageFormat::Png).unwrap();
        }
    }
    out.into_inner()
}

fn exr_picture(compression: Compression) -> Vec<u8> {
    let channels = SpecificChannels::rgba(|p: exr::math::Vec2<usize>| (p.0 as f32, p.1 as f32, 0.25f32, 1.0f32));
    let encoding = Encoding { compression, line_order: LineOrder::Increasing, blocks: exr::prelude::Blocks::ScanLines };
    let layer = Layer::new((16, 8), LayerAttributes::named("l"), encoding, channels);
    let mut out = Cursor::new(Vec::new());
    Image::from_layer(layer).write().non_parallel().to_buffered(&mut out).unwrap();
    out.into_inner()
}

/// A glTF that uses everything the loader knows.
fn scene_json() -> Value {
    let numbers = |v: &[f32]| v.iter().flat_map(|v| v.to_le_bytes()).collect::<Vec<u8>>();
    let views = [
        numbers(&[0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 1.0, 1.0, 0.0]),
        numbers(&[0.0, 0.0, 1.0].repeat(4)),
        vec![0, 0, 255, 0, 0, 255, 255, 255],
        vec![0, 1, 2, 2, 1, 3],
        vec![1, 3],
        numbers(&[2.0, 0.0, 0.0, 2.0, 2.0, 0.0]),
        numbers(&[0.0, 0.0, 0.0, 4.0, 0.0, 0.0]),
        picture(ImageFormat::Png),
    ];
    let mut bytes = Vec::new();
    let mut json_views = Vec::new();
    for view in &views {
        json_views.push(json!({ "buffer": 0, "byteOffset": bytes.len(), "byteLength": view.len() }));
        bytes.extend(view);
    }
    let uri = |mime: &str, bytes: &[u8]| format!("data:{mime};base64,{}", BASE64_STANDARD.encode(bytes));
    let transform =
        json!({ "KHR_texture_transform": { "offset": [0.1, 0.2], "rotation": 0.3, "scale": [2, 2], "texCoord": 0 } });
    json!({
        "asset": { "version": "2.0" },
        "extensionsUsed": ["EXT_mesh_gpu_instancing"],
        "scene": 0,
        "scenes": [{ "nodes": [0, 3] }],
        "nodes": [
            { "mesh": 0, "translation": [1, 2, 3], "rotation": [0, 0, 0.6, 0.8], "scale": [1, 2, 3], "children": [1, 2],
              "extensions": { "EXT_mesh_gpu_instancing": { "attributes": { "TRANSLATION": 4 } } } },
            { "camera": 0, "matrix": [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 9, 1] },
            { "extensions": { "KHR_lights_punctual": { "light": 0 } } },
            { "mesh": 1 },
        ],
        "meshes": [
            { "primitives": [
                { "attributes": { "POSITION": 0, "NORMAL": 1, "TEXCOORD_0": 2 }, "indices": 3, "material": 0 },
            ] },
            { "primitives": [{ "attributes": { "POSITION": 0 }, "mode": 5, "material": 1 }] },
        ],
        "accessors": [
            { "bufferView": 0, "componentType": 5126, "count": 4, "type": "VEC3", "sparse": { "count": 2,
              "indices": { "bufferView": 4, "componentType": 5121 }, "values": { "bufferView": 5, "byteOffset": 0 } } },
            { "bufferView": 1, "byteOffset": 0, "componentType": 5126, "count": 4, "type": "VEC3" },
            { "bufferView": 2, "componentType": 5121, "count": 4, "type": "VEC2", "normalized": true },
            { "bufferView": 3, "componentType": 5121, "count": 6, "type": "SCALAR" },
            { "bufferView": 6, "componentType": 5126, "count": 2, "type": "VEC3" },
        ],
        "bufferViews": json_views,
        "buffers": [{ "byteLength": bytes.len(), "uri": uri("application/octet-stream", &bytes) }],
        "materials": [
            {
                "pbrMetallicRoughness": { "baseColorFactor": [1, 0.5, 0.25, 1], "metallicFactor": 0.5, "roughnessFactor": 0.5,
                    "baseColorTexture": { "index": 0, "extensions": transform }, "metallicRoughnessTexture": { "index": 1 } },
                "normalTexture": { "index": 1, "scale": 0.5, "texCoord": 0, "extensions": transform },
                "emissiveTexture": { "index": 0 }, "emissiveFactor": [0.5, 0.5, 0.5], "doubleSided": true, "alphaMode": "MASK",
                "extensions": {
                    "KHR_materials_emissive_strength": { "emissiveStrength": 3 }, "KHR_materials_ior": { "ior": 1.4 },
                    "KHR_materials_transmission": { "transmissionFactor": 0.5, "transmissionTexture": { "index": 0 } },
                    "KHR_materials_volume": { "thicknessFactor": 1, "attenuationDistance": 2, "attenuationColor": [1, 0, 0] },
                },
            },
            { "extensions": { "KHR_materials_unlit": {} } },
        ],
        "textures": [{ "source": 0, "sampler": 0 }, { "source": 1 }],
        "images": [{ "uri": uri("image/jpeg", JPEG) }, { "bufferView": 7, "mimeType": "image/png" }],
        "samplers": [{ "magFilter": 9728, "minFilter": 9984, "wrapS": 33071, "wrapT": 33648 }],
        "cameras": [{ "type": "perspective", "perspective": { "yfov": 0.7, "znear": 0.1, "aspectRatio": 1.5 } }],
        "extensions": { "KHR_lights_punctual": { "lights": [
            { "type": "spot", "color": [1, 1, 1], "intensity": 3, "spot": { "innerConeAngle": 0.1, "outerConeAngle": 0.3 } },
        ] } },
    })
}

fn glb(json: &Value) -> Vec<u8> {
    let mut json = json.clone();
    let uri = json["buffers"][0]["uri"].take();
    let bin = BASE64_STANDARD.decode(uri.as_str().unwrap().split_once(',').unwrap().1).unwrap();
    json["buffers"][0].as_object_mut().unwrap().remove("uri");
    let text = serde_json::to_vec(&json).unwrap();
    let chunk = |kind: &[u8; 4], data: &[u8]| [&(data.len() as u32).to_le_bytes(), &kind[..], data].concat();
    let body = [chunk(b"JSON", &text), chunk(b"BIN\0", &bin)].concat();
    [b"glTF", &2u32.to_le_bytes()[..], &(12 + body.len() as u32).to_le_bytes(), &body].concat()
}

#[test]
fn damaged_scenes_load_or_give_an_error() {
    let _alone = alone();
    let json = scene_json();
    let (text, binary) = (serde_json::to_vec(&json).unwrap(), glb(&json));
    for (name, good) in [("gltf", text), ("glb", binary)] {
        assert!(matches!(read_scene(good.clone(), name), Outcome::Loaded), "the {name} itself must load");
        let loaded = try_all(name, damaged(&good, 2000), read_scene);
        assert!(loaded > 100, "{name}: almost nothing loads: the damage is not subtle enough to test the loader");
    }
}

#[test]
fn damaged_pictures_decode_or_give_an_error() {
    let _alone = alone();
    let pictures = [
        ("png", picture(ImageFormat::Png)),
        ("jpeg", JPEG.to_vec()),
        ("hdr", picture(ImageFormat::Hdr)),
        ("exr uncompressed", exr_picture(Compression::Uncompressed)),
        ("exr rle", exr_picture(Compression::RLE)),
        ("exr zip", exr_picture(Compression::ZIP16)),
        ("exr piz", exr_picture(Compression::PIZ)),
        ("exr pxr24", exr_picture(Compression::PXR24)),
        ("exr b44", exr_picture(Compression::B44)),
    ];
    for (name, good) in pictures {
        assert!(matches!(decode(&good, name), Outcome::Loaded), "the {name} itself must load");
        try_all(name, damaged(&good, 1000), read_picture);
    }
}

/// Puts every kind of unlikely value in the place of every value of a good file, one at a time.
#[test]
fn every_value_of_a_scene_may_be_anything() {
    let _alone = alone();
    let good = scene_json();
    let mut pointers = Vec::new();
    all_pointers(&good, String::new(), &mut pointers);
    let unlikely = [
        json!(0),
        json!(1),
        json!(-1),
        json!(3),
        json!(255),
        json!(4294967295u32),
        json!(u64::MAX),
        json!(0.5),
        json!(-1e39),
        json!(1e39),
        json!(1e18),
        json!(1e-45),
        json!(""),
        json!("data:,x"),
        json!([]),
        json!([1e38, 1e38, 1e38]),
        json!({}),
        json!(null),
        json!(true),
        json!(5126),
        json!("VEC4"),
    ];
    let copies = pointers.iter().flat_map(|pointer| {
        let good = &good;
        unlikely.iter().map(move |value| {
            let mut json = good.clone();
            *json.pointer_mut(pointer).unwrap() = value.clone();
            serde_json::to_vec(&json).unwrap()
        })
    });
    let loaded = try_all("replaced values", copies, read_scene);
    assert!(loaded > 500, "only {loaded} loaded");
}

fn all_pointers(value: &Value, at: String, into: &mut Vec<String>) {
    match value {
        Value::Array(list) => list.iter().enumerate().for_each(|(i, v)| all_pointers(v, format!("{at}/{i}"), into)),
        Value::Object(map) => map.iter().for_each(|(k, v)| all_pointers(v, format!("{at}/{k}"), into)),
        _ => {}
    }
    into.push(at);
}
