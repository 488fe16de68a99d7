//! Reflection of half-spaces and slabs: multiple scattering against the theory of plane layers.

use crate::common::{assert_mean, build, camera, render};
use crate::scenes::{NULL, body, desc, grey};
use renderer::integrator::IntegratorKind::Path;
use renderer::light::LightDesc;
use renderer::math::{DVec3, exp64};
use renderer::scene::Scene;
use renderer::scene::desc::ShapeKind;
use renderer::spectrum::Rgb;
use std::f64::consts::PI;

/// A block 1 thick whose upper side is at `z`, in a white sky, seen at the cosine `mu`.
fn block(sigma: f32, z: f64, mu: f64) -> Scene {
    let block = body(ShapeKind::Cube, DVec3::Z * (z - 0.5), DVec3::new(1.0, 1.0, 0.5), NULL, Some(0));
    let mut d = desc(vec![block], vec![grey(sigma, 0.9, 0.0)], vec![LightDesc::Constant { radiance: Rgb::ONE }]);
    let to = DVec3::Z * z;
    d.camera = camera(to + DVec3::new((1.0 - mu * mu).sqrt(), 0.0, mu) * 2.0, to, 1e-3);
    build(d)
}

/// Nodes and weights of Gauss and Legendre's rule on [0, 1], by Newton's method on the polynomial.
fn gauss(n: usize) -> Vec<(f64, f64)> {
    let legendre = |x: f64| {
        let (mut p, mut before) = (x, 1.0);
        for k in 2..=n {
            (p, before) = (((2 * k - 1) as f64 * x * p - (k - 1) as f64 * before) / k as f64, p);
        }
        (p, n as f64 * (x * p - before) / (x * x - 1.0))
    };
    let node = |i: usize| {
        let mut x = renderer::math::cos64(PI * (i as f64 + 0.75) / (n as f64 + 0.5));
        for _ in 0..100 {
            let (p, slope) = legendre(x);
            x -= p / slope;
        }
        let slope = legendre(x).1;
        (0.5 * (1.0 + x), 1.0 / ((1.0 - x * x) * slope * slope))
    };
    (0..n).map(node).collect()
}

/// Chandrasekhar's H function of an isotropically scattering half-space of this albedo (Chandrasekhar 1960, "Radiative Transfer",
/// chapter V, equation 14 of section 39), at `mu`, by iteration.
fn h_function(albedo: f64, mu: f64) -> f64 {
    let rule = gauss(64);
    let root = (1.0 - albedo).sqrt();
    let next = |h: &[f64], mu: f64| {
        let sum: f64 = rule.iter().zip(h).map(|((x, w), h)| w * x * h / (mu + x)).sum();
        1.0 / (root + 0.5 * albedo * sum)
    };
    let mut h = vec![1.0; rule.len()];
    for _ in 0..500 {
        h = rule.iter().map(|(x, _)| next(&h, *x)).collect();
    }
    // Its zeroth moment is known (the same chapter, section 38).
    let moment: f64 = rule.iter().zip(&h).map(|((_, w), h)| w * h).sum();
    assert!((moment - 2.0 / albedo * (1.0 - root)).abs() < 1e-9, "{moment}");
    next(&h, mu)
}

#[test]
fn thick_media_reflect_as_half_spaces() {
    // The reflectance of a half-space in a white sky, 1 - H(mu) sqrt(1 - albedo) (the same book, chapter V, and reciprocity).
    // At the origin numbers resolve any length; elsewhere, what light goes unhindered must be some hundred units in the last place.
    let cases = [(1e3f32, 0.0), (1e4, 0.0), (1e5, 0.0), (1e6, 0.0), (1e3, 1.37), (1e4, -5.3), (1e5, 1.37)];
    for (i, (sigma, z)) in cases.into_iter().enumerate() {
        for (k, mu) in [1.0, 0.4].into_iter().enumerate() {
            let image = render(&block(sigma, z, mu), Path, (32, 32), 64, -1, (10 * i + k) as u64);
            let expected = 1.0 - h_function(0.9, mu) * 0.1f64.sqrt();
            assert_mean(&image, expected, 0.04, &format!("depth {sigma} at {z}, mu {mu}"));
        }
    }
}

/// What leaves at node i per radiance that comes at node j.
type Matrix = Vec<Vec<f64>>;

fn multiply(a: &Matrix, b: &Matrix) -> Matrix {
    let n = a.len();
    let cell = |i: usize, j: usize| (0..n).map(|k| a[i][k] * b[k][j]).sum();
    (0..n).map(|i| (0..n).map(|j| cell(i, j)).collect()).collect()
}

