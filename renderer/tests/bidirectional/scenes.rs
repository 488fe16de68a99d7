//! Rooms without delta lobes, each with another kind of light.

use crate::common::{build, camera, emission, lambert, shape};
use renderer::bsdf::{Distribution, Material, Roughness};
use renderer::math::{DAffine3, DQuat, DVec3};
use renderer::scene::Scene;
use renderer::scene::desc::{Emission, LightDesc, SceneDesc, ShapeDesc, ShapeKind};
use renderer::spectrum::Rgb;
use renderer::texture::{FloatParam, RgbParam};

fn placed(offset: DVec3, rotation: DQuat, size: f64) -> DAffine3 {
    DAffine3::from_translation(offset) * DAffine3::from_quat(rotation) * DAffine3::from_scale(DVec3::splat(size))
}

/// Walls on all sides but the camera's (of a closed room: on all), a ball and a block.
fn furniture(closed: bool) -> Vec<ShapeDesc> {
    let quarter = std::f64::consts::FRAC_PI_2;
    let wall = |offset, rotation, material| shape(ShapeKind::Rectangle, placed(offset, rotation, 1.0), material);
    let mut shapes = vec![
        wall(-DVec3::Z, DQuat::IDENTITY, 0),
        wall(-DVec3::Y, DQuat::from_rotation_x(-quarter), 0),
        wall(DVec3::Y, DQuat::from_rotation_x(quarter), 0),
        wall(-DVec3::X, DQuat::from_rotation_y(quarter), 1),
        wall(DVec3::X, DQuat::from_rotation_y(-quarter), 0),
        shape(ShapeKind::Sphere, placed(DVec3::new(0.3, -0.6, 0.1), DQuat::IDENTITY, 0.4), 2),
        shape(ShapeKind::Cube, placed(DVec3::new(-0.4, -0.6, -0.3), DQuat::from_rotation_y(0.4), 0.3), 3),
    ];
    if closed {
        shapes.push(wall(DVec3::Z, DQuat::from_rotation_y(2.0 * quarter), 0));
    }
    shapes
}

/// Diffuse, and rough metal and glass: no delta lobes.
fn materials() -> Vec<Material> {
    let roughness = |alpha| Roughness {
        distribution: Distribution::Ggx,
        alpha_u: FloatParam::Const(alpha),
        alpha_v: FloatParam::Const(alpha),
    };
    let metal = Material::Conductor {
        eta: Rgb::new(0.2, 0.9, 1.1),
        k: Rgb::new(3.9, 2.4, 2.2),
        reflectance: RgbParam::Const(Rgb::ONE),
        roughness: Some(roughness(0.4)),
    };
    vec![lambert(0.7), lambert(0.3), metal, rough_glass(roughness(0.5))]
}

fn rough_glass(roughness: Roughness) -> Material {
    Material::Dielectric {
        eta: 1.5,
        reflectance: RgbParam::Const(Rgb::ONE),
        transmittance: RgbParam::Const(Rgb::ONE),
        roughness: Some(roughness),
    }
}

fn scene(closed: bool, extra: Vec<ShapeDesc>, lights: Vec<LightDesc>, materials: Vec<Material>) -> Scene {
    let mut shapes = furniture(closed);
    shapes.extend(extra);
    let from = if closed { DVec3::new(0.1, 0.1, 0.9) } else { DVec3::new(0.1, 0.0, 3.6) };
    let camera = camera(from, DVec3::new(0.0, -0.1, -1.0), if closed { 80.0 } else { 40.0 });
    build(SceneDesc { shapes, materials, lights, camera, ..Default::default() })
}

fn lamp(two_sided: bool) -> ShapeDesc {
    let mut lamp = shape(
        ShapeKind::Rectangle,
        placed(DVec3::Y * 0.8, DQuat::from_rotation_x(std::f64::consts::FRAC_PI_2), 0.4),
        0,
    );
    lamp.emission = Some(Emission { radiance: RgbParam::Const(Rgb::splat(5.0)), two_sided });
    lamp
}

fn bulb() -> ShapeDesc {
    let mut bulb = shape(ShapeKind::Sphere, placed(DVec3::new(-0.4, 0.4, 0.2), DQuat::IDENTITY, 0.2), 1);
    bulb.emission = emission(8.0);
    bulb
}

/// Every kind of light; name and scene.
pub fn all() -> Vec<(&'static str, Scene)> {
    let point = LightDesc::Point { position: DVec3::new(0.2, 0.5, 0.2), intensity: Rgb::ONE };
    let sun = LightDesc::Directional { direction: DVec3::new(0.3, -0.5, -1.0), irradiance: Rgb::new(0.4, 0.3, 0.2) };
    let sky = LightDesc::Constant { radiance: Rgb::splat(0.5) };
    vec![
        ("lamp", scene(true, vec![lamp(false)], vec![], materials())),
        ("two-sided lamp and ball", scene(true, vec![lamp(true), bulb()], vec![], materials())),
        ("point", scene(true, vec![], vec![point], materials())),
        ("sun and sky", scene(false, vec![], vec![sun, sky], materials())),
    ]
}

/// Diffuse, closed, with a large lamp that walks from the camera find.
pub fn diffuse() -> Scene {
    let mut diffuse = vec![lambert(0.7), lambert(0.3)];
    diffuse.extend([lambert(0.5), lambert(0.6)]);
    scene(true, vec![lamp(true), bulb()], vec![], diffuse)
}
