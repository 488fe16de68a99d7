use super::UnitContext;
use crate::film::{Aov, Rect, TileSums};
use crate::math::{Anchor, Ray};
use crate::path::Scattering;
use crate::sampling::SobolSampler;
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

/// Sums what `radiance` makes of samples `samples` of each pixel of a tile; `None` when stopped.
pub fn render(
    c: &UnitContext<'_>,
    rect: Rect,
    samples: Range<u32>,
    mut radiance: impl FnMut(PixelSample<'_>) -> Rgb,
) -> Option<TileSums> {
    let mut sums = Vec::with_capacity(rect.area());
    let mut aovs = Vec::with_capacity(if c.replicate == 0 { rect.area() } else { 0 });
    for (x, y) in rect.pixels() {
        if x == rect.x0 && (c.stopped)() {
            return None;
        }
        let mut sum = [0.0f64; 3];
        let mut aov = Aov::default();
        let pixel = u64::from(y) * u64::from(c.view.width) + u64::from(x);
        for index in samples.clone() {
            let mut sampler = SobolSampler::new(c.seed, c.replicate, pixel, index);
            let ray = c.camera_ray(&mut sampler, x, y);
            let aov = (c.replicate == 0).then_some(&mut aov);
            let value = radiance(PixelSample { pixel, index, sampler, ray, aov });
            for (to, from) in sum.iter_mut().zip(value.to_array()) {
                *to += f64::from(from);
            }
        }
        sums.push(Rgb::from(sum.map(|v| v as f32)));
        if c.replicate == 0 {
            aovs.push(aov);
        }
    }
    Some(TileSums { rect, samples: samples.end - samples.start, sums, aovs })
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
