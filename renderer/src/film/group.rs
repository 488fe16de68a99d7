use super::{SplatSums, TileGrid, TileSums, TiledFilm};

/// The film of one replicate group: a complete, independent estimate of the image.
///
/// Open, it holds f64 sums (36 bytes a pixel of tiles, 24 of splats, 60 of both); closed, the mean in f32 (12 bytes a pixel). Where
/// samples are the budget, few groups are open at a time; where time or error is, all are.
#[derive(Clone, Debug, PartialEq)]
pub enum GroupFilm {
    /// No sample yet.
    Empty,
    /// Still growing.
    Open {
        /// Sums of tile samples, already in units of radiance times samples.
        sums: Vec<[f64; 3]>,
        /// Sums of their weights.
        weights: Vec<f64>,
        /// Tile samples that were taken of each pixel.
        samples: Vec<u32>,
        /// Sums of splats.
        splats: Vec<[f64; 3]>,
        /// What a splat sum is divided by: light paths, or the weight of the passes of chains.
        splat_weight: f64,
        /// Without splats the group is not complete, and counts for nothing.
        awaits_splats: bool,
    },
    /// Still growing, with more samples of some tiles than of others.
    Tiled(TiledFilm),
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
            *self = Self::Open {
                sums: Vec::new(),
                weights: Vec::new(),
                samples: Vec::new(),
                splats: Vec::new(),
                splat_weight: 0.0,
                awaits_splats: false,
            };
        }
        if let Self::Open { sums, weights, samples, splats, .. } = self {
            if tiles && sums.is_empty() {
                *sums = vec![[0.0; 3]; pixels];
                *weights = vec![0.0; pixels];
                *samples = vec![0; pixels];
            }
            if splat && splats.is_empty() {
                *splats = vec![[0.0; 3]; pixels];
            }
        }
    }

    /// Adds a tile, for which `rays` rays were traced; the tile must lie on the film of `width * height` pixels.
    pub fn add_tile(&mut self, width: u32, height: u32, tile: &TileSums, rays: u64) {
        if let Self::Tiled(film) = self {
            return film.add(tile, rays);
        }
        self.open(width as usize * height as usize, true, false);
        let Self::Open { sums, weights, samples, .. } = self else { return };
        for (((x, y), v), w) in tile.covered.pixels().zip(&tile.sums).zip(&tile.weights) {
            let i = y as usize * width as usize + x as usize;
            for (to, from) in sums[i].iter_mut().zip(v.to_array()) {
                *to += f64::from(from);
            }
            weights[i] += f64::from(*w);
        }
        for (x, y) in tile.rect.pixels() {
            samples[y as usize * width as usize + x as usize] += tile.samples;
        }
    }

    /// Adds splats made by `paths` light paths over the whole film: the image is their sum over `paths`.
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
        *splat_weight += paths as f64;
    }

    /// From now on the group counts for nothing until [`GroupFilm::add_chains`] completes it.
    pub fn await_chains(&mut self, pixels: usize) {
        self.open(pixels, true, true);
        if let Self::Open { awaits_splats, .. } = self {
            *awaits_splats = true;
        }
    }

    /// Adds a complete estimate of what chains carry, with its weight among those of other passes.
    pub fn add_chains(&mut self, radiance: &[[f64; 3]], pixels: usize, weight: f64) {
        self.open(pixels, true, true);
        let Self::Open { splats, splat_weight, awaits_splats, .. } = self else { return };
        for (to, from) in splats.iter_mut().zip(radiance) {
            for c in 0..3 {
                to[c] += weight * from[c];
            }
        }
        *splat_weight += weight;
        *awaits_splats = false;
    }

    /// Puts a picture in place of what chains made: for previews.
    pub fn replace_chains(&mut self, radiance: &[[f64; 3]], pixels: usize) {
        self.open(pixels, true, true);
        if let Self::Open { splats, splat_weight, awaits_splats, .. } = self {
            splats.clear();
            splats.extend_from_slice(radiance);
            splats.resize(pixels, [0.0; 3]);
            (*splat_weight, *awaits_splats) = (1.0, false);
        }
    }

    /// The mean of pixel `i` and its weight among the groups (samples, or light paths per pixel; where samples go by what was found, 1
    /// for all); weight 0 where nothing was sampled.
    pub fn pixel(&self, i: usize) -> ([f64; 3], f64) {
        match self {
            Self::Empty => ([0.0; 3], 0.0),
            Self::Closed { mean, weight } => (mean[i].map(f64::from), *weight),
            Self::Tiled(film) => film.pixel(i).map_or(([0.0; 3], 0.0), |mean| (mean, 1.0)),
            Self::Open { awaits_splats: true, .. } => ([0.0; 3], 0.0),
            Self::Open { sums, weights, samples, splats, splat_weight, .. } => {
                let n = samples.get(i).copied().map_or(0.0, f64::from);
                let mut mean = [0.0; 3];
                if n > 0.0 && weights[i] > 0.0 {
                    mean = sums[i].map(|v| v / weights[i]);
                }
                if *splat_weight > 0.0 {
                    for c in 0..3 {
                        mean[c] += splats[i][c] / splat_weight;
                    }
                }
                // Where tiles and splats sample the same image together, the tile's count leads.
                (mean, if samples.is_empty() { splat_weight / splats.len() as f64 } else { n })
            }
        }
    }

    /// Samples of pixel `i` (or light paths per pixel).
    pub fn samples(&self, i: usize) -> f64 {
        if let Self::Tiled(film) = self { f64::from(film.samples_of(i)) } else { self.pixel(i).1 }
    }

    /// What splats contribute to the mean of pixel `i`, while the group is open.
    pub fn splats(&self, i: usize) -> [f64; 3] {
        match self {
            Self::Open { splats, splat_weight, .. } if *splat_weight > 0.0 => splats[i].map(|v| v / splat_weight),
            _ => [0.0; 3],
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

/// Groups as bytes, for a merge that goes on later (`job::Merger::save`).
impl GroupFilm {
    /// Appends the group.
    pub fn save(&self, out: &mut Vec<u8>) {
        fn array<T: bytemuck::NoUninit>(out: &mut Vec<u8>, v: &[T]) {
            out.extend((v.len() as u64).to_le_bytes());
            out.extend_from_slice(bytemuck::cast_slice(v));
        }
        match self {
            Self::Empty => out.push(0),
            Self::Open { sums, weights, samples, splats, splat_weight, awaits_splats } => {
                out.push(1);
                array(out, sums);
                array(out, weights);
                array(out, samples);
                array(out, splats);
                out.extend(splat_weight.to_le_bytes());
                out.push(u8::from(*awaits_splats));
            }
            Self::Closed { mean, weight } => {
                out.push(2);
                array(out, mean);
                out.extend(weight.to_le_bytes());
            }
            Self::Tiled(film) => {
                let (reach, samples, rays, sums) = film.parts();
                out.push(3);
                out.extend(reach.to_le_bytes());
                array(out, samples);
                array(out, rays);
                array(out, sums);
            }
        }
    }

    /// Takes a group of a film of `width * height` pixels off the front of `bytes`; `None` when they are not one.
    pub fn load(bytes: &mut &[u8], width: u32, height: u32) -> Option<Self> {
        let pixels = width as usize * height as usize;
        fn take<'a>(bytes: &mut &'a [u8], n: usize) -> Option<&'a [u8]> {
            let (head, tail) = bytes.split_at_checked(n)?;
            *bytes = tail;
            Some(head)
        }
        fn word(bytes: &mut &[u8]) -> Option<u64> {
            take(bytes, 8)?.try_into().ok().map(u64::from_le_bytes)
        }
        fn array<T: bytemuck::AnyBitPattern>(bytes: &mut &[u8], fits: impl Fn(usize) -> bool) -> Option<Vec<T>> {
            let n = usize::try_from(word(bytes)?).ok().filter(|n| fits(*n))?;
            let raw = take(bytes, n.checked_mul(size_of::<T>())?)?;
            Some(raw.chunks_exact(size_of::<T>()).map(bytemuck::pod_read_unaligned).collect())
        }
        let film = |n: usize| n == 0 || n == pixels;
        Some(match take(bytes, 1)? {
            [0] => Self::Empty,
            [1] => Self::Open {
                sums: array(bytes, film)?,
                weights: array(bytes, film)?,
                samples: array(bytes, film)?,
                splats: array(bytes, film)?,
                splat_weight: f64::from_bits(word(bytes)?),
                awaits_splats: take(bytes, 1)? == [1],
            },
            [2] => Self::Closed {
                mean: array(bytes, film).filter(|m: &Vec<_>| m.len() == pixels)?,
                weight: f64::from_bits(word(bytes)?),
            },
            [3] => {
                let reach = take(bytes, 4)?.try_into().ok().map(u32::from_le_bytes)?;
                let grid = TileGrid::of_film(width, height);
                let tiles = |n: usize| n == grid.tiles() as usize;
                let (samples, rays) = (array(bytes, tiles)?, array(bytes, tiles)?);
                // The sums are checked with the grid, and the bytes are there or not.
                Self::Tiled(TiledFilm::from_parts(grid, reach, samples, rays, array(bytes, |_| true)?)?)
            }
            _ => return None,
        })
    }
}
