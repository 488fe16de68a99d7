use super::*;
use crate::math::{DVec3, Vec3};
use crate::scene::desc::ShapeKind;

fn point(scene: &SceneDesc, shape: usize, p: [f64; 3]) -> DVec3 {
    scene.shapes[shape].to_world.transform_point3(DVec3::from_array(p))
}

#[test]
fn transforms_compose_from_the_root_down() {
    let mut file = File::triangle();
    let half = std::f32::consts::FRAC_1_SQRT_2;
    // A quarter turn about z, after doubling x, before moving by (10, 0, 0); all below a parent that mirrors z.
    file.json["nodes"][0] =
        json!({ "mesh": 0, "translation": [10, 0, 0], "rotation": [0, 0, half, half], "scale": [2, 1, 1] });
    file.json["scenes"][0]["nodes"] = json!([1]);
    let mirror = [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, -1, 0, 0, 0, 5, 1];
    file.add("nodes", json!({ "children": [0], "matrix": mirror }));
    let (scene, _) = file.load();
    let p = point(&scene, 0, [1.0, 0.0, 0.25]);
    assert!((p - DVec3::new(10.0, 2.0, 4.75)).length() < 1e-6, "{p}");
}

#[test]
fn rotations_are_made_unit() {
    let mut file = File::triangle();
    file.json["nodes"][0]["rotation"] = json!([0, 0, 3, 3]);
    let p = point(&file.load().0, 0, [1.0, 0.0, 0.0]);
    assert!((p - DVec3::Y).length() < 1e-12, "{p}");
    file.json["nodes"][0]["rotation"] = json!([0, 0, 0, 0]);
    assert!(says(&file.errors(), &["nodes[0].rotation", "quaternion"]));
}

#[test]
fn loops_and_second_parents_are_refused() {
    let mut file = File::triangle();
    file.json["nodes"][0]["children"] = json!([1]);
    file.add("nodes", json!({ "children": [0] }));
    assert!(says(&file.errors(), &["nodes[1].children[0]", "nodes[0] is reached a second time"]));
    file.json["nodes"][1]["children"] = json!([1]);
    assert!(says(&file.errors(), &["nodes[1].children[0]", "nodes[1] is reached a second time"]));
    file.json["nodes"][1]["children"] = json!([7]);
    assert!(says(&file.errors(), &["nodes[1].children[0]", "only 2"]));
    file.json["nodes"][1]["children"] = json!([]);
    file.json["scenes"][0]["nodes"] = json!([0, 0]);
    assert!(says(&file.errors(), &["scenes[0].nodes[1]", "second time"]));
}

#[test]
fn a_chain_of_nodes_may_be_long() {
    let mut file = File::triangle();
    let count = 20_000;
    file.json["nodes"] = (0..count).map(|i| json!({ "children": [i + 1], "translation": [0, 0, 0.5] })).collect();
    file.add("nodes", json!({ "mesh": 0 }));
    assert_eq!(point(&file.load().0, 0, [0.0; 3]).z, 0.5 * f64::from(count));
}

#[test]
fn scenes_are_chosen() {
    let mut file = File::triangle();
    file.add("nodes", json!({ "mesh": 0, "translation": [1, 0, 0] }));
    file.add("scenes", json!({ "nodes": [1] }));
    file.json["scene"] = json!(1);
    let (scene, warnings) = file.load();
    assert_eq!(point(&scene, 0, [0.0; 3]), DVec3::X);
    assert!(says(&warnings, &["of 2 scenes only scenes[1]"]));
    file.json["scene"] = json!(2);
    assert!(says(&file.errors(), &["scene: it names scenes[2]"]));
    // No scene at all: all nodes without a parent.
    file.json.as_object_mut().unwrap().remove("scene");
    file.json["scenes"] = json!([]);
    file.json["nodes"][0]["children"] = json!([1]);
    assert_eq!(file.load().0.shapes.len(), 2);
}

