//! Lights too small, too large, too bright, too dark and too many.

use crate::probe::{Probe, Shot};
use crate::scene::{at, camera, diffuse, facing, lamp, room, shape};
use renderer::camera::Camera;
use renderer::film::MergedImage;
use renderer::integrator::IntegratorKind::{self, Bdpt, Light, Mmlt, Path};
use renderer::light::LightDesc;
use renderer::math::{DVec3, Vec2};
use renderer::scene::desc::{CameraDesc, SceneDesc, ShapeDesc, ShapeKind};
use renderer::spectrum::Rgb;
use renderer::texture::RgbParam;
use std::f64::consts::PI;

const ALBEDO: f64 = 0.5;
const SIZE: u32 = 16;

/// Looks at a patch of the floor y = 0 from the side, so that nothing above it is seen.
fn view() -> CameraDesc {
    camera(DVec3::new(0.0, 0.5, 2.0), DVec3::ZERO, 15.0)
}

/// A grey floor and what shines on it.
fn floor(lamps: Vec<ShapeDesc>, lights: Vec<LightDesc>) -> SceneDesc {
    let mut shapes = vec![shape(ShapeKind::Rectangle, facing(DVec3::ZERO, DVec3::Y, DVec3::splat(4.0)), 0)];
    shapes.extend(lamps);
    SceneDesc {
        shapes,
        lights,
        materials: vec![diffuse(ALBEDO as f32), diffuse(0.0)],
        camera: view(),
        ..SceneDesc::default()
    }
}

/// Mean radiance of the picture when the floor at `p` has this irradiance.
fn mean(irradiance: impl Fn(DVec3) -> f64) -> [f64; 3] {
    const FINE: u32 = 8 * SIZE;
    let Ok(camera) = Camera::new(&view(), SIZE, SIZE) else { return [f64::NAN; 3] };
    let mut sum = 0.0;
    for i in 0..FINE * FINE {
        let raster = Vec2::new((i % FINE) as f32 + 0.5, (i / FINE) as f32 + 0.5) * (SIZE as f32 / FINE as f32);
        let ray = camera.generate_ray(raster, Vec2::ZERO);
        let (o, d) = (ray.o.as_dvec3(), ray.d.as_dvec3());
        sum += irradiance(o - d * (o.y / d.y));
    }
    [sum / f64::from(FINE * FINE) * ALBEDO / PI; 3]
}

fn shot(kind: IntegratorKind, count: u32, depth: i32, seed: u64) -> Shot {
    Shot { size: (SIZE, SIZE), ..Shot::new(kind, count, depth, seed) }
}

/// Renders the scene by `kinds`; each must have the mean `truth`.
fn known(probe: &mut Probe, what: &str, desc: SceneDesc, kinds: &[IntegratorKind], truth: [f64; 3]) {
    let count = probe.pick(256, 2048);
    let Some(scene) = probe.build(what, desc) else { return };
    for (i, kind) in kinds.iter().enumerate() {
        if let Some(image) = probe.shoot(what, &scene, &shot(*kind, count, -1, 31 + i as u64)) {
            probe.is(&format!("{what}, {}", kind.name()), &image, truth, 0.1);
        }
    }
}

/// Lights of 1e-12 sr, and nothing but deltas.
pub fn tiny(probe: &mut Probe) {
    let kinds = [Path, Light, Bdpt, Mmlt];
    let radius = (1e-12 / PI).sqrt();
    // Irradiance 1 right below.
    let radiance = 1e12f32;
    let area = PI * radius * radius;
    for place in [DVec3::Y, DVec3::new(0.3, 0.9, -0.2)] {
        let ball = |p: DVec3| {
            let d = place - p;
            f64::from(radiance) * area * d.y / d.length().powi(3)
        };
        let scene = floor(vec![lamp(ShapeKind::Sphere, at(place, radius), 1, radiance)], Vec::new());
        known(probe, &format!("ball of 1e-12 sr at {place}"), scene, &kinds, mean(ball));
        let flat = |p: DVec3| {
            let d = place - p;
            f64::from(radiance) * area * (d.y / d.length()).powi(2) / d.length_squared()
        };
        let disk = lamp(ShapeKind::Disk, facing(place, -DVec3::Y, DVec3::splat(radius)), 1, radiance);
        known(probe, &format!("disk of 1e-12 sr at {place}"), floor(vec![disk], Vec::new()), &kinds, mean(flat));
    }
    // Corners this near each other are known to the steps of coordinates only: near the axis these are small enough.
    let square = |p: DVec3| f64::from(radiance) * 4.0 * radius * radius / (p - DVec3::Y).length().powi(4);
    let scene = floor(
        vec![lamp(ShapeKind::Rectangle, facing(DVec3::Y, -DVec3::Y, DVec3::splat(radius)), 1, radiance)],
        Vec::new(),
    );
    known(probe, "square of 1e-12 sr", scene, &kinds, mean(square));
    // Elsewhere rounding changes its area, which is warned of.
    let m = facing(DVec3::new(0.3, 0.9, -0.2), -DVec3::Y, DVec3::splat(0.1 * radius));
    let scene = floor(vec![lamp(ShapeKind::Rectangle, m, 1, radiance)], Vec::new());
    probe.build_warned("a square of 1e-14 sr off the axes", scene, "single precision");
    let point = LightDesc::Point { position: DVec3::Y, intensity: Rgb::ONE };
    known(probe, "point", floor(Vec::new(), vec![point]), &kinds, mean(|p| 1.0 / (p - DVec3::Y).length().powi(3)));
}

