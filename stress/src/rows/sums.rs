//! Sums of many terms, and numbers of samples far along their sequences.

use crate::probe::Probe;
use renderer::film::{Aov, Counters, Filter, GroupFilm, Rect, SplatSums, TileSums};
use renderer::integrator::IntegratorKind;
use renderer::job::{Merger, RenderOptions, RenderSettings, UnitKind, UnitResult};
use renderer::math::Vec2;
use renderer::sampling::{IndependentSampler, Sampler, SobolSampler};
use renderer::scene::desc::{FilterDesc, RenderDefaults};
use renderer::spectrum::Rgb;

/// An exact sum of f32 numbers between 2^-60 and 2^40: in units of 2^-84.
#[derive(Clone, Copy, Default)]
struct Exact(i128);

impl Exact {
    const UNIT: i32 = -84;

    fn add(&mut self, v: f32) {
        let bits = v.to_bits();
        let (exponent, fraction) = ((bits >> 23 & 0xff) as i32, i128::from(bits & 0x7f_ffff));
        if exponent > 0 {
            self.0 += (fraction | 1 << 23) << (exponent - 150 - Self::UNIT);
        }
    }

    fn value(self) -> f64 {
        self.0 as f64 * f64::powi(2.0, Self::UNIT)
    }
}

/// A million splats of sizes over twelve decades, against exact sums.
pub fn splats(probe: &mut Probe) {
    const SIDE: u32 = 64;
    let count = probe.pick(1_000_000, 20_000_000);
    let units = 50;
    let filter = Filter::new(&FilterDesc::Box { radius: 0.5 }, SIDE, SIDE);
    let mut s = IndependentSampler::new([11]);
    let mut exact = vec![Exact::default(); (SIDE * SIDE) as usize];
    let mut group = GroupFilm::Empty;
    let mut worst_unit = 0.0f64;
    for _ in 0..units {
        let mut film = SplatSums::new(SIDE, SIDE);
        let mut own = vec![Exact::default(); exact.len()];
        for _ in 0..count / units {
            // Most fall on a few pixels.
            let raster = Vec2::new(s.next_1d() * s.next_1d(), s.next_1d() * s.next_1d()) * SIDE as f32;
            let value = 10f32.powf(12.0 * s.next_1d() - 6.0);
            film.splat(&filter, raster, Rgb::splat(value));
            let i = raster.y as usize * SIDE as usize + raster.x as usize;
            own[i].add(value);
            exact[i].add(value);
        }
        for (x, y, v) in film.pixels() {
            let truth = own[(y * SIDE + x) as usize].value();
            worst_unit = worst_unit.max(relative(v[0], truth));
        }
        film.round();
        group.add_splats(&film, 1);
    }
    let mut worst = 0.0f64;
    for (i, e) in exact.iter().enumerate() {
        worst = worst.max(relative(group.pixel(i).0[1] * f64::from(units), e.value()));
    }
    probe.holds(worst_unit <= 1e-11, || format!("sums of a unit's splats are off by {worst_unit:.1e}"));
    // Each unit's sum is rounded once, to single precision.
    probe.holds(worst <= 6e-8, || format!("merged sums are off by {worst:.1e}"));
    probe.figure(format!("{count} splats: off by {worst_unit:.1e} in a unit, {worst:.1e} merged"));
}

fn relative(a: f64, truth: f64) -> f64 {
    if truth == 0.0 { a.abs() } else { (a / truth - 1.0).abs() }
}

/// A job of very many samples, all of the same known value: what it sums must not drift.
pub fn drift(probe: &mut Probe) {
    sums_of_a_group(probe);
    a_whole_job(probe);
}

/// Samples that all count for their own pixel, once.
fn tile(rect: Rect, samples: u32, sums: Vec<Rgb>, aovs: Vec<Aov>) -> TileSums {
    TileSums { rect, covered: rect, samples, weights: vec![samples as f32; rect.area()], sums, aovs }
}

