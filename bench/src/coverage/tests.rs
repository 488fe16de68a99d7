use super::render::telling;
use super::*;
use crate::meshes::Random;
use renderer::film::SplatSums;
use renderer::integrator::mmlt::MmltOptions;
use renderer::job::{Merger, Part, PassPlan, Stop, Unit, UnitKind, UnitResult, run_unit};
use renderer::spectrum::Rgb;
use statcheck::Estimate;
use std::path::Path;

const RENDERS: u32 = 200;
/// Side of the pictures, and of their blocks.
const SIDE: u32 = 8;
const BLOCK: u32 = 4;

fn scene(file: &str) -> Scene {
    let file = Path::new(env!("CARGO_MANIFEST_DIR")).join("..").join("scenes").join(file);
    let file = file.to_str().unwrap().to_string();
    load::scene(&scenes::chosen(&[file]).unwrap()[0].file).unwrap()
}

fn settings(scene: &Scene, options: &RenderOptions, seed: u64) -> RenderSettings {
    let options = RenderOptions { size: Some((SIDE, SIDE)), seed: Some(seed), ..options.clone() };
    RenderSettings { replicates: GROUPS, ..RenderSettings::resolve(&options, &scene.defaults).unwrap() }
}

fn renders(scene: &Scene, options: &RenderOptions, count: u32, first: u64) -> Vec<Telling> {
    many(2, count, |i| render(scene, &settings(scene, options, first + u64::from(i)), BLOCK)).unwrap()
}

fn counted(areas: Areas, renders: &[Telling], reference: &[Telling]) -> Count {
    let of = |tellings: &[Telling]| tellings.iter().map(|t| areas.of(t)).collect::<Vec<_>>();
    Count::new(&of(renders), &truth(&of(reference)), |_| true).unwrap()
}

#[test]
fn intervals_of_image_means_are_true() {
    let scene = scene("cornell-diffuse.toml");
    let counting = |kind, n| RenderOptions { max_depth: Some(4), ..RenderOptions::counting(kind, n) };
    let reference = renders(&scene, &counting(IntegratorKind::Path, 1024), 32, 1 << 32);
    for (kind, n) in [(IntegratorKind::Path, 256), (IntegratorKind::Bdpt, 64), (IntegratorKind::Mmlt, 256)] {
        let started = Instant::now();
        let renders = renders(&scene, &counting(kind, n), RENDERS, (kind as u64) << 16);
        let count = counted(Areas::Image, &renders, &reference);
        println!("{kind:?} {:.1} s: {count:?}", started.elapsed().as_secs_f64());
        assert!(count.truth_error < 0.2, "{kind:?}: the truth is not known well enough: {count:?}");
        assert!(count.holds(), "{kind:?}: {count:?}");
    }
}

/// Chains of every group start from the group's own pool, but what they find is scaled by the mean of all groups' pools.
fn with_pooled_b(plan: &PassPlan, unit: &Unit, result: &UnitResult) -> UnitResult {
    let mut wrong = result.clone();
    let (UnitKind::Chains { part, .. }, Some(splats)) = (unit.kind, &result.splats) else { return wrong };
    let Part::Chains { edges: own_edges, b: own_b, .. } = plan.parts[part as usize] else { return wrong };
    let of_length = |p: &Part| match p {
        Part::Chains { edges, b, .. } if *edges == own_edges => Some(f64::from(*b)),
        _ => None,
    };
    // A group whose pool found nothing has no part, and counts as 0.
    let pooled = plan.parts.iter().filter_map(of_length).sum::<f64>() / f64::from(GROUPS);
    let factor = (pooled / f64::from(own_b)) as f32;
    let mut scaled = SplatSums::new(plan.width, plan.height);
    splats.pixels().for_each(|(x, y, v)| {
        let v = v.map(|v| v as f32 * factor);
        scaled.add(x, y, Rgb::new(v[0], v[1], v[2]));
    });
    wrong.splats = Some(scaled);
    wrong
}

