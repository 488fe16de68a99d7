//! Whole renders against answers known exactly.

mod common;

use common::{assert_mean, assert_same_mean, build, camera, emission, lambert, render, render_with, shape};
use renderer::film::MergedImage;
use renderer::integrator::IntegratorKind;
use renderer::integrator::IntegratorKind::{Bdpt, Light, Mmlt, Path};
use renderer::job::{RenderOptions, RenderSettings};
use renderer::math::{DAffine3, DQuat, DVec3};
use renderer::scene::Scene;
use renderer::scene::desc::{LightDesc, SceneDesc, ShapeKind};
use renderer::spectrum::Rgb;

/// The inside of a sphere around the camera.
fn closed_sphere(radius: f64, centre: DVec3, albedo: f32, glow: Option<f32>, lights: Vec<LightDesc>) -> Scene {
    let to_world = DAffine3::from_translation(centre) * DAffine3::from_scale(DVec3::splat(radius));
    let mut s = shape(ShapeKind::Sphere, to_world, 0);
    s.flip_normals = true;
    s.emission = glow.and_then(emission);
    build(SceneDesc {
        shapes: vec![s],
        materials: vec![lambert(albedo)],
        lights,
        camera: camera(centre + DVec3::new(0.1, 0.2, 0.3) * radius, centre, 60.0),
        ..Default::default()
    })
}

#[test]
fn a_glowing_closed_sphere_is_the_geometric_series() {
    // Le / (1 - albedo), or its first terms under a depth limit; at any size and place.
    for (radius, centre) in [(1.0, DVec3::ZERO), (1e-3, DVec3::X * 2e-3), (1e6, DVec3::new(1e6, 0.0, -3e6))] {
        let scene = closed_sphere(radius, centre, 0.5, Some(0.5), Vec::new());
        for kind in [Path, Light, Bdpt, Mmlt] {
            let what = format!("{kind:?} at radius {radius}");
            assert_mean(&render(&scene, kind, (20, 20), 160, -1, 1), 1.0, 0.03, &what);
            assert_mean(&render(&scene, kind, (20, 20), 160, 3, 2), 0.5 + 0.25 + 0.125, 0.03, &what);
            assert_mean(&render(&scene, kind, (20, 20), 160, 1, 3), 0.5, 0.03, &what);
        }
    }
}

#[test]
fn a_point_light_in_a_closed_sphere_is_the_geometric_series() {
    // The point at the centre sends I / r^2 to every point: albedo / pi * I / r^2 / (1 - albedo).
    let intensity = Rgb::splat(std::f32::consts::PI);
    let scene = closed_sphere(1.0, DVec3::ZERO, 0.5, None, vec![LightDesc::Point { position: DVec3::ZERO, intensity }]);
    for kind in [Path, Light, Bdpt, Mmlt] {
        assert_mean(&render(&scene, kind, (20, 20), 160, -1, 1), 1.0, 0.03, &format!("{kind:?}"));
        assert_mean(&render(&scene, kind, (20, 20), 160, 2, 1), 0.5, 0.02, &format!("{kind:?}, direct light"));
    }
}

#[test]
fn white_things_vanish_in_a_white_sky() {
    let at = |x: f64, y: f64| DAffine3::from_translation(DVec3::new(x, y, 0.0));
    let turned =
        at(0.8, 0.2) * DAffine3::from_quat(DQuat::from_rotation_y(0.7)) * DAffine3::from_scale(DVec3::splat(0.5));
    let scene = build(SceneDesc {
        shapes: vec![
            shape(ShapeKind::Sphere, at(-0.8, 0.0), 0),
            shape(ShapeKind::Cube, turned, 0),
            shape(ShapeKind::Disk, at(0.3, -0.9), 1),
        ],
        materials: vec![
            lambert(1.0),
            renderer::bsdf::Material::TwoSided {
                front: renderer::bsdf::MaterialId(0),
                back: renderer::bsdf::MaterialId(0),
            },
        ],
        lights: vec![LightDesc::Constant { radiance: Rgb::ONE }],
        camera: camera(DVec3::new(0.2, 0.5, 5.0), DVec3::ZERO, 35.0),
        ..Default::default()
    });
    for kind in [Path, Light, Bdpt, Mmlt] {
        assert_mean(&render(&scene, kind, (20, 20), 512, -1, 1), 1.0, 0.03, &format!("{kind:?}"));
    }
}

