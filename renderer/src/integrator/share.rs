//! Paths of neighbouring pixels share their second vertices (Bekaert, Sbert and Halton 2002, "Accelerating Path Tracing by Re-Using
//! Paths").
//!
//! What a path finds beyond its first two vertices is light that its second vertex reflects. Most first vertices of the pixels around
//! see that point too, and to join them takes one shadow ray, where a path of their own takes several rays. In a block of n pixels each
//! so has n estimates in place of one, weighted by the balance heuristic: with `p_k(y)` the density per area with which the path of
//! pixel k finds the point y as its second vertex, y counts for pixel i with `f_i(y) / sum_k p_k(y)`, where the sum is over all that
//! can find it, and `f_i` is what takes the radiance of y to the picture. As visibility is known for all of them, the weights add up to
//! one wherever y is.
//!
//! Shared are points that reflect broadly: diffuse surfaces, whose radiance is the same for all who see that side of them, and
//! diffuse ones with a rough coat, for whom it is what the two directions from which light was found to come give towards each.
//!
//! What it gains depends on how much of a pixel's variance is that of shared light, and on what the joins cost: [`Gauge`] measures both
//! while a tile is rendered, and chooses the blocks for what follows. So the samples of a pixel are made by one estimator or another
//! according to what was found *before*; each has the same expectation, whatever that was, and all count alike: no bias.

use super::gauge::{Gauge, Seen};
use super::path::Walk;
use super::tile::Tile;
use super::{Carried, UnitContext};
use crate::bsdf::{DirectionSample, Material, ShadingPoint, Spread, Transport};
use crate::film::{Counters, Rect, TileSums};
use crate::light::LightLessons;
use crate::math::{Anchor, Ray, Vec2, Vec3};
use crate::path::Scattering;
use crate::spectrum::Rgb;
use std::ops::Range;

/// What a path has to share.
#[derive(Default)]
pub(super) struct Kept {
    /// The first vertex, if there is one.
    pub first: Option<(Anchor, Scattering)>,
    /// Value times cosine of the direction taken there, and its density; none for a delta lobe.
    pub departed: Option<(Rgb, f32)>,
    /// The direction of the last light that next-event estimation chose, and its radiance times weight over density.
    pub lit: Option<(Vec3, Rgb)>,
    /// The second vertex, if it may be shared.
    second: Option<Second>,
}

/// A second vertex.
struct Second {
    anchor: Anchor,
    /// Unit shading normal.
    n: Vec3,
    /// Unit direction to the first vertex of its own path.
    wo: Vec3,
    /// What it reflects along `wo`.
    radiance: Rgb,
    /// What reflects, unless it reflects evenly.
    shading: Option<ShadingPoint>,
    /// Direction of a light, and its radiance times weight over density.
    lit: Option<(Vec3, Rgb)>,
    /// The direction in which its path goes on: weight, density, and what came from there.
    onward: Option<Onward>,
}

struct Onward {
    wi: Vec3,
    weight: Rgb,
    pdf: f32,
    radiance: Rgb,
}

impl Kept {
    /// Notes the second vertex of the path, seen along `wo`, if it is to be shared.
    #[inline]
    pub fn begin(&mut self, anchor: &Anchor, scattering: &Scattering, wo: Vec3) -> bool {
        let Scattering::Surface(shading) = scattering else { return false };
        let spread = shading.bsdf.spread();
        if self.departed.is_none() || spread == Spread::Narrow {
            return false;
        }
        self.second = Some(Second {
            anchor: *anchor,
            n: shading.frame.n,
            wo,
            radiance: Rgb::ZERO,
            shading: (spread == Spread::Broad).then_some(*shading),
            lit: None,
            onward: None,
        });
        true
    }

    /// Lights were connected to the second vertex, which reflects `radiance` of them.
    #[inline]
    pub fn connected(&mut self, radiance: Rgb) {
        if let Some(second) = &mut self.second {
            (second.radiance, second.lit) = (radiance, self.lit);
        }
    }

    /// The path goes on from its second vertex.
    #[inline]
    pub fn departs(&mut self, s: &DirectionSample) {
        if let Some(second) = &mut self.second {
            second.onward = Some(Onward { wi: s.wi, weight: s.weight(), pdf: s.pdf, radiance: Rgb::ZERO });
        }
    }

    /// The path has ended, and `radiance` came to its second vertex from where it went on. Whether there is such a vertex.
    #[inline]
    pub fn end(&mut self, radiance: Rgb) -> bool {
        let Some(second) = &mut self.second else { return false };
        if let Some(onward) = &mut second.onward {
            onward.radiance = radiance;
            second.radiance += onward.weight * radiance;
        }
        true
    }

    /// What comes to the pixel from its own path's second vertex, if it is not shared.
    #[inline]
    fn unshared(&self) -> Rgb {
        match (&self.departed, &self.second) {
            (Some((value, pdf)), Some(second)) => *value * second.radiance * (1.0 / *pdf),
            _ => Rgb::ZERO,
        }
    }
}

