//! Scenes of any size, made here.

use crate::meshes;
use renderer::bsdf::{Material, MaterialId};
use renderer::diagnostics::Diagnostics;
use renderer::geometry::MeshId;
use renderer::math::{DAffine3, DQuat, DVec3};
use renderer::scene::Scene;
use renderer::scene::desc::{CameraDesc, Emission, SceneDesc, ShapeDesc, ShapeKind};
use renderer::spectrum::Rgb;
use renderer::texture::RgbParam;
use std::f64::consts::{FRAC_PI_2, PI};

fn shape(kind: ShapeKind, to_world: DAffine3) -> ShapeDesc {
    ShapeDesc {
        name: String::new(),
        kind,
        to_world,
        flip_normals: false,
        material: MaterialId(0),
        emission: None,
        interior: None,
        priority: 0,
    }
}

/// A white material, walls and camera of a room that is the cube [-1, 1]^3.
fn empty_room() -> SceneDesc {
    let white = Material::Lambert { reflectance: RgbParam::Const(Rgb::splat(0.7)) };
    let two_sided = Material::TwoSided { front: MaterialId(0), back: MaterialId(0) };
    let mut desc = SceneDesc { materials: vec![white, two_sided], ..Default::default() };
    let down = DQuat::from_rotation_x(-0.2);
    let to_world = DAffine3::from_rotation_translation(down, DVec3::new(0.0, 0.2, 0.95));
    desc.camera = CameraDesc { to_world, fov: 80.0, ..Default::default() };
    desc
}

/// Under the ceiling, facing down: a square of half the side `half` at x, z.
fn lamp(x: f64, z: f64, half: f64, radiance: f32) -> ShapeDesc {
    let place = DAffine3::from_scale_rotation_translation(
        DVec3::new(half, half, 1.0),
        DQuat::from_rotation_x(FRAC_PI_2),
        DVec3::new(x, 0.99, z),
    );
    ShapeDesc {
        emission: Some(Emission { radiance: RgbParam::Const(Rgb::splat(radiance)), two_sided: false }),
        ..shape(ShapeKind::Rectangle, place)
    }
}

fn build(desc: SceneDesc) -> Result<Scene, String> {
    let mut diagnostics = Diagnostics::default();
    Scene::build(desc, "a scene made by the benchmark", &mut diagnostics)
        .ok_or_else(|| format!("{:?}", diagnostics.list))
}

/// A closed diffuse room with two boxes and `count` lamps that are equally bright together.
pub fn lamps(count: usize) -> Result<Scene, String> {
    let mut desc = empty_room();
    let quarter = |axis: DVec3, angle: f64| DQuat::from_axis_angle(axis, angle);
    for (rotation, at) in [
        (quarter(DVec3::X, -FRAC_PI_2), DVec3::NEG_Y),
        (quarter(DVec3::X, FRAC_PI_2), DVec3::Y),
        (quarter(DVec3::Y, FRAC_PI_2), DVec3::NEG_X),
        (quarter(DVec3::Y, -FRAC_PI_2), DVec3::X),
        (DQuat::IDENTITY, DVec3::NEG_Z),
        (quarter(DVec3::Y, PI), DVec3::Z),
    ] {
        desc.shapes.push(shape(ShapeKind::Rectangle, DAffine3::from_rotation_translation(rotation, at)));
    }
    for (x, z, height) in [(-0.4, -0.3, 0.6), (0.4, 0.1, 0.3)] {
        let scale = DVec3::new(0.25, height, 0.25);
        let place =
            DAffine3::from_scale_rotation_translation(scale, quarter(DVec3::Y, x), DVec3::new(x, height - 1.0, z));
        desc.shapes.push(shape(ShapeKind::Cube, place));
    }
    // A grid of lamps whose areas sum to the same.
    let side = (count as f64).sqrt().ceil() as usize;
    for i in 0..count {
        let at = |k: usize| ((k as f64 + 0.5) / side as f64 - 0.5) * 1.8;
        let half = 0.2 / (count as f64).sqrt();
        desc.shapes.push(lamp(at(i % side), at(i / side), half, 20.0));
    }
    build(desc)
}

/// [`meshes::room`] with a lamp; and how many triangles it has.
pub fn room(triangles: usize) -> Result<(Scene, usize), String> {
    let mut desc = empty_room();
    let mesh = meshes::room(triangles);
    let count = mesh.triangles.len();
    desc.meshes.push(mesh);
    desc.shapes.push(ShapeDesc { material: MaterialId(1), ..shape(ShapeKind::Mesh(MeshId(0)), DAffine3::IDENTITY) });
    desc.shapes.push(lamp(0.0, 0.0, 0.3, 20.0));
    build(desc).map(|scene| (scene, count))
}
