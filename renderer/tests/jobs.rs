//! Plans, bytes and merges: every sample is planned once, every result keeps its bits, and no order or interruption changes a film.

#![allow(clippy::unwrap_used, reason = "test helpers")]

use renderer::film::{Aov, Counters, SplatSums, TileSums};
use renderer::integrator::mmlt::{BootstrapSums, ChainStats, Found};
use renderer::integrator::{IntegratorKind, Lesson};
use renderer::job::{
    Merger, Part, PassPlan, Planner, RenderOptions, RenderSettings, Sampling, Unit, UnitKind, UnitResult,
};
use renderer::scene::desc::RenderDefaults;
use renderer::spectrum::Rgb;

fn settings(integrator: IntegratorKind, size: (u32, u32), spp: u32) -> RenderSettings {
    let options = RenderOptions { size: Some(size), ..RenderOptions::counting(integrator, spp) };
    RenderSettings::resolve(&options, &RenderDefaults::default()).unwrap()
}

fn splats(plan: &PassPlan, unit: &Unit) -> SplatSums {
    let mut splats = SplatSums::new(plan.width, plan.height);
    for i in 0..500u32 {
        let h = (unit.id + 1).wrapping_mul(2_654_435_761).wrapping_add(i.wrapping_mul(40_503));
        splats.add(h % plan.width, (h >> 16) % plan.height, Rgb::splat((h % 977) as f32 / 97.0));
    }
    splats.round();
    splats
}

/// A result with numbers that depend on the unit alone.
fn made_up(plan: &PassPlan, unit: &Unit) -> UnitResult {
    let value = |i: usize| ((u64::from(unit.id) * 7919 + i as u64 * 104_729) % 10_007) as f32 / 977.0;
    let counters = Counters { samples: 10 + u64::from(unit.id), rays: 20, non_finite: 0, negative: 0 };
    let mut result = UnitResult { counters, ..UnitResult::default() };
    match unit.kind {
        UnitKind::Tile { rect, covered, start, end } => {
            let sums = (0..covered.area()).map(|i| Rgb::new(value(i), value(i + 1), 1.0 / 3.0)).collect();
            let aov = |i: usize| Aov { depth: value(i), hits: 1.0, ..Aov::default() };
            let aovs = if unit.replicate == 0 { (0..rect.area()).map(aov).collect() } else { Vec::new() };
            let weights = vec![(end - start) as f32; covered.area()];
            result.tile = Some(TileSums { rect, covered, samples: end - start, sums, weights, aovs });
            if plan.sampling == Sampling::Tiles {
                let numbers = std::array::from_fn(|i| f64::from(value(i)) + 1.0 / 3.0);
                result.sharing = Lesson::of_numbers(numbers);
                assert!(result.sharing.is_some());
            }
            if plan.sampling == Sampling::SplattingTiles {
                result.splats = Some(splats(plan, unit));
                result.paths = rect.area() as u64 * u64::from(end - start);
            }
        }
        UnitKind::Paths { start, end } => {
            result.splats = Some(splats(plan, unit));
            result.paths = end - start;
            // Squares of two lights, then their rays.
            result.light_sums = vec![f64::from(value(3)), 1.0 / 7.0, 2.0, 3.0];
        }
        UnitKind::Bootstrap { start, end } => {
            let depths = &plan.chains.as_ref().unwrap().depths;
            let of_sample = |index: u32| {
                depths.iter().map(move |d| Found {
                    edges: d.edges,
                    index,
                    technique: index % (d.edges + 1),
                    weight: value(index as usize) + 0.1,
                    target: 2.0,
                })
            };
            let found = (start..end).step_by(3).flat_map(of_sample).collect();
            let techniques = depths.iter().map(|d| (0..=d.edges).map(|s| f64::from(s) / 3.0).collect()).collect();
            result.bootstrap = Some(BootstrapSums { found, techniques });
            result.splats = (plan.pass == 0).then(|| splats(plan, unit));
        }
        UnitKind::Chains { first, end, .. } => {
            result.splats = Some(splats(plan, unit));
            let small = u64::from(end - first);
            result.chains = Some(ChainStats { small, small_accepted: small / 2, large: 2, large_accepted: 1 });
        }
    }
    result
}

fn saved(merger: &Merger) -> Vec<u8> {
    let mut bytes = Vec::new();
    assert_eq!(merger.save(&mut bytes).unwrap(), bytes.len() as u64);
    bytes
}

