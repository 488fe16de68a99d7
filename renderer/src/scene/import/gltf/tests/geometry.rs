use super::*;
use crate::math::{Vec2, Vec3};

/// A file with one primitive of five vertices around the origin, drawn in the given mode.
fn drawn(mode: u32, indices: Option<&[u32]>) -> File {
    let mut file = File::new();
    let corners: Vec<f32> = (0..5).flat_map(|i| [i as f32, (i * i) as f32, 0.0]).collect();
    let positions = file.floats("VEC3", &corners);
    let mut primitive = json!({ "attributes": { "POSITION": positions }, "mode": mode });
    if let Some(indices) = indices {
        primitive["indices"] = json!(file.indices(indices));
    }
    file.add("meshes", json!({ "primitives": [primitive] }));
    file.root(json!({ "mesh": 0 }));
    file
}

#[test]
fn triangles_strips_and_fans() {
    // Orders from the tables of glTF 2.0, 3.7.2.1.
    let strip = vec![[0, 1, 2], [1, 3, 2], [2, 3, 4]];
    assert_eq!(drawn(5, None).load().0.meshes[0].triangles, strip);
    let fan = vec![[1, 2, 0], [2, 3, 0], [3, 4, 0]];
    assert_eq!(drawn(6, None).load().0.meshes[0].triangles, fan);
    let (scene, warnings) = drawn(4, None).load();
    assert_eq!(scene.meshes[0].triangles, [[0, 1, 2]]);
    assert!(says(&warnings, &["5 corners", "whole number"]), "{warnings:?}");
    // A strip may repeat corners to jump: those triangles have no area.
    let jump = drawn(5, Some(&[0, 1, 2, 2, 3, 4])).load().0;
    assert_eq!(jump.meshes[0].triangles, [[0, 1, 2], [2, 4, 3]]);
}

#[test]
fn points_and_lines_are_left_out_with_a_warning() {
    let mut file = File::triangle();
    for mode in 0..4 {
        let primitive = json!({ "attributes": { "POSITION": 0 }, "mode": mode });
        file.json["meshes"][0]["primitives"].as_array_mut().unwrap().push(primitive);
    }
    let (scene, warnings) = file.load();
    assert_eq!(scene.shapes.len(), 1);
    assert!(says(&warnings, &["meshes[0].primitives[1], meshes[0].primitives[2]", "points and lines"]), "{warnings:?}");
    file.json["meshes"][0]["primitives"][1]["mode"] = json!(7);
    assert!(says(&file.errors(), &["meshes[0].primitives[1].mode"]));
}

#[test]
fn all_index_types_and_vertices_that_are_not_used() {
    for (component, bytes) in
        [(U8, vec![4, 0, 2]), (U16, vec![4, 0, 0, 0, 2, 0]), (U32, vec![4, 0, 0, 0, 0, 0, 0, 0, 2, 0, 0, 0])]
    {
        let mut file = drawn(4, Some(&[0, 0, 0]));
        file.json["meshes"][0]["primitives"][0]["indices"] = json!(file.json["accessors"].as_array().unwrap().len());
        file.accessor("SCALAR", component, 3, &bytes);
        let mesh = &file.load().0.meshes[0];
        // Five vertices are stored and three used: the others are dropped.
        assert_eq!(mesh.triangles, [[2, 0, 1]]);
        assert_eq!(mesh.positions, [Vec3::ZERO, Vec3::new(2.0, 4.0, 0.0), Vec3::new(4.0, 16.0, 0.0)]);
    }
}

#[test]
fn normals_are_made_unit_and_missing_ones_stay_missing() {
    let mut file = File::triangle();
    assert!(file.load().0.meshes[0].normals.is_empty());
    let normals = file.floats("VEC3", &[0.0, 0.0, 2.0, 0.0, 0.0, 0.0, f32::NAN, 1.0, 0.0]);
    file.json["meshes"][0]["primitives"][0]["attributes"]["NORMAL"] = json!(normals);
    let (scene, warnings) = file.load();
    assert_eq!(scene.meshes[0].normals, [Vec3::Z, Vec3::ZERO, Vec3::ZERO]);
    assert!(says(&warnings, &["NORMAL", "no direction"]), "{warnings:?}");
}

