//! The picture of every strategy of bidirectional path tracing, with and without its weight: a debugging aid (Veach 1997, figure 10.2;
//! Pharr, Jakob, Humphreys 2023, section 16.3.5 of the online edition).

use super::UnitContext;
use super::bdpt::{Bidirectional, Sink};
use crate::path::Connection;
use crate::path::mis::Heuristic;
use crate::sampling::{Sampler, SobolSampler, hash_words};
use std::ops::Range;

/// Edges of the longest path that is told apart.
pub const MAX_EDGES: u32 = 8;

/// One picture for each strategy (s, t) of paths of 2 to `edges` edges.
#[derive(Clone, Debug)]
pub struct Strategies {
    /// Width of each picture in pixels.
    pub width: u32,
    /// Height of each.
    pub height: u32,
    /// Edges of the longest path.
    pub edges: u32,
    /// Sums by strategy and pixel, unweighted and weighted; see [`Strategies::place`].
    films: Vec<[[f32; 3]; 2]>,
    samples: u32,
}

impl Strategies {
    fn new(c: &UnitContext<'_>, edges: u32) -> Self {
        let (width, height) = (c.view.width, c.view.height);
        let pictures = Self::place(edges as usize, edges as usize) + 1;
        let films = vec![[[0.0; 3]; 2]; pictures * width as usize * height as usize];
        Self { width, height, edges, films, samples: 0 }
    }

    /// Number of the strategy with s vertices from the light among those of paths of 2 edges and more.
    fn place(edges: usize, s: usize) -> usize {
        // Paths of k edges have k + 1 strategies, those before them 3 + 4 + ... + k.
        edges * (edges + 1) / 2 - 3 + s
    }

    /// Renders samples `samples` of each pixel; `None` when stopped.
    pub fn render(c: &UnitContext<'_>, samples: Range<u32>) -> Option<Self> {
        let mut sums = Self::new(c, c.max_depth.clamp(2, MAX_EDGES));
        let mut bdpt = Bidirectional::new(c, Heuristic::Power);
        for y in 0..sums.height {
            for x in 0..sums.width {
                if x == 0 && (c.stopped)() {
                    return None;
                }
                let pixel = u64::from(y) * u64::from(sums.width) + u64::from(x);
                for index in samples.clone() {
                    let mut camera = SobolSampler::new(c.seed, c.replicate, pixel, index);
                    let mut light = SobolSampler::new(c.seed, c.replicate, hash_words(&[pixel]), index);
                    let raster = c.view.filter.sample(camera.next_2d(), x, y);
                    let ray = c.camera_ray(&mut camera, raster);
                    bdpt.sample(ray, &mut camera, &mut light, &mut Film { c, sums: &mut sums, at: pixel as usize });
                }
            }
        }
        sums.samples = samples.end - samples.start;
        Some(sums)
    }

    /// Adds other samples of the same pictures.
    pub fn add(&mut self, o: &Self) {
        for (to, from) in self.films.iter_mut().flatten().flatten().zip(o.films.iter().flatten().flatten()) {
            *to += from;
        }
        self.samples += o.samples;
    }

    /// All pictures in one: a row for each length, a column for each s, from 0 at the left. Width, height and pixels.
    pub fn pyramid(&self, weighted: bool) -> (u32, u32, Vec<[f32; 3]>) {
        let (across, down) = (self.edges + 1, self.edges - 1);
        let (width, height) = (across * self.width, down * self.height);
        let mut pixels = vec![[0.0; 3]; width as usize * height as usize];
        let area = self.width as usize * self.height as usize;
        let scale = 1.0 / self.samples.max(1) as f32;
        for edges in 2..=self.edges as usize {
            for s in 0..=edges {
                let film = &self.films[Self::place(edges, s) * area..][..area];
                for (row, line) in film.chunks_exact(self.width as usize).enumerate() {
                    let y = (edges - 2) * self.height as usize + row;
                    let to = &mut pixels[y * width as usize + s * self.width as usize..][..line.len()];
                    to.iter_mut().zip(line).for_each(|(to, from)| *to = from[usize::from(weighted)].map(|v| v * scale));
                }
            }
        }
        (width, height, pixels)
    }
}

/// Sorts the paths of one sample into the pictures.
struct Film<'a, 'b> {
    c: &'a UnitContext<'a>,
    sums: &'b mut Strategies,
    /// The sample's pixel.
    at: usize,
}

impl Film<'_, '_> {
    fn put(&mut self, picture: usize, pixel: usize, path: &Connection, share: f32) {
        let area = self.sums.width as usize * self.sums.height as usize;
        let to = &mut self.sums.films[picture * area + pixel];
        for (to, value) in to.iter_mut().zip([path.value, path.weighted()]) {
            to.iter_mut().zip((value * share).to_array()).for_each(|(to, v)| *to += v);
        }
    }
}

impl Sink for Film<'_, '_> {
    fn add(&mut self, s: usize, t: usize, path: &Connection) {
        let edges = s + t - 1;
        if edges < 2 || edges > self.sums.edges as usize {
            return;
        }
        let picture = Strategies::place(edges, s);
        let Some(raster) = path.raster else { return self.put(picture, self.at, path, 1.0) };
        // As many walks start at lights as pixels have samples together.
        let (width, area) = (self.sums.width, (self.sums.width * self.sums.height) as f32);
        for (x, y, h) in self.c.view.filter.weights(raster).iter() {
            self.put(picture, (y * width + x) as usize, path, h / area);
        }
    }
}