fn run(settings: &RenderSettings, mut each: impl FnMut(&PassPlan, &Unit, UnitResult) -> UnitResult) -> Merger {
    let mut merger = Merger::new(settings.clone());
    loop {
        let plan = merger.plan().clone();
        for id in 0..plan.unit_count() {
            let unit = plan.unit(id).unwrap();
            let result = each(&plan, &unit, made_up(&plan, &unit));
            merger.fold(id, &result).unwrap();
        }
        if merger.advance(false).is_none() {
            return merger;
        }
    }
}

#[test]
fn every_sample_of_every_pixel_is_planned_exactly_once() {
    for (size, spp) in [((1, 1), 1), ((33, 17), 5), ((200, 130), 64), ((64, 64), 3000), ((500, 3), 100)] {
        let s = settings(IntegratorKind::Path, size, spp);
        let mut taken = vec![vec![0u64; s.replicates as usize]; (size.0 * size.1) as usize];
        run(&s, |_, unit, result| {
            let UnitKind::Tile { rect, start, end, .. } = unit.kind else { panic!("a path tracer's unit is a tile") };
            for (x, y) in rect.pixels() {
                let group = &mut taken[(y * size.0 + x) as usize][unit.replicate as usize];
                assert_eq!(*group, u64::from(start), "samples of a group follow each other");
                *group = u64::from(end);
            }
            result
        });
        for groups in taken {
            assert_eq!(groups.iter().sum::<u64>(), u64::from(spp));
            assert!(groups.iter().max().unwrap() - groups.iter().min().unwrap() <= 1);
        }
    }
}

#[test]
fn every_light_path_is_planned_exactly_once() {
    for (size, spp) in [((7, 5), 1), ((640, 360), 17), ((100, 100), 160)] {
        let s = settings(IntegratorKind::Light, size, spp);
        let mut upto = vec![0u64; s.replicates as usize];
        run(&s, |_, unit, result| {
            let UnitKind::Paths { start, end } = unit.kind else { panic!("a light tracer's unit is a range of paths") };
            assert_eq!(upto[unit.replicate as usize], start);
            assert!(end > start);
            upto[unit.replicate as usize] = end;
            result
        });
        assert_eq!(upto.iter().sum::<u64>(), u64::from(spp) * u64::from(size.0 * size.1));
    }
}

/// Jobs that time or error ends, here capped by a count: on a large film, a pass can't wait for a sample of every group.
#[test]
fn passes_of_open_ended_jobs_start_small_and_deal_evenly() {
    for (_, kind) in IntegratorKind::ALL.iter().copied() {
        let options = RenderOptions { time_s: Some(1e9), size: Some((640, 400)), ..RenderOptions::counting(kind, 150) };
        let s = RenderSettings::resolve(&options, &RenderDefaults::default()).unwrap();
        let (g, mut done, mut passes) = (s.replicates, 0, 0);
        let mut upto = vec![0u32; g as usize];
        let mut turns = vec![0u64; g as usize];
        let mut merger = Merger::new(s.clone());
        loop {
            let plan = merger.plan().clone();
            let limit = if done < 8 * u64::from(g) { (done / 10).max(2) } else { (done / 10).max(u64::from(g)) };
            assert!(plan.spp() <= limit, "{kind:?}: {} samples per pixel after {done}", plan.spp());
            let parts: Vec<_> =
                plan.parts.iter().filter_map(|p| if let Part::Samples(r) = p { Some(*r) } else { None }).collect();
            for range in &parts {
                assert_eq!(
                    range.start, upto[range.replicate as usize],
                    "{kind:?}: samples of a group follow each other"
                );
                assert!(range.end > range.start);
                upto[range.replicate as usize] = range.end;
                turns[range.replicate as usize] += plan.spp().div_ceil(u64::from(g));
            }
            (done, passes) = (done + plan.spp(), passes + 1);
            for id in 0..plan.unit_count() {
                merger.fold(id, &made_up(&plan, &plan.unit(id).unwrap())).unwrap();
            }
            if merger.advance(false).is_none() {
                break;
            }
        }
        // Groups that are dealt their samples by noise get whole ones.
        assert_eq!(done, if s.adapts() { 150u64.next_multiple_of(g.into()) } else { 150 }, "{kind:?}");
        assert!(passes > 20, "{kind:?}: {passes} passes");
        let (most, least) = (turns.iter().max().unwrap(), turns.iter().min().unwrap());
        assert!(most - least <= 1, "{kind:?}: {turns:?}");
        if kind != IntegratorKind::Mmlt {
            assert_eq!(u64::from(upto.iter().sum::<u32>()), done);
        }
    }
}

