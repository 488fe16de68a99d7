//! Many small renders, one a thread, and what each tells of its own error.

use renderer::film::{GroupFilm, MergedImage};
use renderer::job::{Merger, RenderSettings, Stop, run_unit};
use renderer::scene::Scene;
use statcheck::Estimate;
use std::sync::Mutex;
use std::sync::atomic::{AtomicU32, Ordering};

/// A finished render.
#[derive(Clone, Debug)]
pub struct Telling {
    /// The picture.
    pub image: MergedImage,
    /// Means of blocks over their pixels and channels, row by row.
    pub blocks: Vec<Estimate>,
    /// Samples (mutations) per pixel.
    pub samples: u32,
}

/// Renders a job, unit after unit, as `lightfarm render` does with threads.
pub fn render(scene: &Scene, settings: &RenderSettings, block: u32) -> Result<Telling, String> {
    let mut merger = Merger::new(settings.clone());
    loop {
        let plan = merger.plan().clone();
        for id in 0..plan.unit_count() {
            let unit = plan.unit(id).ok_or("a plan lacks one of its units")?;
            let result = run_unit(scene, settings, &plan, &unit, &Stop::new()).map_err(|e| e.to_string())?;
            merger.fold(id, &result).map_err(|e| e.to_string())?;
        }
        if merger.advance(false).is_none() {
            break;
        }
    }
    Ok(telling(&merger, block))
}

/// What a merger tells of its picture, with blocks of `block`^2 pixels.
pub fn telling(merger: &Merger, block: u32) -> Telling {
    let image = merger.image();
    let blocks = blocks(merger.groups(), [image.width, image.height], block);
    Telling { image, blocks, samples: merger.done_spp() }
}

/// `count` things made by `threads` threads, in their order.
pub fn many<T: Send>(
    threads: usize,
    count: u32,
    make: impl Fn(u32) -> Result<T, String> + Sync,
) -> Result<Vec<T>, String> {
    let (next, made) = (AtomicU32::new(0), Mutex::new(Vec::new()));
    std::thread::scope(|scope| {
        for _ in 0..threads.max(1) {
            scope.spawn(|| {
                loop {
                    let i = next.fetch_add(1, Ordering::Relaxed);
                    if i >= count {
                        break;
                    }
                    let thing = make(i);
                    made.lock().unwrap_or_else(|e| e.into_inner()).push((i, thing));
                }
            });
        }
    });
    let mut made = made.into_inner().unwrap_or_else(|e| e.into_inner());
    made.sort_by_key(|(i, _)| *i);
    made.into_iter().map(|(_, thing)| thing).collect()
}

/// The mean of every block of `side`^2 pixels and its error, from the scatter between the groups. The product tells such errors of
/// blocks of 16^2 pixels; a picture small enough to be rendered hundreds of times has too few of those.
fn blocks(groups: &[GroupFilm], [width, height]: [u32; 2], side: u32) -> Vec<Estimate> {
    let corners =
        (0..height).step_by(side as usize).flat_map(|y| (0..width).step_by(side as usize).map(move |x| (x, y)));
    let estimate = |(x0, y0): (u32, u32)| {
        let (x1, y1) = ((x0 + side).min(width), (y0 + side).min(height));
        let pixels = || (y0..y1).flat_map(|y| (x0..x1).map(move |x| (y * width + x) as usize));
        let of_group = |g: &GroupFilm| {
            let (mut sum, mut weight) = (0.0, 0.0);
            for (value, n) in pixels().map(|i| g.pixel(i)) {
                sum += value.iter().sum::<f64>() / 3.0;
                weight += n;
            }
            (sum / pixels().count() as f64, weight)
        };
        weighted(&groups.iter().map(of_group).collect::<Vec<_>>())
    };
    corners.map(estimate).collect()
}

/// The mean of groups (value, weight) with its variance: `sum n_g (x_g - x)^2 / ((G - 1) sum n_g)`.
fn weighted(groups: &[(f64, f64)]) -> Estimate {
    let dof = groups.len() as f64 - 1.0;
    let total: f64 = groups.iter().map(|g| g.1).sum();
    let mean = groups.iter().map(|(x, n)| n * x).sum::<f64>() / total;
    let squares: f64 = groups.iter().map(|(x, n)| n * (x - mean) * (x - mean)).sum();
    Estimate { mean, variance: squares / (dof * total), dof }
}
