//! Long paths, dark scenes, and scenes without anything.

use crate::probe::{Probe, Shot};
use crate::scene::{at, camera, colour, diffuse, facing, lamp, room, shape};
use renderer::bsdf::Material;
use renderer::integrator::IntegratorKind::{self, Bdpt, Light, Mmlt, Path};
use renderer::light::{Emission, LightDesc};
use renderer::math::{DVec3, Vec3};
use renderer::scene::desc::{SceneDesc, ShapeKind};
use renderer::spectrum::Rgb;

const ALL: [IntegratorKind; 4] = [Path, Light, Bdpt, Mmlt];

/// The inside of a ball or a box around the camera, all of one material.
fn closed(kind: ShapeKind, albedo: f32, glow: f32) -> SceneDesc {
    let mut s = shape(kind, at(DVec3::ZERO, 1.0), 0);
    s.flip_normals = true;
    s.emission = (glow > 0.0).then(|| Emission { radiance: colour(glow, glow, glow), two_sided: false });
    SceneDesc {
        shapes: vec![s],
        materials: vec![diffuse(albedo), diffuse(0.0)],
        camera: camera(DVec3::new(0.1, 0.2, 0.3), DVec3::ZERO, 60.0),
        ..SceneDesc::default()
    }
}

/// Paths of 1024 edges in closed rooms, where what they carry is a geometric series.
pub fn depth(probe: &mut Probe) {
    const DEPTH: i32 = 1024;
    for (albedo, roulette, kinds) in
        [(0.999f32, 2000, &[Path, Light, Mmlt][..]), (0.9, 2000, &[Path]), (0.9, 5, &ALL), (0.5, 5, &ALL)]
    {
        for kind in &[ShapeKind::Sphere, ShapeKind::Cube][..probe.pick(1, 2)] {
            let kind = *kind;
            let mut desc = closed(kind, albedo, 1.0 - albedo);
            desc.defaults.rr_depth = Some(roulette);
            let a = f64::from(albedo);
            let truth = f64::from(1.0 - albedo) * (1.0 - a.powi(DEPTH)) / (1.0 - a);
            let what = format!("{kind:?} of albedo {albedo}, roulette from {roulette}");
            let Some(scene) = probe.build(&what, desc) else { continue };
            for (i, kind) in kinds.iter().enumerate() {
                // A path of 1000 edges costs as much as 100 of 10.
                let count = if albedo > 0.99 { probe.pick(16, 256) } else { probe.pick(96, 1024) };
                let shot = Shot { size: (8, 8), ..Shot::new(*kind, count, DEPTH, 41 + i as u64) };
                if let Some(image) = probe.shoot(&what, &scene, &shot) {
                    // The throughput is rounded at every edge, by the same product of the albedo.
                    let rounding = f64::from(DEPTH) * f64::from(f32::EPSILON / 2.0);
                    probe.is_after(&format!("{what}, {}", kind.name()), &image, [truth; 3], 0.2, rounding);
                }
            }
        }
    }
    white(probe);
}

/// In a white box nothing takes light away but the black lamp: radiance is that of the lamp, everywhere.
fn white(probe: &mut Probe) {
    let mut desc = closed(ShapeKind::Cube, 1.0, 0.0);
    let side = |normal: DVec3| facing(-normal, normal, DVec3::ONE);
    desc.shapes =
        [DVec3::Y, DVec3::X, -DVec3::X, DVec3::Z, -DVec3::Z].map(|n| shape(ShapeKind::Rectangle, side(n), 0)).into();
    desc.shapes.push(lamp(ShapeKind::Rectangle, side(-DVec3::Y), 1, 1.0));
    desc.camera = camera(DVec3::new(0.1, -0.9, 0.3), DVec3::new(0.0, -0.8, 0.0), 60.0);
    let Some(scene) = probe.build("white box", desc) else { return };
    for (i, kind) in ALL.into_iter().enumerate() {
        let shot = Shot { size: (16, 16), ..Shot::new(kind, probe.pick(256, 2048), -1, 45 + i as u64) };
        if let Some(image) = probe.shoot("white box", &scene, &shot) {
            probe.is(&format!("white box, {}", kind.name()), &image, [1.0; 3], 0.1);
        }
    }
}

/// Where no light is, every pixel is exactly black; where there is nothing but sky, exactly the sky.
pub fn dark(probe: &mut Probe) {
    let mut unlit = room();
    unlit.lights.clear();
    unlit.shapes.iter_mut().for_each(|s| s.emission = None);
    let mut off = room();
    off.lights = vec![LightDesc::Point { position: DVec3::ZERO, intensity: Rgb::ZERO }];
    off.shapes.iter_mut().filter_map(|s| s.emission.as_mut()).for_each(|e| e.radiance = colour(0.0, 0.0, 0.0));
    let mut black = room();
    black.materials = vec![diffuse(0.0); black.materials.len()];
    black.shapes.iter_mut().for_each(|s| s.emission = None);
    let empty = SceneDesc::default();
    let only_point = SceneDesc {
        lights: vec![LightDesc::Point { position: DVec3::NEG_Z, intensity: Rgb::ONE }],
        ..SceneDesc::default()
    };
    // A lamp that shines away from everything.
    let mut away = closed(ShapeKind::Sphere, 0.5, 0.0);
    away.shapes.push(lamp(ShapeKind::Sphere, at(DVec3::X * 5.0, 1.0), 1, 1.0));
    let cases = [
        ("no light", unlit),
        ("lights that are off", off),
        ("black surfaces", black),
        ("white box", closed(ShapeKind::Cube, 1.0, 0.0)),
        ("nothing", empty),
        ("a point light only", only_point),
        ("a lamp behind a wall", away),
    ];
    for (what, desc) in cases {
        exactly(probe, what, desc, 0.0);
    }
    for radiance in [1.0f32, 1e-20, 1e20] {
        let sky =
            SceneDesc { lights: vec![LightDesc::Constant { radiance: Rgb::splat(radiance) }], ..SceneDesc::default() };
        exactly(probe, &format!("a sky of {radiance:e} only"), sky, radiance);
    }
    let sun = LightDesc::Directional { direction: Vec3::NEG_Y.as_dvec3(), irradiance: Rgb::ONE };
    exactly(
        probe,
        "a sun only",
        SceneDesc { lights: vec![sun], materials: vec![Material::Null], ..SceneDesc::default() },
        0.0,
    );
}

fn exactly(probe: &mut Probe, what: &str, desc: SceneDesc, radiance: f32) {
    let Some(scene) = probe.build(what, desc) else { return };
    for kind in ALL {
        if radiance > 0.0 && kind == Light {
            // Light tracing does not see the sky itself.
            continue;
        }
        for depth in [-1, 8] {
            let Some(image) = probe.shoot(what, &scene, &Shot { size: (20, 12), ..Shot::new(kind, 32, depth, 46) })
            else {
                continue;
            };
            let off = image.mean.iter().flatten().filter(|v| (**v - radiance).abs() > 1e-6 * radiance).count();
            probe.holds(off == 0, || format!("{what}, {}: {off} values are not {radiance}", kind.name()));
            let error =
                image.error.is_some_and(|e| [e.relative, e.upper95, e.mean, e.mean_se].iter().all(|v| v.is_finite()));
            probe.holds(error, || format!("{what}, {}: its error is {:?}", kind.name(), image.error));
        }
    }
}
