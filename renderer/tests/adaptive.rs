//! Adaptive sampling: noisy tiles get more samples, and the expectation of every pixel stays the image.

#![allow(clippy::unwrap_used, clippy::panic, reason = "test helpers")]

use renderer::film::{Counters, Filter, MergedImage, TileGrid, TileSums, TiledFilm};
use renderer::integrator::IntegratorKind;
use renderer::job::{Merger, RenderOptions, RenderSettings, Unit, UnitKind, UnitResult};
use renderer::math::Vec2;
use renderer::sampling::{IndependentSampler, Sampler};
use renderer::scene::desc::{FilterDesc, RenderDefaults};
use renderer::spectrum::Rgb;

const SIZE: (u32, u32) = (128, 64);

fn settings(seed: u64, spp: u32) -> RenderSettings {
    let options = RenderOptions {
        size: Some(SIZE),
        seed: Some(seed),
        adaptive: Some(true),
        ..RenderOptions::counting(IntegratorKind::Path, spp)
    };
    let scene = RenderDefaults { filter: Some(FilterDesc::Box { radius: 0.5 }), ..RenderDefaults::default() };
    RenderSettings::resolve(&options, &scene).unwrap()
}

/// A sample of a picture whose mean is 1 everywhere: quiet on the left, on the right noise that grows downward to rare bright paths.
fn sample(s: &mut IndependentSampler, (x, y): (u32, u32)) -> f32 {
    let u = s.next_1d();
    if x < SIZE.0 / 2 {
        return 0.99 + 0.02 * u;
    }
    let rare = if y < SIZE.1 / 2 { 0.2 } else { 0.0005 };
    if u < rare { 0.5 + 0.5 / rare } else { 0.5 }
}

/// What a renderer of that picture would give for a unit.
fn made_up(seed: u64, unit: &Unit) -> UnitResult {
    let UnitKind::Tile { rect, covered, start, end } = unit.kind else { panic!("samples of path are tiles") };
    let value = |(x, y)| {
        let of = |index| {
            let pixel = u64::from(y * SIZE.0 + x);
            sample(&mut IndependentSampler::new([seed, u64::from(unit.replicate), pixel, u64::from(index)]), (x, y))
        };
        Rgb::splat((start..end).map(of).sum())
    };
    let n = end - start;
    let tile = TileSums {
        rect,
        covered,
        samples: n,
        sums: covered.pixels().map(value).collect(),
        weights: vec![n as f32; covered.area()],
        aovs: if unit.replicate == 0 { vec![Default::default(); rect.area()] } else { Vec::new() },
    };
    let samples = rect.area() as u64 * u64::from(n);
    UnitResult {
        tile: Some(tile),
        counters: Counters { samples, rays: samples, ..Counters::default() },
        ..UnitResult::default()
    }
}

fn render(settings: &RenderSettings, mut each: impl FnMut(&mut Merger, &Unit)) -> Merger {
    let mut merger = Merger::new(settings.clone());
    loop {
        for id in 0..merger.plan().unit_count() {
            let unit = merger.plan().unit(id).unwrap();
            merger.fold(id, &made_up(settings.seed, &unit)).unwrap();
            each(&mut merger, &unit);
        }
        if merger.advance(false).is_none() {
            return merger;
        }
    }
}

#[test]
fn samples_follow_the_noise_and_add_up() {
    let s = settings(1, 256);
    let mut upto = vec![0; (SIZE.0 * SIZE.1 * s.replicates) as usize];
    let merger = render(&s, |_, unit| {
        let UnitKind::Tile { rect, start, end, .. } = unit.kind else { return };
        for (x, y) in rect.pixels() {
            let to = &mut upto[((y * SIZE.0 + x) * s.replicates + unit.replicate) as usize];
            assert_eq!(*to, start, "samples of a pixel follow each other in each group");
            *to = end;
        }
    });
    let image = merger.image();
    let of = |x: u32, y: u32| image.samples[(y * SIZE.0 + x) as usize];
    assert_eq!(of(0, 0) as u32, upto[..s.replicates as usize].iter().sum::<u32>());
    let total: f32 = image.samples.iter().sum();
    let mean = total / (SIZE.0 * SIZE.1) as f32;
    assert!((mean - 256.0).abs() < 256.0 * 0.02, "{mean} samples a pixel");
    // The standard deviations are 0.006, 1 and 22.
    assert!(
        of(5, 5) < 0.4 * mean && of(100, 5) < of(100, 60) && of(100, 60) > 1.5 * mean,
        "{:?}",
        [of(5, 5), of(100, 5), of(100, 60)]
    );
}

