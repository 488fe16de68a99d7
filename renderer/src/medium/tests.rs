//! Distances and weights against closed forms, directions against the exact distribution.

use super::*;
use crate::math::{Vec2, Vec3, exp64};
use crate::sampling::{IndependentSampler, Sampler};
use statcheck::{chi2_test, sidak};
use std::f64::consts::{PI, TAU};

fn medium(sigma_t: [f32; 3], albedo: [f32; 3]) -> Medium {
    Medium::new(sigma_t.into(), albedo.into(), Phase::Isotropic).unwrap()
}

/// Mean over `u` of what `f` makes of it: the integral over the primary number, by the midpoint rule.
fn mean_over_u(f: impl Fn(f32) -> Rgb) -> [f64; 3] {
    let n = 3 << 18;
    let mut sum = [0.0; 3];
    for i in 0..n {
        let v = f((i as f32 + 0.5) / n as f32);
        for (c, s) in sum.iter_mut().enumerate() {
            *s += f64::from(v[c]) / f64::from(n);
        }
    }
    sum
}

#[test]
fn weighted_flights_estimate_the_transport_equation_in_every_channel() {
    // Flights over a length: what passes carries the transmittance, what scatters the integral of sigma_s T(t) t.
    for (sigma_t, length) in
        [([0.4, 0.4, 0.4], 1.0), ([0.1, 1.0, 3.0], 1.5), ([0.0, 0.5, 2.0], 2.0), ([1e-3, 1e-3, 2.0], 3.0)]
    {
        let m = medium(sigma_t, [0.9, 0.5, 1.0]);
        for channels in [Channels::ALIKE, Channels::by_throughput(Rgb::new(0.2, 3.0, 0.7))] {
            let passed = mean_over_u(|u| {
                let passes = Reach::new(u, Some(&channels)).distance(&m) >= length;
                if passes { passing_weight(m.tau(length), &channels) } else { Rgb::ZERO }
            });
            let scattered = mean_over_u(|u| {
                let t = Reach::new(u, Some(&channels)).distance(&m);
                if t < length { m.scatter_weight(m.tau(t), &channels) * t } else { Rgb::ZERO }
            });
            for c in 0..3 {
                let (s, l) = (f64::from(m.sigma_t[c]), f64::from(length));
                let transmittance = exp64(-s * l);
                assert!((passed[c] - transmittance).abs() < 2e-5, "{sigma_t:?} {c}: {} {transmittance}", passed[c]);
                let moment = if s > 0.0 { (1.0 - transmittance * (1.0 + s * l)) / s } else { 0.0 };
                let moment = f64::from(m.albedo[c]) * moment;
                assert!((scattered[c] - moment).abs() < 5e-5, "{sigma_t:?} {c}: {} {moment}", scattered[c]);
            }
        }
    }
}

#[test]
fn grey_media_have_exact_weights_at_any_depth() {
    for sigma in [1.3e-30f32, 7e-20, 3.3e-10, 1e-6, 0.017, 0.3, 1.0, 1.7, 19.0, 1e3, 7e6, 3e9, MAX_SIGMA] {
        let m = Medium::new(Rgb::splat(sigma), Rgb::new(0.9, 0.3, 1.0), Phase::Isotropic).unwrap();
        for t in [0.0, 1e-20, 1e-3, 1.0, 1e6] {
            assert_eq!(passing_weight(m.tau(t), &Channels::ALIKE), Rgb::ONE);
            assert_eq!(m.scatter_weight(m.tau(t), &Channels::ALIKE), m.albedo, "sigma {sigma}, t {t}");
        }
    }
}

#[test]
fn chromatic_weights_survive_where_the_transmittance_underflows() {
    let m = medium([50.0, 200.0, 1e9], [1.0; 3]);
    let w = passing_weight(m.tau(3.0), &Channels::ALIKE);
    assert!((w.r - 3.0).abs() < 1e-5 && w.g == 0.0 && w.b == 0.0, "{w:?}");
    let w = m.scatter_weight(m.tau(3.0), &Channels::ALIKE);
    assert!((w.r - 3.0).abs() < 1e-5 && w.is_valid(), "{w:?}");
    assert_eq!(passing_probability(m.tau(f32::INFINITY)), 0.0);
    // A channel without extinction is not scattered, wherever the others are.
    let clear = medium([0.0, 1.0, 1.0], [1.0; 3]);
    let w = clear.scatter_weight(clear.tau(40.0), &Channels::ALIKE);
    assert!(w.r == 0.0 && w.is_valid(), "{w:?}");
    assert_eq!(clear.tau(f32::INFINITY).r, 0.0);
}

#[test]
fn reaches_are_never_zero_and_end() {
    let uneven = Channels::by_throughput(Rgb::new(0.0, 0.3, 0.1));
    for u in [0.0, f32::MIN_POSITIVE, 0.33333334, 0.5, 0.6666667, 0.75, ONE_MINUS_EPSILON] {
        for channels in [None, Some(&Channels::ALIKE), Some(&uneven), Some(&Channels::by_throughput(Rgb::ZERO))] {
            let reach = Reach::new(u, channels);
            assert!(reach.tau > 0.0 && reach.tau < 17.0 && reach.channel < 3, "{u}: {reach:?}");
            assert!(channels != Some(&uneven) || reach.channel > 0, "{u}: {reach:?}");
        }
    }
    let only_green = Channels::by_throughput(Rgb::new(0.0, 1e-30, 0.0));
    assert_eq!([0.0, 0.3, ONE_MINUS_EPSILON].map(|u| Reach::new(u, Some(&only_green)).channel), [1; 3]);
}

