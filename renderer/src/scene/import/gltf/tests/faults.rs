use super::*;

/// A .glb of these chunks.
fn glb(chunks: &[(&[u8; 4], &[u8])]) -> Vec<u8> {
    let body: Vec<u8> =
        chunks.iter().flat_map(|(kind, data)| [&(data.len() as u32).to_le_bytes(), &kind[..], data].concat()).collect();
    let length = 12 + body.len() as u32;
    [b"glTF", &2u32.to_le_bytes()[..], &length.to_le_bytes(), &body].concat()
}

fn binary_triangle() -> (Vec<u8>, Vec<u8>) {
    let mut file = File::triangle();
    file.json["buffers"] = json!([{ "byteLength": file.bytes.len() }]);
    (file.text(), file.bytes.clone())
}

#[test]
fn binary_files() {
    let (json, bin) = binary_triangle();
    let good = glb(&[(b"JSON", &json), (b"BIN\0", &[bin.clone(), vec![0; 3]].concat()), (b"EXTR", b"abc")]);
    let mut source = MemorySource::default();
    source.files.insert("a.glb".into(), good.clone().into());
    let mut diagnostics = Diagnostics::default();
    let scene = load_gltf(&source, "a.glb", &mut diagnostics);
    assert_eq!(scene.unwrap().meshes[0].positions.len(), 3, "{diagnostics:?}");
    let with = |at: usize, word: u32| {
        let mut bytes = good.clone();
        bytes[at..at + 4].copy_from_slice(&word.to_le_bytes());
        bytes
    };
    for (bytes, words) in [
        (with(4, 1), "version 1"),
        (with(8, u32::MAX), "promises 4294967295 bytes"),
        (with(8, 0), "no JSON chunk"),
        (with(8, 14), "past the end"),
        (with(12, u32::MAX), "past the end"),
        (good[..11].to_vec(), "ends in a header"),
        (glb(&[(b"BIN\0", &bin), (b"JSON", &json)]), "out of place"),
        (glb(&[(b"JSON", &json), (b"JSON", &json)]), "out of place"),
        (glb(&[(b"JSON", &json)]), "buffers[0]"),
        (glb(&[(b"JSON", &json), (b"BIN\0", &bin[1..])]), "buffers[0].byteLength"),
        (glb(&[(b"JSON", b"{ \"asset\": 3 }")]), "JSON chunk line 1, column"),
    ] {
        let errors = errors_of(&bytes);
        assert!(says(&errors, &[words]), "{words}: {errors:?}");
    }
}

#[test]
fn damaged_json_is_refused_with_line_and_path() {
    for (text, words) in [
        ("", "line 1"),
        ("{", "EOF"),
        ("{}", "missing field `asset`"),
        ("{\"asset\":{\"version\":\"2.0\"}} x", "trailing characters"),
        ("\u{feff}{}", "byte-order mark"),
        ("{\"asset\":{\"version\":\"2.0\"},\n\"nodes\":[{\"mesh\":\"x\"}]}", "line 2, column 20, nodes[0].mesh"),
        ("{\"asset\":{\"version\":\"1.0\"}}", "asset.version: this is glTF \"1.0\""),
        ("{\"asset\":{\"version\":\"2.0\",\"minVersion\":\"2.1\"}}", "asset.minVersion"),
    ] {
        let errors = errors_of(text.as_bytes());
        assert!(says(&errors, &[words]), "{words}: {errors:?}");
    }
    let deep = "[".repeat(100_000);
    assert!(says(&errors_of(format!("{{\"extensions\":{{\"x\":{deep}").as_bytes()), &["recursion limit"]));
}

#[test]
fn what_the_crate_refuses_without_need_loads() {
    let mut file = File::triangle();
    file.json["nodes"][0]["mesh"] = json!(0.0);
    file.add("scenes", json!({ "name": "empty" }));
    file.json["animations"] =
        json!([{ "channels": [{ "sampler": 0, "target": { "path": "pointer" } }], "samplers": [] }]);
    let (scene, warnings) = file.load();
    assert_eq!(scene.shapes.len(), 1);
    assert!(says(&warnings, &["animations are not supported"]), "{warnings:?}");
}

