//! Energy: what a surface scatters of one unit of light, by sampling and by quadrature.

use crate::quadrature::{Drawn, Integrand, jumps};
use crate::{SIGNIFICANCE, key, views};
use rayon::prelude::*;
use renderer::bsdf::{Bsdf, Transport, roster};
use renderer::math::Vec3;
use renderer::sampling::{IndependentSampler, Sampler};
use statcheck::{Mean, sidak, student_quantile, t_test};

const SAMPLES: usize = 10_000;

/// Sampled albedo seen from `wo` (largest channel), of all lobes and of those that are not delta; the mode in which energy is
/// conserved is that of light that leaves along `wi`.
struct Albedo {
    all: Mean,
    smooth: Mean,
    drawn: Vec<Drawn>,
}

fn sampled_albedo(bsdf: &Bsdf, wo: Vec3, seed: [u64; 3]) -> Albedo {
    let mut sampler = IndependentSampler::new(seed);
    let mut albedo = Albedo { all: Mean::default(), smooth: Mean::default(), drawn: Vec::new() };
    for _ in 0..SAMPLES {
        let (uc, u) = (sampler.next_1d(), sampler.next_2d());
        let sample = bsdf.sample(wo, uc, u, Transport::Importance);
        let weight = sample.map_or(0.0, |s| f64::from(s.f.max_component() * s.wi.z.abs() / s.pdf));
        albedo.all.push(weight);
        albedo.smooth.push(sample.filter(|s| !s.lobe.delta).map_or(0.0, |_| weight));
        if let Some(s) = sample.filter(|s| !s.lobe.delta) {
            albedo.drawn.push(Drawn { w: s.wi, weight });
        }
    }
    albedo
}

#[test]
fn no_energy_is_created_and_sampling_agrees_with_quadrature() {
    let roster = roster();
    let views = views();
    let tests = roster.len() * views.len();
    let level = sidak(SIGNIFICANCE, 2 * tests);
    roster.par_iter().for_each(|example| {
        for (v, &wo) in views.iter().enumerate() {
            let albedo = sampled_albedo(&example.bsdf, wo, [3, key(&example.name), v as u64]);
            let name = format!("{}, wo {wo}", example.name);
            // Energy: the lower confidence bound is not above one.
            let margin = student_quantile(1.0 - level, (SAMPLES - 1) as f64) * albedo.all.error();
            assert!(albedo.all.mean() - margin <= 1.0 + 1e-5, "{name}: albedo {} +- {margin}", albedo.all.mean());
            // The same by quadrature.
            let f = |wi: Vec3| {
                f64::from(example.bsdf.eval(wo, wi, Transport::Importance).max_component()) * f64::from(wi.z.abs())
            };
            let tolerance = |x: f64| 1e-6 + 1e-4 * x;
            let integral: f64 = Integrand { f: &f, jumps: &jumps(&example.bsdf, wo), tolerance: &tolerance }
                .cells(&albedo.drawn, SAMPLES)
                .iter()
                .sum();
            assert!(integral <= 1.0 + 1e-3, "{name}: albedo by quadrature {integral}");
            let agree = (albedo.smooth.mean() - integral).abs() < 1e-3 || t_test(&albedo.smooth, integral) > level;
            assert!(agree, "{name}: sampled {:?}, by quadrature {integral}", albedo.smooth);
        }
    });
}

/// What loses nothing gives back everything.
#[test]
fn lossless_surfaces_reflect_all() {
    let lossless = [
        "Lambert, white",
        "Conductor, ideal mirror",
        "Dielectric, smooth glass",
        "Dielectric, smooth, matched",
        "Gltf, smooth thin",
        "Gltf, smooth white plastic",
    ];
    let roster = roster();
    for name in lossless {
        let example = roster.iter().find(|e| e.name == name).unwrap_or_else(|| panic!("no {name} in the roster"));
        for wo in views().into_iter().filter(|wo| wo.z > 0.0 || example.bsdf.transmits()) {
            let albedo = sampled_albedo(&example.bsdf, wo, [4, 0, 0]).all;
            let tolerance = 1e-5 + 4.0 * albedo.error();
            assert!((albedo.mean() - 1.0).abs() < tolerance, "{name}, wo {wo}: {albedo:?}");
        }
    }
}

/// As roughness goes to zero, the albedo goes to that of the smooth surface.
#[test]
fn rough_becomes_smooth() {
    let roster = roster();
    let find = |name: &str| roster.iter().find(|e| e.name == name).unwrap_or_else(|| panic!("no {name} in the roster"));
    for (rough, smooth) in
        [("Conductor, ggx 0.002", "Conductor, smooth gold"), ("Dielectric, ggx 0.002", "Dielectric, smooth glass")]
    {
        for wo in views().into_iter().filter(|wo| wo.z.abs() > 0.05) {
            let a = sampled_albedo(&find(rough).bsdf, wo, [5, 0, 0]).all;
            let b = sampled_albedo(&find(smooth).bsdf, wo, [5, 0, 1]).all;
            assert!((a.mean() - b.mean()).abs() < 5e-3, "{rough}, wo {wo}: {} against {}", a.mean(), b.mean());
        }
    }
}
