//! `sample_li` draws directions with the density that `pdf_li` says.

use super::{Example, in_cone};
use crate::light::roster;
use crate::math::{Anchor, Frame, Vec3};
use crate::sampling::{IndependentSampler, Sampler, warp};
use statcheck::{Mean, chi2_test_with_errors, sidak};
use std::f32::consts::TAU;

/// Bins over the cone that holds the light: uniform in 1 - cos and azimuth, so all of the same solid angle.
struct Bins {
    frame: Frame,
    omc_max: f32,
}

const RINGS: usize = 12;
const SECTORS: usize = 16;

impl Bins {
    fn around(example: &Example, p: Vec3) -> Self {
        let bounds = example.ctx().bounds;
        let to = bounds.centre - p;
        let sin = 1.01 * bounds.radius / to.length();
        if !example.is_area() || sin >= 1.0 {
            return Self { frame: Frame::from_normal(Vec3::Z), omc_max: 2.0 };
        }
        Self { frame: Frame::from_normal(to.normalize()), omc_max: warp::one_minus_cos(sin * sin) }
    }

    fn index(&self, w: Vec3) -> usize {
        let local = self.frame.to_local(w);
        let omc = 0.5 * (w - self.frame.n).length_squared();
        let ring = ((omc / self.omc_max * RINGS as f32) as usize).min(RINGS - 1);
        let turn = crate::math::atan2(local.y, local.x) / TAU;
        let sector = (((turn + 1.0).fract() * SECTORS as f32) as usize).min(SECTORS - 1);
        ring * SECTORS + sector
    }

    /// Integral of the density over a bin, with its variance, by `sub` times `sub` jittered points; and whether it is 0 at some.
    fn integrate(&self, look: impl Fn(Vec3) -> f64, bin: usize, sub: usize, s: &mut IndependentSampler) -> Integral {
        let solid_angle = f64::from(self.omc_max) * std::f64::consts::TAU / (RINGS * SECTORS) as f64;
        let mut mean = Mean::default();
        let mut dark = false;
        for k in 0..sub * sub {
            let jitter = s.next_2d();
            let x = ((bin / SECTORS) as f32 + ((k / sub) as f32 + jitter.x) / sub as f32) / RINGS as f32;
            let y = ((bin % SECTORS) as f32 + ((k % sub) as f32 + jitter.y) / sub as f32) / SECTORS as f32;
            let pdf = look(in_cone(&self.frame, self.omc_max, x, y));
            mean.push(pdf);
            dark |= pdf == 0.0;
        }
        let error = mean.error() * solid_angle;
        Integral { value: mean.mean() * solid_angle, variance: error * error, dark }
    }
}

struct Integral {
    value: f64,
    variance: f64,
    dark: bool,
}

#[test]
fn densities_match_histograms_and_integrate_to_one() {
    const SAMPLES: usize = 20_000;
    let roster: Vec<Example> = roster().into_iter().filter(|e| !e.is_delta()).collect();
    let tests: usize = roster.iter().map(|e| e.points().len()).sum();
    let significance = sidak(0.01, 2 * tests);
    for (example, (i, p)) in roster.iter().flat_map(|e| e.points().into_iter().enumerate().map(move |p| (e, p))) {
        let mut s = IndependentSampler::new([3, i as u64]);
        let bins = Bins::around(example, p);
        // Draw directions; what the light itself hides does not count, as it has no density to the eye.
        let accel = example.accel();
        let mut observed = vec![0.0; RINGS * SECTORS];
        let mut seen = 0;
        for _ in 0..SAMPLES {
            let (uc, u) = (s.next_1d(), s.next_2d());
            let Some(li) = example.light.sample_li(&example.ctx(), p, uc, u) else { continue };
            assert!((li.wi.length() - 1.0).abs() < 1e-5 && li.pdf > 0.0 && li.pdf.is_finite() && !li.delta);
            if !accel.occluded(&li.shadow_ray(&Anchor::free(p))) {
                observed[bins.index(li.wi)] += 1.0;
                seen += 1;
            }
        }
        // Integrate; finely where a silhouette crosses a bin.
        let look = |w| example.look(&accel, p, w).1;
        let expected: Vec<Integral> = (0..observed.len())
            .map(|bin| {
                let coarse = bins.integrate(look, bin, 12, &mut s);
                let crossed = coarse.dark && (coarse.value > 0.0 || observed[bin] > 0.0);
                if crossed { bins.integrate(look, bin, 32, &mut s) } else { coarse }
            })
            .collect();
        // Compare.
        let n = SAMPLES as f64;
        let counts: Vec<f64> = expected.iter().map(|b| n * b.value).collect();
        let variances: Vec<f64> = expected.iter().map(|b| n * n * b.variance).collect();
        let chi2 = chi2_test_with_errors(&observed, &counts, &variances);
        assert!(chi2.p > significance, "{} from {p}: {chi2:?}", example.name);
        // Where no sample is lost the density integrates to one.
        let integral: f64 = expected.iter().map(|b| b.value).sum();
        let error = expected.iter().map(|b| b.variance).sum::<f64>().sqrt();
        let share = f64::from(seen) / n;
        let error = error + (share * (1.0 - share) / n).sqrt();
        let p_value = statcheck::normal_p_value(((integral - share).abs() - 2e-5).max(0.0) / error.max(1e-30));
        assert!(p_value > significance, "{} from {p}: integral {integral} +- {error}, seen {share}", example.name);
    }
}

/// A ray along the sampled direction meets the sampled point, with the sample's own density and radiance.
#[test]
fn samples_agree_with_rays() {
    for example in roster().iter().filter(|e| !e.is_delta()) {
        let accel = example.accel();
        let mut s = IndependentSampler::new([4]);
        let (mut compared, mut edges) = (0, 0);
        for p in example.points() {
            for _ in 0..500 {
                let (uc, u) = (s.next_1d(), s.next_2d());
                let Some(li) = example.light.sample_li(&example.ctx(), p, uc, u) else { continue };
                if accel.occluded(&li.shadow_ray(&Anchor::free(p))) {
                    continue;
                }
                let (radiance, pdf) = example.look(&accel, p, li.wi);
                let same = |a: f64, b: f32| (a - f64::from(b)).abs() <= 2e-3 * a.max(f64::from(b));
                // Rounding can turn a sample at the rim past it, or into the next texel of a texture.
                edges += u32::from(!same(pdf, li.pdf) || !same(radiance, li.radiance.luminance()));
                compared += 1;
            }
        }
        assert!(compared > 100 || example.name == "sphere, inward", "{}: {compared}", example.name);
        assert!(edges <= compared / 200, "{}: {edges} of {compared}", example.name);
    }
}