#[test]
fn instances_share_the_mesh() {
    let mut file = File::triangle();
    let translation = file.floats("VEC3", &[1.0, 0.0, 0.0, 2.0, 0.0, 0.0]);
    let scale = file.floats("VEC3", &[1.0, 1.0, 1.0, 3.0, 3.0, 3.0]);
    // A half turn about z, as normalised bytes.
    let rotation = file.accessor("VEC4", I8, 2, &[0, 0, 127, 0, 0, 0, 0, 127]);
    file.json["accessors"][rotation]["normalized"] = json!(true);
    let attributes = json!({ "TRANSLATION": translation, "ROTATION": rotation, "SCALE": scale });
    let extension = json!({ "EXT_mesh_gpu_instancing": { "attributes": attributes } });
    file.json["nodes"][0] = json!({ "name": "fan", "mesh": 0, "translation": [0, 0, 7], "extensions": extension });
    file.json["extensionsRequired"] = json!(["EXT_mesh_gpu_instancing"]);
    let (scene, _) = file.load();
    assert_eq!((scene.meshes.len(), scene.shapes.len()), (1, 2));
    assert_eq!(scene.shapes[1].name, "fan#1");
    assert!((point(&scene, 0, [1.0, 0.0, 0.0]) - DVec3::new(0.0, 0.0, 7.0)).length() < 1e-12);
    assert!((point(&scene, 1, [1.0, 0.0, 0.0]) - DVec3::new(5.0, 0.0, 7.0)).length() < 1e-12);
    for (key, value, words) in [
        ("SCALE", json!(0), "same count"),
        ("SCALE", json!(99), "accessors[99]"),
        ("SCALE", json!("x"), "expected the index"),
        ("ROTATION", json!(0), "Vec4"),
        ("SCALE", json!(1), "Vec3"),
    ] {
        let mut broken = File { json: file.json.clone(), bytes: file.bytes.clone() };
        broken.json["nodes"][0]["extensions"]["EXT_mesh_gpu_instancing"]["attributes"][key] = value;
        let errors = broken.errors();
        assert!(says(&errors, &[words]), "{key}: {errors:?}");
    }
    file.json["nodes"][0]["extensions"]["EXT_mesh_gpu_instancing"] = json!([]);
    assert!(says(&file.errors(), &["nodes[0].extensions.EXT_mesh_gpu_instancing", "expected an object"]));
}

#[test]
fn flattened_meshes_are_kept_and_vanished_ones_left_out() {
    let mut file = File::triangle();
    file.json["nodes"][0]["scale"] = json!([2, 2, 0]);
    file.root(json!({ "mesh": 0, "scale": [0, 0, 0] }));
    let (scene, warnings) = file.load();
    assert_eq!(scene.shapes.len(), 1);
    let ShapeKind::Mesh(id) = scene.shapes[0].kind else { panic!() };
    assert_eq!(scene.meshes[id.0 as usize].positions, [Vec3::ZERO, Vec3::X * 2.0, Vec3::Y * 2.0]);
    assert!(says(&warnings, &["nodes[1]", "scaled to nothing"]), "{warnings:?}");
}

#[test]
fn hidden_nodes_are_left_out_with_their_children() {
    let mut file = File::triangle();
    file.root(json!({ "children": [2], "extensions": { "KHR_node_visibility": { "visible": false } } }));
    file.add("nodes", json!({ "mesh": 0 }));
    file.json["extensionsRequired"] = json!(["KHR_node_visibility"]);
    assert_eq!(file.load().0.shapes.len(), 1);
    file.json["nodes"][1]["extensions"]["KHR_node_visibility"]["visible"] = json!(true);
    assert_eq!(file.load().0.shapes.len(), 2);
}

#[test]
fn transforms_must_stay_finite() {
    for (key, value, words) in [
        ("matrix", json!([1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 2]), "last row"),
        ("matrix", json!([1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 1e38, 0, 0, 1]), "beyond 1e18"),
        ("matrix", json!([1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 1e39, 0, 0, 1]), "beyond single precision"),
        ("translation", json!([1e19, 0, 0]), "beyond 1e18"),
        ("scale", json!([1e19, 1, 1]), "must stay below 1e18"),
        ("rotation", json!([0, 0, 0, 0]), "quaternion"),
        ("rotation", json!([1e39, 0, 0, 1]), "beyond single precision"),
    ] {
        let mut file = File::triangle();
        file.json["nodes"][0][key] = value.clone();
        let errors = file.errors();
        assert!(says(&errors, &["nodes[0]", words]), "{key} {value}: {errors:?}");
    }
}

#[test]
fn what_moves_is_shown_at_rest_with_a_warning() {
    let mut file = File::triangle();
    file.json["nodes"][0]["skin"] = json!(0);
    file.json["skins"] = json!([{ "joints": [0] }]);
    file.json["animations"] = json!([{ "channels": [], "samplers": [] }]);
    file.json["meshes"][0]["primitives"][0]["targets"] = json!([{ "POSITION": 0 }]);
    let (_, warnings) = file.load();
    for words in ["skins are not", "animations are not", "morph targets are not"] {
        assert!(says(&warnings, &[words]), "{words}: {warnings:?}");
    }
}
