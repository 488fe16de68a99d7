//! Random numbers, low-discrepancy points, warps and tables against the distributions they claim.

#![allow(clippy::disallowed_methods, reason = "the bits of expectations need not agree between machines")]

use renderer::math::{ONE_MINUS_EPSILON, Vec2, Vec3};
use renderer::sampling::{
    Discrete, Distribution1D, Distribution2D, IndependentSampler, Sampler, SobolSampler, hash_words, mix64, warp,
};
use statcheck::{Mean, chi2_p_value, chi2_test_fixed_total, clopper_pearson, sidak, t_test};
use std::f64::consts::{PI, TAU};

/// Chance of a false alarm of each test function, all its comparisons together.
const SIGNIFICANCE: f64 = 0.01;

/// p-value of uniformity of points in the unit square, on a grid of `n` by `n` cells.
fn uniform_2d(points: impl Iterator<Item = [f64; 2]>, n: usize) -> f64 {
    let mut observed = vec![0.0; n * n];
    for p in points {
        let [x, y] = p.map(|v| {
            assert!((0.0..=1.0).contains(&v), "{p:?} is not in the unit square");
            ((v * n as f64) as usize).min(n - 1)
        });
        observed[y * n + x] += 1.0;
    }
    let total: f64 = observed.iter().sum();
    let expected = vec![total / (n * n) as f64; n * n];
    // With too few points there is nothing to test: fail.
    chi2_test_fixed_total(&observed, &expected).map_or(0.0, |test| test.p)
}

fn pair(p: Vec2) -> [f64; 2] {
    [f64::from(p.x), f64::from(p.y)]
}

fn independent(words: [u64; 2], n: usize) -> impl Iterator<Item = Vec2> {
    let mut sampler = IndependentSampler::new(words);
    std::iter::repeat_with(move || sampler.next_2d()).take(n)
}

#[test]
fn independent_numbers_are_uniform_and_independent() {
    let n = 100_000u64;
    let first = |key: u64| f64::from(IndependentSampler::new([7, key]).next_1d());
    let mut in_turn = IndependentSampler::new([1, 2]);
    let p_values = [
        // The two of a pair, two in turn, and two with another between them.
        uniform_2d(independent([1, 1], n as usize).map(pair), 50),
        uniform_2d((0..n).map(|_| [in_turn.next_1d(), in_turn.next_1d()].map(f64::from)), 50),
        uniform_2d(
            (0..n).map(|_| {
                let [a, _, b] = [in_turn.next_1d(), in_turn.next_1d(), in_turn.next_1d()];
                [f64::from(a), f64::from(b)]
            }),
            50,
        ),
        // Streams of neighbouring keys, and of keys one bit apart.
        uniform_2d((0..n).map(|k| [first(k), first(k + 1)]), 50),
        uniform_2d((0..n).map(|k| [first(k), first(k ^ (1 << 40))]), 50),
        // Words exchanged.
        uniform_2d(
            (0..n).map(|k| {
                [IndependentSampler::new([k, 3]), IndependentSampler::new([3, k])].map(|mut s| f64::from(s.next_1d()))
            }),
            50,
        ),
    ];
    let level = sidak(SIGNIFICANCE, p_values.len());
    assert!(p_values.iter().all(|p| *p > level), "{p_values:?}");
}

/// Flipping any bit of the input flips each bit of the output half of the time.
#[test]
fn hashes_avalanche() {
    let n = 4000;
    let level = sidak(SIGNIFICANCE, 2 * 64 * 64);
    for input in 0..64 {
        let mut flips = [[0u64; 64]; 2];
        for i in 0..n {
            let x = mix64(i);
            let changes =
                [mix64(x) ^ mix64(x ^ (1 << input)), hash_words(&[5, x]) ^ hash_words(&[5, x ^ (1 << input)])];
            for (counts, change) in flips.iter_mut().zip(changes) {
                counts.iter_mut().enumerate().for_each(|(bit, count)| *count += (change >> bit) & 1);
            }
        }
        for count in flips.into_iter().flatten() {
            let (low, high) = clopper_pearson(count, n, 1.0 - level);
            assert!(low < 0.5 && 0.5 < high, "input bit {input}: {count} of {n} flips");
        }
    }
}

