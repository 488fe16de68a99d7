//! How large the blocks of pixels should be that share their paths ([`super::share`]), and how many samples of lights their first vertices
//! should take.

use super::path::LIGHTS;
use super::share::Kept;
use crate::film::{Filter, Rect};
use crate::math::Vec3;
use crate::spectrum::Rgb;

/// Sides of blocks, in pixels; the largest first, which is best where it costs nothing.
const SIDES: [u32; 7] = [8, 6, 5, 4, 3, 2, 1];
/// Side of blocks before anything is known.
const FIRST: u32 = 2;
/// What it costs to try a join, over a ray of a path with what is computed where it arrives; about half of them take a shadow ray, among
/// others to the same point. As counted in instructions.
const JOIN: f64 = 0.2;
/// What all joins of a second vertex cost together, however many: the tree is walked for all of them.
const BUNDLE: f64 = 2.3;
/// What a join's shadow ray costs, all of this included.
pub const JOIN_RAY: f64 = 0.4;
/// What each further sample of a light costs, its ray included, in the same unit; as timed.
const LIGHT: f64 = 0.9;
/// What a sample costs beside its rays, in the same unit: numbers, camera ray, film.
const SAMPLE: f64 = 1.0;
/// So much must be gained at least: it costs something to keep what may be shared, and what is gained is a guess.
const KEEPING: f64 = 1.1;
/// Neighbours are alike if their normals have at least this cosine, and their albedos are as near to each other: what is
/// reflected to others differs by more than noise.
const ALIKE: f32 = 0.95;
/// Side of the regions whose brightness is taken to be one, in pixels.
const REGION: u32 = 16;
/// Keeps relative errors from dividing by the darkness of black regions: this share of the tile's brightness, whatever its scale.
const FLOOR: f64 = 0.1;
/// Of so many strips one is watched, and at least one of each band: what is watched in one decides for the next.
const WATCHED: u32 = 4;
/// Height of a strip in pixels.
const STRIP: u32 = 4;

/// Measures, for the samples of a tile so far, the variance of what paths can share and of what they can't, and what it costs.
///
/// Both are measured as the difference of neighbours on the same kind of surface, relative to the brightness of the region. The tile is
/// cut into bands, and what is watched in every other of them decides for those between: samples of a pixel depend on one another, as
/// together they fill the space of numbers evenly, so that none of them may decide for the others. (Before the first of them all that was
/// watched may.) Which pixels are watched is fixed, and what is watched does not depend on what is decided: of direct light only the
/// first sample of each pixel tells, which takes [`LIGHTS`] samples of lights everywhere.
pub(super) struct Gauge {
    /// For each of [`SIDES`] the variance of a pixel by what is shared, over that by what is not.
    gains: [f64; SIDES.len()],
    rect: Rect,
    /// Number of the first sample of each pixel.
    first: u32,
    /// Whether pixels may share anything.
    shares: bool,
    /// Of bands of even and of odd number.
    halves: [Half; 2],
    /// For each row the pixel that was watched last.
    last: Vec<Option<Seen>>,
}

/// What pixels do.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Choice {
    /// Side of the blocks that share, in pixels.
    pub side: u32,
    /// Samples of lights at first vertices.
    pub lights: u32,
}

/// What was watched in half of the bands.
#[derive(Clone, Default)]
struct Half {
    regions: Vec<Region>,
    /// First samples, their rays, and how many of them have a vertex that takes samples of lights.
    firsts: f64,
    rays: f64,
    lit: f64,
    samples: f64,
    /// Samples that have something to share.
    shared: f64,
}

/// What was watched in a part of the tile.
#[derive(Clone, Copy, Default)]
struct Region {
    /// Of the first samples: their number, their light that is not shared, and pairs of neighbours with the squares of its differences.
    firsts: f64,
    own_light: f64,
    own_pairs: f64,
    own: f64,
    /// Relative variance by the edges between other neighbours.
    edges: f64,
    /// Variance of what their samples of lights find.
    direct: f64,
    /// Of all samples, what can be shared.
    samples: f64,
    reflected_light: f64,
    reflected_pairs: f64,
    reflected: f64,
}

/// Variances summed over regions, each relative to its brightness.
#[derive(Clone, Copy, Default)]
struct Variances {
    own: f64,
    direct: f64,
    reflected: f64,
}

