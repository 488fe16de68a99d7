//! Chi-squared tests of the directions drawn against the integrated density.

use crate::quadrature::{COLUMNS, Drawn, Integrand, ROWS, cell, jumps};
use crate::{SIGNIFICANCE, key, views};
use rayon::prelude::*;
use renderer::bsdf::{Transport, roster};
use renderer::math::{Vec2, Vec3};
use renderer::sampling::{IndependentSampler, Sampler};
use statcheck::{Chi2, chi2_test_fixed_total, sidak};
use std::f64::consts::FRAC_PI_2;

const SAMPLES: usize = 20_000;

/// Tests directions drawn by `sample` (`None` = absorbed or a delta lobe) against the density `pdf`, which may jump at the angles `jumps`, on a grid over the sphere, with
/// one more cell for what is not drawn. `None` when nothing at all is drawn, as it should be.
pub fn test_density(
    seed: [u64; 3],
    sample: impl Fn(f32, Vec2) -> Option<Vec3>,
    pdf: impl Fn(Vec3) -> f32,
    jumps: &[f64],
) -> Option<Chi2> {
    let mut observed = vec![0.0; ROWS * COLUMNS + 1];
    let mut drawn = Vec::with_capacity(SAMPLES);
    let mut sampler = IndependentSampler::new(seed);
    for _ in 0..SAMPLES {
        let (uc, u) = (sampler.next_1d(), sampler.next_2d());
        let Some(wi) = sample(uc, u) else {
            observed[ROWS * COLUMNS] += 1.0;
            continue;
        };
        observed[cell(wi)] += 1.0;
        drawn.push(Drawn { w: wi, weight: 1.0 });
    }
    let n = SAMPLES as f64;
    let tolerance = |x: f64| 0.02 * (x * n).max(1.0).sqrt() / n;
    let mut expected = Integrand { f: &|w| f64::from(pdf(w)), jumps, tolerance: &tolerance }.cells(&drawn, SAMPLES);
    expected.iter_mut().for_each(|e| *e *= n);
    let total: f64 = expected.iter().sum();
    assert!(total < n * (1.0 + 1e-3), "the density integrates to {}", total / n);
    expected.push((n - total).max(0.0));
    // The quadrature can't tell an empty cell from one that holds a thousandth of a sample.
    expected.iter_mut().for_each(|e| *e = e.max(1e-3));
    if observed[ROWS * COLUMNS] == n && total < 1e-3 {
        return None;
    }
    let result = chi2_test_fixed_total(&observed, &expected);
    assert!(result.is_some(), "too few cells: {observed:?}");
    result
}

#[test]
fn directions_follow_the_density() {
    let roster = roster();
    let views = views();
    let level = sidak(SIGNIFICANCE, roster.len() * views.len());
    roster.par_iter().filter(|example| !example.bsdf.is_delta_only()).for_each(|example| {
        for (v, &wo) in views.iter().enumerate() {
            let mode = if v % 2 == 0 { Transport::Radiance } else { Transport::Importance };
            let sample = |uc, u| {
                let s = example.bsdf.sample(wo, uc, u, mode)?;
                assert!((s.wi.length() - 1.0).abs() < 1e-6, "{}: not a unit vector: {s:?}", example.name);
                assert!(s.pdf > 0.0 && s.f.is_valid(), "{}: {s:?}", example.name);
                assert_eq!(s.lobe.transmission, wo.z * s.wi.z < 0.0, "{}: {s:?}", example.name);
                if s.lobe.delta {
                    return None;
                }
                // What is drawn says of itself what evaluation says of it.
                assert_eq!((s.f, s.pdf), example.bsdf.eval_pdf(wo, s.wi, mode), "{}: {s:?}", example.name);
                Some(s.wi)
            };
            let result = test_density(
                [1, key(&example.name), v as u64],
                sample,
                |wi| example.bsdf.pdf(wo, wi, mode),
                &jumps(&example.bsdf, wo),
            );
            if let Some(chi2) = result {
                assert!(chi2.p > level, "{}, wo {wo}: {chi2:?}, level {level}", example.name);
            }
        }
    });
}

/// The test has power: a density that is wrong by a tenth here and there is found.
#[test]
fn a_wrong_density_is_found() {
    let example = &roster()[0];
    let wo = Vec3::new(0.6, 0.0, 0.8);
    let sample = |uc, u| example.bsdf.sample(wo, uc, u, Transport::Radiance).map(|s| s.wi);
    let right = |wi: Vec3| example.bsdf.pdf(wo, wi, Transport::Radiance);
    assert!(test_density([2, 0, 0], sample, right, &[FRAC_PI_2]).is_some_and(|t| t.p > 0.01));
    let wrong = |wi: Vec3| right(wi) * (1.0 + 0.2 * wi.x);
    assert!(test_density([2, 0, 0], sample, wrong, &[FRAC_PI_2]).is_some_and(|t| t.p < 1e-4));
}