/// Lights a million times the size of what they shine on.
pub fn huge(probe: &mut Probe) {
    let kinds = [Path, Bdpt, Mmlt];
    let far = 1e6f64;
    let lamp_of = |kind, m| floor(vec![lamp(kind, m, 1, 1.0)], Vec::new());
    let plane = lamp_of(ShapeKind::Rectangle, facing(DVec3::Y, -DVec3::Y, DVec3::splat(far)));
    known(probe, "plane of side 2e6", plane, &kinds, [ALBEDO; 3]);
    let disk = lamp_of(ShapeKind::Disk, facing(DVec3::Y, -DVec3::Y, DVec3::splat(far)));
    known(probe, "disk of radius 1e6", disk, &kinds, [ALBEDO; 3]);
    let beside = lamp_of(ShapeKind::Sphere, at(DVec3::Y * (far + 1.0), far));
    known(probe, "ball of radius 1e6", beside, &kinds, [ALBEDO * (far / (far + 1.0)).powi(2); 3]);
    let mut around = lamp_of(ShapeKind::Sphere, at(DVec3::ZERO, far));
    around.shapes[1].flip_normals = true;
    known(probe, "inside of a ball of radius 1e6", around, &kinds, [ALBEDO; 3]);
}

/// The room with all that it emits multiplied.
fn brighter(factor: f32) -> SceneDesc {
    let mut desc = room();
    for s in &mut desc.shapes {
        if let Some(e) = &mut s.emission
            && let RgbParam::Const(radiance) = &mut e.radiance
        {
            *radiance *= factor;
        }
    }
    for light in &mut desc.lights {
        if let LightDesc::Point { intensity, .. } = light {
            *intensity *= factor;
        }
    }
    desc
}

/// The picture with all values divided.
fn dimmed(mut image: MergedImage, factor: f64) -> MergedImage {
    let dim = |v: &mut f32| *v = (f64::from(*v) / factor) as f32;
    image.mean.iter_mut().chain(&mut image.std_error).flatten().for_each(dim);
    image.blocks.std_error.iter_mut().flatten().for_each(dim);
    if let Some(m) = &mut image.blocks.image {
        m.mean.iter_mut().chain(&mut m.std_error).for_each(|v| *v /= factor);
    }
    image
}

/// From 1e-20 to 1e20.
pub fn radiance(probe: &mut Probe) {
    let count = probe.pick(64, 512);
    for kind in [Path, Light, Bdpt, Mmlt] {
        let picture = |probe: &mut Probe, factor: f64, seed| {
            let what = format!("radiance times {factor:e}");
            let scene = probe.build(&what, brighter(factor as f32))?;
            let image = probe.shoot(&what, &scene, &Shot::new(kind, count, 6, seed))?;
            Some(dimmed(image, f64::from(factor as f32)))
        };
        let Some(plain) = picture(probe, 1.0, 32) else { continue };
        // Chains aim at relative errors, with a floor that ordinary pictures do not come near: theirs are other samples.
        for power in [-66, 66].into_iter().filter(|_| kind != Mmlt) {
            let factor = f64::powi(2.0, power);
            if let Some(image) = picture(probe, factor, 32) {
                probe.same_bits(&format!("radiance times 2^{power}, {}", kind.name()), &image, &plain);
            }
        }
        for factor in [1e-20, 1e20] {
            if let Some(image) = picture(probe, factor, 33) {
                let share = if kind == Mmlt { 0.15 } else { 0.06 };
                probe.agree(&format!("radiance times {factor:e}, {}", kind.name()), &image, &plain, share);
            }
        }
    }
}

/// 1e5 lights in place of one.
pub fn many(probe: &mut Probe) {
    const SIDE: u32 = 316;
    let half = 1.0 / f64::from(SIDE);
    let tile = |i: u32| {
        let centre =
            DVec3::new(f64::from(2 * (i % SIDE) + 1) * half - 1.0, 1.0, f64::from(2 * (i / SIDE) + 1) * half - 1.0);
        lamp(ShapeKind::Rectangle, facing(centre, -DVec3::Y, DVec3::splat(half)), 1, 1.0)
    };
    let tiles = floor((0..SIDE * SIDE).map(tile).collect(), Vec::new());
    let one = floor(vec![lamp(ShapeKind::Rectangle, facing(DVec3::Y, -DVec3::Y, DVec3::ONE), 1, 1.0)], Vec::new());
    let count = probe.pick(256, 2048);
    let reference =
        probe.build("one lamp", one).and_then(|s| probe.shoot("one lamp", &s, &shot(Path, 4 * count, -1, 34)));
    let scene = probe.build("99856 lamps", tiles);
    for kind in [Path, Light, Bdpt, Mmlt] {
        let Some(scene) = &scene else { break };
        let image = probe.shoot("99856 lamps", scene, &shot(kind, count, -1, 35));
        if let (Some(image), Some(reference)) = (&image, &reference) {
            probe.agree(&format!("99856 lamps against one, {}", kind.name()), image, reference, 0.1);
        }
    }
    // Points of very different strengths, in one place.
    let strength = |i: u32| f32::powi(10.0, i as i32 % 7 - 6);
    let total: f64 = (0..100_000).map(|i| f64::from(strength(i))).sum();
    let points =
        (0..100_000).map(|i| LightDesc::Point { position: DVec3::Y, intensity: Rgb::splat(strength(i)) }).collect();
    let truth = mean(|p| total / (p - DVec3::Y).length().powi(3));
    known(probe, "1e5 points", floor(Vec::new(), points), &[Path, Bdpt, Mmlt], truth);
}