/// A sample.
#[derive(Clone, Copy)]
pub(super) struct Seen {
    /// All light but that which the second vertex reflects.
    pub own: Rgb,
    /// Light that the second vertex reflects, of the sample's own path.
    pub reflected: Rgb,
    /// Normal and albedo of the first surface.
    surface: Option<(Vec3, f32)>,
    /// Rays that it took.
    rays: u64,
    /// Variance of what its samples of lights find, if the first vertex took several.
    direct: Option<f64>,
}

impl Seen {
    /// What came of a path that took so many rays.
    pub fn new(kept: &Kept, own: Rgb, reflected: Rgb, rays: u64) -> Self {
        let surface = kept.first.as_ref().map(|(_, s)| (s.normal(), s.albedo().luminance()));
        Self { own, reflected, surface, rays, direct: kept.scatter }
    }

    /// Whether the first surfaces of two should look alike.
    fn is_like(&self, other: &Self) -> bool {
        let (Some((n, x)), Some((m, y))) = (self.surface, other.surface) else { return false };
        n.dot(m) >= ALIKE && x.min(y) >= ALIKE * x.max(y)
    }
}

impl Gauge {
    /// Of a tile of a picture by this filter whose pixels' first sample is number `first`.
    pub fn new(filter: &Filter, rect: Rect, first: u32, shares: bool) -> Self {
        let alone = filter.spread_of_blocks(1);
        let gain = |side: u32| filter.spread_of_blocks(side) / (alone * f64::from(side * side));
        let regions = rect.width().div_ceil(REGION) as usize * rect.height().div_ceil(REGION) as usize;
        let half = Half { regions: vec![Region::default(); regions], ..Half::default() };
        let last = vec![None; rect.height() as usize];
        Self { gains: SIDES.map(gain), rect, first, shares, halves: [half.clone(), half], last }
    }

    /// Height of the bands.
    fn band(&self) -> u32 {
        (self.rect.height() / 4).next_multiple_of(STRIP).clamp(2 * STRIP, 8 * STRIP)
    }

    /// Whether the band that holds row `y` is one of even number (0) or of odd (1).
    fn half(&self, y: u32) -> usize {
        ((y - self.rect.y0) / self.band()) as usize % 2
    }

    /// Where the band that holds row `y` ends.
    pub fn band_end(&self, y: u32) -> u32 {
        let band = self.band();
        (self.rect.y0 + ((y - self.rect.y0) / band + 1) * band).min(self.rect.y1)
    }

    /// Whether row `y` is the first of a band.
    pub fn begins_band(&self, y: u32) -> bool {
        (y - self.rect.y0).is_multiple_of(self.band())
    }

    /// Where the strip that holds row `y` ends.
    pub fn strip_end(&self, y: u32) -> u32 {
        (self.rect.y0 + ((y - self.rect.y0) / STRIP + 1) * STRIP).min(self.rect.y1)
    }

    /// Whether sample `index` of the pixels of row `y` is watched.
    pub fn watches(&self, y: u32, index: u32) -> bool {
        let strips = self.band() / STRIP;
        (self.shares || index == self.first)
            && ((y - self.rect.y0) / STRIP % strips + index).is_multiple_of(WATCHED.min(strips))
    }

    /// Sample `index` of pixel (x, y), if it is one of those that are watched. Pixels of a row come from left to right.
    pub fn see(&mut self, (x, y): (u32, u32), index: u32, seen: Seen) {
        if !self.watches(y, index) {
            return;
        }
        let (half, first) = (self.half(y), index == self.first);
        let half = &mut self.halves[half];
        let (column, row) = (x - self.rect.x0, y - self.rect.y0);
        let last = self.last[row as usize].replace(seen).filter(|_| column > 0);
        let like = last.filter(|last| last.is_like(&seen));
        let region = &mut half.regions[(row / REGION * self.rect.width().div_ceil(REGION) + column / REGION) as usize];
        half.samples += 1.0;
        half.shared += if seen.reflected.is_black() { 0.0 } else { 1.0 };
        let square = |a: Rgb, b: Rgb| {
            let difference = f64::from((a - b).luminance());
            difference * difference
        };
        region.samples += 1.0;
        region.reflected_light += f64::from(seen.reflected.luminance());
        if let Some(last) = &like {
            region.reflected_pairs += 1.0;
            region.reflected += square(last.reflected, seen.reflected);
        }
        if !first {
            return;
        }
        half.firsts += 1.0;
        half.rays += seen.rays as f64;
        region.firsts += 1.0;
        region.own_light += f64::from(seen.own.luminance());
        if let Some(last) = &like {
            region.own_pairs += 1.0;
            region.own += square(last.own, seen.own);
        } else if let Some(last) = &last {
            region.edges += edge(f64::from(last.own.luminance()), f64::from(seen.own.luminance()));
        }
        if let Some(direct) = seen.direct {
            half.lit += 1.0;
            region.direct += direct;
        }
    }

