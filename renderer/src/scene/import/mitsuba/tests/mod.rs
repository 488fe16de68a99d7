//! Mitsuba scenes written here: what comes out of each feature, and what is said of each fault.

mod faults;
mod materials;
mod media;
mod shapes;
mod shared;
mod view;

use crate::scene::desc::SceneDesc;
use crate::scene::import::tests::{errors, scene};

/// A one-triangle OBJ without normals.
const TRIANGLE: &[u8] = b"v 0 0 0\nv 2 0 0\nv 0 2 0\nvt 0 0\nvt 1 0\nvt 0 0.25\nf 1/1 2/2 3/3\n";
const SENSOR: &str = "<sensor type='perspective'/>";

/// A complete scene file of version 3 around `content`.
fn document(content: &str) -> String {
    format!("<scene version='3.0.0'>{SENSOR}\n{content}</scene>")
}

fn with_files<T>(text: &str, f: impl Fn(&[(&str, &[u8])]) -> T) -> T {
    f(&[("scene.xml", text.as_bytes()), ("models/t.obj", TRIANGLE), ("grey.png", GREY_PNG)])
}

/// The scene around `content`, which must not cause warnings.
fn import(content: &str) -> SceneDesc {
    let (scene, warnings) = import_with_warnings(content);
    assert!(warnings.is_empty(), "{warnings:#?}");
    scene
}

fn import_with_warnings(content: &str) -> (SceneDesc, Vec<String>) {
    with_files(&document(content), scene)
}

/// The errors of the scene around `content`.
fn faults(content: &str) -> Vec<String> {
    with_files(&document(content), errors)
}

/// A 1 x 1 PNG, 8-bit grey 188 (linear 0.503).
const GREY_PNG: &[u8] = &[
    0x89, 0x50, 0x4e, 0x47, 0x0d, 0x0a, 0x1a, 0x0a, 0, 0, 0, 13, 0x49, 0x48, 0x44, 0x52, 0, 0, 0, 1, 0, 0, 0, 1, 8, 0,
    0, 0, 0, 0x3a, 0x7e, 0x9b, 0x55, 0x00, 0x00, 0x00, 0x0a, 0x49, 0x44, 0x41, 0x54, 0x78, 0xda, 0x63, 0xd8, 0x03,
    0x00, 0x00, 0xbe, 0x00, 0xbd, 0x7e, 0xba, 0x55, 0x46, 0x00, 0x00, 0x00, 0x00, 0x49, 0x45, 0x4e, 0x44, 0xae, 0x42,
    0x60, 0x82,
];
