//! The same job gives the same bytes, whatever happens to those who work on it.

#![allow(clippy::unwrap_used, clippy::panic, reason = "test helpers")]

use e2e::{Farm, Job, assert_same_pixels, lightfarm, room, until};
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};
use tempfile::TempDir;

const PATIENCE: Duration = Duration::from_secs(120);

/// One core works on a job for this long at least, so that there is something left to kill however fast the machine and the code are.
const WORK: Duration = Duration::from_secs(4);

/// A render that is the same for `lightfarm render` and for the farm.
struct Work {
    integrator: &'static str,
    /// Options beside those that all have.
    more: &'static [&'static str],
    /// Samples or mutations a pixel.
    budget: u32,
}

impl Work {
    fn options(&self) -> Vec<String> {
        let unit = if self.integrator == "mmlt" { "--mpp" } else { "--spp" };
        let budget = self.budget.to_string();
        let all = ["--integrator", self.integrator, unit, &budget, "--size", "128x96", "--seed", "7"];
        all.iter().chain(self.more).map(|s| s.to_string()).collect()
    }

    /// What `lightfarm render` makes of it.
    fn reference(&self, folder: &TempDir, threads: &str) -> PathBuf {
        let path = folder.path().join(format!("{}-{threads}.exr", self.integrator));
        let mut args = vec!["render".into(), room().into_os_string()];
        args.extend(self.options().into_iter().map(Into::into));
        args.extend(["--threads".into(), threads.into(), "-o".into(), path.clone().into_os_string()]);
        let output = lightfarm(args);
        assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
        path
    }

