//! Media from hardly any to hardly any light through, and phase functions of all shapes.

use crate::probe::{Probe, Shot};
use crate::scene::{at, camera, diffuse, facing, lamp, shape};
use renderer::bsdf::Material;
use renderer::integrator::IntegratorKind::{Bdpt, Light, Mmlt, Path};
use renderer::light::LightDesc;
use renderer::math::{DAffine3, DVec3};
use renderer::medium::{Medium, MediumId, Phase};
use renderer::scene::desc::{SceneDesc, ShapeKind};
use renderer::spectrum::Rgb;

fn medium(extinction: f32, albedo: f32, g: f32) -> Vec<Medium> {
    let phase = if g == 0.0 { Phase::Isotropic } else { Phase::HenyeyGreenstein { g } };
    Medium::new(Rgb::splat(extinction), Rgb::splat(albedo), phase).into_iter().collect()
}

/// A ball of the medium in front of the camera.
fn ball(media: Vec<Medium>) -> SceneDesc {
    let mut s = shape(ShapeKind::Sphere, at(DVec3::ZERO, 1.0), 0);
    s.interior = Some(MediumId(0));
    SceneDesc {
        shapes: vec![s],
        media,
        materials: vec![Material::Null, diffuse(0.0), diffuse(0.7)],
        camera: camera(DVec3::Z * 5.0, DVec3::ZERO, 20.0),
        ..SceneDesc::default()
    }
}

/// Optical thickness from 1e-6 to 1e6.
pub fn thickness(probe: &mut Probe) {
    absorption(probe);
    furnace(probe, &[1e-6, 1e-3, 1.0, 30.0], &[0.0]);
    between_integrators(probe, &[1e-6, 1e-2, 1.0, 1e2, 1e4, 1e6], &[0.0, 0.7]);
}

/// Mean cosines to +-0.999999.
pub fn asymmetry(probe: &mut Probe) {
    let all = [1e-4f32, 0.9, -0.9, 0.999, -0.999, 0.999_999, -0.999_999];
    furnace(probe, &[1.0, 10.0], &all);
    between_integrators(probe, &[0.3, 10.0], &all);
}

/// A sky seen through a slab that only absorbs: Beer and Lambert.
fn absorption(probe: &mut Probe) {
    for tau in [1e-6f32, 1e-3, 0.1, 1.0, 10.0, 80.0] {
        let mut desc = ball(medium(tau, 0.0, 0.0));
        let slab = DAffine3::from_scale(DVec3::new(100.0, 100.0, 0.5));
        desc.shapes[0].kind = ShapeKind::Cube;
        desc.shapes[0].to_world = slab;
        desc.camera = camera(DVec3::Z * 5.0, DVec3::ZERO, 0.01);
        desc.lights = vec![LightDesc::Constant { radiance: Rgb::ONE }];
        let what = format!("slab of thickness {tau:e}");
        let Some(scene) = probe.build(&what, desc) else { continue };
        for kind in [Path, Bdpt, Mmlt] {
            let Some(image) = probe.shoot(&what, &scene, &Shot { size: (8, 8), ..Shot::new(kind, 32, 6, 51) }) else {
                continue;
            };
            let truth = (-f64::from(tau)).exp();
            // The optical depth is rounded to f32, and the exponential carries that on.
            let allowed = 1e-6 * truth * f64::from(tau.max(1.0));
            let off = image.mean.iter().flatten().map(|v| (f64::from(*v) - truth).abs()).fold(0.0, f64::max);
            probe.holds(off <= allowed, || format!("{what}, {}: off by {off:e} from {truth:e}", kind.name()));
        }
    }
}

/// A white medium in a white sky can't be seen.
fn furnace(probe: &mut Probe, thicknesses: &[f32], asymmetries: &[f32]) {
    let count = probe.pick(128, 2048);
    for tau in thicknesses {
        for g in asymmetries {
            let mut desc = ball(medium(*tau, 1.0, *g));
            desc.lights = vec![LightDesc::Constant { radiance: Rgb::ONE }];
            let what = format!("furnace, thickness {tau:e}, g {g}");
            let Some(scene) = probe.build(&what, desc) else { continue };
            let shot = Shot { size: (8, 8), ..Shot::new(Path, count, -1, 52) };
            if let Some(image) = probe.shoot(&what, &scene, &shot) {
                probe.is(&what, &image, [1.0; 3], 0.1);
            }
        }
    }
}

/// All integrators on a ball under a lamp, paths bounded.
fn between_integrators(probe: &mut Probe, thicknesses: &[f32], asymmetries: &[f32]) {
    let count = probe.pick(256, 4096);
    for tau in thicknesses {
        for g in asymmetries {
            let mut desc = ball(medium(*tau, 0.9, *g));
            desc.shapes.push(shape(ShapeKind::Rectangle, facing(-DVec3::Y * 1.2, DVec3::Y, DVec3::splat(3.0)), 2));
            desc.shapes.push(lamp(ShapeKind::Rectangle, facing(DVec3::Y * 3.0, -DVec3::Y, DVec3::splat(2.0)), 1, 3.0));
            desc.camera = camera(DVec3::new(0.0, 1.0, 5.0), DVec3::ZERO, 35.0);
            let what = format!("ball of thickness {tau:e}, g {g}");
            // Of free flights shorter than what coordinates can tell there must be a warning.
            let scene =
                if *tau >= 1e6 { probe.build_warned(&what, desc, "so dense") } else { probe.build(&what, desc) };
            let Some(scene) = scene else { continue };
            let more = |kind| if kind == Light { 4 * count } else { count };
            let shot = |kind, seed| Shot { size: (12, 12), ..Shot::new(kind, more(kind), 8, seed) };
            let Some(reference) = probe.shoot(&what, &scene, &shot(Path, 53)) else { continue };
            // Light tracing alone joins scattering to the lens, which a narrow peak makes a matter of luck.
            for kind in [Light, Bdpt, Mmlt].into_iter().filter(|k| *k != Light || g.abs() < 0.99) {
                if let Some(image) = probe.shoot(&what, &scene, &shot(kind, 54)) {
                    probe.agree(&format!("{what}, {}", kind.name()), &image, &reference, 0.2);
                }
            }
        }
    }
}
