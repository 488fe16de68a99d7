//! Paths of neighbouring pixels share their second vertices (Bekaert, Sbert and Halton 2002, "Accelerating Path Tracing by Re-Using
//! Paths").
//!
//! What a path finds beyond its first two vertices is light that its second vertex reflects. Most first vertices of the pixels around
//! see that point too, and to join them takes one shadow ray, where a path of their own takes several rays. In a block of n pixels each
//! so has n estimates in place of one, weighted by the balance heuristic: with `p_k(y)` the density per area with which the path of
//! pixel k finds the point y as its second vertex, y counts for pixel i with `f_i(y) / sum_k p_k(y)`, where the sum is over all that
//! can find it, and `f_i` is what takes the radiance of y to the picture. As visibility is known for all of them, the weights add up to
//! one wherever y is.
//!
//! Shared are points that reflect broadly: diffuse surfaces, whose radiance is the same for all who see that side of them, and
//! diffuse ones with a rough coat, for whom it is what the two directions from which light was found to come give towards each.
//!
//! What it gains depends on how much of a pixel's variance is that of shared light, and on what the joins cost: [`Gauge`] measures both
//! while a tile is rendered, and chooses the blocks for what follows. So the samples of a pixel are made by one estimator or another
//! according to what was found *before*; each has the same expectation, whatever that was, and all count alike: no bias.

mod joints;
mod kept;

use super::gauge::{Choice, Gauge, Seen};
use super::path::Walk;
use super::tile::Tile;
use super::{Carried, Lessons, UnitContext};
use crate::bsdf::Material;
use crate::film::{Counters, Rect, TileSums};
use crate::light::LightLessons;
use crate::math::Vec2;
use crate::spectrum::Rgb;
use joints::Joints;
pub(super) use kept::Kept;
use std::ops::Range;

/// Whether pixels may have anything to share.
fn shares(c: &UnitContext<'_>) -> bool {
    let reflects = |m: &Material| matches!(m, Material::Lambert { .. } | Material::Gltf { .. });
    c.max_depth > 2 && c.carried == Carried::ALL && c.scene.materials.iter().any(reflects)
}

/// Whether there may be anything to share, or lights of which to take several samples.
pub(super) fn is_of_use(c: &UnitContext<'_>) -> bool {
    let splits = || c.max_depth > 1 && c.carried.has(2) && !c.selector.is_empty();
    c.share && (shares(c) || splits())
}

/// Renders samples `samples` of each pixel of a tile of a scene without media; `None` when stopped.
pub(super) fn render(
    c: &UnitContext<'_>,
    rect: Rect,
    samples: Range<u32>,
    lessons: &mut Lessons,
    counters: &mut Counters,
) -> Option<TileSums> {
    let mut tile = Tile::new(c, rect);
    let lights = &mut lessons.lights;
    let mut block = Block { c, lessons: lights, counters, lights: 1, pixels: Vec::new(), joints: Joints::default() };
    let mut gauge = Gauge::new(&c.view.filter, rect, samples.start, shares(c), c.begin);
    for index in samples.clone() {
        let mut y = rect.y0;
        while y < rect.y1 {
            if (c.stopped)() {
                return None;
            }
            let Choice { side, lights } = gauge.choose(y, index);
            block.lights = lights;
            let y1 = if side == 1 {
                let y1 = gauge.strip_end(y);
                block.render_alone(&mut tile, Rect { y0: y, y1, ..rect }, index, &mut gauge);
                y1
            } else {
                let band = gauge.band_end(y);
                let y1 = y + cut(band - y, side, gauge.begins_band(y).then_some(index * 5 + 3));
                let mut x = rect.x0;
                while x < rect.x1 {
                    let x1 = x + cut(rect.x1 - x, side, (x == rect.x0).then_some(index));
                    block.render(&mut tile, Rect { x0: x, y0: y, x1, y1 }, index, &mut gauge);
                    x = x1;
                }
                y1
            };
            y = y1;
        }
    }
    lessons.sharing = gauge.lesson().checked();
    Some(tile.finish(samples.end - samples.start))
}

/// The length of the first of the blocks of about `side` into which `length` pixels are cut: as long as the others, so that none of them
/// has few pixels to share with, or, by `jitter`, up to a quarter more or less: borders between blocks would show if they did not move.
fn cut(length: u32, side: u32, jitter: Option<u32>) -> u32 {
    const EIGHTHS: [i32; 8] = [0, 4, -2, 2, -4, 1, 3, -3];
    let count = ((length + side / 2) / side).max(1);
    let more = jitter.map_or(0, |j| EIGHTHS[j as usize % 8]);
    // In sixteenths of a block, rounded.
    let count = i64::from(count);
    let cut = ((i64::from(length) * i64::from(16 + more) + 8 * count) / (16 * count)) as u32;
    if count == 1 { length } else { cut.clamp(1, length) }
}

