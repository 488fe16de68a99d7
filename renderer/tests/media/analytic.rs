//! Attenuation and single scattering against closed forms and quadrature.

use crate::common::{assert_mean, build, camera, emission, render};
use crate::scenes::{BLACK, GLASS, NULL, ball, body, desc, grey, scene};
use renderer::bsdf::Material;
use renderer::film::MergedImage;
use renderer::integrator::IntegratorKind::Path;
use renderer::light::LightDesc;
use renderer::math::{DVec3, exp64};
use renderer::medium::{Medium, MediumId, Phase};
use renderer::scene::Scene;
use renderer::scene::desc::ShapeKind;
use renderer::spectrum::Rgb;
use std::f64::consts::PI;

/// Angle of view at which all pixels look the same way.
const NARROW: f64 = 1e-3;

/// Density of Henyey and Greenstein's function for the cosine of the deflection.
fn hg(g: f64, cos: f64) -> f64 {
    let d = 1.0 + g * g - 2.0 * g * cos;
    (1.0 - g * g) / (4.0 * PI * d * d.sqrt())
}

/// Integral from `a` to `b` by the midpoint rule.
fn integral(a: f64, b: f64, f: impl Fn(f64) -> f64) -> f64 {
    let n = 200_000;
    let h = (b - a) / f64::from(n);
    (0..n).map(|i| f(a + (f64::from(i) + 0.5) * h)).sum::<f64>() * h
}

fn channel(image: &MergedImage, c: usize) -> f64 {
    image.mean.iter().map(|p| f64::from(p[c])).sum::<f64>() / image.mean.len() as f64
}

/// A lamp of radiance 1 behind a slab of a medium, 0.5 thick, seen straight on.
fn lamp_behind(medium: Medium, boundary: u32) -> Scene {
    let mut lamp = body(ShapeKind::Rectangle, DVec3::Z * -2.0, DVec3::ONE, BLACK, None);
    lamp.emission = emission(1.0);
    let slab = body(ShapeKind::Cube, DVec3::ZERO, DVec3::new(1.0, 1.0, 0.25), boundary, Some(0));
    let mut d = desc(vec![lamp, slab], vec![medium], vec![]);
    d.camera = camera(DVec3::Z * 5.0, DVec3::ZERO, NARROW);
    if let Material::Dielectric { eta, .. } = &mut d.materials[GLASS as usize] {
        *eta = 1.0;
    }
    build(d)
}

#[test]
fn beams_fall_off_exponentially() {
    // Beer and Lambert. What only absorbs is exact in every pixel.
    for sigma_t in [[0.0, 1.0, 3.0], [1e-6, 20.0, 1e6]] {
        let absorbing = Medium::new(sigma_t.into(), Rgb::ZERO, Phase::Isotropic).unwrap();
        for boundary in [NULL, GLASS] {
            let image = render(&lamp_behind(absorbing, boundary), Path, (4, 4), 8, -1, 1);
            for (p, c) in image.mean.iter().flat_map(|p| (0..3).map(move |c| (p[c], c))) {
                let expected = exp64(-0.5 * f64::from(sigma_t[c]));
                assert!((f64::from(p) - expected).abs() <= 1e-6 * expected + 1e-30, "channel {c}: {p} {expected}");
            }
        }
    }
    // What scatters as well, so that distances are sampled: the light that is not scattered, one edge long.
    for (i, sigma) in [1e-3f32, 0.5, 4.0, 8.0].into_iter().enumerate() {
        let image = render(&lamp_behind(grey(sigma, 0.5, 0.3), NULL), Path, (32, 32), 256, 1, i as u64);
        assert_mean(&image, exp64(-0.5 * f64::from(sigma)), 0.1, &format!("sigma {sigma}"));
    }
    let coloured = Medium::new(Rgb::new(0.2, 1.0, 4.0), Rgb::splat(0.5), Phase::Isotropic).unwrap();
    let image = render(&lamp_behind(coloured, NULL), Path, (32, 32), 256, 1, 7);
    let mean = [0.2, 1.0, 4.0].map(|s: f64| exp64(-0.5 * s)).iter().sum::<f64>() / 3.0;
    assert_mean(&image, mean, 0.02, "three channels");
}

