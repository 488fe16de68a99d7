//! Joins the first vertices of a block to the second vertices of all its paths.

use super::Pixel;
use super::kept::Second;
use crate::accel::Accel;
use crate::bsdf::{Even, Transport};
use crate::film::Counters;
use crate::math::{INV_PI, Ray, Vec3};
use crate::path::Scattering;
use crate::spectrum::Rgb;

/// The first vertices of a block, and what is joined at a time.
#[derive(Default)]
pub(super) struct Joints {
    firsts: Vec<First>,
    joined: Vec<Join>,
    /// Rays that tell whether the joined see each other.
    rays: Vec<Ray>,
}

/// A first vertex, prepared to be joined to many.
struct First {
    pixel: usize,
    p: Vec3,
    ng: Vec3,
    /// Where rays begin, on the side of the geometric normal and on the other.
    starts: [Vec3; 2],
    /// If it reflects evenly.
    even: Option<Even>,
}

/// A first vertex and the second vertex of some pixel's path.
struct Join {
    /// The pixel of the first vertex.
    pixel: usize,
    /// Unit direction from there.
    w: Vec3,
    /// What it takes to the pixel.
    value: Rgb,
    /// Density per area with which the pixel's path finds the second vertex.
    density: f64,
    /// The factor from solid angle to area.
    to_area: f64,
    /// Whether a ray tells if they see each other; a pixel's own path does so.
    traced: bool,
    /// Whether they do.
    sees: bool,
}

impl Joints {
    /// Prepares the first vertices.
    pub fn begin(&mut self, pixels: &[Pixel]) {
        self.firsts.clear();
        self.firsts.extend(pixels.iter().enumerate().filter_map(|(pixel, p)| {
            let (anchor, scattering) = p.kept.first.as_ref()?;
            let even = match scattering {
                Scattering::Surface(shading) => shading.even(),
                Scattering::Medium(_) => None,
            };
            let starts = [anchor.start(anchor.ng), anchor.start(-anchor.ng)];
            Some(First { pixel, p: anchor.p, ng: anchor.ng, starts, even })
        }));
    }

    /// Adds what the second vertex of pixel `j` reflects to all pixels whose first vertices see it.
    pub fn share(&mut self, accel: &Accel, pixels: &mut [Pixel], j: usize, counters: &mut Counters) {
        let Some(second) = &pixels[j].kept.second else { return };
        if second.radiance.is_black() {
            return;
        }
        self.join(pixels, second, j);

        // Leave out those that don't see it.
        counters.rays += self.rays.len() as u64;
        let traced = self.joined.iter_mut().filter(|join| join.traced);
        for (join, hidden) in traced.zip(accel.occluded_each(&self.rays)) {
            join.sees = !hidden;
        }
        let density: f64 = self.joined.iter().filter(|join| join.sees).map(|join| join.density).sum();
        if !(density > 0.0 && density.is_finite()) {
            // Edge-on, or too near to tell from the first vertex: its own path's, as if it were alone.
            let alone = pixels[j].kept.unshared();
            if counters.admit(alone) {
                pixels[j].value += alone;
            }
            return;
        }
        for join in self.joined.iter_mut().filter(|join| join.sees) {
            let radiance = if join.traced { second.radiance_towards(-join.w) } else { second.radiance };
            join.value *= radiance * (join.to_area / density) as f32;
        }
        for join in self.joined.iter().filter(|join| join.sees) {
            if counters.admit(join.value) {
                pixels[join.pixel].value += join.value;
            }
        }
    }

    /// Finds the first vertices that may be joined to a second vertex, that of pixel `j`.
    fn join(&mut self, pixels: &[Pixel], second: &Second, j: usize) {
        self.joined.clear();
        self.rays.clear();
        let [ng, n] = second.normals();
        // All rays end at the same point.
        let farthest = self.firsts.iter().fold(Vec3::ZERO, |far, first| far.max((second.anchor.p - first.p).abs()));
        let end = second.anchor.end(ng, farthest.max_element());
        for first in &self.firsts {
            let d = second.anchor.p - first.p;
            let (d2, traced) = (d.length_squared(), first.pixel != j);
            if traced && !(d2 > 0.0 && ng.dot(d) < 0.0 && n.dot(d) < 0.0) {
                continue;
            }
            let w = d * (1.0 / d2.sqrt());
            let (value, pdf) = match (&first.even, pixels[first.pixel].kept.departed) {
                (_, Some(departed)) if !traced => departed,
                (Some(even), _) => {
                    let cos = even.n.dot(w);
                    // Where nothing is reflected paths end, so that they do not find the point.
                    if !(cos > 0.0 && even.ng.dot(d) > 0.0) {
                        continue;
                    }
                    (even.f * cos, cos * INV_PI)
                }
                (None, _) => {
                    let Some((_, scattering)) = &pixels[first.pixel].kept.first else { continue };
                    let (f, pdf) = scattering.eval_pdf(w, Transport::Radiance);
                    (f * scattering.abs_cos(w), pdf)
                }
            };
            if value.is_black() {
                continue;
            }
            if traced {
                let start = first.starts[usize::from(w.dot(first.ng) < 0.0)];
                self.rays.push(Ray::segment(start, end - start, 1.0));
            }
            let to_area = f64::from(w.dot(ng).abs()) / f64::from(d2);
            let density = f64::from(pdf) * to_area;
            self.joined.push(Join { pixel: first.pixel, w, value, density, to_area, traced, sees: true });
        }
    }
}