/// Over pixels a sample of fixed index is uniform, and neighbours in pixel, replicate, seed and dimension are independent.
#[test]
fn sobol_scrambles_are_uniform_and_independent() {
    let n = 100_000u64;
    // (seed, replicate, pixel, index, calls before) of the two numbers of a point.
    let value = |seed, replicate, pixel, index, skip| {
        let mut s = SobolSampler::new(seed, replicate, pixel, index);
        for _ in 0..skip {
            s.next_2d();
        }
        s.next_2d()
    };
    let x = |p: Vec2| f64::from(p.x);
    let mut p_values = Vec::new();
    for index in [0, 1, 2, 1023, u32::MAX] {
        p_values.push(uniform_2d((0..n).map(|i| pair(value(1, 0, i, index, 0))), 40));
        let of = |i| x(value(1, 0, i, index, 0));
        p_values.push(uniform_2d((0..n).map(|i| [of(i), of(i + 1)]), 40));
        p_values.push(uniform_2d((0..n).map(|i| [of(i), x(value(1, 1, i, index, 0))]), 40));
        p_values.push(uniform_2d((0..n).map(|i| [of(i), x(value(2, 0, i, index, 0))]), 40));
        p_values.push(uniform_2d((0..n).map(|i| [of(i), x(value(1, 0, i, index, 1))]), 40));
        p_values.push(uniform_2d((0..n).map(|i| [of(i), f64::from(value(1, 0, i, index, 3).y)]), 40));
    }
    let level = sidak(SIGNIFICANCE, p_values.len());
    assert!(p_values.iter().all(|p| *p > level), "{p_values:?}");
}

/// Within a pixel, different dimension pairs fill their joint square as if they were independent. Each n samples in turn hit every
/// column and every row once, so the n by n counts are a sum of random permutation matrices: (n - 1)^2 degrees of freedom, whose
/// variances are n / (n - 1) times those of independent points.
#[test]
fn sobol_dimension_pairs_are_independent_within_a_pixel() {
    const N: usize = 16;
    let samples = 4096u32;
    let (mut statistic, mut tables) = (0.0, 0);
    for pixel in 0..50 {
        for (a, b) in [(0, 1), (1, 2), (0, 5)] {
            let mut observed = [0.0; N * N];
            for index in 0..samples {
                let mut s = SobolSampler::new(3, 0, pixel, index);
                let points: Vec<Vec2> = (0..6).map(|_| s.next_2d()).collect();
                observed[(points[b].x * N as f32) as usize * N + (points[a].x * N as f32) as usize] += 1.0;
            }
            let expected = f64::from(samples) / (N * N) as f64;
            statistic += observed.iter().map(|o| (o - expected) * (o - expected) / expected).sum::<f64>();
            tables += 1;
        }
    }
    statistic *= (N - 1) as f64 / N as f64;
    let p = chi2_p_value(statistic, f64::from(tables) * ((N - 1) * (N - 1)) as f64);
    assert!(p > 0.001 && p < 0.999, "p {p}, statistic {statistic} of {tables} tables");
}

/// A smooth function is integrated without bias and far better than by independent numbers.
#[test]
fn sobol_integrates_smooth_functions() {
    let f = |p: Vec2| (f64::from(p.x) * 2.0).exp() * (3.0 * f64::from(p.y)).sin();
    let exact = (2f64.exp() - 1.0) / 2.0 * (1.0 - 3f64.cos()) / 3.0;
    let n = 1024;
    let sobol: Mean = (0..400)
        .map(|pixel| (0..n).map(|i| f(SobolSampler::new(1, 0, pixel, i).next_2d())).sum::<f64>() / f64::from(n))
        .collect();
    let monte_carlo: Mean =
        (0..400).map(|key| independent([4, key], n as usize).map(f).sum::<f64>() / f64::from(n)).collect();
    assert!(t_test(&sobol, exact) > 0.01, "{sobol:?}, exact {exact}");
    let gain = (monte_carlo.variance() / sobol.variance()).sqrt();
    assert!(gain > 50.0, "the error is only {gain} times smaller");
}

