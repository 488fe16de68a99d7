//! Reciprocity: light and importance see one BSDF.

use crate::key;
use renderer::bsdf::{Bsdf, Transport, roster};
use renderer::math::Vec3;
use renderer::sampling::{IndependentSampler, Sampler, warp};
use renderer::spectrum::Rgb;

/// Whether two values differ by no more than the rounding of f32 directions explains, relatively.
fn close(a: Rgb, b: Rgb, tolerance: f32) -> bool {
    (0..3).all(|c| (a[c] - b[c]).abs() <= tolerance * a[c].max(b[c]) + 1e-7)
}

/// That difference: narrow lobes and indices near one magnify the rounding.
fn tolerance(name: &str) -> f32 {
    if name.contains("0.002") || name.contains("matched") { 2e-2 } else { 1e-3 }
}

/// Pairs of directions, half of them drawn from the BSDF, where most of its energy is.
fn pairs(bsdf: &Bsdf, seed: u64) -> Vec<(Vec3, Vec3)> {
    let mut sampler = IndependentSampler::new([6, seed]);
    let mut pairs = Vec::new();
    for i in 0..2000 {
        let wo = warp::uniform_sphere(sampler.next_2d());
        let (uc, u) = (sampler.next_1d(), sampler.next_2d());
        let drawn = bsdf.sample(wo, uc, u, Transport::Radiance).filter(|s| !s.lobe.delta);
        match drawn {
            Some(s) if i % 2 == 0 => pairs.push((wo, s.wi)),
            _ => pairs.push((wo, warp::uniform_sphere(u))),
        }
    }
    pairs
}

#[test]
fn importance_is_the_adjoint_of_radiance() {
    for example in &roster() {
        let mut seen = 0;
        for (a, b) in pairs(&example.bsdf, key(&example.name)) {
            let importance = example.bsdf.eval(a, b, Transport::Importance);
            let radiance = example.bsdf.eval(b, a, Transport::Radiance);
            seen += usize::from(!importance.is_black());
            assert!(
                close(importance, radiance, tolerance(&example.name)),
                "{}: {a} -> {b}: importance {importance:?}, radiance back {radiance:?}",
                example.name
            );
        }
        assert!(seen > 0 || example.bsdf.is_delta_only(), "{}: only black pairs", example.name);
    }
}

/// Reflection is symmetric in both modes.
#[test]
fn reflection_is_symmetric() {
    for example in &roster() {
        for (a, b) in pairs(&example.bsdf, !key(&example.name)).into_iter().filter(|(a, b)| a.z * b.z > 0.0) {
            for mode in [Transport::Radiance, Transport::Importance] {
                let (there, back) = (example.bsdf.eval(a, b, mode), example.bsdf.eval(b, a, mode));
                assert!(
                    close(there, back, tolerance(&example.name)),
                    "{}: {a} -> {b}: {there:?}, back {back:?}",
                    example.name
                );
            }
        }
    }
}

/// Radiance that refracts is scaled by the squared ratio of indices, for delta lobes too.
#[test]
fn refraction_scales_radiance_by_the_squared_index() {
    for example in roster() {
        for wo in crate::views() {
            for uc in [0.02, 0.5, 0.98] {
                let draw = |mode| example.bsdf.sample(wo, uc, renderer::math::Vec2::new(0.3, 0.6), mode);
                let (Some(radiance), Some(importance)) = (draw(Transport::Radiance), draw(Transport::Importance))
                else {
                    continue;
                };
                let scale = if radiance.lobe.transmission { radiance.eta * radiance.eta } else { 1.0 };
                assert_eq!((radiance.wi, radiance.lobe), (importance.wi, importance.lobe), "{}", example.name);
                assert!(
                    close(radiance.f * scale, importance.f, 1e-5),
                    "{}: {radiance:?}, {importance:?}",
                    example.name
                );
            }
        }
    }
}
