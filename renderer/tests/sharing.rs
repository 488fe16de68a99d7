//! Pixels that share their paths, and chains whose paths count for the pixels around: the same image, with less noise, and the error that
//! is told is the true one.

#![allow(clippy::unwrap_used, clippy::panic, reason = "test helpers")]

mod common;

use common::{camera, deviations, emission, lambert, render_with, shape};
use renderer::bsdf::{Distribution, Material, MaterialId, Roughness};
use renderer::film::MergedImage;
use renderer::integrator::IntegratorKind;
use renderer::integrator::mmlt::MmltOptions;
use renderer::job::{RenderOptions, RenderSettings};
use renderer::light::{LightDesc, SpotFalloff};
use renderer::math::{DAffine3, DMat3, DVec3};
use renderer::scene::Scene;
use renderer::scene::desc::{CameraDesc, RenderDefaults, SceneDesc, ShapeDesc, ShapeKind};
use renderer::spectrum::Rgb;
use renderer::texture::{FloatParam, RgbParam};
use statcheck::{Mean, sidak, welch_test};

const RENDERS: u64 = 48;
/// Blocks of the picture along each axis, which are compared.
const BLOCKS: u32 = 4;

fn coated(base: Rgb, metallic: f32, roughness: f32) -> Material {
    Material::Gltf {
        base_color: RgbParam::Const(base),
        metallic: FloatParam::Const(metallic),
        roughness: FloatParam::Const(roughness),
        ior: 1.5,
        transmission: FloatParam::Const(0.0),
        thin: true,
    }
}

/// A wall of half side 1 around `p`, facing the direction `n`.
fn wall(p: DVec3, n: DVec3, material: u32) -> ShapeDesc {
    shape(ShapeKind::Rectangle, DAffine3::from_mat3_translation(frame(n), p), material)
}

/// Axes of which the third is `n`.
fn frame(n: DVec3) -> DMat3 {
    let s = n.any_orthonormal_vector();
    DMat3::from_cols(s, n.cross(s), n)
}

fn ball(p: DVec3, radius: f64, material: u32) -> ShapeDesc {
    shape(
        ShapeKind::Sphere,
        DAffine3::from_scale_rotation_translation(DVec3::splat(radius), Default::default(), p),
        material,
    )
}

/// A room of all kinds of surfaces: diffuse ones, seen from both sides, coated ones whose light depends on where it goes, and metal and
/// glass, which share nothing; or with a mirror in place of a metal ball, seen through a lens. Its lamp shines at the ceiling, so that
/// nearly all light is reflected twice.
fn room(mirror: bool) -> Scene {
    let lamp = ShapeDesc {
        emission: emission(12.0),
        ..shape(
            ShapeKind::Disk,
            DAffine3::from_mat3_translation(
                DMat3::from_cols(DVec3::X, DVec3::NEG_Z, DVec3::Y) * 0.25,
                DVec3::new(0.2, 0.45, -0.2),
            ),
            0,
        )
    };
    let mut screen = wall(DVec3::new(-0.55, -0.6, -0.3), DVec3::new(1.0, 0.3, 0.6).normalize(), 2);
    screen.to_world *= DAffine3::from_scale(DVec3::splat(0.35));
    let metal = coated(Rgb::new(0.9, 0.7, 0.4), 1.0, if mirror { 0.0 } else { 0.4 });
    let camera = camera(DVec3::new(0.0, -0.1, 3.2), DVec3::new(0.0, -0.1, 0.0), 38.0);
    let aperture_radius = if mirror { 0.05 } else { 0.0 };
    common::build(SceneDesc {
        shapes: vec![
            wall(DVec3::NEG_Y, DVec3::Y, 0),
            wall(DVec3::Y, DVec3::NEG_Y, 0),
            wall(DVec3::NEG_X, DVec3::X, 1),
            wall(DVec3::X, DVec3::NEG_X, 3),
            wall(DVec3::NEG_Z, DVec3::Z, 0),
            lamp,
            screen,
            ball(DVec3::new(0.4, -0.65, 0.1), 0.35, 5),
            ball(DVec3::new(-0.3, -0.75, 0.45), 0.25, 4),
            ball(DVec3::new(-0.1, -0.75, -0.5), 0.25, 3),
        ],
        materials: vec![
            lambert(0.7),
            Material::Lambert { reflectance: RgbParam::Const(Rgb::new(0.7, 0.2, 0.1)) },
            Material::TwoSided { front: MaterialId(0), back: MaterialId(1) },
            coated(Rgb::new(0.2, 0.6, 0.3), 0.0, 0.45),
            metal,
            Material::Dielectric {
                eta: 1.5,
                reflectance: RgbParam::Const(Rgb::ONE),
                transmittance: RgbParam::Const(Rgb::ONE),
                roughness: None,
            },
        ],
        camera: CameraDesc { aperture_radius, focus_distance: 3.0, ..camera },
        ..SceneDesc::default()
    })
}