/// Undoes each warp by its cumulative function, which gives back uniform points.
#[test]
fn warps_have_their_densities() {
    let n = 100_000;
    let phi = |w: Vec3| (f64::from(w.y).atan2(f64::from(w.x)) / TAU).rem_euclid(1.0);
    let z = |w: Vec3| f64::from(w.z);
    let tiny = 1e-13;
    let p_values = [
        uniform_2d(
            independent([10, 0], n).map(|u| {
                let p = warp::concentric_disk(u);
                [f64::from(p.length_squared()).min(1.0), phi(p.extend(0.0))]
            }),
            50,
        ),
        uniform_2d(independent([10, 1], n).map(warp::cosine_hemisphere).map(|w| [z(w) * z(w), phi(w)]), 50),
        uniform_2d(independent([10, 2], n).map(warp::uniform_hemisphere).map(|w| [z(w), phi(w)]), 50),
        uniform_2d(independent([10, 3], n).map(warp::uniform_sphere).map(|w| [0.5 + 0.5 * z(w), phi(w)]), 50),
        uniform_2d(
            independent([10, 4], n)
                .map(|u| warp::uniform_cone(u, 0.3))
                .map(|w| [(1.0 - z(w)).max(0.0) / 0.300_001, phi(w)]),
            50,
        ),
        // A cone so narrow that its cosines round to one: sin^2 = 2 (1 - cos).
        uniform_2d(
            independent([10, 5], n).map(|u| warp::uniform_cone(u, tiny as f32)).map(|w| {
                let sin2 = f64::from(w.x).powi(2) + f64::from(w.y).powi(2);
                [(sin2 / (2.000_001 * tiny)).min(1.0), phi(w)]
            }),
            50,
        ),
        // A triangle's points: the first weight has the density 2 (1 - b), the second is uniform below what is left.
        uniform_2d(
            independent([10, 6], n).map(warp::uniform_triangle).map(|b| {
                let (b, c) = (f64::from(b[0]), f64::from(b[1]));
                [1.0 - (1.0 - b) * (1.0 - b), (c / (1.0 - b)).min(1.0)]
            }),
            50,
        ),
    ];
    let level = sidak(SIGNIFICANCE, p_values.len());
    assert!(p_values.iter().all(|p| *p > level), "{p_values:?}");
    for w in independent([10, 7], 1000)
        .flat_map(|u| [warp::cosine_hemisphere(u), warp::uniform_sphere(u), warp::uniform_cone(u, 1e-9)])
    {
        assert!((w.length() - 1.0).abs() < 1e-6, "{w}");
    }
}

#[test]
fn densities_are_those_of_the_domains() {
    let close = |a: f32, b: f64| assert!((f64::from(a) / b - 1.0).abs() < 1e-6, "{a} {b}");
    close(warp::UNIFORM_DISK_PDF, 1.0 / PI);
    close(warp::UNIFORM_HEMISPHERE_PDF, 1.0 / TAU);
    close(warp::UNIFORM_SPHERE_PDF, 0.5 / TAU);
    close(warp::uniform_cone_pdf(2.0), 0.5 / TAU);
    close(warp::cosine_hemisphere_pdf(0.5), 0.5 / PI);
    assert_eq!(warp::cosine_hemisphere_pdf(-0.5), 0.0);
    // 1 - cos from the sine: exact for large angles, not cancelled for small ones.
    close(warp::one_minus_cos(1.0), 1.0);
    close(warp::one_minus_cos(0.75), 0.5);
    close(warp::one_minus_cos(1e-12), 5e-13);
}

#[test]
fn warps_are_undone_by_their_inverses() {
    for u in independent([11, 0], 10_000) {
        let disk = warp::concentric_disk_inverse(warp::concentric_disk(u));
        let triangle = warp::uniform_triangle_inverse(warp::uniform_triangle(u));
        assert!(disk.distance(u) < 1e-5 && triangle.distance(u) < 1e-6, "{u}: {disk} {triangle}");
    }
    assert_eq!(warp::concentric_disk(Vec2::splat(0.5)), Vec2::ZERO);
    assert_eq!(warp::concentric_disk_inverse(Vec2::ZERO), Vec2::splat(0.5));
}

const WEIGHTS: [f32; 9] = [0.0, 3.0, 0.5, 0.0, 0.0, 10.0, 1e-3, f32::NAN, -2.0];