#[test]
fn interleaved_attributes() {
    let mut file = File::new();
    let mut bytes = Vec::new();
    for i in 0..3 {
        let (x, y) = ([0.0f32, 1.0, 0.0][i], [0.0f32, 0.0, 1.0][i]);
        bytes.extend([x, y, 0.5, x, y].iter().flat_map(|v| v.to_le_bytes()));
    }
    let view = file.view(&bytes);
    file.json["bufferViews"][view]["byteStride"] = json!(20);
    let accessor =
        |offset, kind| json!({ "bufferView": 0, "byteOffset": offset, "componentType": F32, "count": 3, "type": kind });
    file.add("accessors", accessor(0, "VEC3"));
    file.add("accessors", accessor(12, "VEC2"));
    file.add("materials", json!({ "normalTexture": { "index": 0 } }));
    let file = &mut file;
    let image = BASE64_STANDARD.encode(png(&[128, 128, 255]));
    file.add("images", json!({ "uri": format!("data:image/png;base64,{image}") }));
    file.add("textures", json!({ "source": 0 }));
    file.add("meshes", json!({ "primitives": [{ "attributes": { "POSITION": 0, "TEXCOORD_0": 1 }, "material": 0 }] }));
    file.root(json!({ "mesh": 0 }));
    let mesh = &file.load().0.meshes[0];
    assert_eq!(mesh.positions, [Vec3::new(0.0, 0.0, 0.5), Vec3::new(1.0, 0.0, 0.5), Vec3::new(0.0, 1.0, 0.5)]);
    assert_eq!(mesh.uvs, [Vec2::ZERO, Vec2::X, Vec2::Y]);
    // With a wider stride the last element sticks out.
    file.json["bufferViews"][0]["byteStride"] = json!(24);
    assert!(says(&file.errors(), &["accessors[1]", "do not fit"]));
    file.json["bufferViews"][0]["byteStride"] = json!(8);
    assert!(says(&file.errors(), &["accessors[0]", "byteStride"]));
}

#[test]
fn sparse_accessors() {
    let mut file = File::triangle();
    let indices = file.view(&[0, 2]);
    let values = file.view(&[7.0f32, 8.0, 9.0, -1.0, -2.0, -3.0].map(f32::to_le_bytes).concat());
    let sparse = json!({
        "count": 2,
        "indices": { "bufferView": indices, "componentType": U8 },
        "values": { "bufferView": values },
    });
    file.json["accessors"][0]["sparse"] = sparse.clone();
    let expected = [Vec3::new(7.0, 8.0, 9.0), Vec3::X, Vec3::new(-1.0, -2.0, -3.0)];
    assert_eq!(file.load().0.meshes[0].positions, expected);
    // Without a view of its own the rest is zero.
    file.json["accessors"][0].as_object_mut().unwrap().remove("bufferView");
    assert_eq!(file.load().0.meshes[0].positions[1], Vec3::ZERO);
    for (key, value, words) in [
        ("count", json!(4), "only 3"),
        ("count", json!(3), "accessors[0].sparse"),
        ("indices", json!({ "bufferView": values, "componentType": U8 }), "rise strictly"),
        ("indices", json!({ "bufferView": 99, "componentType": U8 }), "bufferViews[99]"),
        ("indices", json!({ "bufferView": indices, "componentType": F32 }), "unsigned integers"),
        ("values", json!({ "bufferView": values, "byteOffset": 4 }), "do not fit"),
    ] {
        let mut sparse = sparse.clone();
        sparse[key] = value;
        file.json["accessors"][0]["sparse"] = sparse;
        let errors = file.errors();
        assert!(says(&errors, &[words]), "{key}: {errors:?}");
    }
}

