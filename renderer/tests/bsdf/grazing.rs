//! Directions and random numbers at their extremes: everything stays finite and bounded.

use crate::direction;
use renderer::bsdf::{Transport, roster};
use renderer::math::{ONE_MINUS_EPSILON, Vec2, Vec3};
use renderer::sampling::{IndependentSampler, Sampler, warp};

/// Directions whose cosine goes down to zero, on both sides.
fn grazing() -> Vec<Vec3> {
    let mut all = Vec::new();
    for cos in [0.1f32, 1e-2, 1e-3, 1e-4, 1e-5, 1e-6, 1e-7, 1e-20, f32::MIN_POSITIVE, 0.0] {
        for phi in [0.0, 0.7, 2.0, 4.0] {
            let d = direction(90.0, phi);
            all.extend([cos, -cos].map(|z| Vec3::new(d.x, d.y, z).normalize()));
        }
    }
    all.extend([Vec3::Z, -Vec3::Z]);
    all
}

#[test]
fn evaluation_is_finite() {
    let mut sampler = IndependentSampler::new([7]);
    let mut others = grazing();
    others.extend((0..50).map(|_| warp::uniform_sphere(sampler.next_2d())));
    for example in roster() {
        for &wo in &others {
            let mirrored = [Vec3::new(-wo.x, -wo.y, wo.z), -wo, wo];
            for &wi in others.iter().chain(&mirrored) {
                for mode in [Transport::Radiance, Transport::Importance] {
                    let (f, pdf) = example.bsdf.eval_pdf(wo, wi, mode);
                    assert!(
                        f.is_valid() && pdf.is_finite() && pdf >= 0.0,
                        "{}: {wo}, {wi}: {f:?}, {pdf}",
                        example.name
                    );
                }
            }
        }
    }
}

#[test]
fn weights_are_bounded() {
    let edge = [0.0, 1e-7, 0.25, 0.5, 0.75, 0.999, ONE_MINUS_EPSILON];
    for example in roster() {
        for wo in grazing() {
            for (uc, (x, y)) in edge.iter().flat_map(|&uc| edge.iter().flat_map(move |&x| edge.map(|y| (uc, (x, y))))) {
                let Some(s) = example.bsdf.sample(wo, uc, Vec2::new(x, y), Transport::Importance) else { continue };
                let weight = s.f.max_component() * s.wi.z.abs() / s.pdf;
                assert!(s.f.is_valid() && s.pdf > 0.0 && s.pdf.is_finite(), "{}: wo {wo}: {s:?}", example.name);
                assert!(s.wi.is_finite() && (s.wi.length() - 1.0).abs() < 1e-5, "{}: wo {wo}: {s:?}", example.name);
                // Facets alone have weights of at most one; a mixture's, at most one over the share of a lobe.
                assert!(weight <= 12.0, "{}: wo {wo}, u {uc} {x} {y}: weight {weight}, {s:?}", example.name);
            }
        }
    }
}