/// 1e9 samples of a pixel.
fn sums_of_a_group(probe: &mut Probe) {
    const PER_UNIT: u32 = 1000;
    let rect = Rect { x0: 0, y0: 0, x1: 1, y1: 1 };
    let mut group = GroupFilm::Empty;
    let mut exact = Exact::default();
    let mut s = IndependentSampler::new([12]);
    let units = 1_000_000;
    for _ in 0..units {
        let sum = (0.1 + 0.01 * f64::from(s.next_1d())) * f64::from(PER_UNIT);
        let sums = vec![Rgb::splat(sum as f32)];
        exact.add(sum as f32);
        group.add_tile(1, 1, &tile(rect, PER_UNIT, sums, Vec::new()), 0);
    }
    let (mean, n) = group.pixel(0);
    let truth = exact.value() / f64::from(units) / f64::from(PER_UNIT);
    probe.holds(n == 1e9, || format!("{n} samples are counted, not 1e9"));
    let off = relative(mean[0], truth);
    probe.holds(off <= 1e-11, || format!("the mean of 1e9 samples is off by {off:.1e}"));
    probe.figure(format!("1e9 samples: off by {off:.1e}"));
}

/// As many samples per pixel as a job may have, through the merger.
fn a_whole_job(probe: &mut Probe) {
    let options = RenderOptions { size: Some((1, 1)), ..RenderOptions::counting(IntegratorKind::Path, 1 << 24) };
    let Ok(mut settings) = RenderSettings::resolve(&options, &RenderDefaults::default()) else {
        probe.holds(false, || "the settings are refused".into());
        return;
    };
    settings.replicates = 1;
    let (value, depth) = (0.1f32, 5.001f32);
    let mut merger = Merger::new(settings);
    loop {
        let plan = merger.plan().clone();
        for id in 0..plan.unit_count() {
            let Some(UnitKind::Tile { rect, start, end, .. }) = plan.unit(id).map(|u| u.kind) else { return };
            let n = end - start;
            let mut aov = Aov::default();
            for _ in 0..n {
                aov.add(&Aov { albedo: [0.3; 3], normal: [0.0, 0.6, 0.8], depth, hits: 1.0 });
            }
            let sums = vec![Rgb::splat((f64::from(value) * f64::from(n)) as f32); rect.area()];
            let tile = Some(tile(rect, n, sums, vec![aov; rect.area()]));
            let result = UnitResult { tile, counters: Counters::default(), ..UnitResult::default() };
            if !probe.holds(merger.fold(id, &result).is_ok(), || format!("unit {id} is not folded")) {
                return;
            }
        }
        if merger.advance(false).is_none() {
            break;
        }
    }
    let image = merger.image();
    let samples = image.samples[0];
    probe.holds(samples == (1 << 24) as f32, || format!("{samples} samples are counted"));
    let off = relative(f64::from(image.mean[0][0]), f64::from(value));
    probe.holds(off <= 1e-7, || format!("the mean of 2^24 samples is off by {off:.1e}"));
    let a = image.aovs[0];
    for (what, found, truth) in
        [("depth", a.depth, depth), ("albedo", a.albedo[0], 0.3), ("normal", a.normal[2], 0.8), ("hits", a.hits, 1.0)]
    {
        // A unit sums 256 of them in single precision.
        let off = relative(f64::from(found), f64::from(truth));
        probe.holds(off <= 1e-5, || format!("the mean {what} of 2^24 samples is off by {off:.1e}"));
    }
}

/// Samples whose numbers are near 2^24, 2^31 and 2^32 are as well spread as the first.
pub fn sobol(probe: &mut Probe) {
    let m = probe.pick(12u32, 16);
    let n = 1u32 << m;
    for first in [0, (1 << 24) - n, 1 << 24, (1 << 31) - n, 1 << 31, u32::MAX - n + 1] {
        for replicate in [0, 63] {
            let point = |i: u32, pair: u32| {
                let mut s = SobolSampler::new(5, replicate, 1 << 40, first + i);
                (0..pair).for_each(|_| _ = s.next_1d());
                s.next_2d()
            };
            for pair in [0, 1, 40, 8 * 1024 + 3] {
                let points: Vec<Vec2> = (0..n).map(|i| point(i, pair)).collect();
                let inside = points.iter().all(|p| p.min_element() >= 0.0 && p.max_element() < 1.0);
                probe.holds(inside, || format!("a number from index {first} on is not in [0, 1)"));
                for a in [0, 1, m / 2, m - 1, m] {
                    let (columns, rows) = (1u32 << a, 1u32 << (m - a));
                    let mut seen = vec![false; n as usize];
                    let mut twice = 0;
                    for p in &points {
                        let cell = (p.x * columns as f32) as u32 * rows + (p.y * rows as f32) as u32;
                        twice += u32::from(std::mem::replace(&mut seen[cell as usize], true));
                    }
                    probe.holds(twice == 0, || {
                        format!(
                            "2^{m} points from index {first}, pair {pair}: {twice} share a cell of {columns} x {rows}"
                        )
                    });
                }
            }
        }
    }
}
