//! Cost against the number of workers of a farm.

use super::super::document::{Growth, GrowthRow};
use super::super::scene::Budget;
use crate::farm::{Farm, timed};
use std::path::Path;

/// The binary that is the farm.
const LIGHTFARM: &str = "target/release/lightfarm";
/// Where the coordinator listens.
const LISTEN: &str = "127.0.0.1:50972";

/// Whole jobs, from `submit` to the file, by 1, 2, 4, ... workers of one thread.
pub fn by_workers(budget: Budget) -> Result<Growth, String> {
    let about =
        "from submit to the finished file, scenes/cornell-diffuse.toml by path, workers of one thread on this machine";
    let mut growth = super::growth("workers", about, "s", Vec::new());
    let (lightfarm, scene) = (Path::new(LIGHTFARM), Path::new("scenes/cornell-diffuse.toml"));
    if !lightfarm.is_file() || !scene.is_file() {
        growth
            .notes
            .push(format!("left out: {LIGHTFARM} and {} are not both here; cargo build --release", scene.display()));
        return Ok(growth);
    }
    let cores = std::thread::available_parallelism().map_or(1, usize::from);
    let mut counts: Vec<usize> = (0..).map(|i| 1 << i).take_while(|n| *n < cores).collect();
    counts.push(cores);
    let spp = if budget == Budget::Smoke { 1 } else { 128 };
    for count in counts {
        let folder = tempfile::tempdir().map_err(|e| format!("no temporary folder: {e}"))?;
        let farm = Farm::start(lightfarm, LISTEN, folder.path(), count)?;
        let out = folder.path().join("out.exr");
        let mut seconds = Vec::new();
        // The first job ships the scene and does not count.
        for run in 0..=super::runs(budget) {
            let s = timed(lightfarm, &farm.submit(), scene, spp, &run.to_string(), &out)?;
            if run > 0 {
                seconds.push(s);
            }
        }
        let cost = super::spread(&seconds);
        let one = growth.rows.first().map_or(cost.value, |r: &GrowthRow| r.cost.value);
        growth.rows.push(GrowthRow { x: count as f64, cost, more: vec![("speed-up".into(), one / cost.value)] });
    }
    Ok(growth)
}
