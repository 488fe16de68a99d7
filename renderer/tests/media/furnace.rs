//! A medium that absorbs nothing does not show in a white environment.

use crate::common::{assert_mean, build, camera, render};
use crate::scenes::{GLASS, NULL, ball, body, desc, grey};
use renderer::bsdf::Material;
use renderer::integrator::IntegratorKind::Path;
use renderer::light::LightDesc;
use renderer::math::DVec3;
use renderer::medium::Medium;
use renderer::scene::Scene;
use renderer::scene::desc::{ShapeDesc, ShapeKind};
use renderer::spectrum::Rgb;

/// A ball of radius 1 in a white sky, the camera outside or inside; it is bounded by nothing, or by glass of index 1.
fn furnace(medium: Medium, inside: bool, glass: bool) -> Scene {
    let boundary = if glass { GLASS } else { NULL };
    let mut d = desc(vec![ball(DVec3::ZERO, 1.0, boundary, Some(0))], vec![medium], white_sky());
    if let Material::Dielectric { eta, .. } = &mut d.materials[GLASS as usize] {
        *eta = 1.0;
    }
    d.camera = camera(if inside { DVec3::new(0.2, 0.1, 0.3) } else { DVec3::Z * 5.0 }, DVec3::ZERO, 20.0);
    build(d)
}

fn white_sky() -> Vec<LightDesc> {
    vec![LightDesc::Constant { radiance: Rgb::ONE }]
}

/// Optical thickness of the ball, samples per pixel, and how wide the interval may be.
const DEPTHS: [(f32, u32, f64); 5] =
    [(1e-6, 16, 1e-4), (1e-3, 16, 0.01), (1.0, 64, 0.02), (30.0, 24, 0.1), (100.0, 32, 0.1)];

#[test]
fn media_that_absorb_nothing_vanish_in_a_white_sky() {
    for (k, g) in [0.0, 0.5, -0.5, 0.9, 0.999].into_iter().enumerate() {
        for (i, (tau, spp, share)) in DEPTHS.into_iter().enumerate() {
            let medium = grey(0.5 * tau, 1.0, g);
            let seed = (10 * k + i) as u64;
            let what = format!("g {g}, depth {tau}");
            let image = render(&furnace(medium, i % 2 == 1, k % 2 == 1), Path, (16, 16), spp, -1, seed);
            assert_mean(&image, 1.0, share, &what);
            if tau > 1.0 {
                continue;
            }
            let image = render(&furnace(medium, i % 2 == 0, k % 2 == 0), Path, (16, 16), spp, -1, seed + 100);
            assert_mean(&image, 1.0, share, &format!("{what}, the other way round"));
        }
    }
}

#[test]
fn nested_and_coloured_media_that_absorb_nothing_vanish_in_a_white_sky() {
    // Overlapping bodies of different priorities and of every kind of extinction, one of them without any medium.
    let coloured = |r, g, b| Medium::new(Rgb::new(r, g, b), Rgb::ONE, grey(1.0, 1.0, 0.7).phase).unwrap();
    let media = vec![grey(3.0, 1.0, -0.3), coloured(0.2, 2.0, 9.0), coloured(4.0, 0.0, 0.7)];
    let with_priority = |priority, shape| ShapeDesc { priority, ..shape };
    let shapes = vec![
        ball(DVec3::ZERO, 1.0, NULL, Some(0)),
        with_priority(2, ball(DVec3::X * 0.9, 0.7, NULL, Some(1))),
        with_priority(-1, body(ShapeKind::Cube, DVec3::Y * 0.8, DVec3::splat(0.7), NULL, Some(2))),
        ball(DVec3::new(0.2, -0.3, 0.1), 0.3, NULL, None),
    ];
    for (i, from) in [DVec3::Z * 5.0, DVec3::new(0.2, -0.3, 0.1), DVec3::new(0.8, 0.1, 0.2)].into_iter().enumerate() {
        let mut d = desc(shapes.clone(), media.clone(), white_sky());
        d.camera = camera(from, DVec3::new(0.01, 0.2, 0.0), 25.0);
        let image = render(&build(d), Path, (16, 16), 256, -1, i as u64);
        assert_mean(&image, 1.0, 0.02, &format!("from {from}"));
        for c in 0..3 {
            let mean = image.mean.iter().map(|p| f64::from(p[c])).sum::<f64>() / image.mean.len() as f64;
            // Of a channel the error is not told; that of the mean of all is not less than a third of it.
            assert!((mean - 1.0).abs() < 0.06, "from {from}, channel {c}: {mean}");
        }
    }
}

#[test]
fn refracting_borders_keep_all_light_too() {
    // Radiance in equilibrium is that of the sky outside, and outside is where the camera is.
    let scene =
        crate::scenes::scene(vec![ball(DVec3::ZERO, 1.0, GLASS, Some(0))], vec![grey(1.5, 1.0, 0.4)], white_sky());
    let d = render(&scene, Path, (16, 16), 64, -1, 5);
    assert_mean(&d, 1.0, 0.05, "a ball of milk glass");
}