/// A floor that is lit by what a dark wall with a coat throws on it, of a spotlight: the more so the nearer to the mirror direction.
fn glow() -> Scene {
    let spot = LightDesc::Spot {
        position: DVec3::new(0.5, 0.3, 0.0),
        direction: DVec3::new(-1.0, -0.4, 0.1),
        intensity: Rgb::ONE,
        beam: 15.0,
        cutoff: 20.0,
        falloff: SpotFalloff::LinearAngle,
    };
    common::build(SceneDesc {
        shapes: vec![wall(DVec3::NEG_Y, DVec3::Y, 0), wall(DVec3::NEG_X, DVec3::X, 1)],
        lights: vec![spot],
        materials: vec![lambert(0.7), coated(Rgb::splat(0.02), 0.0, 0.32)],
        camera: camera(DVec3::new(0.0, 1.5, 0.0), DVec3::NEG_Y, 35.0),
        ..SceneDesc::default()
    })
}

/// Lights of all kinds on a diffuse floor, a glossy plate, a mirror and a ball behind glass: some are found by samples of lights alone,
/// some by rays alone, and most by both.
fn lamps() -> Scene {
    let lamp = |shape: ShapeDesc, radiance: f32| ShapeDesc { emission: emission(radiance), ..shape };
    let mut screen = lamp(wall(DVec3::new(-0.9, 0.0, -0.4), DVec3::new(1.0, -0.2, 0.5).normalize(), 0), 1.5);
    screen.to_world *= DAffine3::from_scale(DVec3::splat(0.3));
    let plate = |x: f64, n: DVec3, material: u32| {
        let mut plate = wall(DVec3::new(x, -0.7, 0.2), n.normalize(), material);
        plate.to_world *= DAffine3::from_scale(DVec3::splat(0.4));
        plate
    };
    let point = LightDesc::Point { position: DVec3::new(0.9, 0.6, 0.8), intensity: Rgb::splat(0.3) };
    let sky = LightDesc::Constant { radiance: Rgb::new(0.05, 0.1, 0.2) };
    common::build(SceneDesc {
        shapes: vec![
            wall(DVec3::NEG_Y, DVec3::Y, 0),
            wall(DVec3::NEG_Z, DVec3::Z, 0),
            plate(-0.5, DVec3::new(0.2, 1.0, 0.3), 1),
            plate(0.5, DVec3::new(-0.3, 0.6, 1.0), 2),
            ball(DVec3::new(0.0, -0.6, 0.6), 0.2, 3),
            lamp(ball(DVec3::new(0.3, 0.5, -0.2), 0.1, 0), 20.0),
            screen,
        ],
        materials: vec![
            lambert(0.6),
            coated(Rgb::new(0.9, 0.7, 0.4), 1.0, 0.2),
            coated(Rgb::new(0.2, 0.5, 0.7), 0.0, 0.0),
            Material::Dielectric {
                eta: 1.5,
                reflectance: RgbParam::Const(Rgb::ONE),
                transmittance: RgbParam::Const(Rgb::ONE),
                roughness: Some(Roughness {
                    distribution: Distribution::Ggx,
                    alpha_u: FloatParam::Const(0.3),
                    alpha_v: FloatParam::Const(0.3),
                }),
            },
        ],
        lights: vec![point, sky],
        camera: camera(DVec3::new(0.0, 0.2, 3.2), DVec3::new(0.0, -0.2, 0.0), 38.0),
        ..SceneDesc::default()
    })
}

fn renders(scene: &Scene, options: &RenderOptions, first: u64) -> Vec<MergedImage> {
    let of = |seed| {
        let max_depth = options.max_depth.or(Some(6));
        let options = RenderOptions { max_depth, seed: Some(seed), ..options.clone() };
        render_with(scene, &RenderSettings::resolve(&options, &scene.defaults).unwrap(), 2)
    };
    (first..first + RENDERS).map(of).collect()
}

/// `path` with square pictures.
fn path(size: u32, share: bool) -> RenderOptions {
    RenderOptions { size: Some((size, size)), share: Some(share), ..RenderOptions::counting(IntegratorKind::Path, 32) }
}

/// For each block and channel its means over the renders.
fn blocks(renders: &[MergedImage]) -> Vec<Mean> {
    let width = renders[0].width;
    let side = width / BLOCKS;
    let mean = |r: &MergedImage, x: u32, y: u32, channel: usize| {
        let pixels = (0..side * side).map(|i| (y * side + i / side) * width + x * side + i % side);
        pixels.map(|i| f64::from(r.mean[i as usize][channel])).sum::<f64>()
    };
    let places = (0..BLOCKS).flat_map(|y| (0..BLOCKS).map(move |x| (x, y)));
    let all = places.flat_map(|(x, y)| (0..3).map(move |channel| (x, y, channel)));
    all.map(|(x, y, channel)| renders.iter().map(|r| mean(r, x, y, channel)).collect()).collect()
}