#[test]
fn required_extensions_must_be_supported() {
    let mut file = File::triangle();
    file.json["extensionsRequired"] =
        json!(["KHR_texture_transform", "KHR_draco_mesh_compression", "EXT_meshopt_compression"]);
    let errors = file.errors();
    assert!(says(&errors, &["extensionsRequired[1]", "KHR_draco_mesh_compression"]));
    assert!(says(&errors, &["extensionsRequired[2]", "EXT_meshopt_compression"]));
    assert_eq!(errors.len(), 2);
    file.json["extensionsRequired"] = json!([]);
    file.json["extensionsUsed"] = json!(["KHR_draco_mesh_compression", "KHR_texture_transform"]);
    let (_, warnings) = file.load();
    assert!(says(&warnings, &["extensionsUsed[0]", "is ignored"]) && !says(&warnings, &["extensionsUsed[1]"]));
}

#[test]
fn accessors_and_views_are_checked() {
    for (list, index, key, value, words) in [
        ("bufferViews", 0, "byteOffset", json!(u64::MAX), "bufferViews[0]: bytes"),
        ("bufferViews", 0, "byteLength", json!(u64::MAX), "bufferViews[0]: bytes"),
        ("bufferViews", 0, "byteLength", json!(35), "accessors[0]: 3 elements of 12 bytes"),
        ("bufferViews", 0, "buffer", json!(1), "bufferViews[0]: it names buffers[1]"),
        ("accessors", 0, "byteOffset", json!(4), "do not fit"),
        ("accessors", 0, "byteOffset", json!(u64::MAX), "do not fit"),
        ("accessors", 0, "count", json!(u64::MAX), "do not fit"),
        ("accessors", 0, "count", json!(4), "do not fit"),
        ("accessors", 0, "bufferView", json!(77), "accessors[0].bufferView: it names bufferViews[77]"),
        (
            "accessors",
            0,
            "type",
            json!("VEC2"),
            "accessors[0].type: meshes[0].primitives[0].attributes.POSITION needs Vec3",
        ),
        ("accessors", 0, "type", json!("VEC9"), "not a type of glTF"),
        ("accessors", 0, "componentType", json!(U32), "accessors[0].componentType"),
        ("accessors", 0, "componentType", json!(1), "not a component type of glTF"),
        ("nodes", 0, "mesh", json!(5), "nodes[0].mesh: it names meshes[5]"),
    ] {
        let mut file = File::triangle();
        file.json[list][index][key] = value.clone();
        let errors = file.errors();
        assert!(says(&errors, &[words]), "{list}[{index}].{key} = {value}: {errors:?}");
    }
    let mut file = File::triangle();
    file.json["accessors"][0].as_object_mut().unwrap().remove("bufferView");
    file.json["accessors"][0]["count"] = json!(1u64 << 40);
    assert!(says(&file.errors(), &["accessors[0].count", "too many"]));
    let mut file = File::triangle();
    let more = file.floats("VEC3", &[0.0; 12]);
    file.json["meshes"][0]["primitives"][0]["attributes"]["NORMAL"] = json!(more);
    assert!(says(&file.errors(), &["4 NORMAL values for 3 positions"]));
    let mut file = File::triangle();
    file.json["meshes"][0]["primitives"][0]["indices"] = json!(file.indices(&[0, 1, 3]));
    assert!(says(&file.errors(), &["meshes[0].primitives[0].indices", "index 2 is 3", "only 3 vertices"]));
    let mut file = File::triangle();
    file.bytes[..4].copy_from_slice(&f32::NAN.to_le_bytes());
    assert!(says(&file.errors(), &["meshes[0].primitives[0]", "vertex 0", "not a finite"]));
}

