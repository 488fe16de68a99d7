//! How cost grows with threads, workers, resolution, triangles, lights and depth.

mod farm;
pub mod fit;
mod scenes;

use super::document::{Growth, GrowthRow};
use super::scene::Budget;
use crate::error::process;
use crate::error::stats::Interval;
use renderer::integrator::IntegratorKind;
use renderer::job::{LocalOptions, RenderOptions, RenderSettings, Stop, render_local};
use renderer::scene::Scene;
use std::time::Instant;

/// What cost may grow with.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kind {
    /// Threads of one process.
    Threads,
    /// Workers of a farm.
    Workers,
    /// Pixels of the picture.
    Resolution,
    /// Triangles of the scene.
    Triangles,
    /// Lights of the scene.
    Lights,
    /// Edges of the longest path.
    Depth,
}

const KINDS: [(&str, Kind); 6] = [
    ("threads", Kind::Threads),
    ("workers", Kind::Workers),
    ("resolution", Kind::Resolution),
    ("triangles", Kind::Triangles),
    ("lights", Kind::Lights),
    ("depth", Kind::Depth),
];

/// The kinds of these names; all of them where nothing is said.
pub fn kinds(names: Option<&[String]>) -> Result<Vec<Kind>, String> {
    let Some(names) = names else { return Ok(KINDS.iter().map(|k| k.1).collect()) };
    if names.iter().any(|n| n == "none") {
        return Ok(Vec::new());
    }
    let find = |name: &String| KINDS.iter().find(|k| k.0 == name).map(|k| k.1);
    let known = || KINDS.map(|k| k.0).join(", ");
    names
        .iter()
        .map(|n| find(n).ok_or_else(|| format!("cost can't be measured by {n:?}, only by {}", known())))
        .collect()
}

/// One render: seconds and largest memory above that before it.
struct Cost {
    seconds: f64,
    mib: f64,
}

/// Renders `spp` samples per pixel by `path`; paths have at most `depth` edges and no roulette.
fn render(scene: &Scene, size: (u32, u32), spp: u32, depth: i32, threads: usize, seed: u64) -> Result<Cost, String> {
    let options = RenderOptions {
        size: Some(size),
        max_depth: Some(depth),
        seed: Some(seed),
        ..RenderOptions::counting(IntegratorKind::Path, spp)
    };
    let mut settings = RenderSettings::resolve(&options, &scene.defaults).map_err(|e| e.to_string())?;
    // So that every path is as long as it may be.
    settings.rr_depth = u32::MAX;
    let before = process::resident_mib().unwrap_or(0.0);
    process::reset_peak();
    let started = Instant::now();
    let outcome = render_local(scene, &settings, &LocalOptions { threads }, &Stop::new(), &mut |_| {});
    let seconds = started.elapsed().as_secs_f64();
    outcome.map_err(|e| e.to_string())?;
    Ok(Cost { seconds, mib: process::peak_mib().unwrap_or(0.0) - before })
}

/// Median, least and greatest.
fn spread(values: &[f64]) -> Interval {
    let mut sorted = values.to_vec();
    sorted.sort_by(f64::total_cmp);
    let value = sorted[sorted.len() / 2];
    Interval { value, low: sorted[0], high: sorted[sorted.len() - 1] }
}

/// Runs of each measurement.
fn runs(budget: Budget) -> usize {
    match budget {
        Budget::Smoke => 1,
        Budget::Quick => 3,
        Budget::Full => 5,
    }
}

/// Measures.
pub fn measure(kind: Kind, budget: Budget, threads: usize) -> Result<Growth, String> {
    eprintln!("growth of cost: {kind:?}");
    let mut growth = match kind {
        Kind::Threads => by_threads(budget)?,
        Kind::Workers => farm::by_workers(budget)?,
        Kind::Resolution => by_resolution(budget, threads)?,
        Kind::Triangles => by_triangles(budget, threads)?,
        Kind::Lights => by_lights(budget, threads)?,
        Kind::Depth => by_depth(budget, threads)?,
    };
    let upper = growth.rows.len() / 2;
    let points: Vec<(f64, f64)> = growth.rows.iter().map(|r| (r.x, r.cost.value)).collect();
    growth.exponent = fit::exponent(&points[upper.min(points.len().saturating_sub(3))..]);
    Ok(growth)
}