/// Renders with the options of both kinds, of which the blocks must have the same expectation.
fn compared(scene: &Scene, options: [RenderOptions; 2]) -> [Vec<MergedImage>; 2] {
    let [first, second] = &options;
    let both = [renders(scene, first, 0), renders(scene, second, 1000)];
    let (a, b) = (blocks(&both[0]), blocks(&both[1]));
    let significance = sidak(0.01, a.len());
    for (i, (a, b)) in a.iter().zip(&b).enumerate() {
        let p = welch_test(a, b);
        assert!(p > significance, "block {}, channel {}: {a:?} against {b:?} alone, p = {p}", i / 3, i % 3);
    }
    both
}

/// How many times less the pixels of the first renders scatter; that they tell how much they do.
fn gain([first, second]: &[Vec<MergedImage>; 2]) -> f64 {
    let ((found, told), (found_alone, _)) = (deviations(first), deviations(second));
    let difference: Mean = told.iter().zip(&found).map(|(t, f)| t - f).collect();
    let (mean, error) = (difference.mean(), difference.error());
    assert!(mean.abs() < 3.5 * error, "told variance less true variance: {mean} +- {error}");
    found_alone.iter().sum::<f64>() / found.iter().sum::<f64>()
}

#[test]
fn shared_paths_make_the_same_image_with_less_noise() {
    let gain = gain(&compared(&room(false), [path(40, true), path(40, false)]));
    assert!(gain > 2.0, "variance is only {gain} times less");
}

/// Several samples of lights at first vertices, where these are worth their rays, without anything to share and with it.
#[test]
fn several_samples_of_lights_make_the_same_image_with_less_noise() {
    let scene = lamps();
    let direct = |share| RenderOptions { max_depth: Some(2), ..path(24, share) };
    let both = compared(&scene, [direct(true), direct(false)]);
    let gain = gain(&both);
    // A sample costs about a ray beside its rays.
    let work =
        |renders: &Vec<MergedImage>| -> u64 { renders.iter().map(|r| r.counters.samples + r.counters.rays).sum() };
    let dearer = work(&both[0]) as f64 / work(&both[1]) as f64;
    assert!(gain > 1.1 && gain > dearer, "variance is only {gain} times less, for {dearer} times the work");
    compared(&scene, [path(24, true), path(24, false)]);
}

/// Light of coated surfaces depends on where it goes: what is shared is not what the path itself found.
#[test]
fn what_is_shared_goes_where_it_should() {
    compared(&glow(), [path(16, true), path(16, false)]);
}

/// `mmlt` with square pictures, `n` mutations of which one counts for the pixels around.
fn chains(size: u32, n: u32) -> RenderOptions {
    RenderOptions {
        size: Some((size, size)),
        mmlt: Some(MmltOptions { neighbours: n, ..MmltOptions::default() }),
        ..RenderOptions::counting(IntegratorKind::Mmlt, 24)
    }
}

/// Seen through a lens, by mirrors and through glass, too.
#[test]
fn paths_of_chains_that_count_for_neighbours_make_the_same_image_with_less_noise() {
    let scene = room(true);
    compared(&scene, [chains(40, 4), path(40, false)]);
    let gain = gain(&compared(&scene, [chains(40, 4), chains(40, 0)]));
    assert!(gain > 1.5, "variance is only {gain} times less");
}

#[test]
fn paths_of_chains_go_where_they_should() {
    compared(&glow(), [chains(16, 2), path(16, false)]);
}

#[test]
fn only_path_shares() {
    let resolve = |kind, share| {
        let options = RenderOptions { share: Some(share), ..RenderOptions::counting(kind, 64) };
        RenderSettings::resolve(&options, &RenderDefaults::default())
    };
    assert!(resolve(IntegratorKind::Path, true).unwrap().share && !resolve(IntegratorKind::Path, false).unwrap().share);
    for kind in [IntegratorKind::Light, IntegratorKind::Bdpt, IntegratorKind::Mmlt] {
        let said = resolve(kind, true).unwrap_err().to_string();
        assert!(said.contains("--share is for path"), "{said}");
    }
}

/// In a closed white sphere with a light in its middle the radiance is known: what comes directly, times the geometric series.
#[test]
fn light_of_many_reflections_is_known() {
    let albedo = 0.8f32;
    let mut inside = ball(DVec3::ZERO, 1.0, 0);
    inside.flip_normals = true;
    inside.emission = emission(1.0);
    let scene = common::build(SceneDesc {
        shapes: vec![inside],
        materials: vec![lambert(albedo)],
        camera: camera(DVec3::new(0.1, 0.2, 0.3), DVec3::new(1.0, 0.0, 0.0), 60.0),
        ..SceneDesc::default()
    });
    let options = RenderOptions { size: Some((64, 64)), ..RenderOptions::counting(IntegratorKind::Path, 64) };
    for share in [false, true] {
        let options = RenderOptions { share: Some(share), ..options.clone() };
        let image = render_with(&scene, &RenderSettings::resolve(&options, &scene.defaults).unwrap(), 2);
        common::assert_mean(&image, 1.0 / (1.0 - f64::from(albedo)), 0.01, if share { "shared" } else { "alone" });
    }
}
