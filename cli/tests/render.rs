//! `lightfarm render` as a user meets it: files, exit statuses, full disks and interruptions.

#![allow(clippy::unwrap_used, reason = "test code")]

mod common;

use common::{Lab, Run, read};
use renderer::integrator::IntegratorKind;
use std::io::{BufRead, BufReader};
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

#[test]
fn a_render_writes_both_pictures_and_sums_up() {
    let lab = Lab::new();
    let run = lab.run(&["render", "scene.xml", "--spp", "8", "--json", "--threads", "2"]);
    run.status(0);
    let done = run.json();
    assert_eq!(done["event"], "done");
    assert_eq!((&done["width"], &done["height"], &done["spp"]), (&48.into(), &32.into(), &8.0.into()));
    assert_eq!((&done["non_finite"], &done["negative"]), (&0.into(), &0.into()));
    assert!(done["error"]["relative"].as_f64().unwrap() > 0.0 && done["first_preview_s"].as_f64().unwrap() < 2.0);
    let skipped = done["skipped"].as_array().unwrap();
    assert!(skipped.iter().any(|s| s == "participating media"), "{skipped:?}");
    let picture = lab.picture("scene.exr");
    let metadata = picture.metadata.clone().unwrap();
    assert_eq!(metadata.scene.to_string(), done["scene"].as_str().unwrap());
    assert_eq!(metadata.settings["budget"]["spp"], 8);
    assert!(picture.channel("samples.Y").unwrap().iter().all(|n| *n == 8.0));
    assert!(picture.channel("R").unwrap().iter().sum::<f32>() > 0.0);
    let png = std::fs::read(lab.path("scene.png")).unwrap();
    assert!(png.starts_with(b"\x89PNG"));
    // Nothing else is left in the folder.
    assert_eq!(std::fs::read_dir(lab.path("")).unwrap().count(), 3);
}

#[test]
fn threads_and_names_change_no_byte() {
    let lab = Lab::new();
    for integrator in ["path", "light"] {
        let render = |threads: &str, out: &str| {
            let common = ["render", "scene.xml", "--spp", "5", "--integrator", integrator, "--exposure", "-1.5"];
            lab.run(&[&common[..], &["--threads", threads, "-o", out]].concat()).status(0);
            (std::fs::read(lab.path(out)).unwrap(), std::fs::read(lab.path(out).with_extension("png")).unwrap())
        };
        assert!(render("1", "one.exr") == render("3", "three.exr"), "{integrator}");
    }
}

#[test]
fn auto_says_what_it_chose_and_why() {
    let lab = Lab::new();
    let render = |threads: &str, out: &str| {
        let args = ["render", "scene.xml", "--spp", "100", "--integrator", "auto", "--json", "-o", out, "--threads"];
        let run = lab.run(&[&args[..], &[threads]].concat());
        run.status(0);
        (run.json(), std::fs::read(lab.path(out)).unwrap())
    };
    let (done, bytes) = render("1", "auto.exr");
    let choice = &done["choice"];
    let integrator = choice["integrator"].as_str().unwrap().to_string();
    assert!(["path", "bdpt", "mmlt"].contains(&&*integrator), "{choice}");
    assert!(choice["why"].as_str().unwrap().contains("times as long"), "{choice}");
    assert_eq!(lab.picture("auto.exr").metadata.unwrap().choice.as_ref(), Some(choice));
    assert!(choice["share"].as_f64().unwrap() < 1.0 && done["spp"].as_f64().unwrap() >= 1.0, "{done}");
    assert!(render("2", "auto2.exr").1 == bytes, "the number of threads changes the file");
    // The image is that of the chosen integrator with as many samples, and nothing of the trials.
    let count = (done["spp"].as_f64().unwrap() as u32).to_string();
    if integrator != "mmlt" {
        let args = ["render", "scene.xml", "--integrator", &integrator, "--spp", &count, "-o", "own.exr"];
        lab.run(&args).status(0);
        let same = |name: &str| lab.picture("own.exr").channel(name) == lab.picture("auto.exr").channel(name);
        assert!(["R", "G", "B", "samples.Y", "stderror.R"].into_iter().all(same));
    }
    let small = lab.run(&["render", "scene.xml", "--spp", "2", "--integrator", "auto", "--json", "-o", "small.exr"]);
    small.status(0);
    assert_eq!(small.json()["choice"]["integrator"], "path");
}

