//! `lightfarm diff` and `info`: their figures against plain computations, and their exit statuses.

mod common;

use common::Lab;

/// Two renders of the same scene with different seeds.
fn lab() -> Lab {
    let lab = Lab::new();
    for seed in ["1", "2"] {
        lab.run(&["render", "scene.xml", "--spp", "8", "--seed", seed, "-o", &format!("{seed}.exr")]).status(0);
    }
    lab
}

#[test]
fn measures_agree_with_a_plain_computation() {
    let lab = lab();
    let run = lab.run(&["diff", "1.exr", "2.exr", "--json"]);
    run.status(0);
    let got = run.json();
    let [a, b] = ["1.exr", "2.exr"].map(|f| lab.picture(f).triple(["R", "G", "B"]).unwrap());
    let values = || a.iter().flatten().zip(b.iter().flatten()).map(|(a, b)| (f64::from(*a), f64::from(*b)));
    let n = values().count() as f64;
    let rmse = (values().map(|(a, b)| (a - b) * (a - b)).sum::<f64>() / n).sqrt();
    let relmse = values().map(|(a, b)| (a - b) * (a - b) / (b * b + 0.01)).sum::<f64>() / n;
    let mape = values().map(|(a, b)| (a - b).abs() / (b.abs() + 0.01)).sum::<f64>() / n;
    let ratio = values().map(|v| v.0).sum::<f64>() / values().map(|v| v.1).sum::<f64>();
    for (name, want) in [("rmse", rmse), ("relmse", relmse), ("mape", mape), ("mean_ratio_all", ratio)] {
        let value = got[name].as_f64().unwrap();
        assert!((value / want - 1.0).abs() < 1e-6, "{name}: {value} for {want}");
    }
    assert!(got["relmse_trimmed"].as_f64().unwrap() < relmse);
    assert!(got["flip"].as_f64().unwrap() > 0.0 && got["hdr_flip"].as_f64().unwrap() > 0.0);
    assert_eq!(got["agreement"]["agree"], true);
}

#[test]
fn limits_set_the_exit_status() {
    let lab = lab();
    lab.run(&["diff", "1.exr", "2.exr", "--max-relmse", "10"]).status(0);
    assert!(lab.run(&["diff", "1.exr", "2.exr", "--max-relmse", "1e-9"]).status(1).contains("--max-relmse"));
    lab.run(&["diff", "1.exr", "2.exr", "--require-agreement"]).status(0);
    // Half the light is another picture.
    let scene = std::fs::read_to_string(lab.path("scene.xml")).unwrap();
    lab.write("dark.xml", &scene.replace("9, 8, 7", "4.5, 4, 3.5"));
    lab.run(&["render", "dark.xml", "--spp", "8"]).status(0);
    lab.run(&["diff", "dark.exr", "1.exr", "--require-agreement"]).status(1);
    lab.run(&["diff", "missing.exr", "1.exr"]).status(1);
    lab.run(&["diff", "scene.xml", "1.exr"]).status(1);
    lab.run(&["render", "scene.xml", "--spp", "1", "--size", "16x16", "-o", "small.exr"]).status(0);
    assert!(lab.run(&["diff", "small.exr", "1.exr"]).status(1).contains("16 x 16"));
    assert!(lab.run(&["diff", "small.exr", "small.exr", "--require-agreement"]).status(1).contains("error"));
}

#[test]
fn bits_are_compared_one_by_one() {
    let lab = lab();
    lab.run(&["diff", "1.exr", "1.exr", "--bit-exact"]).status(0);
    let run = lab.run(&["diff", "1.exr", "2.exr", "--bit-exact", "--json"]);
    assert!(run.status(1).contains("values differ"));
    lab.run(&["diff", "1.exr", "2.exr", "--bit-exact", "--max-relmse", "1"]).status(2);
}

#[test]
fn a_map_of_the_error_is_written() {
    let lab = lab();
    lab.run(&["diff", "1.exr", "2.exr", "--save-map", "map.png"]).status(0);
    assert!(std::fs::read(lab.path("map.png")).unwrap().starts_with(b"\x89PNG"));
    lab.run(&["diff", "1.exr", "2.exr", "--save-map", "no/folder/map.png"]).status(3);
}

#[test]
fn info_counts_what_a_scene_contains() {
    let lab = Lab::new();
    let run = lab.run(&["info", "scene.xml", "--json"]);
    run.status(0);
    let info = run.json();
    assert_eq!((&info["features"]["objects"], &info["lights"]["Area"]), (&3.into(), &1.into()));
    assert_eq!((&info["settings"]["width"], &info["settings"]["max_depth"]), (&48.into(), &4.into()));
    assert!(info["features"]["skipped"].as_array().unwrap().iter().any(|s| s == "texture lookups"));
    assert!(lab.run(&["info", "scene.xml"]).stdout().contains("1 Area"));
}