/// Runs `cost` for every x, in turn, `runs` times; the rows hold medians.
fn in_turn<T>(
    xs: &[T],
    runs: usize,
    mut cost: impl FnMut(&T, u64) -> Result<f64, String>,
) -> Result<Vec<Interval>, String> {
    let mut all: Vec<Vec<f64>> = xs.iter().map(|_| Vec::with_capacity(runs)).collect();
    for run in 0..runs {
        for (x, costs) in xs.iter().zip(&mut all) {
            costs.push(cost(x, run as u64 + 1)?);
        }
    }
    Ok(all.iter().map(|c| spread(c)).collect())
}

fn growth(name: &str, about: &str, unit: &str, rows: Vec<GrowthRow>) -> Growth {
    Growth { name: name.into(), about: about.into(), unit: unit.into(), rows, exponent: None, notes: Vec::new() }
}

fn by_threads(budget: Budget) -> Result<Growth, String> {
    let scene = scenes::lamps(1)?;
    let cores = std::thread::available_parallelism().map_or(1, usize::from);
    let mut counts: Vec<usize> = (0..).map(|i| 1 << i).take_while(|n| *n < cores).collect();
    counts.push(cores);
    let (side, spp) = if budget == Budget::Smoke { (32, 4) } else { (256, 64) };
    let samples = f64::from(side * side * spp);
    let costs = in_turn(&counts, 2 * runs(budget) + 1, |n, seed| {
        Ok(render(&scene, (side, side), spp, 9, *n, seed)?.seconds / samples * 1e9)
    })?;
    let one = costs[0].value;
    let rows = counts.iter().zip(&costs).map(|(n, c)| GrowthRow {
        x: *n as f64,
        cost: *c,
        more: vec![("speed-up".into(), one / c.value), ("Msamples/s".into(), 1e3 / c.value)],
    });
    Ok(growth("threads", "path in a diffuse room, paths of 9 edges", "ns per sample", rows.collect()))
}

fn by_resolution(budget: Budget, threads: usize) -> Result<Growth, String> {
    let scene = scenes::lamps(1)?;
    let sides: &[u32] = match budget {
        Budget::Smoke => &[16, 32, 64],
        Budget::Quick => &[128, 256, 512, 1024, 2048, 4096],
        Budget::Full => &[128, 256, 512, 1024, 2048, 4096, 8192],
    };
    let mut memory = vec![0.0f64; sides.len()];
    let costs = in_turn(sides, 1, |side, seed| {
        let cost = render(&scene, (*side, *side), 1, 5, threads, seed)?;
        let pixels = f64::from(*side) * f64::from(*side);
        let place = sides.iter().position(|s| s == side).unwrap_or(0);
        memory[place] = cost.mib * f64::from(1 << 20) / pixels;
        Ok(cost.seconds / pixels * 1e9)
    })?;
    let rows = sides.iter().zip(costs).zip(memory).map(|((side, cost), bytes)| GrowthRow {
        x: f64::from(*side) * f64::from(*side),
        cost,
        more: vec![("bytes per pixel".into(), bytes)],
    });
    let about = "path with one sample per pixel in a diffuse room, paths of 5 edges; the time includes the merge";
    Ok(growth("pixels", about, "ns per sample", rows.collect()))
}