impl Second {
    /// Whether it is seen from the unit direction `wo` as from that of its own path: the same side of both normals.
    #[inline]
    fn is_same_from(&self, wo: Vec3) -> bool {
        self.anchor.ng.dot(wo) * self.anchor.ng.dot(self.wo) > 0.0 && self.n.dot(wo) * self.n.dot(self.wo) > 0.0
    }

    /// What it reflects towards the unit direction `wo`, on the side from which its path came. The directions from which light comes
    /// were drawn for another `wo`, but on the whole side, and weighted by weights that add up to one for each of them.
    #[inline]
    fn radiance_towards(&self, wo: Vec3) -> Rgb {
        let Some(shading) = self.shading.as_ref().map(|s| s.seen_from(wo)) else { return self.radiance };
        let from = |wi: Vec3, radiance: Rgb| shading.eval(wi, Transport::Radiance) * radiance * shading.abs_cos(wi);
        let lit = self.lit.map_or(Rgb::ZERO, |(wi, radiance)| from(wi, radiance));
        self.onward.as_ref().map_or(lit, |o| lit + from(o.wi, o.radiance * (1.0 / o.pdf)))
    }
}

/// Whether there may be anything to share.
pub(super) fn is_of_use(c: &UnitContext<'_>) -> bool {
    let reflects = |m: &Material| matches!(m, Material::Lambert { .. } | Material::Gltf { .. });
    c.share && c.max_depth > 2 && c.carried == Carried::ALL && c.scene.materials.iter().any(reflects)
}

/// Renders samples `samples` of each pixel of a tile of a scene without media; `None` when stopped.
pub(super) fn render(
    c: &UnitContext<'_>,
    rect: Rect,
    samples: Range<u32>,
    lessons: &mut LightLessons,
    counters: &mut Counters,
) -> Option<TileSums> {
    let mut tile = Tile::new(c, rect);
    let mut block = Block { c, lessons, counters, pixels: Vec::new(), joined: Vec::new(), rays: Vec::new() };
    let mut gauge = Gauge::new(&c.view.filter, rect);
    for index in samples.clone() {
        let mut y = rect.y0;
        while y < rect.y1 {
            if (c.stopped)() {
                return None;
            }
            let side = gauge.side(y, index == samples.start);
            let y1 = if side == 1 {
                let y1 = gauge.strip_end(y);
                block.render_alone(&mut tile, Rect { y0: y, y1, ..rect }, index, &mut gauge);
                y1
            } else {
                // The grid of blocks moves, so that its borders do not show.
                let grid = Grid { side, shift: [index, index / side] };
                let y1 = grid.end(1, y).min(gauge.band_end(y));
                let mut x = rect.x0;
                while x < rect.x1 {
                    let x1 = grid.end(0, x).min(rect.x1);
                    block.render(&mut tile, Rect { x0: x, y0: y, x1, y1 }, index, &mut gauge);
                    x = x1;
                }
                y1
            };
            y = y1;
        }
    }
    Some(tile.finish(samples.end - samples.start))
}

/// Blocks of pixels.
struct Grid {
    side: u32,
    shift: [u32; 2],
}

impl Grid {
    /// Where the block that holds a pixel ends, along an axis.
    fn end(&self, axis: usize, pixel: u32) -> u32 {
        let shift = self.shift[axis] % self.side;
        (pixel + shift) / self.side * self.side + self.side - shift
    }
}

/// A sample of a pixel.
#[derive(Default)]
struct Pixel {
    place: (u32, u32),
    raster: Vec2,
    kept: Kept,
    /// Where rays from its first vertex begin, on the side of the geometric normal and on the other.
    starts: [Vec3; 2],
    /// What comes of it.
    value: Rgb,
}

/// The samples of a block.
struct Block<'a, 'b> {
    c: &'a UnitContext<'a>,
    lessons: &'b mut LightLessons,
    counters: &'b mut Counters,
    pixels: Vec<Pixel>,
    /// First vertices that see the second vertex at hand.
    joined: Vec<Join>,
    /// Rays that tell whether they do.
    rays: Vec<Ray>,
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

impl Block<'_, '_> {
    /// A sample of each pixel of a block, shared.
    fn render(&mut self, tile: &mut Tile<'_>, rect: Rect, index: u32, gauge: &mut Gauge) {
        // Trace each pixel's path.
        let mut pixels = std::mem::take(&mut self.pixels);
        pixels.resize_with(rect.area(), Pixel::default);
        for (place, pixel) in rect.pixels().zip(&mut pixels) {
            let (raster, seen) = self.trace(tile, place, index, &mut pixel.kept);
            (pixel.place, pixel.raster, pixel.value) = (place, raster, seen.own);
            let first = pixel.kept.first.as_ref().map(|(first, _)| first);
            pixel.starts = first.map_or([Vec3::ZERO; 2], |first| [first.start(first.ng), first.start(-first.ng)]);
            gauge.see(place, index, seen);
        }

        // Share what the second vertices reflect.
        self.pixels = pixels;
        for j in 0..self.pixels.len() {
            self.share(j);
        }
        for pixel in &self.pixels {
            tile.add(pixel.place, pixel.raster, pixel.value);
        }
    }