/// 600 renders: the mean of each kind of region within its 99.9 % interval, and errors that tell the truth.
#[test]
fn the_expectation_is_the_image_and_the_error_is_true() {
    let (renders, mut means, mut told) = (600, [Vec::new(), Vec::new(), Vec::new()], [0.0; 3]);
    let region = |i: usize| {
        let (x, y) = (i as u32 % SIZE.0, i as u32 / SIZE.0);
        if x < SIZE.0 / 2 { 0 } else { 1 + usize::from(y >= SIZE.1 / 2) }
    };
    for seed in 0..renders {
        let image = render(&settings(seed, 48), |_, _| ()).image();
        let (mut sum, mut count) = ([0.0; 3], [0.0; 3]);
        for i in 0..image.mean.len() {
            sum[region(i)] += f64::from(image.mean[i][1]);
            count[region(i)] += 1.0;
            let error = f64::from(image.std_error[i][1]);
            told[region(i)] += error * error;
        }
        (0..3).for_each(|r| means[r].push(sum[r] / count[r]));
    }
    for r in 0..3 {
        let n = renders as f64;
        let mean = means[r].iter().sum::<f64>() / n;
        let var = means[r].iter().map(|m| (m - mean) * (m - mean)).sum::<f64>() / (n - 1.0);
        let se = (var / n).sqrt();
        assert!((mean - 1.0).abs() < 3.29 * se, "region {r}: {mean} +- {se}");
        // Pixels are independent here: a region's variance is that of its pixels over their number, and so is what is told.
        let pixels = f64::from(SIZE.0 * SIZE.1) / if r == 0 { 2.0 } else { 4.0 };
        let ratio = told[r] / (n * pixels) / (var * pixels);
        assert!((ratio - 1.0).abs() < 3.29 * (2.0 / n).sqrt() * 1.2, "region {r}: told variance over true {ratio}");
    }
}

/// At the seam of tiles with many and with few samples the filter's weights are what they are elsewhere.
#[test]
fn tiles_of_different_samples_leave_no_seam() {
    let (width, height) = (64, 32);
    let filter = Filter::new(&FilterDesc::Tent { radius: 1.0 }, width, height);
    let grid = TileGrid::of_film(width, height);
    assert_eq!(grid.tiles(), 2);
    let mut random = IndependentSampler::new([5]);
    let mut seam = [Vec::new(), Vec::new()];
    for _ in 0..200 {
        let mut film = TiledFilm::new(grid, filter.reach());
        for (tile, n) in [(0, 16), (1, 256)] {
            let rect = grid.rect(tile);
            let covered = rect.grown(filter.reach(), width, height);
            let mut sums = TileSums {
                rect,
                covered,
                samples: n,
                sums: vec![Rgb::splat(0.0); covered.area()],
                weights: vec![0.0; covered.area()],
                aovs: Vec::new(),
            };
            // One row of pixels beside the seam is enough.
            let columns = if tile == 0 { 29..32 } else { 32..35 };
            for x in columns.flat_map(|x| std::iter::repeat_n(x, n as usize)) {
                for y in 14..18 {
                    let raster = Vec2::new(x as f32 + random.next_1d(), y as f32 + random.next_1d());
                    for (px, py, w) in filter.weights(raster).iter() {
                        let i = ((py - covered.y0) * covered.width() + px - covered.x0) as usize;
                        sums.sums[i] += Rgb::splat(w * raster.x);
                        sums.weights[i] += w;
                    }
                }
            }
            film.add(&sums, 0);
        }
        for (side, x) in [(0, 31), (1, 32)] {
            seam[side].push(film.pixel(16 * width as usize + x).unwrap()[0] - (x as f64 + 0.5));
        }
    }
    for errors in seam {
        let n = errors.len() as f64;
        let mean = errors.iter().sum::<f64>() / n;
        let se = (errors.iter().map(|e| (e - mean) * (e - mean)).sum::<f64>() / (n - 1.0) / n).sqrt();
        assert!(mean.abs() < 3.29 * se, "{mean} +- {se}");
        assert!(se < 0.01, "too wide to tell: {se}");
    }
}

#[test]
fn a_merge_that_was_saved_goes_on_with_the_same_bits() {
    let s = settings(3, 96);
    let mut count = 0;
    let saved = render(&s, |merger, _| {
        count += 1;
        if count % 7 == 0 {
            let mut bytes = Vec::new();
            merger.save(&mut bytes).unwrap();
            *merger = Merger::load(&bytes).unwrap();
        }
    });
    assert!(count > 70, "{count} units");
    let bits = |image: &MergedImage| image.mean.iter().flatten().map(|v| v.to_bits()).collect::<Vec<_>>();
    assert_eq!(bits(&saved.image()), bits(&render(&s, |_, _| ()).image()));
}

#[test]
fn only_path_is_adaptive() {
    let options = |kind, adaptive| RenderOptions { adaptive, ..RenderOptions::counting(kind, 64) };
    let resolve = |o: &RenderOptions| RenderSettings::resolve(o, &RenderDefaults::default());
    assert!(!resolve(&options(IntegratorKind::Path, None)).unwrap().adapts());
    assert!(resolve(&options(IntegratorKind::Path, Some(true))).unwrap().adapts());
    let target = RenderOptions { target_error: Some(0.1), ..RenderOptions::default() };
    assert!(resolve(&target).unwrap().adapts());
    assert!(!resolve(&RenderOptions { adaptive: Some(false), ..target }).unwrap().adapts());
    for kind in [IntegratorKind::Light, IntegratorKind::Bdpt, IntegratorKind::Mmlt] {
        let said = resolve(&options(kind, Some(true))).unwrap_err().to_string();
        assert!(said.contains("--adaptive is for path"), "{said}");
    }
}