    /// As much work as takes one core long enough, and its reference.
    fn of(integrator: &'static str, more: &'static [&'static str], folder: &TempDir) -> (Self, PathBuf) {
        let mut work = Self { integrator, more, budget: 64 };
        loop {
            let start = Instant::now();
            let reference = work.reference(folder, "1");
            let share = start.elapsed().div_duration_f64(WORK);
            if share >= 1.0 {
                return (work, reference);
            }
            work.budget *= (1.2 / share).ceil() as u32;
        }
    }

    fn submit(&self, farm: &Farm) -> Job {
        let options = self.options();
        farm.submit(&room(), &options.iter().map(String::as_str).collect::<Vec<_>>())
    }
}

/// Three workers: one is killed while it renders, one comes when half is done.
fn three_workers(work: &Work, reference: &Path) {
    let mut farm = Farm::start();
    farm.start_worker("victim", 1);
    farm.start_worker("steady", 1);
    let job = work.submit(&farm);
    // It has delivered units, so it is past loading the scene.
    until("the victim renders", PATIENCE, || {
        let w = farm.worker("victim");
        w["units"].as_u64() > Some(0) && farm.fraction(&job) > 0.0
    });
    // It is stopped first, and what it has sent arrives: between two units, or two passes, it would lose nothing.
    until("the victim holds a unit", PATIENCE, || {
        farm.step_worker("victim", Duration::from_millis(20));
        std::thread::sleep(Duration::from_millis(50));
        farm.worker("victim")["held_units"].as_u64() > Some(0)
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
fn killed_coordinator(work: &Work, reference: &Path) {
    let mut farm = Farm::start();
    farm.start_worker("a", 1);
    farm.start_worker("b", 1);
    let job = work.submit(&farm);
    let mut at = Vec::new();
    for kill in 1..=5u32 {
        let goal = 0.1 * f64::from(kill);
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

fn one_worker(work: &Work, reference: &Path) {
    let mut farm = Farm::start();
    farm.start_worker("only", 2);
    let job = work.submit(&farm);
    farm.wait(&job, PATIENCE);
    let fetched = farm.fetch(&job, "one.exr");
    assert_same_pixels(reference, &fetched);
    // Nothing in the file tells the farm from one process.
    assert_eq!(std::fs::read(reference).unwrap(), std::fs::read(fetched).unwrap());
}

/// The pass under way, units of it that are stored, and how many it has; `None` between passes and while restoring.
fn pass(farm: &Farm, job: &Job) -> Option<(u64, u64, u64)> {
    let shown = farm.show(job);
    let number = |key: &str| shown[key].as_u64().unwrap();
    (number("units") > 0).then(|| (number("pass"), number("units_stored"), number("units")))
}

/// Steps a worker until it holds units of a pass, and leaves it stopped: the shortest passes take less time than two questions.
fn until_held(farm: &Farm, job: &Job, worker: &str, wanted: u64) {
    until(&format!("{worker} holds units of pass {wanted}"), PATIENCE, || {
        farm.step_worker(worker, Duration::from_millis(5));
        // In this order: what is held then is of this pass or of a later one, and passes only begin when all is stored.
        let held = farm.worker_if_known(worker).is_some_and(|w| w["held_units"].as_u64() > Some(0));
        let Some((at, stored, units)) = pass(farm, job) else { return false };
        assert!(at <= wanted, "pass {wanted} was over too soon for a kill");
        held && at == wanted && stored < units
    });
}

/// A worker is killed in each of the first three passes, alone, so that nobody goes on with its pass; then others end the job.
fn worker_killed_in_each_pass(work: &Work, reference: &Path) {
    let mut farm = Farm::start();
    let job = work.submit(&farm);
    for wanted in 0..3 {
        let name = format!("victim-{wanted}");
        farm.start_worker(&name, 1);
        until_held(&farm, &job, &name, wanted);
        farm.kill_worker(&name);
        until("the loss is noticed", Duration::from_secs(5), || farm.worker(&name)["state"] == "lost");
        let (at, stored, units) = pass(&farm, &job).unwrap();
        assert!(at == wanted && stored < units, "the kill came too late: pass {at}, {stored} of {units} units");
        assert!(farm.worker(&name)["losses"].as_u64() > Some(0), "{name} held nothing when it died");
        if wanted < 2 {
            // Somebody has to bring the job to the next pass: a worker that is killed as soon as it has.
            let bridge = format!("bridge-{wanted}");
            farm.start_worker(&bridge, 1);
            until("the pass ends", PATIENCE, || pass(&farm, &job).is_some_and(|p| p.0 > wanted));
            farm.kill_worker(&bridge);
        }
    }
    farm.start_worker("late", 1);
    farm.start_worker("later", 1);
    farm.wait(&job, PATIENCE);
    assert_same_pixels(reference, &farm.fetch(&job, "passes.exr"));
}

/// A coordinator that is killed in each of the first three passes.
fn coordinator_killed_in_each_pass(work: &Work, reference: &Path) {
    let mut farm = Farm::start();
    let job = work.submit(&farm);
    farm.start_worker("only", 1);
    for wanted in 0..3 {
        until_held(&farm, &job, "only", wanted);
        farm.kill_coordinator();
        farm.resume_worker("only");
        farm.start_coordinator();
        until("the job is restored", PATIENCE, || pass(&farm, &job).is_some());
        // The worker went on meanwhile, so that it may be a pass further already.
        assert!(pass(&farm, &job).is_none_or(|p| p.0 >= wanted), "a pass was forgotten");
    }
    farm.start_worker("late", 1);
    farm.wait(&job, PATIENCE);
    assert_same_pixels(reference, &farm.fetch(&job, "coordinator.exr"));
}

fn all(integrator: &'static str, more: &'static [&'static str]) {
    let folder = TempDir::new().unwrap();
    let (work, one) = Work::of(integrator, more, &folder);
    assert_same_pixels(&one, &work.reference(&folder, "2"));
    one_worker(&work, &one);
    three_workers(&work, &one);
    killed_coordinator(&work, &one);
    if integrator == "mmlt" {
        worker_killed_in_each_pass(&work, &one);
        coordinator_killed_in_each_pass(&work, &one);
    }
}

#[test]
fn tiles_are_the_same_through_every_history() {
    all("path", &[]);
}

/// Samples that go where earlier passes found noise.
#[test]
fn dealt_samples_are_the_same_through_every_history() {
    all("path", &["--adaptive"]);
}

#[test]
fn splats_are_the_same_through_every_history() {
    all("light", &[]);
}

#[test]
fn tiles_with_splats_are_the_same_through_every_history() {
    all("bdpt", &[]);
}

/// Trials, and the render that they chose.
#[test]
fn trials_choose_the_same_through_every_history() {
    all("auto", &[]);
}

/// Pilot, pools and chains: passes that depend on what those before them found.
#[test]
fn chains_are_the_same_through_every_history() {
    all("mmlt", &[]);
}