#[test]
fn light_of_the_sun_scattered_once_is_in_closed_form() {
    // A slab 0.8 thick, lit at an angle, seen from above at another: along the view the integral of
    // sigma_s p E exp(-sigma_t s (1/cos_view + 1/cos_sun)) over the depth s, divided by cos_view.
    let sun = DVec3::new(0.3, 0.4, -1.0).normalize();
    let (target, from) = (DVec3::ZERO, DVec3::new(-1.0, 0.2, 4.0));
    let view = (target - from).normalize();
    let (mu_sun, mu_view) = (-sun.z, -view.z);
    for (i, (sigma, g)) in [(0.5f32, 0.0f32), (2.0, 0.8), (2.0, -0.5), (30.0, 0.3)].into_iter().enumerate() {
        for (k, boundary) in [NULL, GLASS].into_iter().enumerate() {
            let slab = body(ShapeKind::Cube, DVec3::Z * -0.4, DVec3::new(500.0, 500.0, 0.4), boundary, Some(0));
            let lights = vec![LightDesc::Directional { direction: sun, irradiance: Rgb::splat(3.0) }];
            let mut d = desc(vec![slab], vec![grey(sigma, 0.7, g)], lights);
            d.camera = camera(from, target, NARROW);
            if let Material::Dielectric { eta, .. } = &mut d.materials[GLASS as usize] {
                *eta = 1.0;
            }
            let image = render(&build(d), Path, (32, 32), 128, 2, (10 * i + k) as u64);
            let path = 1.0 / mu_view + 1.0 / mu_sun;
            let s = f64::from(sigma);
            // Light goes along `sun` and then against `view`.
            let p = hg(f64::from(g), sun.dot(-view));
            let expected = 3.0 * 0.7 * p / mu_view / path * (1.0 - exp64(-s * 0.8 * path));
            assert_mean(&image, expected, 0.02, &format!("sigma {sigma}, g {g}, boundary {boundary}"));
        }
    }
}

#[test]
fn light_of_a_point_scattered_once_agrees_with_quadrature() {
    // A medium that fills the scene, and one in a ball whose border is at 3 on the line of sight.
    let light = DVec3::new(0.6, 0.0, 0.0);
    let eye = DVec3::new(0.0, 0.0, 2.0);
    for (i, (sigma, g)) in [(0.4f32, 0.0f32), (1.0, 0.8), (1.0, -0.5), (3.0, 0.9)].into_iter().enumerate() {
        let lights = vec![LightDesc::Point { position: light, intensity: Rgb::splat(2.0) }];
        let (s, g64) = (f64::from(sigma), f64::from(g));
        let along = |t: f64| {
            let p = eye - DVec3::Z * t;
            let (to_light, r) = ((light - p).normalize(), p.distance(light));
            // From the light to the point, then on to the eye.
            0.9 * s * hg(g64, (-to_light).dot(DVec3::Z)) * 2.0 / (r * r) * exp64(-s * (t + r))
        };
        let mut d = desc(vec![], vec![grey(sigma, 0.9, g)], lights.clone());
        d.global_medium = Some(MediumId(0));
        d.shapes.push(ball(DVec3::new(0.0, 30.0, 0.0), 1.0, BLACK, None));
        d.camera = camera(eye, DVec3::ZERO, NARROW);
        let image = render(&build(d), Path, (32, 32), 128, 2, i as u64);
        assert_mean(
            &image,
            integral(0.0, 60.0 / s.max(1.0), along),
            0.03,
            &format!("everywhere: sigma {sigma}, g {g}"),
        );
        // From inside of the ball.
        let mut d = desc(vec![ball(DVec3::ZERO, 3.0, NULL, Some(0))], vec![grey(sigma, 0.9, g)], lights);
        d.camera = camera(eye, DVec3::ZERO, NARROW);
        let image = render(&build(d), Path, (32, 32), 128, 2, (10 + i) as u64);
        assert_mean(&image, integral(0.0, 5.0, along), 0.03, &format!("in a ball: sigma {sigma}, g {g}"));
    }
}

#[test]
fn a_coloured_medium_is_its_three_grey_channels() {
    let (sigma_t, albedo) = ([0.5f32, 2.0, 8.0], [0.9f32, 1.0, 0.6]);
    let phase = Phase::HenyeyGreenstein { g: 0.4 };
    let lights = || vec![LightDesc::Point { position: DVec3::new(0.0, 2.0, 1.0), intensity: Rgb::splat(9.0) }];
    let make = |m: Medium| scene(vec![ball(DVec3::ZERO, 0.4, NULL, Some(0))], vec![m], lights());
    let all = Medium::new(sigma_t.into(), albedo.into(), phase).unwrap();
    let coloured: Vec<MergedImage> = (0..6).map(|k| render(&make(all), Path, (24, 24), 128, -1, k)).collect();
    for c in 0..3 {
        let m = Medium::new(Rgb::splat(sigma_t[c]), Rgb::splat(albedo[c]), phase).unwrap();
        let grey = render(&make(m), Path, (24, 24), 512, -1, 9);
        let e = grey.error.unwrap();
        // The spread of independent renders tells the error of one channel.
        let means: Vec<f64> = coloured.iter().map(|i| channel(i, c)).collect();
        let mean = means.iter().sum::<f64>() / 6.0;
        let se = (means.iter().map(|m| (m - mean) * (m - mean)).sum::<f64>() / 30.0).sqrt();
        let half = statcheck::student_quantile(0.9995, 5.0) * (se * se + e.mean_se * e.mean_se).sqrt();
        assert!(half < 0.05 * e.mean, "channel {c}: {mean} +- {half} tells nothing");
        assert!((mean - e.mean).abs() < half, "channel {c}: {mean} +- {half}, should be {}", e.mean);
    }
}
