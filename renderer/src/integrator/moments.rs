//! How much the samples of `path` would scatter, as bidirectional samples find it: a picture of the second moment of a sample's
//! contributions.
//!
//! A short render by `path` can't tell. Light that it finds by rare luck, such as a caustic, scatters the more the rarer it is, and a
//! picture that has not found it looks clean. Bidirectional samples find such paths by other strategies, and know with which density
//! `path` would have made them: the strategies s = 0 and s = 1 of Veach (1997, chapter 10) are its own. With `p` their density together
//! (the root of the sum of squares, as the power heuristic has it), the second moment is the integral of `f^2 / p`, estimated by all
//! strategies with their weights. Lengths of paths are taken one by one, so what the parts of one sample have in common is left out.

use super::bdpt::{Bidirectional, LIGHT_STREAM, Sink};
use super::{UnitContext, tile};
use crate::film::{Counters, Rect, SplatSums, TileSums};
use crate::path::Connection;
use crate::path::mis::Heuristic;
use crate::sampling::SobolSampler;
use crate::spectrum::Rgb;
use std::ops::Range;

/// Density of `path`'s strategies, over that of all together, below which it counts as this: it may be zero, and the moment infinite.
const LEAST: f64 = 1e-12;

/// A path that a sample has made.
#[derive(Clone, Copy)]
struct Made {
    strategy: (usize, usize),
    path: Connection,
}

/// Keeps all paths of a sample.
#[derive(Default)]
struct Paths(Vec<Made>);

impl Sink for Paths {
    fn add(&mut self, s: usize, t: usize, path: &Connection) {
        self.0.push(Made { strategy: (s, t), path: *path });
    }
}

/// Renders samples `samples` of each pixel of a tile, and what they splat; `None` when stopped.
pub fn render_tile(
    c: &UnitContext<'_>,
    rect: Rect,
    samples: Range<u32>,
    splats: &mut SplatSums,
    counters: &mut Counters,
) -> Option<TileSums> {
    counters.samples += rect.area() as u64 * u64::from(samples.end - samples.start);
    // The same samples twice: weighed among all strategies, and among all but those of `path`.
    let pixels = c.view.width as f32 * c.view.height as f32;
    let mut all = Bidirectional::new(c, Heuristic::Power);
    let mut beyond = Bidirectional::new(c, Heuristic::Beyond);
    let (mut of_all, mut of_beyond) = (Paths::default(), Paths::default());
    let tile = tile::render(c, rect, samples, |s| {
        let light = SobolSampler::new(c.seed, c.replicate, LIGHT_STREAM + s.pixel, s.index);
        of_all.0.clear();
        of_beyond.0.clear();
        all.sample(s.ray, &mut s.sampler.clone(), &mut light.clone(), &mut of_all);
        beyond.sample(s.ray, &mut s.sampler.clone(), &mut light.clone(), &mut of_beyond);
        let mut pixel = Rgb::ZERO;
        let mut others = of_beyond.0.iter();
        for made in &of_all.0 {
            // Both make the same paths in the same order; where one of them has a weight of zero, it is left out.
            let Some(other) = others.clone().position(|o| o.strategy == made.strategy) else { continue };
            let other = others.nth(other).map_or(1.0, |o| o.path.weight);
            let moment = moment(made, other);
            if !all.admit(moment) {
                continue;
            }
            match made.path.raster {
                None => pixel += moment,
                // Densities are those over the whole picture; `path` makes its samples in one pixel of it.
                Some(raster) => splats.splat(&c.view.filter, raster, moment * (1.0 / pixels)),
            }
        }
        pixel
    })?;
    counters.add(&all.counters());
    counters.add(&beyond.counters());
    Some(tile)
}

/// What a path contributes to the second moment. `beyond` is its strategy's weight when those of `path` are left out (beside itself).
fn moment(made: &Made, beyond: f64) -> Rgb {
    let (value, weight) = (made.path.value, made.path.weight);
    // (p_0^2 + p_1^2) / p_s^2
    let own = if made.strategy.0 < 2 { 1.0 } else { 0.0 };
    let density = (1.0 / weight - 1.0 / beyond + own).max(LEAST / weight);
    value * value * ((weight / density.sqrt()).min(f64::from(f32::MAX)) as f32)
}
