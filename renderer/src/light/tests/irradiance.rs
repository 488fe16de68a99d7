//! Irradiance by `sample_li` against looking in all directions, and against closed forms near and far at all scales.

use super::examples::square;
use super::{Example, irradiance_sample, irradiance_sample_from};
use crate::geometry::{Geometry, MeshId, Object, ObjectId, Shape};
use crate::light::{Emission, Light, roster};
use crate::math::rounding::gamma;
use crate::math::{Anchor, DAffine3, DVec3, Frame, Transform, Vec3};
use crate::sampling::{IndependentSampler, Sampler, warp};
use crate::spectrum::Rgb;
use crate::texture::RgbParam;
use statcheck::{Mean, sidak};
use std::f64::consts::PI;

#[test]
fn sampling_the_light_equals_looking_everywhere() {
    let roster: Vec<Example> = roster().into_iter().filter(|e| !e.is_delta()).collect();
    let tests: usize = roster.iter().map(|e| e.points().len()).sum();
    for example in &roster {
        let accel = example.accel();
        // Looking everywhere finds hardly anything from far away.
        let bounds = example.ctx().bounds;
        let near = |p: &Vec3| (*p - bounds.centre).length() < 5.0 * bounds.radius;
        for (i, p) in example.points().into_iter().filter(near).enumerate() {
            let mut s = IndependentSampler::new([5, i as u64]);
            let to = (example.ctx().bounds.centre - p).normalize();
            let n = (to + 0.4 * warp::uniform_sphere(s.next_2d())).normalize();
            let frame = Frame::from_normal(n);
            let (mut by_light, mut by_looking) = (Mean::default(), Mean::default());
            for _ in 0..20_000 {
                by_light.push(irradiance_sample(example, &accel, p, n, &mut s));
                let w = frame.to_world(warp::cosine_hemisphere(s.next_2d()));
                by_looking.push(PI * example.look(&accel, p, w).0);
            }
            let p_value = by_light.p_value_same(&by_looking, 1e-5);
            assert!(p_value > sidak(0.01, tests), "{} from {p}: {by_light:?} {by_looking:?}", example.name);
        }
    }
}

/// An emitter of radiance 1 (two-sided), placed by `m`.
fn emitter(name: &'static str, shape: Shape, m: DAffine3) -> Example {
    let objects = vec![Object { shape, to_world: Transform::new(m).unwrap(), flip_normals: false }];
    let geometry = Geometry::new(vec![square()], objects);
    let emission = Emission { radiance: RgbParam::Const(Rgb::ONE), two_sided: true };
    let light = Light::area(&geometry, ObjectId(0), &emission).unwrap();
    Example::new(name, geometry, Vec::new(), light)
}

/// Irradiance at the origin, normal +z, from the polygon of radiance 1 (Lambert 1760).
fn polygon(corners: &[DVec3]) -> f64 {
    let edge = |a: DVec3, b: DVec3| {
        let (a, b) = (a.normalize(), b.normalize());
        let cross = a.cross(b);
        libm::atan2(cross.length(), a.dot(b)) * cross.normalize().z
    };
    let sum: f64 = (0..corners.len()).map(|i| edge(corners[i], corners[(i + 1) % corners.len()])).sum();
    0.5 * sum.abs()
}

/// Emitters whose distance over size and whose size span many orders of magnitude.
#[test]
fn closed_forms_at_all_scales() {
    let gaps = [1e-3f64, 0.1, 1.0, 30.0, 1e3, 1e6];
    let scales = [1e-3f64, 1.0, 1e6];
    let significance = sidak(0.01, 3 * gaps.len() * scales.len());
    for (i, (&gap, &scale)) in gaps.iter().flat_map(|g| scales.iter().map(move |s| (g, s))).enumerate() {
        let check = |name, shape, m: DAffine3, truth: f64| {
            let example = emitter(name, shape, DAffine3::from_scale(DVec3::splat(scale)) * m);
            let accel = example.accel();
            let mut s = IndependentSampler::new([6, i as u64]);
            let mut mean = Mean::default();
            for _ in 0..20_000 {
                mean.push(irradiance_sample(&example, &accel, Vec3::ZERO, Vec3::Z, &mut s));
            }
            let p_value = mean.p_value(truth, 1e-5);
            assert!(p_value > significance, "{name}, gap {gap}, scale {scale}: {truth} {mean:?}");
            // The estimate must be worth something.
            assert!(mean.error() < 0.1 * truth, "{name}, gap {gap}, scale {scale}: {truth} {mean:?}");
        };
        // A sphere of radius 1, straight above: pi / d^2.
        let d = 1.0 + gap;
        check("sphere", Shape::Sphere, DAffine3::from_translation(DVec3::Z * d), PI / (d * d));
        if gap < 0.1 {
            // Sampling by area is no use so near: the density grows with the square of the distance.
            continue;
        }
        // A disk of radius 1, straight above: pi / (1 + d^2).
        check("disk", Shape::Disk, DAffine3::from_translation(DVec3::Z * gap), PI / (1.0 + gap * gap));
        // A square to the side, tilted.
        let tilted = DAffine3::from_rotation_y(0.5);
        let m = DAffine3::from_translation(DVec3::new(0.3, 0.2, 1.5) * gap.max(1.0)) * tilted;
        let corners = square().positions.iter().map(|p| m.transform_point3(p.as_dvec3())).collect::<Vec<_>>();
        check("square", Shape::Mesh(MeshId(0)), m, polygon(&corners));
    }
}

/// Inside a sphere of radiance 1, and on its inner side, the irradiance is pi, wherever.
#[test]
fn inside_a_sphere() {
    let example = emitter("inside", Shape::Sphere, DAffine3::from_scale(DVec3::splat(3.0)));
    let accel = example.accel();
    let mut s = IndependentSampler::new([7]);
    let mut points = vec![(Vec3::ZERO, Vec3::Y), (Vec3::X, Vec3::Y), (Vec3::X * 2.9, Vec3::Z)];
    // Points of the sphere as rounded as hits are: some lie outside.
    points.extend((0..20).map(|_| warp::uniform_sphere(s.next_2d())).map(|n| (n * 3.0, -n)));
    let significance = sidak(0.01, points.len());
    for (p, n) in points {
        let from = Anchor { p, p_error: p.abs() * gamma(4), ng: n };
        let mut mean = Mean::default();
        for _ in 0..5000 {
            mean.push(irradiance_sample_from(&example, &accel, &from, n, &mut s));
        }
        assert!(mean.p_value(PI, 1e-5) > significance, "{p}: {mean:?}");
    }
}

/// Constant light: irradiance is pi times the radiance.
#[test]
fn uniform_sky() {
    let light = Light::from_desc(&crate::light::LightDesc::Constant { radiance: Rgb::splat(2.0) }).unwrap().unwrap();
    let example = Example::free("constant", light);
    let accel = example.accel();
    let mut s = IndependentSampler::new([8]);
    let mut mean = Mean::default();
    for _ in 0..20_000 {
        mean.push(irradiance_sample(&example, &accel, Vec3::ONE, Vec3::X, &mut s));
    }
    assert!(mean.p_value(2.0 * PI, 1e-5) > 0.001, "{mean:?}");
}
