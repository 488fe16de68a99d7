use super::{Rect, TileSums};
use serde::{Deserialize, Serialize};

/// The least side of a tile of [`TileGrid`].
const LEAST_SIDE: u32 = 32;
/// Tiles that a film is cut into at most.
const MOST_TILES: u64 = 1024;

/// A film cut into square tiles of one size, numbered row by row.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct TileGrid {
    width: u32,
    height: u32,
    side: u32,
}

impl TileGrid {
    /// Of a film of `width * height` pixels: at most 1024 tiles, of 32 pixels a side or more.
    pub fn of_film(width: u32, height: u32) -> Self {
        let grid = |side| Self { width, height, side };
        let sides = std::iter::successors(Some(LEAST_SIDE), |s| s.checked_mul(2));
        let fits = |g: &Self| u64::from(g.across()) * u64::from(height.div_ceil(g.side)) <= MOST_TILES;
        sides.map(grid).find(fits).unwrap_or(grid(width.max(height).max(1)))
    }

    /// Width of the film in pixels.
    pub fn width(&self) -> u32 {
        self.width
    }

    /// Number of tiles.
    pub fn tiles(&self) -> u32 {
        self.across() * self.height.div_ceil(self.side)
    }

    fn across(&self) -> u32 {
        self.width.div_ceil(self.side)
    }

    /// The tile that pixel (x, y) is in.
    pub fn tile_at(&self, x: u32, y: u32) -> u32 {
        y / self.side * self.across() + x / self.side
    }

    /// The pixels of a tile.
    pub fn rect(&self, tile: u32) -> Rect {
        let (x0, y0) = (tile % self.across() * self.side, tile / self.across() * self.side);
        Rect { x0, y0, x1: (x0 + self.side).min(self.width), y1: (y0 + self.side).min(self.height) }
    }
}

/// Sums of ordinary samples of one replicate group, of which each tile has as many as it needs.
///
/// A sample counts for the pixels around its tile too, so that the sums of each tile are kept apart: a pixel is a ratio of sums over the
/// tiles that reach it, each divided by the samples of a pixel of that tile. That keeps the weights those of the filter, whatever the
/// samples. 32 bytes a pixel, and some more for the seams.
#[derive(Clone, Debug, PartialEq)]
pub struct TiledFilm {
    grid: TileGrid,
    reach: u32,
    /// Of each tile: samples of a pixel that were taken.
    samples: Vec<u32>,
    /// Of each tile: rays that they took.
    rays: Vec<u64>,
    /// Of each tile: sums of weighted radiance and of weights over the square of the tile and what it reaches, row by row.
    sums: Vec<[f64; 4]>,
}

impl TiledFilm {
    /// Without samples; those of a tile count for pixels as far as `reach` around it.
    pub fn new(grid: TileGrid, reach: u32) -> Self {
        let tiles = grid.tiles() as usize;
        let side = (grid.side + 2 * reach) as usize;
        Self { grid, reach, samples: vec![0; tiles], rays: vec![0; tiles], sums: vec![[0.0; 4]; tiles * side * side] }
    }

    /// The tiles.
    pub fn grid(&self) -> &TileGrid {
        &self.grid
    }

    /// Samples of a pixel of `tile` that were taken.
    pub fn samples(&self, tile: u32) -> u32 {
        self.samples[tile as usize]
    }

    /// Rays that the samples of `tile` took.
    pub fn rays(&self, tile: u32) -> u64 {
        self.rays[tile as usize]
    }

    /// Where the sums of `tile` for pixel (x, y) are, which it reaches.
    fn place(&self, tile: u32, x: u32, y: u32) -> usize {
        let side = (self.grid.side + 2 * self.reach) as usize;
        let rect = self.grid.rect(tile);
        let (column, row) = ((x + self.reach - rect.x0) as usize, (y + self.reach - rect.y0) as usize);
        (tile as usize * side + row) * side + column
    }

    /// Adds samples of one of the tiles, which took so many rays.
    pub fn add(&mut self, tile: &TileSums, rays: u64) {
        let at = self.grid.tile_at(tile.rect.x0, tile.rect.y0);
        for (((x, y), v), w) in tile.covered.pixels().zip(&tile.sums).zip(&tile.weights) {
            let place = self.place(at, x, y);
            let from = [v.r, v.g, v.b, *w];
            self.sums[place].iter_mut().zip(from).for_each(|(to, v)| *to += f64::from(v));
        }
        self.samples[at as usize] += tile.samples;
        self.rays[at as usize] += rays;
    }

    /// The value of pixel `i`; `None` while its tile has no samples.
    pub fn pixel(&self, i: usize) -> Option<[f64; 3]> {
        let (x, y) = self.position(i);
        if self.samples(self.grid.tile_at(x, y)) == 0 {
            return None;
        }
        let (side, reach) = (self.grid.side, self.reach);
        let tiles = |at: u32, end: u32| (at.saturating_sub(reach) / side, (at + reach).min(end - 1) / side);
        let ((left, right), (top, bottom)) = (tiles(x, self.grid.width), tiles(y, self.grid.height));
        let mut sum = [0.0; 4];
        for tile in (top..=bottom).flat_map(|row| (left..=right).map(move |column| (row, column))) {
            let tile = tile.0 * self.grid.across() + tile.1;
            let n = f64::from(self.samples(tile));
            if n > 0.0 {
                let own = self.sums[self.place(tile, x, y)];
                sum.iter_mut().zip(own).for_each(|(to, v)| *to += v / n);
            }
        }
        let [r, g, b, weight] = sum;
        Some(if weight > 0.0 { [r, g, b].map(|v| v / weight) } else { [0.0; 3] })
    }

    /// Samples that were taken of pixel `i`.
    pub fn samples_of(&self, i: usize) -> u32 {
        let (x, y) = self.position(i);
        self.samples(self.grid.tile_at(x, y))
    }

    fn position(&self, i: usize) -> (u32, u32) {
        (i as u32 % self.grid.width, i as u32 / self.grid.width)
    }

    /// What a merge that goes on later needs: the reach and the arrays.
    pub(super) fn parts(&self) -> (u32, &[u32], &[u64], &[[f64; 4]]) {
        (self.reach, &self.samples, &self.rays, &self.sums)
    }

    /// From what [`TiledFilm::parts`] gave; `None` when it does not fit the grid.
    pub(super) fn from_parts(
        grid: TileGrid,
        reach: u32,
        samples: Vec<u32>,
        rays: Vec<u64>,
        sums: Vec<[f64; 4]>,
    ) -> Option<Self> {
        let side = u64::from(grid.side.checked_add(reach.checked_mul(2)?)?);
        let tiles = u64::from(grid.tiles());
        let fits = samples.len() as u64 == tiles
            && rays.len() as u64 == tiles
            && side.checked_mul(side)?.checked_mul(tiles)? == sums.len() as u64;
        fits.then_some(Self { grid, reach, samples, rays, sums })
    }
}
