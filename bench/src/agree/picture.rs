//! What is known of a picture: means with their errors.

use renderer::film::{ERROR_BLOCK, Filter, MergedImage};
use statcheck::Estimate;

/// How far a pixel's filter reaches, in pixels: that of the default filter.
const REACH: u32 = 2;

/// A picture whose means can be tested.
#[derive(Clone, Copy, Debug)]
pub enum Picture<'a> {
    /// What an integrator estimates; with its filter, if its pixels are independent but for that.
    Rendered(&'a MergedImage, Option<&'a Filter>),
    /// The same radiance in every pixel, known exactly.
    Exact(f64),
}

/// Pixels: `[x0, y0]` to `[x1, y1]`, the latter excluded.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Area {
    /// Top left pixel.
    pub from: [u32; 2],
    /// One past the bottom right one.
    pub to: [u32; 2],
}

impl Area {
    /// A whole picture.
    pub fn whole(image: &MergedImage) -> Self {
        Self { from: [0, 0], to: [image.width, image.height] }
    }

    /// The blocks of a picture whose errors it tells.
    pub fn blocks(image: &MergedImage) -> impl Iterator<Item = Self> {
        let (width, height) = (image.width, image.height);
        let starts = |size: u32| (0..size).step_by(ERROR_BLOCK as usize);
        starts(height).flat_map(move |y| {
            starts(width)
                .map(move |x| Self { from: [x, y], to: [(x + ERROR_BLOCK).min(width), (y + ERROR_BLOCK).min(height)] })
        })
    }

    fn pixels(self, width: u32) -> impl Iterator<Item = usize> {
        (self.from[1]..self.to[1]).flat_map(move |y| (self.from[0]..self.to[0]).map(move |x| (y * width + x) as usize))
    }
}

impl Picture<'_> {
    /// The mean over the image or one of its blocks.
    ///
    /// Pixels of a path tracer share samples in a way that the filter tells: their errors add up to the area's. Those of splatted pixels,
    /// and of pixels that share paths, don't; there the scatter of the whole area between the replicate groups tells the error.
    pub fn area(&self, area: Area, channel: usize) -> Estimate {
        let (image, filter) = match *self {
            Self::Exact(radiance) => return Estimate::exact(radiance),
            Self::Rendered(image, filter) => (image, filter),
        };
        let pixels = || area.pixels(image.width);
        let mean = pixels().map(|i| f64::from(image.mean[i][channel])).sum::<f64>() / pixels().count() as f64;
        let dof = self.dof();
        let square = |e: f64| e * e;
        if let Some(filter) = filter {
            let variances = pixels().map(|i| square(f64::from(image.std_error[i][channel])));
            let [x, y] = [0, 1].map(|axis| area.from[axis]..area.to[axis]);
            return Estimate::pooled(mean, variances, dof, filter.inflation(0, &x) * filter.inflation(1, &y));
        }
        let error = if area == Area::whole(image) {
            image.blocks.image.map_or(f64::NAN, |m| m.std_error[channel])
        } else {
            let [x, y] = area.from.map(|v| v / ERROR_BLOCK);
            f64::from(image.blocks.std_error[(y * image.width.div_ceil(ERROR_BLOCK) + x) as usize][channel])
        };
        Estimate { mean, variance: square(error), dof }
    }

    /// One pixel.
    ///
    /// Its groups can't tell what only a sample in hundreds finds, such as a lamp at the rim of the filter. So its error is at least
    /// what one sample as bright as the brightest pixel around would change.
    pub fn pixel(&self, i: usize, channel: usize) -> Estimate {
        let image = match *self {
            Self::Exact(radiance) => return Estimate::exact(radiance),
            Self::Rendered(image, ..) => image,
        };
        let (x, y) = (i as u32 % image.width, i as u32 / image.width);
        let around = Area {
            from: [x.saturating_sub(REACH), y.saturating_sub(REACH)],
            to: [(x + REACH + 1).min(image.width), (y + REACH + 1).min(image.height)],
        };
        let brightest = around.pixels(image.width).map(|j| image.mean[j][channel]).fold(0.0, f32::max);
        let error = f64::from(image.std_error[i][channel]).max(f64::from(brightest / image.samples[i]));
        Estimate { mean: f64::from(image.mean[i][channel]), variance: error * error, dof: self.dof() }
    }

    /// Half the width of the 99 % interval of the image mean over that mean: the largest of the channels.
    pub fn half_width(&self) -> f64 {
        match *self {
            Self::Exact(_) => 0.0,
            Self::Rendered(image, ..) => (0..3)
                .map(|c| self.area(Area::whole(image), c))
                .map(|e| if e.variance.is_finite() { e.half_width(0.99) / e.mean } else { f64::NAN })
                .fold(0.0, |a: f64, b| if b.is_nan() { b } else { a.max(b) }),
        }
    }

    fn dof(&self) -> f64 {
        match self {
            Self::Exact(_) => f64::INFINITY,
            Self::Rendered(image, ..) => image.error.map_or(f64::NAN, |e| f64::from(e.groups) - 1.0),
        }
    }
}