/// A sample of a pixel.
#[derive(Default)]
struct Pixel {
    place: (u32, u32),
    raster: Vec2,
    kept: Kept,
    /// What comes of it.
    value: Rgb,
}

/// The samples of a block.
struct Block<'a, 'b> {
    c: &'a UnitContext<'a>,
    lessons: &'b mut LightLessons,
    counters: &'b mut Counters,
    /// How many samples of lights first vertices take.
    lights: u32,
    pixels: Vec<Pixel>,
    joints: Joints,
}

impl Block<'_, '_> {
    /// A sample of each pixel of a block, shared.
    fn render(&mut self, tile: &mut Tile<'_>, rect: Rect, index: u32, gauge: &mut Gauge) {
        // Trace each pixel's path.
        let mut pixels = std::mem::take(&mut self.pixels);
        pixels.resize_with(rect.area(), Pixel::default);
        for (place, pixel) in rect.pixels().zip(&mut pixels) {
            let (raster, seen) = self.trace(tile, place, index, &mut pixel.kept, gauge);
            (pixel.place, pixel.raster, pixel.value) = (place, raster, seen.own);
        }

        // Share what the second vertices reflect.
        self.joints.begin(&pixels);
        for j in 0..pixels.len() {
            self.joints.share(&self.c.scene.accel, &mut pixels, j, self.counters);
        }
        for pixel in &pixels {
            tile.add(pixel.place, pixel.raster, pixel.value);
        }
        self.pixels = pixels;
    }

    /// Samples of a strip that share nothing.
    fn render_alone(&mut self, tile: &mut Tile<'_>, rect: Rect, index: u32, gauge: &mut Gauge) {
        let mut kept = Kept::default();
        let watched = gauge.watches(rect.y0, index);
        for place in rect.pixels() {
            let (raster, value) = if watched {
                let (raster, seen) = self.trace(tile, place, index, &mut kept, gauge);
                (raster, seen.own + seen.reflected)
            } else {
                let (raster, s) = tile.sample(place, index);
                let (c, lessons, counters, kept) = (self.c, &mut *self.lessons, &mut *self.counters, &mut kept);
                let (sampler, aov, lights) = (s.sampler, s.aov, self.lights);
                let mut walk = Walk::<false, false> { c, lessons, counters, sampler, aov, lights, kept };
                (raster, walk.radiance(s.ray))
            };
            tile.add(place, raster, value);
        }
    }

    /// A path that keeps what it may share, and is watched if it is one of those that are.
    fn trace(
        &mut self,
        tile: &mut Tile<'_>,
        place: (u32, u32),
        index: u32,
        kept: &mut Kept,
        gauge: &mut Gauge,
    ) -> (Vec2, Seen) {
        let rays = self.counters.rays;
        let (raster, s) = tile.sample(place, index);
        let (c, lessons, counters) = (self.c, &mut *self.lessons, &mut *self.counters);
        let (sampler, aov, lights) = (s.sampler, s.aov, gauge.lights(place.1, index, self.lights));
        let mut walk = Walk::<false, true> { c, lessons, counters, sampler, aov, lights, kept: &mut *kept };
        let own = walk.radiance(s.ray);
        let reflected = kept.unshared();
        let reflected = if self.counters.admit(reflected) { reflected } else { Rgb::ZERO };
        let seen = Seen::new(kept, own, reflected, self.counters.rays - rays);
        gauge.see(place, index, seen);
        (raster, seen)
    }
}

#[cfg(test)]
mod tests {
    use super::cut;

    #[test]
    fn blocks_are_about_as_long_as_they_should_be() {
        for length in 1..80u32 {
            for side in 2..=8 {
                for jitter in 0..16 {
                    let (mut left, mut first, mut blocks) = (length, true, Vec::new());
                    while left > 0 {
                        blocks.push(cut(left, side, first.then_some(jitter)));
                        (left, first) = (left - blocks[blocks.len() - 1], false);
                    }
                    assert_eq!(blocks.iter().sum::<u32>(), length);
                    let about = |b: &u32| 2 * b >= side.min(length) && 2 * b <= 3 * side + 2;
                    assert!(blocks.iter().all(about), "{length} in blocks of {side}, {jitter}: {blocks:?}");
                }
            }
        }
        // Borders move.
        let borders: std::collections::BTreeSet<u32> = (0..8).map(|i| cut(64, 8, Some(i))).collect();
        assert!(borders.len() >= 4, "{borders:?}");
    }
}
