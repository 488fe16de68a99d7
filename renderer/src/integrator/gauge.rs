//! How large the blocks of pixels should be that share their paths ([`super::share`]).

use crate::film::{Filter, Rect};
use crate::math::Vec3;
use crate::path::Scattering;
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
/// What a sample costs beside its rays, in the same unit: numbers, camera ray, film.
const SAMPLE: f64 = 1.0;
/// So much must be gained at least: it costs something to keep what may be shared, and what is gained is a guess.
const KEEPING: f64 = 1.1;
/// Neighbours are compared if their normals have at least this cosine, and their albedos are as near to each other: what differs
/// otherwise is not noise.
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
/// watched may.) Which pixels are watched is fixed, and what is watched does not depend on what is shared.
pub(super) struct Gauge {
    /// For each of [`SIDES`] the variance of a pixel by what is shared, over that by what is not.
    gains: [f64; SIDES.len()],
    rect: Rect,
    /// Of bands of even and of odd number.
    halves: [Half; 2],
    /// For each row the pixel that was watched last.
    last: Vec<Option<Seen>>,
}

/// What was watched in half of the bands.
#[derive(Clone, Default)]
struct Half {
    regions: Vec<Region>,
    samples: f64,
    rays: f64,
    /// Samples that have something to share.
    shared: f64,
}

/// What was watched in a part of the tile.
#[derive(Clone, Copy, Default)]
struct Region {
    samples: f64,
    brightness: f64,
    /// Squared differences of what is not shared.
    own: f64,
    /// Of what can be shared.
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
    pub rays: u64,
}

impl Seen {
    /// A sample whose path has this first vertex.
    pub fn new(first: Option<&Scattering>, own: Rgb, reflected: Rgb, rays: u64) -> Self {
        let surface = first.map(|s| (s.normal(), s.albedo().luminance()));
        Self { own, reflected, surface, rays }
    }

    /// Whether the first surfaces of two should look alike.
    fn is_like(&self, other: &Self) -> bool {
        let (Some((n, x)), Some((m, y))) = (self.surface, other.surface) else { return false };
        n.dot(m) >= ALIKE && x.min(y) >= ALIKE * x.max(y)
    }
}

impl Gauge {
    /// Of a tile of a picture by this filter.
    pub fn new(filter: &Filter, rect: Rect) -> Self {
        let alone = filter.spread_of_blocks(1);
        let gain = |side: u32| filter.spread_of_blocks(side) / (alone * f64::from(side * side));
        let regions = rect.width().div_ceil(REGION) as usize * rect.height().div_ceil(REGION) as usize;
        let half = Half { regions: vec![Region::default(); regions], ..Half::default() };
        let last = vec![None; rect.height() as usize];
        Self { gains: SIDES.map(gain), rect, halves: [half.clone(), half], last }
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
        ((y - self.rect.y0) / STRIP % strips + index).is_multiple_of(WATCHED.min(strips))
    }

    /// Sample `index` of pixel (x, y), if it is one of those that are watched. Pixels of a row come from left to right.
    pub fn see(&mut self, (x, y): (u32, u32), index: u32, seen: Seen) {
        if !self.watches(y, index) {
            return;
        }
        let half = self.half(y);
        let half = &mut self.halves[half];
        half.samples += 1.0;
        half.rays += seen.rays as f64;
        half.shared += if seen.reflected.is_black() { 0.0 } else { 1.0 };
        let (column, row) = (x - self.rect.x0, y - self.rect.y0);
        let region = &mut half.regions[(row / REGION * self.rect.width().div_ceil(REGION) + column / REGION) as usize];
        let luminance = f64::from((seen.own + seen.reflected).luminance());
        if !luminance.is_finite() {
            return;
        }
        region.samples += 1.0;
        region.brightness += luminance;
        let last = self.last[row as usize].replace(seen);
        if let Some(last) = last.filter(|last| column > 0 && last.is_like(&seen)) {
            let own = f64::from((last.own - seen.own).luminance());
            let reflected = f64::from((last.reflected - seen.reflected).luminance());
            region.own += own * own;
            region.reflected += reflected * reflected;
        }
    }

    /// The side of blocks for which variance times cost is least in row `y`; `first`: its pixels have no samples yet.
    pub fn side(&self, y: u32, first: bool) -> u32 {
        let half = self.half(y);
        let deciding = (0..2).filter(|h| first || *h != half).map(|h| &self.halves[h]);
        let total = |of: fn(&Half) -> f64| deciding.clone().map(of).sum::<f64>();
        let (samples, rays, shared) = (total(|h| h.samples), total(|h| h.rays), total(|h| h.shared));
        if samples == 0.0 {
            return FIRST;
        }
        let regions = || deciding.clone().flat_map(|h| &h.regions);
        let floor = FLOOR * regions().map(|r| r.brightness).sum::<f64>() / samples;
        let sum = |sum: (f64, f64), region: (f64, f64)| (sum.0 + region.0, sum.1 + region.1);
        let (own, reflected) = regions().map(|r| r.relative(floor)).fold((0.0, 0.0), sum);
        let work = |(side, gain): (&u32, &f64)| {
            let joins = if *side > 1 { BUNDLE + JOIN * f64::from(side * side - 1) } else { 0.0 };
            let cost = samples * SAMPLE + rays + shared * joins;
            // Where nothing has varied yet cost decides.
            let variance = own + reflected * gain + f64::MIN_POSITIVE.sqrt();
            cost * variance * if *side > 1 { KEEPING } else { 1.0 }
        };
        let works = SIDES.iter().zip(&self.gains).map(|both| (*both.0, work(both)));
        works.reduce(|best, next| if next.1 < best.1 { next } else { best }).map_or(1, |(side, _)| side)
    }
}