#[test]
fn wrong_command_lines_are_usage_errors() {
    let lab = Lab::new();
    for args in [
        &["render"][..],
        &["render", "scene.xml", "--no-such-option"],
        &["render", "scene.xml", "--size", "640"],
        &["render", "scene.xml", "--spp", "0"],
        &["render", "scene.xml", "--max-depth", "-2"],
        &["render", "scene.xml", "--time", "soon"],
        &["render", "scene.xml", "--target-error", "0"],
        &["render", "scene.xml", "--integrator", "paht"],
        &["render", "scene.xml", "--threads", "0"],
        &["render", "scene.xml", "-o", "same.png", "--png", "same.png"],
        &["render", "scene.xml", "--size", "65536x65536"],
        &["frobnicate"],
        &[],
    ] {
        let stderr = lab.run(args).status(2);
        assert!(!stderr.is_empty(), "{args:?} says nothing");
    }
    assert!(lab.run(&["render", "scene.xml", "--integrator", "paht"]).status(2).contains("did you mean"));
    assert!(lab.run(&["--help"]).stdout().contains("exit status"));
}

#[test]
fn options_that_do_not_go_together_are_usage_errors() {
    let lab = Lab::new();
    lab.write(
        "mmlt.toml",
        "camera = { from = [0, 0, 5], to = [0, 0, 0] }\n[render]\nintegrator = 'mmlt'\n[[lights]]\nkind = 'constant'\n",
    );
    for (args, advice) in [
        (&["scene.xml", "--mpp", "3"][..], "give --spp in place of --mpp"),
        (&["scene.xml", "--mpp", "3", "--integrator", "light"], "give --spp in place of --mpp"),
        (&["scene.xml", "--mpp", "3", "--integrator", "bdpt"], "give --spp in place of --mpp"),
        (&["scene.xml", "--spp", "3", "--integrator", "mmlt"], "give --mpp in place of --spp"),
        (&["mmlt.toml", "--spp", "3"], "give --mpp in place of --spp"),
        (&["scene.xml", "--mpp", "3", "--integrator", "auto"], "give --spp in place of --mpp"),
        (&["scene.xml", "--mmlt", "plain", "--integrator", "auto"], "give --integrator mmlt"),
        (&["scene.xml", "--mmlt", "plain"], "give --integrator mmlt"),
        (&["mmlt.toml", "--mmlt", "", "--integrator", "path"], "give --integrator mmlt"),
        (&["scene.xml", "--integrator", "mmlt", "--mmlt", "lift=3"], "between 0 and 1"),
    ] {
        // A farm is asked nothing before the options are found to fit, so none is needed.
        for verb in [&["render"][..], &["submit", "--coordinator", "http://127.0.0.1:1"]] {
            let stderr = lab.run(&[verb, args].concat()).status(2);
            assert!(stderr.contains(advice), "{verb:?} {args:?}: {stderr}");
        }
    }
    let strategies = |scene| lab.run(&["render", scene, "--strategies", "folder"]).status(2);
    assert!(strategies("scene.xml").contains("give --integrator bdpt"));
    assert!(strategies("mmlt.toml").contains("give --integrator bdpt"));
}

#[test]
fn scenes_name_the_integrators_that_there_are() {
    let lab = Lab::new();
    let info = |name: &str| {
        lab.write("scene.toml", &format!("camera = {{ from = [0, 0, 5], to = [0, 0, 0] }}\n[render]\nintegrator = '{name}'\n[[lights]]\nkind = 'constant'\n"));
        lab.run(&["info", "scene.toml"])
    };
    for name in IntegratorKind::names() {
        info(name).status(0);
    }
    let stderr = info("autos").status(1);
    let known: Vec<_> = IntegratorKind::names().collect();
    assert!(stderr.contains("scene.toml, line 3") && stderr.contains(&known.join(", ")), "{stderr}");
}

#[test]
fn scenes_that_cannot_be_loaded_are_the_inputs_fault() {
    let lab = Lab::new();
    assert!(lab.run(&["render", "missing.xml"]).status(1).contains("missing.xml"));
    assert!(lab.run(&["render", "scene.blend"]).status(1).contains(".gltf"));
    // Both faults are shown at once.
    lab.write("two.xml", "<scene version=\"3.0.0\">\n<shape type=\"teapot\"/>\n<bsdf type=\"marzipan\"/>\n</scene>");
    for verb in ["render", "info"] {
        let run = lab.run(&[verb, "two.xml", "--json"]);
        let stderr = run.status(1);
        assert!(stderr.contains("teapot") && stderr.contains("marzipan"), "{stderr}");
        assert!(stderr.contains("line 2") && stderr.contains("line 3"), "{stderr}");
        assert_eq!((&run.json()["event"], &run.json()["status"]), (&"error".into(), &1.into()));
    }
    assert!(!lab.path("two.exr").exists());
}

