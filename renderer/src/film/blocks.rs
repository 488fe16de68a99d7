use serde::{Deserialize, Serialize};

/// Side of a block whose error is told, in pixels.
pub const ERROR_BLOCK: u32 = 16;

/// The error of averages over many pixels, from the scatter between replicate groups. Neighbouring pixels may share paths (light
/// tracing's splats do), so it can't be had from the pixels' own errors.
#[derive(Clone, Debug, PartialEq)]
pub struct BlockErrors {
    /// Standard error of the mean of each block of [`ERROR_BLOCK`]^2 pixels, row by row; NaN where fewer than two groups cover it.
    pub std_error: Vec<[f32; 3]>,
    /// The image as one block; `None` when fewer than two groups cover it.
    pub image: Option<ChannelMeans>,
}

/// Mean of the whole image and its standard error.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ChannelMeans {
    /// Mean of red, green and blue.
    pub mean: [f64; 3],
    /// Standard error of each.
    pub std_error: [f64; 3],
    /// Replicate groups behind it.
    pub groups: u32,
}

/// Sums of one group over one block.
#[derive(Clone, Copy, Debug, Default)]
struct Sum {
    value: [f64; 3],
    /// Sum of the pixels' sample counts.
    weight: f64,
    /// Pixels that have samples.
    pixels: u32,
}

impl Sum {
    fn add(&mut self, o: &Self) {
        for (to, from) in self.value.iter_mut().zip(o.value) {
            *to += from;
        }
        self.weight += o.weight;
        self.pixels += o.pixels;
    }
}

/// Gathers pixels into blocks, group by group.
#[derive(Debug)]
pub(super) struct BlockScatter {
    width: u32,
    height: u32,
    /// Block after block, [`BlockScatter::groups`] sums each.
    sums: Vec<Sum>,
    groups: usize,
}

impl BlockScatter {
    pub(super) fn new(width: u32, height: u32, groups: usize) -> Self {
        let blocks = width.div_ceil(ERROR_BLOCK) as usize * height.div_ceil(ERROR_BLOCK) as usize;
        Self { width, height, sums: vec![Sum::default(); blocks * groups], groups }
    }

    /// Adds the value of pixel `i` in `group`, made of `weight` samples.
    #[inline]
    pub(super) fn add(&mut self, i: usize, group: usize, value: &[f64; 3], weight: f64) {
        let (x, y) = (i as u32 % self.width, i as u32 / self.width);
        let block = (y / ERROR_BLOCK * self.width.div_ceil(ERROR_BLOCK) + x / ERROR_BLOCK) as usize;
        self.sums[block * self.groups + group].add(&Sum { value: *value, weight, pixels: 1 });
    }

    pub(super) fn finish(self) -> BlockErrors {
        let across = self.width.div_ceil(ERROR_BLOCK);
        let pixels_of = |block: u32| {
            let (x, y) = (block % across * ERROR_BLOCK, block / across * ERROR_BLOCK);
            (self.width - x).min(ERROR_BLOCK) * (self.height - y).min(ERROR_BLOCK)
        };
        let mut image = vec![Sum::default(); self.groups];
        let mut std_error = Vec::with_capacity(self.sums.len() / self.groups.max(1));
        for (block, sums) in (0..).zip(self.sums.chunks_exact(self.groups.max(1))) {
            std_error.push(scatter(sums, pixels_of(block)).map_or([f32::NAN; 3], |m| m.std_error.map(|v| v as f32)));
            image.iter_mut().zip(sums).for_each(|(to, from)| to.add(from));
        }
        BlockErrors { std_error, image: scatter(&image, self.width * self.height) }
    }
}

/// Mean and standard error over the groups that cover all `pixels` pixels: `sum n_g (x_g - x)^2 / ((G - 1) sum n_g)`.
fn scatter(groups: &[Sum], pixels: u32) -> Option<ChannelMeans> {
    let full = || groups.iter().filter(|g| g.pixels == pixels);
    let count = full().count();
    if count < 2 {
        return None;
    }
    let total: f64 = full().map(|g| g.weight).sum();
    let n = f64::from(pixels);
    let mean: [f64; 3] = std::array::from_fn(|c| full().map(|g| g.weight * g.value[c] / n).sum::<f64>() / total);
    let std_error = std::array::from_fn(|c| {
        let s: f64 = full().map(|g| g.weight * (g.value[c] / n - mean[c]) * (g.value[c] / n - mean[c])).sum();
        (s / ((count as f64 - 1.0) * total)).sqrt()
    });
    Some(ChannelMeans { mean, std_error, groups: count as u32 })
}
