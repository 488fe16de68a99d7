//! Small scenes with media.

use crate::common::{build, camera, shape};
use renderer::bsdf::Material;
use renderer::light::LightDesc;
use renderer::math::{DAffine3, DVec3};
use renderer::medium::{Medium, MediumId, Phase};
use renderer::scene::Scene;
use renderer::scene::desc::{SceneDesc, ShapeDesc, ShapeKind};
use renderer::spectrum::Rgb;
use renderer::texture::RgbParam;

/// Materials of all scenes here: null, glass, black, white.
pub const NULL: u32 = 0;
pub const GLASS: u32 = 1;
pub const BLACK: u32 = 2;
#[allow(dead_code, reason = "of the scenes to come")]
pub const WHITE: u32 = 3;

/// A medium of grey extinction.
pub fn grey(sigma_t: f32, albedo: f32, g: f32) -> Medium {
    let phase = if g == 0.0 { Phase::Isotropic } else { Phase::HenyeyGreenstein { g } };
    Medium::new(Rgb::splat(sigma_t), Rgb::splat(albedo), phase).unwrap()
}

/// A shape at `centre` scaled by `size`, filled with `interior`.
pub fn body(kind: ShapeKind, centre: DVec3, size: DVec3, material: u32, interior: Option<u32>) -> ShapeDesc {
    let to_world = DAffine3::from_translation(centre) * DAffine3::from_scale(size);
    ShapeDesc { interior: interior.map(MediumId), ..shape(kind, to_world, material) }
}

/// A ball.
pub fn ball(centre: DVec3, radius: f64, material: u32, interior: Option<u32>) -> ShapeDesc {
    body(ShapeKind::Sphere, centre, DVec3::splat(radius), material, interior)
}

/// A scene of these shapes, seen from +Z.
pub fn scene(shapes: Vec<ShapeDesc>, media: Vec<Medium>, lights: Vec<LightDesc>) -> Scene {
    build(desc(shapes, media, lights))
}

/// The description of such a scene.
pub fn desc(shapes: Vec<ShapeDesc>, media: Vec<Medium>, lights: Vec<LightDesc>) -> SceneDesc {
    let lambert = |r: f32| Material::Lambert { reflectance: RgbParam::Const(Rgb::splat(r)) };
    let one = RgbParam::Const(Rgb::ONE);
    let glass = Material::Dielectric { eta: 1.5, reflectance: one, transmittance: one, roughness: None };
    SceneDesc {
        shapes,
        media,
        lights,
        materials: vec![Material::Null, glass, lambert(0.0), lambert(0.8)],
        camera: camera(DVec3::Z * 5.0, DVec3::ZERO, 10.0),
        ..SceneDesc::default()
    }
}