#[test]
fn places_that_cannot_be_written_are_found_before_rendering() {
    let lab = Lab::new();
    // A sample budget that would take hours.
    let render =
        |out: &str| lab.run(&["render", "scene.xml", "--spp", "16000000", "-o", out, "--png", "p.png"]).status(3);
    assert!(render("no/such/folder/out.exr").contains("no/such/folder/out.exr"));
    std::fs::create_dir(lab.path("folder.exr")).unwrap();
    assert!(render("folder.exr").contains("it is a folder"));
}

#[test]
fn a_full_disk_loses_nothing() {
    let lab = Lab::new();
    let stderr = lab.run(&["render", "scene.xml", "--spp", "2", "-o", "/dev/full", "--png", "p.png"]).status(3);
    assert!(stderr.contains("/dev/full"), "{stderr}");
    let saved = std::fs::read_dir(lab.path("")).unwrap().map(|f| f.unwrap().path());
    let saved = saved.into_iter().find(|p| p.to_string_lossy().ends_with("-full")).unwrap();
    assert!(stderr.contains(&*saved.to_string_lossy()), "{stderr}");
    assert!(read(&saved).channel("samples.Y").unwrap().iter().all(|n| *n == 2.0));
    assert!(lab.path("p.png").exists());
}

/// Starts a render that would take hours, and sends a signal after some samples.
fn interrupted(lab: &Lab, integrator: &str, signal: &str) -> Run {
    let mut child = lab
        .command(&["render", "scene.xml", "--spp", "16000000", "--json", "--integrator", integrator])
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    let mut lines = BufReader::new(child.stdout.take().unwrap());
    let mut line = String::new();
    while !line.contains("progress") {
        line.clear();
        assert!(lines.read_line(&mut line).unwrap() > 0, "the program ended by itself");
    }
    let sent = Instant::now();
    assert!(Command::new("kill").args([signal, &child.id().to_string()]).status().unwrap().success());
    let mut output = child.wait_with_output().unwrap();
    assert!(sent.elapsed() < Duration::from_secs(10), "it took {:?} to end", sent.elapsed());
    std::io::Read::read_to_end(&mut lines, &mut output.stdout).unwrap();
    Run(output)
}

#[test]
fn a_signal_saves_what_is_finished_with_the_right_counts() {
    for (integrator, signal) in [("path", "-INT"), ("light", "-TERM")] {
        let lab = Lab::new();
        let run = interrupted(&lab, integrator, signal);
        run.status(130);
        let done = run.stdout().lines().find(|l| l.contains("\"done\"")).unwrap().to_string();
        let done: serde_json::Value = serde_json::from_str(&done).unwrap();
        assert_eq!(done["interrupted"], true);
        let picture = lab.picture("scene.exr");
        let samples = picture.metadata.as_ref().unwrap().counters.samples;
        assert_eq!(done["samples"], samples);
        let counted: f64 = picture.channel("samples.Y").unwrap().iter().map(|n| f64::from(*n)).sum();
        assert!((counted / samples as f64 - 1.0).abs() < 1e-6, "{integrator}: {counted} for {samples}");
        assert!(lab.path("scene.png").exists());
        // The picture is that of a complete render, within both errors.
        lab.run(&["render", "scene.xml", "--spp", "64", "-o", "whole.exr", "--seed", "9"]).status(0);
        let whole = lab.picture("whole.exr").metadata.unwrap().channels.unwrap();
        let mean = picture.triple(["R", "G", "B"]).unwrap().iter().map(|p| f64::from(p[1])).sum::<f64>() / 1536.0;
        assert!((mean / whole.mean[1] - 1.0).abs() < 0.03, "{integrator}: {mean} for {}", whole.mean[1]);
    }
}

#[test]
fn a_reader_that_goes_away_is_no_error() {
    let lab = Lab::new();
    let mut child = lab.command(&["info", "scene.xml"]).stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap();
    drop(child.stdout.take());
    Run(child.wait_with_output().unwrap()).status(0);
}