#[test]
fn quantised_attributes() {
    let mut file = File::with_material(json!({ "normalTexture": { "index": 0 } }));
    file.json["extensionsRequired"] = json!(["KHR_mesh_quantization"]);
    file.json["extensionsUsed"] = json!(["KHR_mesh_quantization"]);
    let bytes = |v: [i16; 9]| v.map(i16::to_le_bytes).concat();
    let positions = file.accessor("VEC3", I16, 3, &bytes([0, 0, 0, 32_767, 0, -32_768, 0, 16_384, 0]));
    let normals = file.accessor("VEC3", I8, 3, &[0, 0, 127, 0, 0, 127, 0, 0, 129]);
    let uvs = file.accessor("VEC2", U8, 3, &[0, 255, 51, 0, 255, 255]);
    for a in [positions, normals, uvs] {
        file.json["accessors"][a]["normalized"] = json!(true);
    }
    let attributes = json!({ "POSITION": positions, "NORMAL": normals, "TEXCOORD_0": uvs });
    file.json["meshes"][0]["primitives"][0]["attributes"] = attributes;
    let mesh = &file.load().0.meshes[0];
    // -32768 / 32767 is clamped to -1.
    let half = 16_384.0 / 32_767.0;
    assert_eq!(mesh.positions, [Vec3::ZERO, Vec3::new(1.0, 0.0, -1.0), Vec3::new(0.0, half, 0.0)]);
    assert_eq!(mesh.normals, [Vec3::Z, Vec3::Z, Vec3::NEG_Z]);
    assert_eq!(mesh.uvs, [Vec2::new(0.0, 1.0), Vec2::new(0.2, 0.0), Vec2::ONE]);
    // Not normalised, the integers are the coordinates.
    file.json["accessors"][positions]["normalized"] = json!(false);
    assert_eq!(file.load().0.meshes[0].positions[1], Vec3::new(32_767.0, 0.0, -32_768.0));
}

#[test]
fn primitives_that_share_their_data_share_a_mesh() {
    let mut file = File::triangle();
    let same = file.json["meshes"][0]["primitives"][0].clone();
    file.json["meshes"][0]["primitives"].as_array_mut().unwrap().push(same);
    file.root(json!({ "mesh": 0, "translation": [5, 0, 0] }));
    let (scene, _) = file.load();
    assert_eq!((scene.meshes.len(), scene.shapes.len()), (1, 4));
    let names: Vec<&str> = scene.shapes.iter().map(|s| s.name.as_str()).collect();
    assert_eq!(names, ["corner/0", "corner/1", "nodes[1]/0", "nodes[1]/1"]);
}

#[test]
fn unusual_coordinates_of_texels() {
    let mut file = File::with_material(json!({ "normalTexture": { "index": 0, "texCoord": 1 } }));
    let (scene, warnings) = file.load();
    assert_eq!(scene.meshes[0].uvs, [Vec2::ZERO; 3]);
    assert!(says(&warnings, &["meshes[0].primitives[0]", "no TEXCOORD_1"]), "{warnings:?}");
    let uvs = file.floats("VEC2", &[f32::INFINITY, 0.0, 1.0, 2.0, 0.0, f32::NAN]);
    file.json["meshes"][0]["primitives"][0]["attributes"]["TEXCOORD_1"] = json!(uvs);
    let (scene, warnings) = file.load();
    assert_eq!(scene.meshes[0].uvs, [Vec2::ZERO, Vec2::new(1.0, 2.0), Vec2::ZERO]);
    assert!(says(&warnings, &["not finite"]), "{warnings:?}");
}

#[test]
fn many_meshes_from_the_same_bytes_are_refused_before_they_fill_the_memory() {
    let mut file = File::new();
    // A thousand triangles whose vertices have no bytes, used through a thousand different accessors.
    let indices = file.indices(&(0..300_000).map(|i| i % 4).collect::<Vec<u32>>());
    for i in 0..1000 {
        let accessor = json!({ "componentType": F32, "count": 300_000 + i, "type": "VEC3" });
        let positions = file.add("accessors", accessor);
        let primitive = json!({ "attributes": { "POSITION": positions }, "indices": indices });
        file.add("meshes", json!({ "primitives": [primitive] }));
        file.root(json!({ "mesh": i }));
    }
    assert!(says(&file.errors(), &["far more memory than the file"]));
}
