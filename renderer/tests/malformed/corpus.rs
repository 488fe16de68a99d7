//! Every file of the shared collection of malformed files.

use crate::guard::{Outcome, alone, guarded};
use crate::whole::{decode, load_scene};
use renderer::scene::bundle::{DiskSource, FileSource};
use serde_json::{Value, json};
use std::path::{Path, PathBuf};
use std::sync::Arc;

fn files_below(folder: &Path, into: &mut Vec<PathBuf>) {
    let Ok(entries) = std::fs::read_dir(folder) else { return };
    let mut entries: Vec<PathBuf> = entries.flatten().map(|e| e.path()).collect();
    entries.sort();
    for path in entries {
        if path.is_dir() {
            files_below(&path, into);
        } else {
            into.push(path);
        }
    }
}

/// The collection, with names relative to it; empty with a printed line where it is not there.
fn collection() -> Vec<(String, PathBuf)> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../shared/data/malformed");
    let mut paths = Vec::new();
    files_below(&folder, &mut paths);
    if paths.is_empty() {
        println!("skipped: {} is not there", folder.display());
    }
    paths.into_iter().map(|p| (p.strip_prefix(&folder).unwrap_or(&p).display().to_string(), p)).collect()
}

fn is_scene(path: &Path) -> bool {
    path.extension().is_some_and(|e| e == "gltf" || e == "glb")
}

#[test]
fn every_malformed_file_loads_or_gives_an_error() {
    let _alone = alone();
    let collection = collection();
    if collection.is_empty() {
        return;
    }
    // [refused, loaded]
    let (mut scenes, mut others) = ([0, 0], [0, 0]);
    for (name, path) in collection {
        let (scene, own) = (is_scene(&path), name.clone());
        let outcome = guarded(&name, move || {
            if scene {
                let (files, root) = DiskSource::for_scene(&path).unwrap();
                load_scene(&files, &root, &own)
            } else {
                decode(&std::fs::read(&path).unwrap(), &own)
            }
        });
        let counts = if scene { &mut scenes } else { &mut others };
        counts[usize::from(matches!(outcome, Outcome::Loaded))] += 1;
        match outcome {
            Outcome::Loaded => println!("{name}: loaded"),
            Outcome::Refused(text) => println!("{name}: {text}"),
        }
    }
    println!("scenes: {} refused, {} loaded", scenes[0], scenes[1]);
    println!("other files: {} refused, {} loaded", others[0], others[1]);
    assert!(scenes[0] + scenes[1] >= 390 && others[1] >= 150, "the collection is not whole");
}

/// Most of the collection's scenes have no node that uses the faulty part. So once more, with nodes that use every part in every way.
#[test]
fn every_part_of_a_malformed_scene_may_be_used() {
    let _alone = alone();
    let mut tried = 0;
    for (name, path) in collection() {
        let Ok(text) = std::fs::read(&path) else { continue };
        let Some(json) = Some(text).filter(|_| is_scene(&path)).and_then(|t| serde_json::from_slice(&t).ok()) else {
            continue;
        };
        for part in 0.. {
            let Some(text) = using(&json, part) else { break };
            tried += 1;
            let (path, own) = (path.clone(), name.clone());
            let outcome = guarded(&name, move || {
                let (disk, root) = DiskSource::for_scene(&path).unwrap();
                load_scene(&Overlay { disk, root: root.clone(), text: text.into() }, &root, &own)
            });
            if let Outcome::Refused(text) = outcome {
                println!("{name} {part}: {text}");
            }
        }
    }
    println!("{tried} parts used");
}

/// The scene's file replaced, the others from the disk.
struct Overlay {
    disk: DiskSource,
    root: String,
    text: Arc<[u8]>,
}

impl FileSource for Overlay {
    fn read(&self, path: &str) -> std::io::Result<Arc<[u8]>> {
        if path == self.root { Ok(self.text.clone()) } else { self.disk.read(path) }
    }
}

