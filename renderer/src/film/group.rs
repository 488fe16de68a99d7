use super::{SplatSums, TileSums};

/// The film of one replicate group: a complete, independent estimate of the image.
///
/// Open, it holds f64 sums (28 bytes a pixel); closed, the mean in f32 (12 bytes a pixel).
#[derive(Clone, Debug, PartialEq)]
pub enum GroupFilm {
    /// No sample yet.
    Empty,
    /// Still growing.
    Open {
        /// Sums of tile samples, already in units of radiance times samples.
        sums: Vec<[f64; 3]>,
        /// Tile samples of each pixel.
        samples: Vec<u32>,
        /// Sums of splats.
        splats: Vec<[f64; 3]>,
        /// Light paths behind `splats`, over the number of pixels: what a splat sum is divided by.
        splat_weight: f64,
    },
    /// Complete.
    Closed {
        /// Mean radiance.
        mean: Vec<[f32; 3]>,
        /// Samples per pixel (or light paths per pixel).
        weight: f64,
    },
}

impl GroupFilm {
    fn open(&mut self, pixels: usize, tiles: bool, splat: bool) {
        if matches!(self, Self::Empty) {
            *self = Self::Open { sums: Vec::new(), samples: Vec::new(), splats: Vec::new(), splat_weight: 0.0 };
        }
        if let Self::Open { sums, samples, splats, .. } = self {
            if tiles && sums.is_empty() {
                *sums = vec![[0.0; 3]; pixels];
                *samples = vec![0; pixels];
            }
            if splat && splats.is_empty() {
                *splats = vec![[0.0; 3]; pixels];
            }
        }
    }

    /// Adds a tile; the tile must lie on the film of `width * height` pixels.
    pub fn add_tile(&mut self, width: u32, height: u32, tile: &TileSums) {
        self.open(width as usize * height as usize, true, false);
        let Self::Open { sums, samples, .. } = self else { return };
        for ((x, y), v) in tile.rect.pixels().zip(&tile.sums) {
            let i = y as usize * width as usize + x as usize;
            for (to, from) in sums[i].iter_mut().zip(v.to_array()) {
                *to += f64::from(from);
            }
            samples[i] += tile.samples;
        }
    }

    /// Adds splats made by `paths` light paths over the whole film.
    pub fn add_splats(&mut self, layer: &SplatSums, paths: u64) {
        let (width, height) = layer.size();
        let pixels = width as usize * height as usize;
        self.open(pixels, false, true);
        let Self::Open { splats, splat_weight, .. } = self else { return };
        for (x, y, v) in layer.pixels() {
            let to = &mut splats[y as usize * width as usize + x as usize];
            for c in 0..3 {
                to[c] += v[c];
            }
        }
        *splat_weight += paths as f64 / pixels as f64;
    }

    /// The mean of pixel `i` and its weight (samples, or light paths per pixel); weight 0 where nothing was sampled.
    pub fn pixel(&self, i: usize) -> ([f64; 3], f64) {
        match self {
            Self::Empty => ([0.0; 3], 0.0),
            Self::Closed { mean, weight } => (mean[i].map(f64::from), *weight),
            Self::Open { sums, samples, splats, splat_weight } => {
                let n = samples.get(i).copied().map_or(0.0, f64::from);
                let mut mean = [0.0; 3];
                if n > 0.0 {
                    mean = sums[i].map(|v| v / n);
                }
                if *splat_weight > 0.0 {
                    for c in 0..3 {
                        mean[c] += splats[i][c] / splat_weight;
                    }
                }
                // Tiles and splats of one job sample the same image together; the tile's count leads where there are tiles.
                (mean, if samples.is_empty() { *splat_weight } else { n })
            }
        }
    }

    /// Rounds the means to f32 and forgets the sums. Only for a group that gets no more samples.
    pub fn close(&mut self, pixels: usize) {
        if let Self::Open { .. } = self {
            let weight = self.pixel(0).1;
            let mean = (0..pixels).map(|i| self.pixel(i).0.map(|v| v as f32)).collect();
            *self = Self::Closed { mean, weight };
        }
    }
}
