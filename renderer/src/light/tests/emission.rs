//! `sample_le`: power by two routes, densities, and where the light goes.

use super::{Example, irradiance_sample};
use crate::light::roster;
use crate::math::{Frame, Ray, Vec3};
use crate::sampling::{IndependentSampler, Sampler, warp};
use statcheck::{Mean, sidak};
use std::f64::consts::PI;

#[test]
fn power_by_three_routes() {
    let roster = roster();
    let significance = sidak(0.01, 2 * roster.len());
    for example in &roster {
        let (ctx, accel) = (example.ctx(), example.accel());
        let bounds = ctx.bounds;
        let power = f64::from(example.light.power(&ctx).luminance());
        let mut s = IndependentSampler::new([9]);
        // Mean throughput of the light's rays, and flux through a sphere: inward over the scene's bounds for lights outside, outward
        // over a sphere around the others.
        let infinite = example.light.flags().infinite;
        let (mut emitted, mut flux) = (Mean::default(), Mean::default());
        let (radius, side) = if infinite { (bounds.radius, 1.0) } else { (3.0 * bounds.radius, -1.0) };
        for _ in 0..40_000 {
            let (uc, u_pos, u_dir) = (s.next_1d(), s.next_2d(), s.next_2d());
            let le = example.light.sample_le(&ctx, uc, u_pos, u_dir);
            emitted.push(le.map_or(0.0, |le| f64::from(le.throughput().luminance())));
            let n = warp::uniform_sphere(s.next_2d());
            let area = 4.0 * PI * f64::from(radius) * f64::from(radius);
            flux.push(area * irradiance_sample(example, &accel, bounds.centre + n * radius, n * side, &mut s));
        }
        // A texture's mean is an estimate over 1024 well distributed points: those that err lie along the squares' borders.
        let rounding = if example.textures.is_empty() { 1e-5 } else { 5e-3 };
        assert!(emitted.p_value(power, rounding) > significance, "{}: {power} {emitted:?}", example.name);
        // Light that the emitter itself swallows never reaches the sphere.
        if !example.name.starts_with("corner")
            && example.name != "sphere, inward"
            && example.name != "sphere, two-sided"
        {
            assert!(flux.p_value(power, rounding) > significance, "{}: {power} {flux:?}", example.name);
        }
    }
}

/// `pdf_le` of what `sample_le` gave is what it said; delta parts are 1 there and 0 here.
#[test]
fn densities_of_samples() {
    for example in roster() {
        let ctx = example.ctx();
        let flags = example.light.flags();
        let mut s = IndependentSampler::new([10]);
        let mut count = 0;
        for _ in 0..2000 {
            let (uc, u_pos, u_dir) = (s.next_1d(), s.next_2d(), s.next_2d());
            let Some(le) = example.light.sample_le(&ctx, uc, u_pos, u_dir) else { continue };
            let (pdf_pos, pdf_dir) = example.light.pdf_le(&ctx, le.light.ng, le.ray.d);
            let same = |a: f32, b: f32, tolerance: f32| (a - b).abs() <= tolerance * a.max(b);
            if flags.delta_position {
                assert!(pdf_pos == 0.0 && le.pdf_pos == 1.0);
            } else {
                assert!(same(pdf_pos, le.pdf_pos, 1e-6), "{}: {pdf_pos} {}", example.name, le.pdf_pos);
            }
            if flags.delta_direction {
                assert!(pdf_dir == 0.0 && le.pdf_dir == 1.0);
            } else {
                // Near-grazing cosines and the dim rim of a spot lose digits when the direction is rounded.
                let tolerance = if le.cos > 0.01 { 1e-3 } else { 1e-1 };
                count += u32::from(!same(pdf_dir, le.pdf_dir, tolerance));
            }
            assert!((le.ray.d.length() - 1.0).abs() < 1e-5);
            assert_eq!(le.flags, flags);
        }
        assert!(count <= 4, "{}: {count}", example.name);
    }
}

/// Rays that leave the light bring to a small disk what `sample_li` finds there.
#[test]
fn rays_from_the_light_bring_the_irradiance() {
    let roster = roster();
    let significance = sidak(0.01, 2 * roster.len());
    for example in &roster {
        let (ctx, accel) = (example.ctx(), example.accel());
        let mut s = IndependentSampler::new([11]);
        // Two receivers, on different sides of the light.
        for side in 0..2u8 {
            let (centre, n, radius) = receiver(example, side);
            let frame = Frame::from_normal(n);
            let (mut arrived, mut found) = (Mean::default(), Mean::default());
            for _ in 0..40_000 {
                let (uc, u_pos, u_dir) = (s.next_1d(), s.next_2d(), s.next_2d());
                let le = example.light.sample_le(&ctx, uc, u_pos, u_dir);
                arrived.push(le.map_or(0.0, |le| {
                    let t = (centre - le.ray.o).dot(n) / le.ray.d.dot(n);
                    let q = le.ray.at(t);
                    let meets = le.ray.d.dot(n) < 0.0 && t > 0.0 && (q - centre).length() < radius;
                    let free = || !accel.occluded(&Ray::segment(le.ray.o, le.ray.d, t));
                    let area = PI * f64::from(radius) * f64::from(radius);
                    if meets && free() { f64::from(le.throughput().luminance()) / area } else { 0.0 }
                }));
                let d = warp::concentric_disk(s.next_2d()) * radius;
                found.push(irradiance_sample(example, &accel, centre + frame.s * d.x + frame.t * d.y, n, &mut s));
            }
            let p = arrived.p_value_same(&found, 1e-4);
            assert!(p > significance, "{}, side {side}: {arrived:?} {found:?}", example.name);
            let lit = side == 0 && example.name != "sphere, inward";
            assert!(!lit || arrived.mean() > 0.0, "{}: dark", example.name);
        }
    }
}

/// Centre, normal and radius of a disk inside the bounds of free lights, and close to an emitting object.
fn receiver(example: &Example, side: u8) -> (Vec3, Vec3, f32) {
    let sign = if side == 0 { 1.0 } else { -1.0 };
    if !example.is_area() {
        return (Vec3::new(0.1, -0.3 * sign, 0.2), Vec3::new(0.1, sign, 0.2).normalize(), 0.6);
    }
    let ctx = example.ctx();
    // Above the surface at one of its points.
    let on = example.a_point();
    let away = (on.ng * sign + Vec3::new(0.2, 0.1, -0.2)).normalize();
    let centre = on.p + away * (0.8 * ctx.bounds.radius);
    (centre, (on.p - centre).normalize(), 0.4 * ctx.bounds.radius)
}