/// The file with a triangle of its own and one more node that uses `part`; `None` after the last part.
fn using(original: &Value, part: usize) -> Option<Vec<u8>> {
    let mut file = original.clone();
    let count = |list: &str| original.get(list).and_then(Value::as_array).map_or(0, Vec::len);
    let lights =
        original.pointer("/extensions/KHR_lights_punctual/lights").and_then(Value::as_array).map_or(0, Vec::len);
    let bytes = "AAAAAAAAAAAAAAAAAACAPwAAAAAAAAAAAAAAAAAAgD8AAAAA";
    let buffer = push(&mut file, "buffers", json!({ "byteLength": 36, "uri": format!("data:;base64,{bytes}") }))?;
    let view = push(&mut file, "bufferViews", json!({ "buffer": buffer, "byteLength": 36 }))?;
    let own = json!({ "bufferView": view, "componentType": 5126, "count": 3, "type": "VEC3" });
    let own = push(&mut file, "accessors", own)?;
    let plain = json!({ "attributes": { "POSITION": own } });
    let mut primitive = plain.clone();
    let mut node = json!({});
    let mut at = part;
    // Takes `ways` parts for each element of a list: Some((element, way)) when `part` is among them.
    let mut takes = |elements: usize, ways: usize| {
        let mine = at < elements * ways;
        let place = (at / ways.max(1), at % ways.max(1));
        at = at.wrapping_sub(elements * ways);
        mine.then_some(place)
    };
    if let Some((a, way)) = takes(count("accessors"), 7) {
        match way {
            0 => primitive["attributes"]["POSITION"] = json!(a),
            1 => primitive["attributes"]["NORMAL"] = json!(a),
            2 => {
                primitive["attributes"]["TEXCOORD_0"] = json!(a);
                let info = json!({ "normalTexture": { "index": 0 } });
                primitive["material"] = json!(push(&mut file, "materials", info)?);
            }
            3 => primitive["indices"] = json!(a),
            _ => {
                let attribute = ["TRANSLATION", "ROTATION", "SCALE"][way - 4];
                node["extensions"] = json!({ "EXT_mesh_gpu_instancing": { "attributes": { attribute: a } } });
            }
        }
    } else if let Some((m, _)) = takes(count("materials"), 1) {
        primitive["material"] = json!(m);
    } else if let Some((t, way)) = takes(count("textures"), 2) {
        let names = ["normalTexture", "emissiveTexture"];
        let material = json!({ names[way]: { "index": t }, "emissiveFactor": [1, 1, 1] });
        primitive["material"] = json!(push(&mut file, "materials", material)?);
    } else if let Some((i, _)) = takes(count("images"), 1) {
        let texture = push(&mut file, "textures", json!({ "source": i }))?;
        let material = json!({ "pbrMetallicRoughness": { "baseColorTexture": { "index": texture } } });
        primitive["material"] = json!(push(&mut file, "materials", material)?);
    } else if let Some((c, _)) = takes(count("cameras"), 1) {
        node["camera"] = json!(c);
    } else if let Some((l, _)) = takes(lights, 1) {
        node["extensions"] = json!({ "KHR_lights_punctual": { "light": l } });
    } else if let Some((m, _)) = takes(count("meshes"), 1) {
        let other = push(&mut file, "nodes", json!({ "mesh": m }))?;
        node["children"] = json!([other]);
    } else if let Some((n, _)) = takes(count("nodes"), 1) {
        node["children"] = json!([n]);
    } else {
        return None;
    }
    node["mesh"] = json!(push(&mut file, "meshes", json!({ "primitives": [plain, primitive] }))?);
    let node = push(&mut file, "nodes", node)?;
    file["scenes"] = json!([{ "nodes": [node] }]);
    let root = file.as_object_mut()?;
    root.remove("scene");
    root.remove("extensionsRequired");
    serde_json::to_vec(&file).ok()
}

/// Appends to a list of the file, which is made if need be.
fn push(file: &mut Value, list: &str, value: Value) -> Option<usize> {
    let list = file.as_object_mut()?.entry(list).or_insert_with(|| json!([])).as_array_mut()?;
    list.push(value);
    Some(list.len() - 1)
}
