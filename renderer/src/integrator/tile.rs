use super::UnitContext;
use crate::film::{Aov, Filter, Rect, TileSums};
use crate::math::{Anchor, Ray, Vec2};
use crate::path::Scattering;
use crate::sampling::{Sampler, SobolSampler};
use crate::spectrum::Rgb;
use std::ops::Range;

/// A sample of a pixel, before anything is traced.
pub struct PixelSample<'a> {
    /// Number of the pixel, row by row.
    pub pixel: u64,
    /// Number of the sample.
    pub index: u32,
    /// The numbers after those of the camera ray.
    pub sampler: SobolSampler,
    /// The camera ray.
    pub ray: Ray,
    /// Where the first surface is noted, if it is wanted.
    pub aov: Option<&'a mut Aov>,
}

/// A tile while its samples are made.
///
/// A sample lies anywhere in its pixel and counts for every pixel whose filter covers it; a pixel is the weighted mean of what counts
/// for it. Its variance is that of a sample times the integral of the squared filter (4/9 for a tent, 1/pi for a Gaussian of standard
/// deviation 0.5) where drawing positions from the filter (Ernst, Stamminger and Greiner 2006, "Filter Importance Sampling") has all of
/// it. Weights do not depend on radiance, so that the expectation is a filtered image still.
pub struct Tile<'a> {
    c: &'a UnitContext<'a>,
    sums: Sums<'a>,
    /// Of all pixels, or of none.
    aovs: Vec<Aov>,
}

impl<'a> Tile<'a> {
    /// Without samples.
    pub fn new(c: &'a UnitContext<'a>, rect: Rect) -> Self {
        let sums = Sums::new(&c.view.filter, rect, (c.view.width, c.view.height));
        Self { c, sums, aovs: vec![Aov::default(); if c.replicate == 0 { rect.area() } else { 0 }] }
    }

    /// Begins sample `index` of pixel (x, y): where it is in the picture, and the rest.
    #[inline(always)]
    pub fn sample(&mut self, (x, y): (u32, u32), index: u32) -> (Vec2, PixelSample<'_>) {
        let (c, filter) = (self.c, self.sums.filter);
        let pixel = u64::from(y) * u64::from(c.view.width) + u64::from(x);
        let mut sampler = SobolSampler::new(c.seed, c.replicate, pixel, index);
        let u = sampler.next_2d();
        let raster = if filter.shares() { inside(x, y, u) } else { filter.sample(u, x, y) };
        let ray = c.camera_ray(&mut sampler, raster);
        let rect = &self.sums.rect;
        let aov = self.aovs.get_mut(((y - rect.y0) * rect.width() + x - rect.x0) as usize);
        (raster, PixelSample { pixel, index, sampler, ray, aov })
    }

    /// Adds what came of a sample of pixel (x, y).
    #[inline(always)]
    pub fn add(&mut self, (x, y): (u32, u32), raster: Vec2, value: Rgb) {
        if self.sums.filter.shares() {
            self.sums.spread(raster, value);
        } else {
            self.sums.add(x, y, 1.0, value);
        }
    }

    /// The sums of so many samples of each pixel.
    pub fn finish(self, samples: u32) -> TileSums {
        self.sums.finish(samples, self.aovs)
    }
}

/// Sums what `radiance` makes of samples `samples` of each pixel of a tile; `None` when stopped.
pub fn render(
    c: &UnitContext<'_>,
    rect: Rect,
    samples: Range<u32>,
    mut radiance: impl FnMut(PixelSample<'_>) -> Rgb,
) -> Option<TileSums> {
    let mut tile = Tile::new(c, rect);
    for (x, y) in rect.pixels() {
        if x == rect.x0 && (c.stopped)() {
            return None;
        }
        for index in samples.clone() {
            let (raster, sample) = tile.sample((x, y), index);
            let value = radiance(sample);
            tile.add((x, y), raster, value);
        }
    }
    Some(tile.finish(samples.end - samples.start))
}

/// A place in pixel (x, y); rounding must not lead into the next.
#[inline]
fn inside(x: u32, y: u32, u: Vec2) -> Vec2 {
    let (x, y) = (x as f32, y as f32);
    Vec2::new((x + u.x).min((x + 1.0).next_down()), (y + u.y).min((y + 1.0).next_down()))
}

/// What the samples of a tile add up to in the pixels for which they count.
struct Sums<'a> {
    filter: &'a Filter,
    rect: Rect,
    covered: Rect,
    /// Sums of weighted radiance and of weights over `covered`.
    sums: Vec<[f64; 4]>,
}

impl<'a> Sums<'a> {
    fn new(filter: &'a Filter, rect: Rect, (width, height): (u32, u32)) -> Self {
        let covered = rect.grown(filter.reach(), width, height);
        Self { filter, rect, covered, sums: vec![[0.0; 4]; covered.area()] }
    }

    /// Adds a sample to all pixels whose filter covers it.
    #[inline]
    fn spread(&mut self, raster: Vec2, value: Rgb) {
        let value = value.to_array().map(f64::from);
        let footprint = self.filter.weights(raster);
        for (x, y, wy, columns) in footprint.rows() {
            let place = self.place(x, y);
            for (to, wx) in self.sums[place..place + columns.len()].iter_mut().zip(columns) {
                add(to, wx * wy, value);
            }
        }
    }

    #[inline]
    fn add(&mut self, x: u32, y: u32, weight: f32, value: Rgb) {
        let place = self.place(x, y);
        add(&mut self.sums[place], weight, value.to_array().map(f64::from));
    }

    /// Where a pixel's sums are.
    #[inline]
    fn place(&self, x: u32, y: u32) -> usize {
        ((y - self.covered.y0) * self.covered.width() + x - self.covered.x0) as usize
    }

    fn finish(self, samples: u32, aovs: Vec<Aov>) -> TileSums {
        let weights = self.sums.iter().map(|s| s[3] as f32).collect();
        let sums = self.sums.iter().map(|s| Rgb::new(s[0] as f32, s[1] as f32, s[2] as f32)).collect();
        TileSums { rect: self.rect, covered: self.covered, samples, sums, weights, aovs }
    }
}

/// Adds a weighted value and its weight.
#[inline]
fn add(to: &mut [f64; 4], weight: f32, [r, g, b]: [f64; 3]) {
    let weight = f64::from(weight);
    to[0] += weight * r;
    to[1] += weight * g;
    to[2] += weight * b;
    to[3] += weight;
}

/// What the first vertex of a path, at `at`, shows in the auxiliary images of a camera at `lens`.
pub fn shown(scattering: &Scattering, lens: &Anchor, at: &Anchor) -> Aov {
    Aov {
        albedo: scattering.albedo().to_array(),
        normal: scattering.normal().to_array(),
        depth: (at.p - lens.p).length(),
        hits: 1.0,
    }
}