fn add(a: &Matrix, b: &Matrix) -> Matrix {
    a.iter().zip(b).map(|(a, b)| a.iter().zip(b).map(|(a, b)| a + b).collect()).collect()
}

fn identity(n: usize) -> Matrix {
    (0..n).map(|i| (0..n).map(|j| f64::from(u8::from(i == j))).collect()).collect()
}

/// Reflection and diffuse transmission of an isotropic slab between the nodes of `rule`, by doubling a layer so thin that single
/// scattering is all (van de Hulst 1980, "Multiple Light Scattering", section 4.3).
fn doubled(rule: &[(f64, f64)], depth: f64, albedo: f64) -> (Matrix, Matrix) {
    const STEPS: u32 = 28;
    let n = rule.len();
    let mut tau = depth / f64::from(1u32 << STEPS);
    let thin = |i: usize, j: usize| 0.5 * albedo * tau * rule[j].1 / rule[i].0;
    let mut r: Matrix = (0..n).map(|i| (0..n).map(|j| thin(i, j)).collect()).collect();
    let mut t = r.clone();
    for _ in 0..STEPS {
        let mut through = t;
        (0..n).for_each(|i| through[i][i] += exp64(-tau / rule[i].0));
        // Between the two halves light goes to and fro.
        let rr = multiply(&r, &r);
        let (mut series, mut power) = (identity(n), identity(n));
        while power.iter().flatten().any(|x| x.abs() > 1e-17) {
            power = multiply(&power, &rr);
            series = add(&series, &power);
        }
        let down = multiply(&series, &through);
        r = add(&r, &multiply(&through, &multiply(&r, &down)));
        t = multiply(&through, &down);
        tau *= 2.0;
        (0..n).for_each(|i| t[i][i] -= exp64(-tau / rule[i].0));
    }
    (r, t)
}

#[test]
fn doubling_keeps_energy_and_tends_to_the_half_space() {
    let rule = gauss(24);
    let (r, t) = doubled(&rule, 2.0, 1.0);
    for (i, (mu, _)) in rule.iter().enumerate() {
        let sum = r[i].iter().chain(&t[i]).sum::<f64>() + exp64(-2.0 / mu);
        // What is scattered twice in the first layer is left out: of the order of its depth along the flattest direction.
        assert!((sum - 1.0).abs() < 1e-5, "mu {mu}: {sum}");
    }
    let (r, _) = doubled(&rule, 64.0, 0.9);
    for (i, (mu, _)) in rule.iter().enumerate() {
        let (sum, expected) = (r[i].iter().sum::<f64>(), 1.0 - h_function(0.9, *mu) * 0.1f64.sqrt());
        // The 24 nodes of the quadrature leave this much near the horizon.
        assert!((sum - expected).abs() < 1e-4, "mu {mu}: {sum} {expected}");
    }
}

#[test]
fn slabs_reflect_and_transmit_as_doubling_says() {
    let rule = gauss(24);
    for (k, (depth, albedo, share)) in
        [(0.5, 1.0, 0.05), (1.0, 0.8, 0.05), (4.0, 0.95, 0.08), (16.0, 0.99, 0.25)].into_iter().enumerate()
    {
        let (r, t) = doubled(&rule, depth, f64::from(albedo as f32));
        for (seed, (i, j)) in [(2, 5), (9, 1), (4, 14)].into_iter().enumerate() {
            let ((mu, _), (mu_sun, weight)) = (rule[i], rule[j]);
            let sun = DVec3::new(0.0, -(1.0 - mu_sun * mu_sun).sqrt(), -mu_sun);
            for (below, operator) in [(false, &r), (true, &t)] {
                let half = DVec3::new(400.0, 400.0, 0.5);
                let slab = body(ShapeKind::Cube, DVec3::ZERO, half, NULL, Some(0));
                let lights = vec![LightDesc::Directional { direction: sun, irradiance: Rgb::ONE }];
                let mut d = desc(vec![slab], vec![grey(depth as f32, albedo as f32, 0.0)], lights);
                let (z, to) = if below { (-mu, DVec3::Z * -0.5) } else { (mu, DVec3::Z * 0.5) };
                d.camera = camera(to + DVec3::new((1.0 - mu * mu).sqrt(), 0.0, z) * 2.0, to, 1e-3);
                let image = render(&build(d), Path, (32, 32), 64, -1, (10 * k + seed) as u64);
                // A beam of irradiance 1 is a radiance over the solid angle that node j stands for, 2 pi times its weight.
                let expected = operator[i][j] / (2.0 * PI * weight);
                assert_mean(&image, expected, share, &format!("depth {depth}, {mu} {mu_sun}, below: {below}"));
            }
        }
    }
}
