//! Separable filters over planes, borders repeated; the kernels of FLIP.

use super::PIXELS_PER_DEGREE;
use renderer::math::fns::exp;
use std::f32::consts::PI;

/// One channel, row by row.
pub type Plane = Vec<f32>;

/// Size of all planes.
#[derive(Clone, Copy, Debug)]
pub struct Size {
    /// Width in pixels.
    pub width: usize,
    /// Height in pixels.
    pub height: usize,
}

impl Size {
    /// Filters each row with `across` and each column with `down`, both of odd length.
    pub fn filter(self, plane: &[f32], across: &[f32], down: &[f32]) -> Plane {
        self.columns(&self.rows(plane, across), down)
    }

    fn rows(self, plane: &[f32], kernel: &[f32]) -> Plane {
        let radius = kernel.len() / 2;
        let mut out = Plane::with_capacity(plane.len());
        let mut padded = vec![0.0; self.width + 2 * radius];
        for row in plane.chunks_exact(self.width) {
            padded[..radius].fill(row[0]);
            padded[radius..radius + self.width].copy_from_slice(row);
            padded[radius + self.width..].fill(row[self.width - 1]);
            out.extend(padded.windows(kernel.len()).map(|w| w.iter().zip(kernel).map(|(v, k)| v * k).sum::<f32>()));
        }
        out
    }

    fn columns(self, plane: &[f32], kernel: &[f32]) -> Plane {
        let radius = kernel.len() / 2;
        let mut out = vec![0.0; plane.len()];
        for (y, to) in out.chunks_exact_mut(self.width).enumerate() {
            for (i, k) in kernel.iter().enumerate() {
                let source = (y + i).saturating_sub(radius).min(self.height - 1);
                let from = &plane[source * self.width..][..self.width];
                to.iter_mut().zip(from).for_each(|(t, f)| *t += k * f);
            }
        }
        out
    }
}

/// Contrast sensitivity as Gaussians: `a sqrt(pi / b) exp(-pi^2 x^2 / b)`, x in degrees. The blue-yellow channel has two of them.
#[derive(Debug)]
pub struct Sensitivity {
    /// Of the achromatic channel.
    pub y: Vec<f32>,
    /// Of the red-green channel.
    pub cx: Vec<f32>,
    /// Of the blue-yellow channel; the filter is the sum of the two separable ones.
    pub cz: [Vec<f32>; 2],
}

impl Sensitivity {
    /// For the standard viewing distance.
    pub fn new() -> Self {
        const WIDEST: f32 = 0.04;
        let radius = (3.0 * (WIDEST / (2.0 * PI * PI)).sqrt() * PIXELS_PER_DEGREE).ceil() as i32;
        let gauss = |a: f32, b: f32| -> Vec<f32> {
            // The square root of the 2D amplitude: the filter is applied along both axes.
            let amplitude = (a * (PI / b).sqrt()).sqrt();
            let at = |i: i32| {
                let x = i as f32 / PIXELS_PER_DEGREE;
                amplitude * exp(-PI * PI * x * x / b)
            };
            (-radius..=radius).map(at).collect()
        };
        let normalised = |kernel: Vec<f32>| {
            let sum: f32 = kernel.iter().sum();
            kernel.into_iter().map(|k| k / sum).collect()
        };
        let cz = [gauss(34.1, 0.04), gauss(13.5, 0.025)];
        let volume: f32 = cz.iter().map(|k| k.iter().sum::<f32>()).map(|s| s * s).sum();
        Self {
            y: normalised(gauss(1.0, 0.0047)),
            cx: normalised(gauss(1.0, 0.0053)),
            cz: cz.map(|kernel| kernel.into_iter().map(|k| k / volume.sqrt()).collect()),
        }
    }
}

/// A Gaussian of 0.082 degrees' width with its first two derivatives: detectors of edges and points.
#[derive(Debug)]
pub struct Detectors {
    /// The Gaussian; sums to 1.
    pub smooth: Vec<f32>,
    /// First derivative; positive and negative parts sum to 1 and -1.
    pub edge: Vec<f32>,
    /// Second derivative; likewise.
    pub point: Vec<f32>,
}

impl Detectors {
    /// For the standard viewing distance.
    pub fn new() -> Self {
        let deviation = 0.5 * 0.082 * PIXELS_PER_DEGREE;
        let radius = (3.0 * deviation).ceil() as i32;
        let gauss = |x: f32| exp(-x * x / (2.0 * deviation * deviation));
        let taps = |f: &dyn Fn(f32) -> f32| -> Vec<f32> { (-radius..=radius).map(|i| f(i as f32)).collect() };
        // Parts of either sign are scaled by their own sum.
        let balanced = |kernel: Vec<f32>| -> Vec<f32> {
            let positive: f32 = kernel.iter().map(|k| k.max(0.0)).sum();
            let negative: f32 = kernel.iter().map(|k| -k.min(0.0)).sum();
            kernel
                .into_iter()
                .map(|k| if k > 0.0 { k / positive } else { k / negative.max(f32::MIN_POSITIVE) })
                .collect()
        };
        Self {
            smooth: balanced(taps(&gauss)),
            edge: balanced(taps(&|x| -x * gauss(x))),
            point: balanced(taps(&|x| (x * x / (deviation * deviation) - 1.0) * gauss(x))),
        }
    }
}