#[test]
fn what_is_out_of_range_is_refused() {
    let new = |t: f32, a: f32| Medium::new(Rgb::splat(t), Rgb::splat(a), Phase::Isotropic).err();
    assert_eq!(new(1.0, 1.0), None);
    for t in [-1.0, f32::NAN, f32::INFINITY, 1.1e12] {
        assert_eq!(new(t, 0.5), Some(MediumError::Extinction));
    }
    for a in [-0.1, f32::NAN, 1.1, f32::INFINITY] {
        assert_eq!(new(1.0, a), Some(MediumError::Albedo));
    }
    let g = Phase::HenyeyGreenstein { g: -1.0 };
    assert_eq!(Medium::new(Rgb::ONE, Rgb::ONE, g), Err(MediumError::Asymmetry));
    // Coefficients that add up to nothing or to all.
    let from = |a: f32, s: f32| Medium::from_coefficients(Rgb::splat(a), Rgb::splat(s), Phase::Isotropic).unwrap();
    assert!(!from(0.0, 0.0).scatters() && !from(1.0, 0.0).scatters());
    assert_eq!(from(0.0, 0.7).albedo, Rgb::ONE);
}

/// Share of light that Henyey and Greenstein's function deflects by less than the angle of `1 - cos = x`, in closed form.
fn hg_distribution(g: f64, x: f64) -> f64 {
    if g == 0.0 {
        return 0.5 * x;
    }
    let root = ((1.0 - g) * (1.0 - g) + 2.0 * g * x).sqrt();
    (1.0 + g) / (2.0 * g) * (1.0 - (1.0 - g) / root)
}

/// `1 - cos` of the deflection and the angle around it.
fn deflection(wo: Vec3, wi: Vec3) -> (f64, f64) {
    let (axis, w) = (-wo.as_dvec3().normalize(), wi.as_dvec3().normalize());
    let frame = crate::math::Frame::from_normal(-wo);
    let phi = f64::from(crate::math::atan2(w.dot(frame.t.as_dvec3()) as f32, w.dot(frame.s.as_dvec3()) as f32));
    (0.5 * (w - axis).length_squared(), phi.rem_euclid(TAU))
}

const VIEWS: [Vec3; 3] = [Vec3::Z, Vec3::new(-0.6, 0.0, -0.8), Vec3::new(0.48, -0.64, 0.6)];

#[test]
fn directions_follow_the_density() {
    const N: usize = 20_000;
    let roster = roster();
    let level = sidak(0.01, roster.len() * VIEWS.len());
    for (k, Example { name, phase }) in roster.iter().enumerate() {
        for (v, &wo) in VIEWS.iter().enumerate() {
            let mut s = IndependentSampler::new([31, k as u64, v as u64]);
            let mut counts = vec![0.0; 24 * 12];
            for _ in 0..N {
                let (wi, pdf) = phase.sample(wo, s.next_2d());
                assert!((wi.length() - 1.0).abs() < 1e-6, "{name}: {wi}");
                assert_eq!(pdf, phase.pdf(wo, wi), "{name}");
                assert!((phase.pdf(wi, wo) / pdf - 1.0).abs() < 1e-5, "{name}: not symmetric");
                let (x, phi) = deflection(wo, wi);
                let row = (hg_distribution(f64::from(phase.mean_cosine()), x) * 24.0) as usize;
                counts[row.min(23) * 12 + ((phi / TAU * 12.0) as usize).min(11)] += 1.0;
            }
            let chi2 = chi2_test(&counts, &[N as f64 / counts.len() as f64; 24 * 12]);
            assert!(chi2.p > level, "{name}, wo {wo}: {chi2:?}");
        }
    }
}

#[test]
fn densities_integrate_to_one_and_hold_in_single_precision() {
    for Example { name, phase } in roster() {
        let g = f64::from(phase.mean_cosine());
        for wo in VIEWS {
            let (rings, around) = (400, 8);
            let mut sum = 0.0;
            for i in 0..rings * around {
                let u = Vec2::new(((i / around) as f32 + 0.5) / rings as f32, (i % around) as f32 / around as f32);
                let (wi, pdf) = phase.sample(wo, u);
                let (x, _) = deflection(wo, wi);
                let d = (1.0 - g) * (1.0 - g) + 2.0 * g * x;
                let exact = (1.0 - g * g) / (4.0 * PI * d * d.sqrt());
                // Rounded to f32, the two directions' lengths differ by up to 2e-7, which adds its square to that of the distance.
                let rounding = 5e-6 + 1.5 * 4e-14 / d;
                assert!((f64::from(pdf) / exact - 1.0).abs() < rounding, "{name}, wo {wo}, wi {wi}: {pdf} {exact}");
                // In the variable in which the exact density is uniform, the integrand is the ratio of the two.
                sum += f64::from(pdf) / exact / f64::from(rings * around);
            }
            assert!((sum - 1.0).abs() < 3e-5, "{name}: {sum}");
        }
    }
}
