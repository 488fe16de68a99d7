//! The same job gives the same bytes, whatever happens to those who work on it.

#![allow(clippy::unwrap_used, clippy::panic, reason = "test helpers")]

use e2e::{Farm, Job, assert_same_pixels, lightfarm, room, until};
use std::path::{Path, PathBuf};
use std::time::Duration;
use tempfile::TempDir;

const PATIENCE: Duration = Duration::from_secs(120);

/// Some seconds of work on one core, in some tens of units.
fn options(integrator: &str) -> Vec<&str> {
    let spp = if integrator == "light" { "768" } else { "512" };
    vec!["--integrator", integrator, "--spp", spp, "--size", "128x96", "--seed", "7"]
}

/// What `lightfarm render` makes of it.
fn reference(folder: &TempDir, integrator: &str, threads: &str) -> PathBuf {
    let path = folder.path().join(format!("{integrator}-{threads}.exr"));
    let mut args = vec!["render".into(), room().into_os_string()];
    args.extend(options(integrator).into_iter().map(Into::into));
    args.extend(["--threads".into(), threads.into(), "-o".into(), path.clone().into_os_string()]);
    let output = lightfarm(args);
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    path
}

fn submit(farm: &Farm, integrator: &str) -> Job {
    farm.submit(&room(), &options(integrator))
}

/// Three workers: one is killed while it renders, one comes when half is done.
fn three_workers(integrator: &str, reference: &Path) {
    let mut farm = Farm::start();
    farm.start_worker("victim", 1);
    farm.start_worker("steady", 1);
    let job = submit(&farm, integrator);
    // Mid-unit: it holds units, and has delivered some, so it is past loading the scene.
    until("the victim renders", PATIENCE, || {
        let w = farm.worker("victim");
        w["held_units"].as_u64() > Some(0) && w["units"].as_u64() > Some(0)
    });
    farm.kill_worker("victim");
    assert!(farm.fraction(&job) < 1.0, "the kill came too late");
    until("the loss is noticed", Duration::from_secs(5), || farm.worker("victim")["state"] == "lost");
    let victim = farm.worker("victim");
    assert!(victim["losses"].as_u64() > Some(0), "the victim held nothing when it died: {victim}");
    farm.start_worker("late", 1);
    farm.wait(&job, PATIENCE);
    assert!(farm.worker("late")["units"].as_u64() > Some(0), "the late worker did nothing");
    assert_same_pixels(reference, &farm.fetch(&job, "three.exr"));
}

/// A coordinator that is killed five times, while two workers render.
fn killed_coordinator(integrator: &str, reference: &Path) {
    let mut farm = Farm::start();
    farm.start_worker("a", 1);
    farm.start_worker("b", 1);
    let job = submit(&farm, integrator);
    let mut at = Vec::new();
    for kill in 1..=5u32 {
        let goal = 0.14 * f64::from(kill);
        until("the job comes on", PATIENCE, || farm.fraction(&job) >= goal);
        farm.kill_coordinator();
        // Workers go on rendering meanwhile, and keep what they have.
        std::thread::sleep(Duration::from_millis(100 * u64::from(kill)));
        farm.start_coordinator();
        let shown = farm.show(&job);
        let (state, fraction) = (shown["state"].as_str().unwrap_or(""), shown["fraction"].as_f64().unwrap_or(0.0));
        assert!(matches!(state, "active" | "restoring") && fraction < 1.0, "kill {kill} came too late: {shown}");
        at.push(fraction);
    }
    farm.wait(&job, PATIENCE);
    assert_eq!(at.len(), 5);
    assert_same_pixels(reference, &farm.fetch(&job, "killed.exr"));
}

fn one_worker(integrator: &str, reference: &Path) {
    let mut farm = Farm::start();
    farm.start_worker("only", 2);
    let job = submit(&farm, integrator);
    farm.wait(&job, PATIENCE);
    let fetched = farm.fetch(&job, "one.exr");
    assert_same_pixels(reference, &fetched);
    // Nothing in the file tells the farm from one process.
    assert_eq!(std::fs::read(reference).unwrap(), std::fs::read(fetched).unwrap());
}

fn all(integrator: &str) {
    let folder = TempDir::new().unwrap();
    let one = reference(&folder, integrator, "1");
    assert_same_pixels(&one, &reference(&folder, integrator, "2"));
    one_worker(integrator, &one);
    three_workers(integrator, &one);
    killed_coordinator(integrator, &one);
}

#[test]
fn tiles_are_the_same_through_every_history() {
    all("path");
}

#[test]
fn splats_are_the_same_through_every_history() {
    all("light");
}