fn by_triangles(budget: Budget, threads: usize) -> Result<Growth, String> {
    let counts: &[usize] = match budget {
        Budget::Smoke => &[1_000, 4_000, 16_000],
        Budget::Quick => &[1_000, 10_000, 100_000, 1_000_000],
        Budget::Full => &[1_000, 10_000, 100_000, 1_000_000, 10_000_000],
    };
    let (side, spp) = if budget == Budget::Smoke { (32, 2) } else { (256, 8) };
    let mut rows = Vec::with_capacity(counts.len());
    // One scene is in memory at a time: these are not interleaved.
    for count in counts {
        let before = process::resident_mib().unwrap_or(0.0);
        process::reset_peak();
        let started = Instant::now();
        let (scene, triangles) = scenes::room(*count)?;
        let load_s = started.elapsed().as_secs_f64();
        let n = triangles as f64;
        let per = |mib: f64| (mib - before) * f64::from(1 << 20) / n;
        let (kept, peak) = (per(process::resident_mib().unwrap_or(0.0)), per(process::peak_mib().unwrap_or(0.0)));
        let samples = f64::from(side * side * spp);
        let costs = in_turn(&[()], runs(budget), |(), seed| {
            Ok(render(&scene, (side, side), spp, 5, threads, seed)?.seconds / samples * 1e9)
        })?;
        rows.push(GrowthRow {
            x: n,
            cost: costs[0],
            more: vec![
                ("bytes per triangle".into(), kept),
                ("at most, while building".into(), peak),
                ("making and building s".into(), load_s),
            ],
        });
    }
    Ok(growth("triangles", "path in a closed room with hills and blobs, paths of 5 edges", "ns per sample", rows))
}

fn by_lights(budget: Budget, threads: usize) -> Result<Growth, String> {
    let counts: &[usize] = match budget {
        Budget::Smoke => &[1, 10, 100],
        Budget::Quick | Budget::Full => &[1, 10, 100, 1_000, 10_000, 100_000],
    };
    let (side, spp) = if budget == Budget::Smoke { (32, 2) } else { (256, 8) };
    let scenes: Vec<Scene> = counts.iter().map(|n| scenes::lamps(*n)).collect::<Result<_, _>>()?;
    let samples = f64::from(side * side * spp);
    let places: Vec<usize> = (0..counts.len()).collect();
    let costs = in_turn(&places, runs(budget), |i, seed| {
        Ok(render(&scenes[*i], (side, side), spp, 5, threads, seed)?.seconds / samples * 1e9)
    })?;
    let rows = counts.iter().zip(costs).map(|(n, cost)| GrowthRow { x: *n as f64, cost, more: Vec::new() });
    let about = "path in a diffuse room, paths of 5 edges, with more and more square lamps under its ceiling";
    Ok(growth("lights", about, "ns per sample", rows.collect()))
}

fn by_depth(budget: Budget, threads: usize) -> Result<Growth, String> {
    let depths: &[i32] = match budget {
        Budget::Smoke => &[1, 4, 16],
        Budget::Quick | Budget::Full => &[1, 2, 4, 8, 16, 32, 64, 128, 256, 512, 1024],
    };
    let scene = scenes::lamps(1)?;
    let (side, spp) = if budget == Budget::Smoke { (16, 2) } else { (64, 4) };
    let samples = f64::from(side * side * spp);
    let costs = in_turn(depths, runs(budget), |d, seed| {
        Ok(render(&scene, (side, side), spp, *d, threads, seed)?.seconds / samples * 1e9)
    })?;
    let rows = depths.iter().zip(costs).map(|(d, cost)| GrowthRow { x: f64::from(*d), cost, more: Vec::new() });
    let about = "path in a closed diffuse room without Russian roulette: every path has as many edges as it may";
    Ok(growth("depth", about, "ns per sample", rows.collect()))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn kinds_by_name() {
        assert_eq!(kinds(None).unwrap().len(), 6);
        assert_eq!(kinds(Some(&["none".into()])).unwrap(), []);
        assert_eq!(kinds(Some(&["depth".into()])).unwrap(), [Kind::Depth]);
        assert!(kinds(Some(&["size".into()])).unwrap_err().contains("resolution"));
    }

    #[test]
    fn the_smallest_measurements_work() {
        for kind in [Kind::Resolution, Kind::Triangles, Kind::Lights, Kind::Depth] {
            let g = measure(kind, Budget::Smoke, 1).unwrap();
            assert!(g.rows.len() == 3 && g.rows.iter().all(|r| r.cost.value > 0.0) && g.exponent.is_some(), "{g:?}");
        }
    }
}