/// A box with a lamp, a ball and a block, seen through its open side.
fn room(lens: f64) -> Scene {
    let wall = |rotation: DQuat, offset: DVec3| {
        DAffine3::from_translation(offset) * DAffine3::from_quat(rotation) * DAffine3::from_scale(DVec3::splat(1.0))
    };
    let quarter = std::f64::consts::FRAC_PI_2;
    let mut lamp = shape(
        ShapeKind::Rectangle,
        wall(DQuat::from_rotation_x(quarter), DVec3::Y * 0.95) * DAffine3::from_scale(DVec3::splat(0.3)),
        0,
    );
    lamp.emission = emission(10.0);
    let mut bulb = shape(
        ShapeKind::Sphere,
        DAffine3::from_translation(DVec3::new(-0.5, 0.3, 0.3)) * DAffine3::from_scale(DVec3::splat(0.05)),
        0,
    );
    bulb.emission = emission(30.0);
    let mut camera = camera(DVec3::new(0.1, 0.0, 3.6), DVec3::ZERO, 40.0);
    camera.aperture_radius = lens;
    camera.focus_distance = 3.6;
    build(SceneDesc {
        shapes: vec![
            lamp,
            bulb,
            shape(ShapeKind::Rectangle, wall(DQuat::IDENTITY, -DVec3::Z), 0),
            shape(ShapeKind::Rectangle, wall(DQuat::from_rotation_x(-quarter), -DVec3::Y), 0),
            shape(ShapeKind::Rectangle, wall(DQuat::from_rotation_x(quarter), DVec3::Y), 0),
            shape(ShapeKind::Rectangle, wall(DQuat::from_rotation_y(quarter), -DVec3::X), 1),
            shape(ShapeKind::Rectangle, wall(DQuat::from_rotation_y(-quarter), DVec3::X), 0),
            shape(
                ShapeKind::Sphere,
                wall(DQuat::IDENTITY, DVec3::new(0.3, -0.6, 0.1)) * DAffine3::from_scale(DVec3::splat(0.4)),
                1,
            ),
            shape(
                ShapeKind::Cube,
                wall(DQuat::from_rotation_y(0.4), DVec3::new(-0.4, -0.5, -0.4))
                    * DAffine3::from_scale(DVec3::splat(0.3)),
                0,
            ),
        ],
        materials: vec![lambert(0.7), lambert(0.3)],
        lights: vec![
            LightDesc::Directional { direction: DVec3::new(0.3, -0.5, -1.0), irradiance: Rgb::new(0.4, 0.3, 0.2) },
            LightDesc::Constant { radiance: Rgb::splat(0.1) },
        ],
        camera,
        ..Default::default()
    })
}

#[test]
fn all_integrators_make_the_same_image() {
    for (lens, what) in [(0.0, "pinhole"), (0.08, "thin lens")] {
        let scene = room(lens);
        let settings = |kind: IntegratorKind, n: u32| {
            let options =
                RenderOptions { size: Some((40, 40)), max_depth: Some(6), ..RenderOptions::counting(kind, n) };
            let mut settings = RenderSettings::resolve(&options, &scene.defaults).unwrap();
            // A wide filter: tiles sample it, splats spread over it.
            settings.filter = renderer::scene::desc::FilterDesc::BlackmanHarris { radius: 1.5 };
            settings
        };
        let path = render_with(&scene, &settings(Path, 512), 2);
        for (kind, n) in [(Light, 512), (Bdpt, 256), (Mmlt, 1024)] {
            let what = format!("{kind:?}, {what}");
            let other = render_with(&scene, &settings(kind, n), 2);
            assert_same_mean(&path, &other, 0.02, &what);
            // Pixel by pixel: at most a share of pixels that chance explains lies beyond its 99.9 % interval.
            let t = common::t999(8);
            let outside = (0..path.mean.len()).filter(|&i| {
                let se = |image: &MergedImage| renderer::math::sqr(image.std_error[i][1]);
                let se = (se(&path) + se(&other)).sqrt();
                f64::from((path.mean[i][1] - other.mean[i][1]).abs()) > t * f64::from(se)
            });
            let outside = outside.count();
            assert!(outside <= 20, "{what}: {outside} of {} pixels", path.mean.len());
        }
    }
}
