//! The integrators that walk from the lights against `path`, at equal depth.

use crate::common::{assert_same_mean, build, camera, emission, render};
use crate::scenes::{GLASS, NULL, WHITE, ball, body, desc, grey};
use renderer::bsdf::Material;
use renderer::integrator::IntegratorKind::{self, Bdpt, Light, Mmlt, Path};
use renderer::light::{LightDesc, SpotFalloff};
use renderer::math::DVec3;
use renderer::medium::Medium;
use renderer::scene::Scene;
use renderer::scene::desc::ShapeKind;
use renderer::spectrum::Rgb;

/// Size of the pictures.
const SIZE: (u32, u32) = (16, 16);

/// Renders by `path` and by `kind`, and compares the means; `share` is how wide the interval may be.
fn assert_agrees(scene: &Scene, kind: IntegratorKind, spp: u32, depth: i32, share: f64, what: &str) {
    let truth = render(scene, Path, SIZE, 2 * spp, depth, 1);
    let image = render(scene, kind, SIZE, spp, depth, 2);
    assert_same_mean(&image, &truth, share, &format!("{kind:?}, {what}"));
}

/// A ball of radius 1 in a white sky, bounded by nothing or by glass of index 1.
fn furnace(medium: Medium, inside: bool, glass: bool) -> Scene {
    let sky = vec![LightDesc::Constant { radiance: Rgb::ONE }];
    let boundary = if glass { GLASS } else { NULL };
    let mut d = desc(vec![ball(DVec3::ZERO, 1.0, boundary, Some(0))], vec![medium], sky);
    if let Material::Dielectric { eta, .. } = &mut d.materials[GLASS as usize] {
        *eta = 1.0;
    }
    d.camera = camera(if inside { DVec3::new(0.2, 0.1, 0.3) } else { DVec3::Z * 5.0 }, DVec3::ZERO, 20.0);
    build(d)
}

#[test]
fn furnaces_have_the_same_terms_in_all_integrators() {
    for (k, g) in [0.0, 0.5, -0.5, 0.9, 0.999].into_iter().enumerate() {
        for (i, (tau, share)) in [(1e-3, 0.02), (1.0, 0.04), (8.0, 0.1)].into_iter().enumerate() {
            let scene = furnace(grey(0.5 * tau, 1.0, g), i % 2 == 0, k % 2 == 1);
            for (kind, share) in [(Bdpt, share), (Mmlt, 2.0 * share)] {
                assert_agrees(&scene, kind, 128, 10, share, &format!("g {g}, depth {tau}"));
            }
        }
    }
}

/// What lights the cloud.
#[derive(Clone, Copy, Debug)]
enum Source {
    Lamp,
    Point,
    Spot,
    Sun,
}

/// A white floor in a coloured cloud, with a lamp in it or in the sun.
fn cloud(source: Source, g: f32) -> Scene {
    let medium = Medium::new(Rgb::new(0.3, 0.6, 1.2), Rgb::new(0.95, 0.8, 0.6), grey(1.0, 1.0, g).phase).unwrap();
    let mut shapes = vec![
        ball(DVec3::ZERO, 2.0, NULL, Some(0)),
        body(ShapeKind::Cube, DVec3::Y * -1.4, DVec3::new(3.0, 0.4, 3.0), WHITE, None),
    ];
    let mut lights = Vec::new();
    let position = DVec3::new(0.4, 0.6, 0.2);
    match source {
        Source::Lamp => {
            let mut lamp = ball(position, 0.25, WHITE, None);
            lamp.emission = emission(8.0);
            shapes.push(lamp);
        }
        Source::Point => lights.push(LightDesc::Point { position, intensity: Rgb::splat(2.0) }),
        Source::Spot => lights.push(LightDesc::Spot {
            position,
            direction: DVec3::new(-0.6, -0.8, 0.1),
            intensity: Rgb::splat(9.0),
            beam: 20.0,
            cutoff: 30.0,
            falloff: SpotFalloff::LinearAngle,
        }),
        Source::Sun => {
            let direction = DVec3::new(0.4, -1.0, -0.3);
            lights.push(LightDesc::Directional { direction, irradiance: Rgb::splat(1.5) });
        }
    }
    let mut d = desc(shapes, vec![medium], lights);
    d.camera = camera(DVec3::new(0.0, 1.0, 5.0), DVec3::Y * -0.3, 30.0);
    build(d)
}

#[test]
fn single_and_multiple_scattering_agree_from_both_ends() {
    use Source::{Lamp, Point, Spot, Sun};
    for (source, g, depth) in [
        (Lamp, 0.0, 2),
        (Lamp, 0.7, 7),
        (Lamp, -0.4, 3),
        (Point, 0.0, 2),
        (Point, -0.4, 3),
        (Spot, -0.4, 4),
        (Sun, 0.0, 7),
        (Sun, -0.4, 2),
    ] {
        let scene = cloud(source, g);
        for (kind, spp, share) in [(Light, 1024, 0.1), (Bdpt, 512, 0.1), (Mmlt, 512, 0.15)] {
            assert_agrees(&scene, kind, spp, depth, share, &format!("{source:?}, g {g}, {depth} edges"));
        }
    }
}