    /// Samples of a strip that share nothing.
    fn render_alone(&mut self, tile: &mut Tile<'_>, rect: Rect, index: u32, gauge: &mut Gauge) {
        let mut kept = Kept::default();
        let watched = gauge.watches(rect.y0, index);
        for place in rect.pixels() {
            let (raster, value) = if watched {
                let (raster, seen) = self.trace(tile, place, index, &mut kept);
                gauge.see(place, index, seen);
                (raster, seen.own + seen.reflected)
            } else {
                let (raster, s) = tile.sample(place, index);
                let (c, lessons, counters, kept) = (self.c, &mut *self.lessons, &mut *self.counters, &mut kept);
                let mut walk = Walk::<_, false, false> { c, lessons, counters, sampler: s.sampler, aov: s.aov, kept };
                (raster, walk.radiance(s.ray))
            };
            tile.add(place, raster, value);
        }
    }

    /// A path that keeps what it may share.
    fn trace(&mut self, tile: &mut Tile<'_>, place: (u32, u32), index: u32, kept: &mut Kept) -> (Vec2, Seen) {
        let rays = self.counters.rays;
        let (raster, s) = tile.sample(place, index);
        let (c, lessons, counters) = (self.c, &mut *self.lessons, &mut *self.counters);
        let mut walk =
            Walk::<_, false, true> { c, lessons, counters, sampler: s.sampler, aov: s.aov, kept: &mut *kept };
        let own = walk.radiance(s.ray);
        let reflected = kept.unshared();
        let reflected = if self.counters.admit(reflected) { reflected } else { Rgb::ZERO };
        let first = kept.first.as_ref().map(|(_, scattering)| scattering);
        (raster, Seen::new(first, own, reflected, self.counters.rays - rays))
    }

    /// Adds what the second vertex of pixel `j` reflects to all pixels whose first vertices see it.
    fn share(&mut self, j: usize) {
        let Some(second) = &self.pixels[j].kept.second else { return };
        if second.radiance.is_black() {
            return;
        }
        // All rays to it end at the same point, which is on the side of its own path.
        let distance = self
            .pixels
            .iter()
            .filter_map(|p| p.kept.first.as_ref())
            .map(|(first, _)| (second.anchor.p - first.p).abs().max_element());
        let q = second.anchor.end(second.wo, distance.fold(0.0, f32::max));

        // Find the first vertices that may be joined to it.
        self.joined.clear();
        self.rays.clear();
        for (k, pixel) in self.pixels.iter().enumerate() {
            let Some((first, scattering)) = &pixel.kept.first else { continue };
            let d = second.anchor.p - first.p;
            let d2 = d.length_squared();
            let w = d / d2.sqrt();
            let (value, pdf) = match pixel.kept.departed {
                Some(departed) if k == j => departed,
                _ if !(d2 > 0.0 && second.is_same_from(-w)) => continue,
                _ => {
                    let (f, pdf) = scattering.eval_pdf(w, Transport::Radiance);
                    (f * scattering.abs_cos(w), pdf)
                }
            };
            // Where nothing is reflected paths end, so that they do not find the point.
            if value.is_black() {
                continue;
            }
            let to_area = f64::from(w.dot(second.anchor.ng).abs()) / f64::from(d2);
            let traced = k != j;
            if traced {
                let o = pixel.starts[usize::from(w.dot(first.ng) < 0.0)];
                self.rays.push(Ray::segment(o, q - o, 1.0));
            }
            self.joined.push(Join {
                pixel: k,
                w,
                value,
                density: f64::from(pdf) * to_area,
                to_area,
                traced,
                sees: true,
            });
        }

        // Leave out those that don't see it.
        self.counters.rays += self.rays.len() as u64;
        let mut hidden = self.c.scene.accel.occluded_bundle(&self.rays);
        let mut density = 0.0f64;
        for join in &mut self.joined {
            if join.traced {
                join.sees = hidden & 1 == 0;
                hidden >>= 1;
            }
            if join.sees {
                density += join.density;
            }
        }
        if !(density > 0.0 && density.is_finite()) {
            // Edge-on, or too near to tell from the first vertex: its own path's, as if it were alone.
            let alone = self.pixels[j].kept.unshared();
            if self.counters.admit(alone) {
                self.pixels[j].value += alone;
            }
            return;
        }
        for join in self.joined.iter_mut().filter(|join| join.sees) {
            let radiance = if join.traced { second.radiance_towards(-join.w) } else { second.radiance };
            join.value *= radiance * (join.to_area / density) as f32;
        }
        for join in self.joined.iter().filter(|join| join.sees) {
            if self.counters.admit(join.value) {
                self.pixels[join.pixel].value += join.value;
            }
        }
    }
}