impl Region {
    /// Its squared differences relative to its brightness, which counts as `floor` at least.
    fn relative(&self, floor: f64) -> (f64, f64) {
        let mean = if self.samples > 0.0 { self.brightness / self.samples } else { 0.0 };
        let level = mean.max(floor);
        if level > 0.0 { (self.own / (level * level), self.reflected / (level * level)) } else { (0.0, 0.0) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::desc::FilterDesc;

    const TILE: Rect = Rect { x0: 32, y0: 64, x1: 64, y1: 128 };

    /// Shows sample `index` of the pixels of rows `rows`, of which every other one is brighter.
    fn watch(gauge: &mut Gauge, rows: std::ops::Range<u32>, index: u32, own: f32, reflected: f32) {
        for y in rows {
            for x in TILE.x0..TILE.x1 {
                let odd = ((x + y) % 2) as f32;
                let surface = Some((Vec3::Y, 0.5));
                let (own, reflected) = (Rgb::splat(1.0 + own * odd), Rgb::splat(reflected * (odd + 1.0)));
                gauge.see((x, y), index, Seen { own, reflected, surface, rays: 6 });
            }
        }
    }

    fn gauge() -> Gauge {
        Gauge::new(&Filter::new(&FilterDesc::Box { radius: 0.5 }, 256, 256), TILE)
    }

    /// The side after samples of the whole tile.
    fn side_after(own: f32, reflected: f32) -> u32 {
        let mut gauge = gauge();
        watch(&mut gauge, TILE.y0..TILE.y1, 0, own, reflected);
        gauge.side(TILE.y0, false)
    }

    #[test]
    fn blocks_grow_with_what_is_shared() {
        assert_eq!(gauge().side(TILE.y0, true), FIRST);
        // Nothing to share, nothing that varies, noise that can't be shared.
        assert_eq!([side_after(0.5, 0.0), side_after(0.0, 0.0), side_after(0.5, 0.01)], [1, 1, 1]);
        let sides = [0.1f32, 0.2, 0.5, 2.0].map(|reflected| side_after(0.05, reflected));
        assert!(sides.windows(2).all(|w| w[0] <= w[1]) && sides[0] > 1 && sides[3] >= 5, "{sides:?}");
    }

    /// However low the tile, its first sample tells of both halves, so that no band goes on without knowing anything.
    #[test]
    fn both_halves_are_watched_from_the_first() {
        for height in 9..70 {
            let mut gauge =
                Gauge::new(&Filter::new(&FilterDesc::Box { radius: 0.5 }, 256, 256), Rect { y1: 64 + height, ..TILE });
            watch(&mut gauge, 64..64 + height, 0, 0.05, 2.0);
            assert!(gauge.halves.iter().all(|h| h.samples > 0.0), "{height} rows");
        }
    }

    /// With samples a and b of variance V alone and `V / n` shared by n, the best of the sides is that of least cost times variance.
    #[test]
    fn the_side_is_the_best_one() {
        let (own, reflected) = (0.1f64, 0.4);
        let work = |side: u32| {
            let n = f64::from(side * side);
            let (keeping, bundle) = if side > 1 { (KEEPING, BUNDLE) } else { (1.0, 0.0) };
            (SAMPLE + 6.0 + bundle + JOIN * (n - 1.0)) * (own * own + reflected * reflected / n) * keeping
        };
        let best = SIDES.into_iter().min_by(|a, b| work(*a).total_cmp(&work(*b)));
        assert_eq!(Some(side_after(own as f32, reflected as f32)), best);
    }

    /// Once a pixel has samples, none of its band has a say in how it goes on.
    #[test]
    fn no_band_decides_for_itself() {
        let mut gauge = gauge();
        let first_band = TILE.y0..gauge.band_end(TILE.y0);
        watch(&mut gauge, first_band.clone(), 0, 0.05, 2.0);
        assert!(gauge.side(first_band.start, true) > 2);
        assert_eq!(gauge.side(first_band.start, false), FIRST);
        assert!(gauge.side(first_band.end, false) > 2);
        let of_others = gauge.band_end(first_band.end);
        watch(&mut gauge, first_band.end..of_others, 1, 0.5, 0.0);
        assert_eq!(gauge.side(first_band.start, false), 1);
    }
}
