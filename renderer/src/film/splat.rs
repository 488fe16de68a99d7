use super::Filter;
use crate::math::Vec2;
use crate::spectrum::Rgb;

/// Side of a splat block in pixels.
pub const BLOCK: u32 = 32;
const BLOCK_PIXELS: usize = (BLOCK * BLOCK) as usize;

/// A sparse film of splats: blocks of [`BLOCK`]^2 pixels, made when first touched.
#[derive(Clone, Debug)]
pub struct SplatSums {
    width: u32,
    height: u32,
    /// Slot of each block, row by row; `u32::MAX` = untouched.
    index: Vec<u32>,
    /// f64 sums, [`BLOCK`]^2 a slot.
    data: Vec<[f64; 3]>,
}

/// Equal sums, in whatever order the blocks were first touched.
impl PartialEq for SplatSums {
    fn eq(&self, o: &Self) -> bool {
        self.size() == o.size() && self.blocks().eq(o.blocks())
    }
}

impl SplatSums {
    /// An empty film.
    pub fn new(width: u32, height: u32) -> Self {
        let blocks = width.div_ceil(BLOCK) as usize * height.div_ceil(BLOCK) as usize;
        Self { width, height, index: vec![u32::MAX; blocks], data: Vec::new() }
    }

    /// Width and height in pixels.
    pub fn size(&self) -> (u32, u32) {
        (self.width, self.height)
    }

    /// Number of blocks of a film of this size.
    pub fn block_count(&self) -> usize {
        self.index.len()
    }

    /// Bytes of memory that the touched blocks take.
    pub fn memory(&self) -> usize {
        size_of_val(&self.data[..])
    }

    /// Adds `value` at a raster position to all pixels whose filter covers it.
    #[inline]
    pub fn splat(&mut self, filter: &Filter, raster: Vec2, value: Rgb) {
        let footprint = filter.weights(raster);
        for (x, y, wy, columns) in footprint.rows() {
            for (x, wx) in (x..).zip(columns) {
                self.add(x, y, value * (wx * wy));
            }
        }
    }

    /// Adds `value` to pixel (x, y), which must lie on the film.
    #[inline]
    pub fn add(&mut self, x: u32, y: u32, value: Rgb) {
        debug_assert!(x < self.width && y < self.height);
        let block = (y / BLOCK) as usize * self.width.div_ceil(BLOCK) as usize + (x / BLOCK) as usize;
        let slot = self.slot(block);
        let px = &mut self.data[slot * BLOCK_PIXELS + ((y % BLOCK) * BLOCK + x % BLOCK) as usize];
        px[0] += f64::from(value.r);
        px[1] += f64::from(value.g);
        px[2] += f64::from(value.b);
    }

    #[inline]
    fn slot(&mut self, block: usize) -> usize {
        if self.index[block] == u32::MAX {
            self.index[block] = (self.data.len() / BLOCK_PIXELS) as u32;
            self.data.resize(self.data.len() + BLOCK_PIXELS, [0.0; 3]);
        }
        self.index[block] as usize
    }

    /// Touched blocks in film order: (block number, sums row by row; pixels beyond the film's border are zero).
    pub fn blocks(&self) -> impl Iterator<Item = (u32, &[[f64; 3]])> {
        self.index.iter().enumerate().filter(|(_, s)| **s != u32::MAX).map(|(b, &s)| {
            let at = s as usize * BLOCK_PIXELS;
            (b as u32, &self.data[at..at + BLOCK_PIXELS])
        })
    }

    /// Sets a block's sums (decoding); `None` when there is no such block or `sums` has the wrong length.
    pub fn set_block(&mut self, block: u32, sums: &[[f32; 3]]) -> Option<()> {
        if block as usize >= self.index.len() || sums.len() != BLOCK_PIXELS {
            return None;
        }
        let slot = self.slot(block as usize);
        for (to, from) in self.data[slot * BLOCK_PIXELS..][..BLOCK_PIXELS].iter_mut().zip(sums) {
            *to = from.map(f64::from);
        }
        Some(())
    }

    /// Rounds every sum to f32, as a transmitted result is: a unit gives the same bits at home and over the wire.
    pub fn round(&mut self) {
        for px in &mut self.data {
            *px = px.map(|v| f64::from(v as f32));
        }
    }

    /// Every touched pixel with its sum.
    pub fn pixels(&self) -> impl Iterator<Item = (u32, u32, [f64; 3])> + '_ {
        let across = self.width.div_ceil(BLOCK);
        let (w, h) = (self.width, self.height);
        self.blocks().flat_map(move |(b, sums)| {
            let (x0, y0) = (b % across * BLOCK, b / across * BLOCK);
            sums.iter()
                .enumerate()
                .map(move |(i, v)| (x0 + i as u32 % BLOCK, y0 + i as u32 / BLOCK, *v))
                .filter(move |(x, y, _)| *x < w && *y < h)
        })
    }
}