#[test]
fn a_light_tracer_plans_its_second_pass_from_the_first() {
    let s = settings(IntegratorKind::Light, (64, 64), 160);
    let mut merger = Merger::new(s);
    assert!(merger.plan().light_weights.is_empty());
    let plan = merger.plan().clone();
    for id in 0..plan.unit_count() {
        let result = made_up(&plan, &plan.unit(id).unwrap());
        merger.fold(id, &result).unwrap();
    }
    let second = merger.advance(false).unwrap();
    assert_eq!(second.light_weights.len(), 2);
    assert!((second.light_weights.iter().sum::<f32>() - 1.0).abs() < 1e-6);
    assert_ne!(second.digest(), plan.digest());
}

#[test]
fn bytes_give_back_the_same_result_and_the_same_bytes() {
    for (_, kind) in IntegratorKind::ALL.iter().copied() {
        let s = settings(kind, (100, 70), 40);
        let straight = run(&s, |_, _, result| result).image();
        let encoded = run(&s, |plan, unit, result| {
            let bytes = result.encode();
            let back = UnitResult::decode(&bytes, unit, plan.width, plan.height, 2).unwrap();
            assert!(back == result);
            assert_eq!(back.encode(), bytes);
            back
        });
        assert!(encoded.image().mean == straight.mean);
    }
}

#[test]
fn damaged_bytes_are_refused_or_decode_but_never_panic() {
    let s = settings(IntegratorKind::Light, (64, 40), 16);
    let plan = Planner::new(s).first();
    let unit = plan.unit(0).unwrap();
    let good = made_up(&plan, &unit).encode();
    let mut refused = 0;
    for i in 0..4000usize {
        let mut bad = good.clone();
        let at = i * 7919 % bad.len();
        if i % 3 == 0 {
            bad.truncate(at);
        } else {
            bad[at] ^= 1 << (i % 8);
        }
        refused += u32::from(UnitResult::decode(&bad, &unit, 64, 40, 2).is_err());
    }
    assert!(refused >= 1334, "every truncation is refused: {refused}");
}

#[test]
fn results_out_of_turn_or_of_another_unit_are_refused() {
    let s = settings(IntegratorKind::Path, (300, 200), 64);
    let mut merger = Merger::new(s);
    let plan = merger.plan().clone();
    let second = made_up(&plan, &plan.unit(1).unwrap());
    assert!(merger.fold(1, &second).is_err());
    assert!(merger.fold(0, &second).is_err());
    merger.fold(0, &made_up(&plan, &plan.unit(0).unwrap())).unwrap();
    assert!(merger.fold(0, &made_up(&plan, &plan.unit(0).unwrap())).is_err(), "a unit counts once");
    merger.fold(1, &second).unwrap();
}

#[test]
fn a_saved_merger_goes_on_with_the_same_bits() {
    for (_, kind) in IntegratorKind::ALL.iter().copied() {
        let s = settings(kind, (70, 50), 40);
        let whole = run(&s, |_, _, result| result);
        let mut merger = Merger::new(s);
        loop {
            let plan = merger.plan().clone();
            for id in 0..plan.unit_count() {
                if id % 5 == 0 {
                    let saved = saved(&merger);
                    assert!(Merger::load(&saved[..saved.len() - 1]).is_none());
                    merger = Merger::load(&saved).unwrap();
                    assert_eq!(merger.plan(), &plan);
                }
                merger.fold(id, &made_up(&plan, &plan.unit(id).unwrap())).unwrap();
            }
            if merger.advance(false).is_none() {
                break;
            }
        }
        assert!(merger.image() == whole.image());
        assert!(Merger::load(&saved(&merger)).unwrap().image() == whole.image());
    }
}

#[test]
fn the_standard_error_is_that_of_the_groups() {
    // Three pixels in a row, eight groups: compare with the textbook formula on the groups' own means.
    let s = settings(IntegratorKind::Path, (3, 1), 64);
    let mut sums = [[0.0f64; 3]; 8];
    let merger = run(&s, |_, unit, mut result| {
        let tile = result.tile.as_mut().unwrap();
        for (i, v) in tile.sums.iter_mut().enumerate() {
            *v = Rgb::splat((unit.replicate * 3 + i as u32) as f32 + 0.25 * unit.pass as f32);
            sums[unit.replicate as usize][i] += f64::from(v.r);
        }
        result
    });
    let image = merger.image();
    for i in 0..3 {
        let means: Vec<f64> = sums.iter().map(|s| s[i] / 8.0).collect();
        let mean = means.iter().sum::<f64>() / 8.0;
        let variance = means.iter().map(|m| (m - mean) * (m - mean)).sum::<f64>() / 7.0;
        assert!((f64::from(image.mean[i][0]) - mean).abs() < 1e-5);
        assert!((f64::from(image.std_error[i][0]) - (variance / 8.0).sqrt()).abs() < 1e-5);
    }
    let error = image.error.unwrap();
    assert!(error.relative > 0.0 && error.upper95 >= error.relative);
}
