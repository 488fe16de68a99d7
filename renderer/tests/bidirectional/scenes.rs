//! Rooms without delta lobes, each with another kind of light.

use crate::common::{build, camera, emission, lambert, shape};
use renderer::bsdf::{Distribution, Material, Roughness};
use renderer::math::{DAffine3, DQuat, DVec3, Vec3};
use renderer::scene::Scene;
use renderer::scene::desc::{Emission, LightDesc, Medium, MediumId, Phase, SceneDesc, ShapeDesc, ShapeKind};
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

/// What fills the scene, for the oracle: the same medium in an axis-aligned box.
pub struct Fog {
    /// Extinction by channel; zero where there is no medium.
    sigma_t: [f64; 3],
    /// Corners of the box.
    low: DVec3,
    high: DVec3,
}

impl Fog {
    /// None.
    const NONE: Self = Self { sigma_t: [0.0; 3], low: DVec3::ZERO, high: DVec3::ZERO };

    /// Optical depths between two points.
    pub fn depth(&self, a: Vec3, b: Vec3) -> [f64; 3] {
        // The part of the segment between the planes of all three pairs.
        let (a, b) = (a.as_dvec3(), b.as_dvec3());
        let d = b - a;
        let (mut t0, mut t1) = (0.0f64, 1.0f64);
        for axis in 0..3 {
            let (x, y) = ((self.low[axis] - a[axis]) / d[axis], (self.high[axis] - a[axis]) / d[axis]);
            t0 = t0.max(x.min(y));
            t1 = t1.min(x.max(y));
        }
        let inside = (t1 - t0).max(0.0) * d.length();
        self.sigma_t.map(|s| if s > 0.0 { s * inside } else { 0.0 })
    }
}

/// Every kind of light, without and with media; name, scene and medium.
pub fn all() -> Vec<(&'static str, Scene, Fog)> {
    let point = LightDesc::Point { position: DVec3::new(0.2, 0.5, 0.2), intensity: Rgb::ONE };
    let sun = LightDesc::Directional { direction: DVec3::new(0.3, -0.5, -1.0), irradiance: Rgb::new(0.4, 0.3, 0.2) };
    let sky = LightDesc::Constant { radiance: Rgb::splat(0.5) };
    let clear = |what, shapes: Vec<ShapeDesc>, lights: Vec<LightDesc>| {
        let closed = lights.iter().all(|l| matches!(l, LightDesc::Point { .. }));
        (what, scene(closed, shapes, lights, materials()), Fog::NONE)
    };
    let mut all = vec![
        clear("lamp", vec![lamp(false)], vec![]),
        clear("two-sided lamp and ball", vec![lamp(true), bulb()], vec![]),
        clear("point", vec![], vec![point.clone()]),
        clear("sun and sky", vec![], vec![sun.clone(), sky.clone()]),
    ];
    let everywhere = DVec3::splat(2.0);
    all.extend([
        foggy("lamp in coloured fog", true, everywhere, 0.0, vec![lamp(false), bulb()], vec![]),
        foggy("point in forward-scattering fog", true, everywhere, 0.7, vec![], vec![point.clone()]),
        foggy("point beside a block of fog", true, DVec3::new(0.9, 0.4, 0.8), -0.4, vec![lamp(true)], vec![point]),
        foggy("sun and sky on a block of fog", false, DVec3::new(0.9, 0.4, 0.8), 0.3, vec![], vec![sun, sky]),
    ]);
    all
}

/// The room with a null box of coloured fog from `-half` to `half` in it, which may be larger than the room.
fn foggy(
    what: &'static str,
    closed: bool,
    half: DVec3,
    g: f32,
    extra: Vec<ShapeDesc>,
    lights: Vec<LightDesc>,
) -> (&'static str, Scene, Fog) {
    let sigma_t = [0.5f32, 0.8, 1.6];
    let medium = Medium::new(Rgb::from(sigma_t), Rgb::new(0.9, 0.8, 0.7), Phase::HenyeyGreenstein { g }).unwrap();
    let mut materials = materials();
    materials.push(Material::Null);
    // No glass: what is inside of it would not be fog.
    materials[3] = lambert(0.6);
    let mut block = shape(ShapeKind::Cube, DAffine3::from_scale(half), 4);
    block.interior = Some(MediumId(0));
    let mut shapes = furniture(closed);
    shapes.extend(extra);
    shapes.push(block);
    let from = if closed { DVec3::new(0.1, 0.1, 0.9) } else { DVec3::new(0.1, 0.0, 3.6) };
    let camera = camera(from, DVec3::new(0.0, -0.1, -1.0), if closed { 80.0 } else { 40.0 });
    let scene = build(SceneDesc { shapes, materials, lights, camera, media: vec![medium], ..Default::default() });
    (what, scene, Fog { sigma_t: sigma_t.map(f64::from), low: -half, high: half })
}

/// Diffuse, closed, with a large lamp that walks from the camera find.
pub fn diffuse() -> Scene {
    let mut diffuse = vec![lambert(0.7), lambert(0.3)];
    diffuse.extend([lambert(0.5), lambert(0.6)]);
    scene(true, vec![lamp(true), bulb()], vec![], diffuse)
}
