use super::picture::Area;
use super::render::{Effort, Limits, Rendering, Task};
use super::*;
use renderer::film::{Filter, MergedImage};
use renderer::integrator::IntegratorKind::{Light, Path};
use renderer::scene::bundle::DiskSource;
use renderer::scene::desc::FilterDesc;
use std::path::Path as FilePath;

/// More tests than any run makes, so that what is rejected here is rejected there.
const TESTS: usize = 10_000;

fn case(name: &str) -> Case {
    let mut case = scenes::all().into_iter().find(|c| c.name == name).unwrap();
    case.file = FilePath::new(env!("CARGO_MANIFEST_DIR")).join("..").join(&case.file);
    case
}

fn rendered(scene: &Scene, kind: IntegratorKind, seed: u64, spp: u32) -> Rendering {
    let limits = Limits { required: 1.0, rays: 0.0 };
    let effort = Effort { pilot_spp: 16, least_spp: spp, aim: 1.0, samples: limits, chains: limits };
    Task { scene, kind, share: false, size: (64, 48), max_depth: None, seed, threads: 2 }.run(&effort).unwrap()
}

/// The filter of scenes that name none.
fn filter(image: &MergedImage) -> Filter {
    Filter::new(&FilterDesc::Gaussian { stddev: 0.5 }, image.width, image.height)
}

fn agrees(image: &MergedImage, kind: IntegratorKind, other: &Picture<'_>) -> bool {
    let filter = filter(image);
    compare(image, &Picture::Rendered(image, (kind == Path).then_some(&filter)), other)
        .agrees(statcheck::sidak(compare::FAMILY, TESTS))
}

/// The picture with some of its pixels brighter or darker, its error as it was.
fn scaled(image: &MergedImage, area: Area, factor: f32) -> MergedImage {
    let mut wrong = image.clone();
    for (y, x) in (area.from[1]..area.to[1]).flat_map(|y| (area.from[0]..area.to[0]).map(move |x| (y, x))) {
        wrong.mean[(y * image.width + x) as usize].iter_mut().for_each(|v| *v *= factor);
    }
    wrong
}

#[test]
fn a_wrong_picture_is_told_from_a_right_one() {
    let scene = load::scene(&case("directional").file).unwrap();
    let path = rendered(&scene, Path, 1, 256).image;
    let filter = filter(&path);
    let reference = Picture::Rendered(&path, Some(&filter));
    for (kind, spp) in [(Path, 256), (Light, 1024)] {
        let own = rendered(&scene, kind, 2, spp).image;
        assert!(agrees(&own, kind, &reference), "{kind:?}");
        // A part in a hundred everywhere, three in one block of the floor.
        for factor in [0.99, 1.01] {
            assert!(!agrees(&scaled(&own, Area::whole(&own), factor), kind, &reference), "{kind:?} times {factor}");
        }
        let block = Area { from: [16, 32], to: [32, 48] };
        assert!(Area::blocks(&own).any(|b| b == block));
        for factor in [0.97, 1.03] {
            assert!(!agrees(&scaled(&own, block, factor), kind, &reference), "{kind:?}: a block times {factor}");
        }
    }
}

#[test]
fn single_pixels_are_tested_too() {
    let scene = load::scene(&case("directional").file).unwrap();
    let path = rendered(&scene, Path, 1, 256).image;
    let mut wrong = rendered(&scene, Path, 2, 256).image;
    let filter = filter(&path);
    let reference = Picture::Rendered(&path, Some(&filter));
    // A fault that every block's mean hides: each second pixel too bright by as much as the next is too dark.
    for (i, v) in wrong.mean.iter_mut().enumerate() {
        let factor = if i % 2 == 0 { 1.5 } else { 0.5 };
        v.iter_mut().for_each(|v| *v *= factor);
    }
    let comparison = compare(&wrong, &Picture::Rendered(&wrong, Some(&filter)), &reference);
    assert!(comparison.pixels < compare::PIXEL_SHARE, "{comparison:?}");
}

#[test]
fn known_radiances_are_told_from_wrong_ones() {
    let case = case("closed-sphere");
    let (scene, exact) = (load::scene(&case.file).unwrap(), case.exact.unwrap());
    assert_eq!([None, Some(1), Some(2), Some(4)].map(exact), [1.0, 0.0, 0.5, 0.875]);
    for kind in [Path, Light] {
        let image = rendered(&scene, kind, 3, 512).image;
        assert!(agrees(&image, kind, &Picture::Exact(exact(None))), "{kind:?}");
        assert!(!agrees(&image, kind, &Picture::Exact(1.01)), "{kind:?}");
    }
}

#[test]
fn every_stress_scene_is_in_the_list_loads_without_a_word_and_has_its_line() {
    let folder = FilePath::new(env!("CARGO_MANIFEST_DIR")).join("../scenes");
    let readme = std::fs::read_to_string(folder.join("README.md")).unwrap();
    let mut files: Vec<String> = std::fs::read_dir(folder.join("stress"))
        .unwrap()
        .map(|e| e.unwrap().file_name().into_string().unwrap())
        .filter(|n| n.ends_with(".toml"))
        .collect();
    files.sort();
    let mut listed: Vec<String> =
        scenes::all().into_iter().filter(|c| !c.full_only).map(|c| c.name + ".toml").collect();
    listed.sort();
    assert_eq!(files, listed);
    for file in files {
        let (source, root) = DiskSource::for_scene(&folder.join("stress").join(&file)).unwrap();
        let (scene, diagnostics) = Scene::load(&source, &root).unwrap();
        assert!(diagnostics.list.is_empty(), "{file}: {:#?}", diagnostics.list);
        assert!(scene.light_count() > 0, "{file} is dark");
        assert!(
            readme.contains(&format!("lightfarm render scenes/stress/{file}")),
            "README.md has no command for {file}"
        );
    }
}

#[test]
fn a_mean_that_is_not_known_well_enough_is_no_agreement() {
    let row = |half_width| Row {
        scene: "scene".into(),
        integrator: "path",
        against: None,
        spp: 16,
        seconds: 1.0,
        half_width,
        required: 0.003,
        dropped: 0,
        comparison: None,
        verdict: report::Verdict::Agrees,
    };
    assert!(Report::new(vec![row(0.002)]).passed);
    for half_width in [0.004, f64::NAN] {
        let report = Report::new(vec![row(0.002), row(half_width)]);
        assert!(!report.passed && report.rows[1].verdict == report::Verdict::TooWide);
        assert!(table(&report).contains("TOO WIDE"));
    }
}
