//! How large the blocks of pixels should be that share their paths ([`super::share`]), and how many samples of lights their first vertices
//! should take.

mod lesson;

use super::path::LIGHTS;
use super::share::Kept;
use crate::film::{Filter, Rect};
use crate::math::Vec3;
use crate::spectrum::Rgb;
pub use lesson::{Choice, Gains, JOIN_RAY, Lesson};

/// Side of blocks before anything is known.
const FIRST: u32 = 2;
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
    gains: Gains,
    rect: Rect,
    /// Number of the first sample of each pixel.
    first: u32,
    /// Whether pixels may share anything.
    shares: bool,
    /// What other samples say the first should do.
    begin: Option<Choice>,
    /// Of bands of even and of odd number.
    halves: [Half; 2],
    /// For each row the pixel that was watched last.
    last: Vec<Option<Seen>>,
}

/// What was watched in half of the bands.
#[derive(Clone, Default)]
struct Half {
    regions: Vec<Region>,
    /// How many samples, and their rays; variances are those of the regions.
    counts: Lesson,
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
    /// Of a tile of a picture by this filter whose pixels' first sample is number `first`; `begin` is what samples of others say it
    /// should do.
    pub fn new(filter: &Filter, rect: Rect, first: u32, shares: bool, begin: Option<Choice>) -> Self {
        let regions = rect.width().div_ceil(REGION) as usize * rect.height().div_ceil(REGION) as usize;
        let half = Half { regions: vec![Region::default(); regions], ..Half::default() };
        let last = vec![None; rect.height() as usize];
        Self { gains: Gains::of(filter), rect, first, shares, begin, halves: [half.clone(), half], last }
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
        half.counts.samples += 1.0;
        half.counts.shared += if seen.reflected.is_black() { 0.0 } else { 1.0 };
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
        half.counts.firsts += 1.0;
        half.counts.rays += seen.rays as f64;
        region.firsts += 1.0;
        region.own_light += f64::from(seen.own.luminance());
        if let Some(last) = &like {
            region.own_pairs += 1.0;
            region.own += square(last.own, seen.own);
        } else if let Some(last) = &last {
            region.edges += edge(f64::from(last.own.luminance()), f64::from(seen.own.luminance()));
        }
        if let Some(direct) = seen.direct {
            half.counts.lit += 1.0;
            region.direct += direct;
        }
    }

    /// What makes variance times cost least for sample `index` of row `y`.
    pub fn choose(&self, y: u32, index: u32) -> Choice {
        let first = index == self.first;
        if let Some(begin) = self.begin.filter(|_| first) {
            return Choice { side: if self.shares { begin.side } else { 1 }, ..begin };
        }
        let half = self.half(y);
        let lesson = Self::lesson_of((0..2).filter(|h| first || *h != half).map(|h| &self.halves[h]));
        // The first sample tells of lights: it takes several of them.
        let fewest = if first { LIGHTS } else { 1 };
        let unknown = Choice { side: if self.shares { FIRST } else { 1 }, lights: LIGHTS };
        lesson.choose(&self.gains, self.shares, fewest).unwrap_or(unknown)
    }

    /// How many samples of lights a pixel of row `y` takes for sample `index` where `lights` were chosen.
    pub fn lights(&self, y: u32, index: u32, lights: u32) -> u32 {
        if index == self.first && self.watches(y, index) { LIGHTS } else { lights }
    }

    /// What all that was watched teaches.
    pub fn lesson(&self) -> Lesson {
        Self::lesson_of(self.halves.iter())
    }

    fn lesson_of<'a>(halves: impl Iterator<Item = &'a Half> + Clone) -> Lesson {
        let mut lesson = Lesson::default();
        halves.clone().for_each(|half| lesson.add(&half.counts));
        let regions = || halves.clone().flat_map(|h| &h.regions);
        let floor = FLOOR * regions().map(Region::brightness).sum::<f64>() / lesson.firsts;
        regions().for_each(|region| region.teach(&mut lesson, floor));
        lesson
    }
}

impl Region {
    /// Light of all its first samples together.
    fn brightness(&self) -> f64 {
        let reflected = if self.samples > 0.0 { self.reflected_light / self.samples } else { 0.0 };
        self.own_light + reflected * self.firsts
    }

    /// Adds its variances, as often as it has first samples, relative to its brightness, which counts as `floor` at least.
    fn teach(&self, lesson: &mut Lesson, floor: f64) {
        let level = if self.firsts > 0.0 { (self.brightness() / self.firsts).max(floor) } else { 0.0 };
        let scale = 1.0 / (level * level);
        if !(scale > 0.0 && scale.is_finite()) {
            return;
        }
        // Half the squared difference of two samples is the variance of one.
        let of_pairs =
            |squares: f64, pairs: f64| if pairs > 0.0 { 0.5 * scale * self.firsts * squares / pairs } else { 0.0 };
        lesson.reflected += of_pairs(self.reflected, self.reflected_pairs);
        lesson.own += of_pairs(self.own, self.own_pairs) + self.edges;
        lesson.direct += scale * self.direct;
    }
}

/// Relative variance of a pixel with an edge somewhere between what these two neighbours show: the mean of p (1 - p) (a - b)^2 over the
/// part p that one of them covers, by the square of their mean.
fn edge(a: f64, b: f64) -> f64 {
    let sum = a + b;
    if sum > 0.0 { (a - b) * (a - b) / (1.5 * sum * sum) } else { 0.0 }
}

#[cfg(test)]
mod tests;
