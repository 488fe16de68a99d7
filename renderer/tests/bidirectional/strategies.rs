use crate::common::t999;
use crate::scenes;
use renderer::integrator::bdpt::{Bidirectional, Sink};
use renderer::integrator::{UnitContext, View};
use renderer::path::Connection;
use renderer::path::mis::Heuristic;
use renderer::sampling::{IndependentSampler, Sampler};
use renderer::scene::desc::FilterDesc;
use std::collections::BTreeMap;

const SIDE: u32 = 16;
const GROUPS: u32 = 16;
const SAMPLES: u64 = 60_000;

/// Sums of each strategy over the picture, without and with weights.
#[derive(Default)]
struct Sums(BTreeMap<(usize, usize), [f64; 2]>);

impl Sink for Sums {
    fn add(&mut self, s: usize, t: usize, path: &Connection) {
        // A walk from the light stands for all pixels, one from the camera for its own.
        let inside = |r: renderer::math::Vec2| r.min_element() >= 0.0 && r.max_element() < SIDE as f32;
        let share = match path.raster {
            Some(raster) if inside(raster) => 1.0 / f64::from(SIDE * SIDE),
            Some(_) => return,
            None => 1.0,
        };
        let value = share * f64::from(path.value.luminance());
        let sums = self.0.entry((s, t)).or_default();
        sums[0] += value;
        sums[1] += value * path.weight;
    }
}

/// Mean and standard error over groups.
fn estimate(values: &[f64]) -> (f64, f64) {
    let n = values.len() as f64;
    let mean = values.iter().sum::<f64>() / n;
    let var = values.iter().map(|v| (v - mean) * (v - mean)).sum::<f64>() / (n * (n - 1.0));
    (mean, var.sqrt())
}

/// In a diffuse closed room every strategy sees every path, so each makes the whole picture of its length without any weight, and with
/// weights all together make it once.
#[test]
fn strategies_without_weights_agree_with_each_other_and_with_their_weighted_sum() {
    let scene = scenes::diffuse();
    let view = View::new(&scene, SIDE, SIDE, FilterDesc::Box { radius: 0.5 }).unwrap();
    let context = UnitContext::of_all_paths(&scene, &view, 5);
    let groups: Vec<Sums> = (0..u64::from(GROUPS))
        .map(|group| {
            let mut sums = Sums::default();
            let mut bdpt = Bidirectional::new(&context, Heuristic::Power);
            for index in 0..SAMPLES {
                let mut camera = IndependentSampler::new([61, group, index]);
                let mut light = IndependentSampler::new([62, group, index]);
                let ray = view.camera.generate_ray(camera.next_2d() * SIDE as f32, renderer::math::Vec2::ZERO);
                bdpt.sample(ray, &mut camera, &mut light, &mut sums);
            }
            sums
        })
        .collect();
    for edges in 2..=5usize {
        let of = |s: usize, k: usize| {
            let values: Vec<f64> =
                groups.iter().map(|g| g.0.get(&(s, edges + 1 - s)).map_or(0.0, |v| v[k] / SAMPLES as f64)).collect();
            values
        };
        let mut whole = vec![0.0; GROUPS as usize];
        for s in 0..=edges {
            whole.iter_mut().zip(of(s, 1)).for_each(|(to, from)| *to += from);
        }
        let (truth, truth_se) = estimate(&whole);
        for s in 0..=edges {
            let (mean, se) = estimate(&of(s, 0));
            let half = t999(GROUPS) * (se * se + truth_se * truth_se).sqrt();
            let what = format!("({s}, {}): {mean}, weighted sum {truth}, +- {half}", edges + 1 - s);
            assert!(half < 0.1 * truth, "too wide to tell: {what}");
            assert!((mean - truth).abs() < half, "{what}");
        }
    }
}
