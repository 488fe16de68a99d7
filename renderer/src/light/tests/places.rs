//! Selecting lights for a place.

use super::super::place::{Cone, Gloss, LANES, LightBounds, Place, Reach};
use super::super::{LightSelector, roster};
use crate::math::{Vec3, pow, safe_acos};
use crate::sampling::{IndependentSampler, Sampler, warp};

fn direction(s: &mut IndependentSampler) -> Vec3 {
    warp::uniform_sphere(s.next_2d())
}

/// A lobe, or none.
fn glossy(s: &mut IndependentSampler) -> Option<Gloss> {
    let (n, wo) = (direction(s), direction(s));
    let wo = wo * n.dot(wo).signum();
    let alpha2 = pow(10.0, -8.0 * s.next_1d());
    (s.next_1d() < 0.7).then_some(Gloss { n, wo, diffuse: 0.01, specular: 1.0, alpha2 })
}

/// Where a light gives any, its bound is not 0.
#[test]
fn no_light_is_left_out() {
    let mut s = IndependentSampler::new([31]);
    let (mut lit, mut dark) = (0, 0);
    for example in roster() {
        let Some(bounds) = example.light.bounds(&example.ctx()) else { continue };
        let mut reach = Reach::default();
        reach.set(0, &bounds);
        let importance = |place: &Place| reach.importance(&[1.0; LANES], place)[0];
        for p in example.points() {
            for _ in 0..64 {
                let place = Place { up: direction(&mut s), lobe: glossy(&mut s), ..Place::anywhere(p) };
                let anywhere = importance(&Place::anywhere(p));
                let Some(li) = example.light.sample_li(&example.ctx(), p, s.next_1d(), s.next_2d()) else {
                    dark += u32::from(anywhere == 0.0);
                    continue;
                };
                assert!(li.radiance.is_black() || anywhere > 0.0, "{}: {p}", example.name);
                let here = importance(&place);
                assert!(
                    li.radiance.is_black() || li.wi.dot(place.up) <= 0.0 || here > 0.0,
                    "{}: {place:?}",
                    example.name
                );
                lit += u32::from(here > 0.0);
                dark += u32::from(here == 0.0);
            }
        }
    }
    assert!(lit > 1000 && dark > 100, "{lit} {dark}");
}

/// A cone around two contains the directions of both, and is no wider than it must be.
#[test]
fn cones_unite() {
    let mut s = IndependentSampler::new([32]);
    for _ in 0..2000 {
        let mut cone = || Cone { axis: direction(&mut s), angle: 2.0 * s.next_1d() };
        let (a, b) = (cone(), cone());
        let both = a.union(b);
        let apart = safe_acos(a.axis.dot(b.axis));
        let least = (0.5 * (a.angle + apart + b.angle)).max(a.angle).max(b.angle);
        assert!(both.angle >= std::f32::consts::PI - 1e-4 || (both.angle - least).abs() < 1e-3, "{a:?} {b:?} {both:?}");
        for own in [a, b] {
            let off = safe_acos(own.axis.dot(both.axis)) + own.angle;
            assert!(both.angle >= std::f32::consts::PI || off <= both.angle + 2e-3, "{own:?} {both:?}");
        }
    }
}

/// Lights of all kinds here and there, some in the same place; every seventh is infinite, every eleventh can't be chosen.
fn scattered(lights: u32) -> (Vec<f32>, Vec<Option<LightBounds>>) {
    let mut s = IndependentSampler::new([33]);
    (0..lights)
        .map(|i| {
            let weight = if i % 11 == 5 { 0.0 } else { 0.1 + s.next_1d() };
            let centre = if i % 5 == 3 { Vec3::ONE } else { direction(&mut s) * (4.0 * s.next_1d()) };
            let normals = if i % 3 == 0 { Cone::ALL } else { Cone { axis: direction(&mut s), angle: s.next_1d() } };
            let bounds = LightBounds {
                radius: 0.3 * s.next_1d(),
                normals,
                spread: 1.5,
                gain: 4.0,
                ..LightBounds::point(centre)
            };
            (weight, (i % 7 != 6).then_some(bounds))
        })
        .unzip()
}

/// Lights are selected as often as their probabilities say, and what is left of the number is uniform.
#[test]
fn frequencies_are_the_probabilities() {
    let mut s = IndependentSampler::new([34]);
    let mut places = 0;
    for lights in [2, 3, 60] {
        let (weights, bounds) = scattered(lights);
        let selector = LightSelector::placed(&weights, &bounds, 5.0);
        let learned: Vec<f32> = (0..lights).map(|i| if i == 1 { 0.5 } else { 0.5 / (lights - 1) as f32 }).collect();
        for selector in [selector.mixed(&learned), selector] {
            for distance in [0.0, 0.5, 3.0, 1e3] {
                let up = if distance == 0.5 { Vec3::ZERO } else { direction(&mut s) };
                let place = Place { up, lobe: glossy(&mut s), ..Place::anywhere(direction(&mut s) * distance) };
                let pmf: Vec<f64> = (0..lights as usize).map(|i| f64::from(selector.pmf_at(&place, i))).collect();
                let n = 50_000;
                let (mut counts, mut rest) = (vec![0.0; lights as usize], vec![0.0; 16]);
                let mut chosen = 0;
                for _ in 0..n {
                    let Some(choice) = selector.sample_at(&place, s.next_1d()) else { continue };
                    assert!((choice.pmf / selector.pmf_at(&place, choice.index) - 1.0).abs() < 1e-4, "{choice:?}");
                    counts[choice.index] += 1.0;
                    rest[(choice.u * 16.0) as usize] += 1.0;
                    chosen += 1;
                }
                // Below a node whose bound is not 0, all bounds may be.
                let sum: f64 = pmf.iter().sum();
                assert!(sum < 1.0 + 1e-5 && (chosen > 0) == (sum > 0.0), "{pmf:?}");
                if chosen == 0 {
                    continue;
                }
                let mut expected: Vec<f64> = pmf.iter().map(|p| p * f64::from(n)).collect();
                expected.push((1.0 - sum).max(0.0) * f64::from(n));
                counts.push(f64::from(n - chosen));
                let p = statcheck::chi2_test(&counts, &expected).p;
                assert!(p > 1e-4, "{lights} lights at {place:?}: {counts:?} {expected:?}");
                let p = statcheck::chi2_test(&rest, &[f64::from(chosen) / 16.0; 16]).p;
                assert!(p > 1e-4, "{rest:?}");
                places += 1;
            }
        }
    }
    assert!(places >= 16, "{places}");
}

/// Where lights would be selected in vain by power, they are selected by place.
#[test]
fn near_lights_come_first() {
    let lamp = |x: f32| Some(LightBounds::point(Vec3::new(x, 0.0, 0.0)));
    let selector = LightSelector::placed(&[1.0, 1.0, 1.0], &[lamp(0.0), lamp(100.0), None], 100.0);
    let place = |up| Place { up, ..Place::anywhere(Vec3::new(1.0, 0.0, 0.0)) };
    assert!(selector.pmf_at(&place(Vec3::ZERO), 0) > 0.99);
    assert_eq!(selector.pmf_at(&place(Vec3::X), 0), 0.0, "it is behind the surface");
    assert!(selector.pmf_at(&place(Vec3::X), 1) > 0.1 && selector.pmf_at(&place(Vec3::X), 2) > 0.1);
}