    /// What makes variance times cost least for sample `index` of row `y`.
    pub fn choose(&self, y: u32, index: u32) -> Choice {
        let (half, first) = (self.half(y), index == self.first);
        let deciding = (0..2).filter(|h| first || *h != half).map(|h| &self.halves[h]);
        let total = |of: fn(&Half) -> f64| deciding.clone().map(of).sum::<f64>();
        let (firsts, samples) = (total(|h| h.firsts), total(|h| h.samples));
        if firsts == 0.0 {
            return Choice { side: if self.shares { FIRST } else { 1 }, lights: LIGHTS };
        }
        let (rays, lit, shared) = (total(|h| h.rays), total(|h| h.lit), total(|h| h.shared));
        let floor = FLOOR * deciding.clone().flat_map(|h| &h.regions).map(Region::brightness).sum::<f64>() / firsts;
        let mut variances = Variances::default();
        deciding.flat_map(|h| &h.regions).for_each(|region| variances.add(region, floor));

        // The first sample tells of lights: it takes several of them.
        let fewest = if first { LIGHTS } else { 1 };
        let sides = SIDES.into_iter().zip(self.gains).filter(|(side, _)| self.shares || *side == 1);
        let choices = sides.flat_map(|both| (fewest..=LIGHTS).rev().map(move |lights| (both, lights)));
        let mut best = (f64::INFINITY, Choice { side: 1, lights: LIGHTS });
        for ((side, gain), lights) in choices {
            let joins = if side > 1 { BUNDLE + JOIN * f64::from(side * side - 1) } else { 0.0 };
            let saved = LIGHT * f64::from(LIGHTS - lights) * lit;
            let cost = SAMPLE + (rays - saved) / firsts + shared / samples * joins;
            // Where nothing has varied yet cost decides.
            let own = variances.own + variances.direct * (f64::from(LIGHTS) / f64::from(lights) - 1.0);
            let variance = own + variances.reflected * gain + f64::MIN_POSITIVE.sqrt();
            let work = cost * variance * if side > 1 { KEEPING } else { 1.0 };
            if work < best.0 {
                best = (work, Choice { side, lights });
            }
        }
        best.1
    }
}

impl Region {
    /// Light of all its first samples together.
    fn brightness(&self) -> f64 {
        let reflected = if self.samples > 0.0 { self.reflected_light / self.samples } else { 0.0 };
        self.own_light + reflected * self.firsts
    }
}

/// Relative variance of a pixel with an edge somewhere between what these two neighbours show: the mean of p (1 - p) (a - b)^2 over the
/// part p that one of them covers, by the square of their mean.
fn edge(a: f64, b: f64) -> f64 {
    let sum = a + b;
    if sum > 0.0 { (a - b) * (a - b) / (1.5 * sum * sum) } else { 0.0 }
}

impl Variances {
    /// Adds those of a region, as often as it has first samples, relative to its brightness, which counts as `floor` at least.
    fn add(&mut self, r: &Region, floor: f64) {
        let level = if r.firsts > 0.0 { (r.brightness() / r.firsts).max(floor) } else { 0.0 };
        let scale = 1.0 / (level * level);
        if !(scale > 0.0 && scale.is_finite()) {
            return;
        }
        // Half the squared difference of two samples is the variance of one.
        let of_pairs =
            |squares: f64, pairs: f64| if pairs > 0.0 { 0.5 * scale * r.firsts * squares / pairs } else { 0.0 };
        self.reflected += of_pairs(r.reflected, r.reflected_pairs);
        self.own += of_pairs(r.own, r.own_pairs) + r.edges;
        self.direct += scale * r.direct;
    }
}

#[cfg(test)]
mod tests;
