use crate::spectrum::Rgb;
use serde::{Deserialize, Serialize};

/// A rectangle of pixels, `x0 <= x < x1`, `y0 <= y < y1`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Rect {
    /// Left.
    pub x0: u32,
    /// Top.
    pub y0: u32,
    /// Right, exclusive.
    pub x1: u32,
    /// Bottom, exclusive.
    pub y1: u32,
}

impl Rect {
    /// Width in pixels.
    pub fn width(&self) -> u32 {
        self.x1 - self.x0
    }

    /// Height in pixels.
    pub fn height(&self) -> u32 {
        self.y1 - self.y0
    }

    /// Number of pixels.
    pub fn area(&self) -> usize {
        self.width() as usize * self.height() as usize
    }

    /// The rectangle with `margin` pixels more on each side, as far as they lie on a film of `width * height` pixels.
    pub fn grown(&self, margin: u32, width: u32, height: u32) -> Self {
        Self {
            x0: self.x0.saturating_sub(margin),
            y0: self.y0.saturating_sub(margin),
            x1: self.x1.saturating_add(margin).min(width),
            y1: self.y1.saturating_add(margin).min(height),
        }
    }

    /// The pixels, row by row.
    pub fn pixels(&self) -> impl Iterator<Item = (u32, u32)> + use<> {
        let r = *self;
        (r.y0..r.y1).flat_map(move |y| (r.x0..r.x1).map(move |x| (x, y)))
    }
}

/// Sums of what the first hit is; for denoisers and compositing.
#[derive(Clone, Copy, Debug, Default, PartialEq, bytemuck::Pod, bytemuck::Zeroable)]
#[repr(C)]
pub struct Aov {
    /// Albedo of the surface.
    pub albedo: [f32; 3],
    /// World-space shading normal.
    pub normal: [f32; 3],
    /// Distance from the camera; averaged, infinite where nothing was hit.
    pub depth: f32,
    /// Samples that hit a surface (depth averages over these).
    pub hits: f32,
}

impl Aov {
    /// Adds another sum: of a unit's samples, of which there are few.
    #[inline]
    pub fn add(&mut self, o: &Self) {
        for i in 0..3 {
            self.albedo[i] += o.albedo[i];
            self.normal[i] += o.normal[i];
        }
        self.depth += o.depth;
        self.hits += o.hits;
    }
}

/// Sums of the auxiliary values of a whole job: albedo, normal, depth, hits. In single precision they would stop growing.
#[derive(Clone, Copy, Debug, Default, PartialEq, bytemuck::Pod, bytemuck::Zeroable)]
#[repr(C)]
pub struct AovSum([f64; 8]);

impl AovSum {
    /// Adds a unit's sum.
    #[inline]
    pub fn add(&mut self, o: &Aov) {
        let values = [o.albedo[0], o.albedo[1], o.albedo[2], o.normal[0], o.normal[1], o.normal[2], o.depth, o.hits];
        self.0.iter_mut().zip(values).for_each(|(to, v)| *to += f64::from(v));
    }

    /// Averages over `samples` samples: depth over the hits, all else over the samples.
    pub fn average(&self, samples: f64) -> Aov {
        let mean = |v: f64| if samples > 0.0 { (v / samples) as f32 } else { 0.0 };
        let [r, g, b, x, y, z, depth, hits] = self.0;
        Aov {
            albedo: [r, g, b].map(mean),
            normal: [x, y, z].map(mean),
            depth: if hits > 0.0 { (depth / hits) as f32 } else { f32::INFINITY },
            hits: mean(hits),
        }
    }
}

impl FromIterator<Aov> for AovSum {
    fn from_iter<T: IntoIterator<Item = Aov>>(sums: T) -> Self {
        let mut all = Self::default();
        sums.into_iter().for_each(|aov| all.add(&aov));
        all
    }
}

/// Unnormalised sums over the samples of one tile.
#[derive(Clone, Debug, PartialEq)]
pub struct TileSums {
    /// The tile.
    pub rect: Rect,
    /// The pixels that its samples count for: those of the tile, and as many around as the filter reaches.
    pub covered: Rect,
    /// Samples of each pixel of the tile that were taken.
    pub samples: u32,
    /// Sums of radiance times weight over `covered`, row by row; rounded once from f64.
    pub sums: Vec<Rgb>,
    /// Sums of the weights over `covered`: of all tiles together, about as much as a pixel has samples.
    pub weights: Vec<f32>,
    /// Sums of the auxiliary values, row by row; empty for all replicates but the first.
    pub aovs: Vec<Aov>,
}