/// One job, merged right and wrong.
fn both_merges(scene: &Scene, settings: &RenderSettings) -> (Telling, Telling) {
    let (mut right, mut wrong) = (Merger::new(settings.clone()), Merger::new(settings.clone()));
    loop {
        let plan = right.plan().clone();
        assert_eq!(&plan, wrong.plan());
        for id in 0..plan.unit_count() {
            let unit = plan.unit(id).unwrap();
            let result = run_unit(scene, settings, &plan, &unit, &Stop::new()).unwrap();
            right.fold(id, &result).unwrap();
            wrong.fold(id, &with_pooled_b(&plan, &unit, &result)).unwrap();
        }
        let next = (right.advance(false).is_some(), wrong.advance(false).is_some());
        assert_eq!(next.0, next.1);
        if !next.0 {
            return (telling(&right, BLOCK), telling(&wrong, BLOCK));
        }
    }
}

/// The groups of a merge that scales all of them by one mean of their pools are no longer independent, and where a pool that found
/// more than others also leads its chains elsewhere, the picture is biased.
#[test]
fn a_pooled_b_is_found_out() {
    let scene = scene("stress/glossy-cornell.toml");
    // The chains as published, so that the merge's factor is all that b does.
    let mmlt = Some(MmltOptions { kelemen: false, lift: 0.0, direct_edges: 0, ..MmltOptions::default() });
    let options = RenderOptions { mmlt, max_depth: Some(4), ..RenderOptions::counting(IntegratorKind::Mmlt, 256) };
    let path = RenderOptions { max_depth: Some(4), ..RenderOptions::counting(IntegratorKind::Path, 512) };
    let reference = renders(&scene, &path, 32, 1 << 32);
    let started = Instant::now();
    let made = many(2, RENDERS, |i| Ok(both_merges(&scene, &settings(&scene, &options, u64::from(i))))).unwrap();
    println!("{:.1} s", started.elapsed().as_secs_f64());
    let (right, wrong): (Vec<_>, Vec<_>) = made.into_iter().unzip();
    for areas in [Areas::Image, Areas::Blocks] {
        let (right, wrong) = (counted(areas, &right, &reference), counted(areas, &wrong, &reference));
        println!("{areas:?} right {right:?}\n wrong {wrong:?}");
        assert!(right.holds(), "{areas:?}: {right:?}");
        assert!(!wrong.holds(), "{areas:?}: {wrong:?}");
    }
}

/// The blocks' errors are computed here and the image's by the product: a block as large as the image must have the image's.
#[test]
fn blocks_are_told_as_the_image_is() {
    let scene = scene("cornell-diffuse.toml");
    for (_, kind) in IntegratorKind::ALL {
        let options = RenderOptions { max_depth: Some(3), ..RenderOptions::counting(*kind, 48) };
        let told = render(&scene, &settings(&scene, &options, 1), 2 * SIDE).unwrap();
        let (block, image) = (told.blocks[0], told.image.error.unwrap());
        let close = |a: f64, b: f64| (a / b - 1.0).abs() < 1e-6;
        assert!(
            close(block.mean, image.mean) && close(block.variance.sqrt(), image.mean_se),
            "{kind:?}: {block:?} {image:?}"
        );
    }
}

/// Renders whose groups are nearly normal; all areas of a render have the same error, as if they shared all their samples.
fn made_up(error: f64, shift: f64, areas: usize) -> Vec<Vec<Estimate>> {
    let mut random = Random(7);
    let mut normal = || (0..12).map(|_| f64::from(random.next())).sum::<f64>() - 6.0;
    let mut one = || {
        let groups: Vec<f64> = (0..16).map(|_| normal()).collect();
        let mean = groups.iter().sum::<f64>() / 16.0;
        let variance = groups.iter().map(|g| (g - mean) * (g - mean)).sum::<f64>() / (15.0 * 16.0);
        Estimate { mean: mean + shift, variance: variance * error * error, dof: 15.0 }
    };
    (0..RENDERS).map(|_| vec![one(); areas]).collect()
}

#[test]
fn counts_tell_right_errors_from_wrong_ones() {
    for areas in [1, 5] {
        let zero = vec![Estimate::exact(0.0); areas];
        let holds = |error, shift| Count::new(&made_up(error, shift, areas), &zero, |_| true).unwrap().holds();
        assert!(holds(1.0, 0.0));
        // Errors that are a third too small or half too large, and a bias as large as the error.
        assert!(!holds(0.67, 0.0) && !holds(1.5, 0.0) && !holds(1.0, 0.25), "{areas}");
    }
}