#[test]
fn all_faults_are_listed_once() {
    let mut file = File::with_material(json!({
        "pbrMetallicRoughness": { "baseColorTexture": { "index": 3 }, "metallicRoughnessTexture": { "index": 4 } },
        "normalTexture": { "index": 5 },
    }));
    file.json["meshes"][0]["primitives"][0]["attributes"]["POSITION"] = json!(9);
    file.root(json!({ "mesh": 0 }));
    file.root(json!({ "mesh": 8 }));
    let errors = file.errors();
    for words in [
        "materials[0].pbrMetallicRoughness.baseColorTexture: it names textures[3]",
        "materials[0].pbrMetallicRoughness.metallicRoughnessTexture: it names textures[4]",
        "materials[0].normalTexture: it names textures[5]",
        "meshes[0].primitives[0].attributes.POSITION: it names accessors[9]",
        "nodes[2].mesh: it names meshes[8]",
    ] {
        assert_eq!(errors.iter().filter(|e| e.contains(words)).count(), 1, "{words}: {errors:?}");
    }
    assert_eq!(errors.len(), 5);
}

#[test]
fn an_endless_list_of_faults_is_cut() {
    let mut file = File::triangle();
    for i in 0..1000 {
        file.root(json!({ "mesh": i + 1 }));
    }
    let errors = file.errors();
    assert_eq!(errors.len(), 101);
    assert!(says(&errors, &["900 more errors are not listed"]));
}

#[test]
fn a_few_bytes_can_not_ask_for_endless_work() {
    let started = std::time::Instant::now();
    // Ten thousand nodes that each use a mesh of ten thousand primitives without triangles.
    let mut file = File::triangle();
    let lines = json!({ "attributes": { "POSITION": 0 }, "mode": 1 });
    file.add("meshes", json!({ "primitives": vec![lines; 10_000] }));
    file.json["nodes"].as_array_mut().unwrap().extend(vec![json!({ "mesh": 1 }); 10_000]);
    file.json["scenes"][0]["nodes"] = (0..10_001).collect();
    assert!(says(&file.errors(), &["more than 2097152 objects"]));
    // Instances at a point, without a byte of their own.
    let mut file = File::triangle();
    file.add("accessors", json!({ "componentType": F32, "count": 1_500_000, "type": "VEC3" }));
    let extension = json!({ "EXT_mesh_gpu_instancing": { "attributes": { "SCALE": 2 } } });
    file.json["nodes"] = vec![json!({ "mesh": 0, "extensions": extension }); 1000].into();
    file.json["scenes"][0]["nodes"] = (0..1000).collect();
    assert!(says(&file.errors(), &["more than 2097152 objects"]));
    // A mesh that turns out to be faulty at its end.
    let mut file = File::new();
    let mut corners = vec![0.0; 300_000];
    corners[299_999] = f32::NAN;
    let positions = file.floats("VEC3", &corners);
    file.add("meshes", json!({ "primitives": [{ "attributes": { "POSITION": positions } }] }));
    file.json["nodes"] = vec![json!({ "mesh": 0 }); 10_000].into();
    file.json["scenes"][0]["nodes"] = (0..10_000).collect();
    assert!(says(&file.errors(), &["vertex 99999"]));
    assert!(started.elapsed().as_secs() < 20, "{:?}", started.elapsed());
}

#[test]
fn long_names_are_cut() {
    let mut file = File::with_material(json!({ "name": "m".repeat(100_000), "alphaMode": "MASK" }));
    file.json["nodes"][0]["name"] = json!("ü".repeat(100_000));
    let (scene, warnings) = file.load();
    assert_eq!(scene.shapes[0].name.chars().count(), 83);
    assert!(warnings.iter().all(|w| w.len() < 2000));
    file.json["images"][0]["uri"] = json!("x".repeat(100_000));
    file.json["materials"][0]["normalTexture"] = json!({ "index": 0 });
    assert!(file.errors().iter().all(|e| e.len() < 2000));
}

#[test]
fn a_file_without_triangles_is_refused() {
    assert!(says(&File::new().errors(), &["nothing to show"]));
}
