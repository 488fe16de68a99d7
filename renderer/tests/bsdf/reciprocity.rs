//! Reciprocity: light and importance see one BSDF.

use renderer::bsdf::{Bsdf, Transport, roster};
use renderer::math::Vec3;
use renderer::sampling::{IndependentSampler, Sampler, warp};
use renderer::spectrum::Rgb;

/// Largest relative difference that f32 directions explain. Refraction at indices near one magnifies their rounding.
fn close(a: Rgb, b: Rgb) -> bool {
    (0..3).all(|c| (a[c] - b[c]).abs() <= 1e-3 * a[c].max(b[c]) + 1e-7)
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
    for (e, example) in roster().iter().enumerate() {
        let narrow = example.name.contains("0.002") || example.name.contains("matched");
        let mut seen = 0;
        for (a, b) in pairs(&example.bsdf, e as u64) {
            let importance = example.bsdf.eval(a, b, Transport::Importance);
            let radiance = example.bsdf.eval(b, a, Transport::Radiance);
            seen += usize::from(!importance.is_black());
            assert!(
                close(importance, radiance) || narrow,
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
    for (e, example) in roster().iter().enumerate() {
        for (a, b) in pairs(&example.bsdf, 100 + e as u64).into_iter().filter(|(a, b)| a.z * b.z > 0.0) {
            for mode in [Transport::Radiance, Transport::Importance] {
                let (there, back) = (example.bsdf.eval(a, b, mode), example.bsdf.eval(b, a, mode));
                assert!(close(there, back), "{}: {a} -> {b}: {there:?}, back {back:?}", example.name);
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
                assert!(close(radiance.f * scale, importance.f), "{}: {radiance:?}, {importance:?}", example.name);
            }
        }
    }
}