#[test]
fn discrete_tables_draw_by_weight() {
    let table = Discrete::new(&WEIGHTS).expect("weights");
    assert!((table.total() - 13.501).abs() < 1e-6 && table.len() == 9);
    let sum: f32 = (0..9).map(|i| table.pmf(i)).sum();
    assert!((sum - 1.0).abs() < 1e-6);
    let n = 200_000;
    let mut observed = [0.0; 9];
    let mut rest = Vec::new();
    for u in independent([12, 0], n) {
        let c = table.sample(u.x);
        assert_eq!(c.pmf, table.pmf(c.index));
        observed[c.index] += 1.0;
        if c.index == 1 {
            rest.push([f64::from(c.u), f64::from(u.y)]);
        }
    }
    let expected: Vec<f64> = (0..9).map(|i| f64::from(table.pmf(i)) * n as f64).collect();
    let p = chi2_test_fixed_total(&observed, &expected).expect("several entries").p;
    assert!(p > 0.005, "{p}: {observed:?}");
    // What is left of the number is uniform.
    let p = uniform_2d(rest.into_iter(), 20);
    assert!(p > 0.005, "{p}");
}

#[test]
fn what_has_no_weight_is_never_drawn() {
    for weights in [vec![], vec![0.0; 5], vec![f32::NAN, -1.0, f32::INFINITY]] {
        assert_eq!(Discrete::new(&weights), None);
        assert_eq!(Distribution1D::new(&weights), None);
        assert_eq!(Distribution2D::new(weights.len(), 1, &weights), None);
    }
    assert_eq!(Distribution2D::new(3, 2, &[1.0; 5]), None);
    let table = Discrete::new(&WEIGHTS).expect("weights");
    let last = Discrete::new(&[1.0, 0.0]).expect("weights");
    let vast = Discrete::new(&[0.0, 1e-30, 1e30, 0.0]).expect("weights");
    for u in [0.0, f32::MIN_POSITIVE, 0.2, 0.222_206_5, 0.259_25, 0.999_999, ONE_MINUS_EPSILON, 1.0, 2.0, f32::NAN] {
        assert!(table.sample(u).pmf > 0.0, "{u}: {:?}", table.sample(u));
        assert_eq!(last.sample(u).index, 0);
        assert!([1, 2].contains(&vast.sample(u).index));
        let c = table.sample(u).u;
        assert!((0.0..1.0).contains(&c), "{u}: {c}");
    }
}

#[test]
fn tables_of_densities_say_the_density_of_what_they_draw() {
    let mut weights = IndependentSampler::new([13]);
    for (width, height) in [(1, 1), (7, 5), (64, 32), (1000, 3), (1 << 16, 2)] {
        let values: Vec<f32> = (0..width * height).map(|i| if i % 3 == 1 { 0.0 } else { weights.next_1d() }).collect();
        let table = Distribution2D::new(width, height, &values).expect("weights");
        let mut draws: Vec<Vec2> = independent([13, width as u64], 2000).collect();
        draws.extend([Vec2::ZERO, Vec2::splat(ONE_MINUS_EPSILON), Vec2::new(ONE_MINUS_EPSILON, 0.0)]);
        for u in draws {
            let c = table.sample(u);
            assert_eq!(c.pdf, table.pdf(c.p), "{width} x {height}: {c:?}");
            assert!(c.pdf > 0.0 && values[c.cell[1] * width + c.cell[0]] > 0.0, "{width} x {height}: {c:?}");
            let expected = f64::from(values[c.cell[1] * width + c.cell[0]]) / table.integral();
            assert!((f64::from(c.pdf) / expected - 1.0).abs() < 1e-4, "{c:?}: {expected}");
            assert!(c.p.x < 1.0 && c.p.y < 1.0 && c.p.x >= 0.0 && c.p.y >= 0.0);
        }
    }
}

#[test]
fn tables_of_densities_draw_by_weight() {
    let values = [1.0, 2.0, 0.0, 4.0, 0.0, 0.0, 0.0, 0.0, 3.0, 0.5, 8.0, 1.0];
    let table = Distribution2D::new(4, 3, &values).expect("weights");
    // Twice as fine as the cells, so that the place within a cell is tested too.
    let n = 200_000;
    let mut observed = vec![0.0; 48];
    for u in independent([14, 0], n) {
        let p = table.sample(u).p;
        observed[(p.y * 6.0) as usize * 8 + (p.x * 8.0) as usize] += 1.0;
    }
    let expected: Vec<f64> =
        (0..48).map(|i| f64::from(values[i / 16 * 4 + i % 8 / 2]) / 19.5 / 4.0 * n as f64).collect();
    let p = chi2_test_fixed_total(&observed, &expected).expect("cells").p;
    assert!(p > 0.01, "{p}");
}
