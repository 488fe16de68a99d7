use super::super::path::LIGHTS;
use crate::film::Filter;

/// Sides of blocks, in pixels; the largest first, which is best where it costs nothing.
pub(super) const SIDES: [u32; 7] = [8, 6, 5, 4, 3, 2, 1];
/// What it costs to try a join, over a ray of a path with what is computed where it arrives; about half of them take a shadow ray, among
/// others to the same point. As counted in instructions.
pub(super) const JOIN: f64 = 0.2;
/// What all joins of a second vertex cost together, however many: the tree is walked for all of them.
pub(super) const BUNDLE: f64 = 2.3;
/// What a join's shadow ray costs, all of this included.
pub const JOIN_RAY: f64 = 0.4;
/// What each further sample of a light costs, its ray included, in the same unit; as timed.
pub(super) const LIGHT: f64 = 0.9;
/// What a sample costs beside its rays, in the same unit: numbers, camera ray, film.
pub(super) const SAMPLE: f64 = 1.0;
/// So much must be gained at least: it costs something to keep what may be shared, and what is gained is a guess.
pub(super) const KEEPING: f64 = 1.1;
/// What pixels do.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Choice {
    /// Side of the blocks that share, in pixels.
    pub side: u32,
    /// Samples of lights at first vertices.
    pub lights: u32,
}

impl Choice {
    /// As two bytes.
    pub fn to_bytes(self) -> [u8; 2] {
        [self.side as u8, self.lights as u8]
    }

    /// What [`Choice::to_bytes`] gave; `None` where that is no choice.
    pub fn of_bytes([side, lights]: [u8; 2]) -> Option<Self> {
        let choice = Self { side: side.into(), lights: lights.into() };
        (SIDES.contains(&choice.side) && (1..=LIGHTS).contains(&choice.lights)).then_some(choice)
    }
}

/// For each side of blocks the variance of a pixel by what is shared, over that by what is not.
#[derive(Clone, Copy, Debug)]
pub struct Gains([f64; SIDES.len()]);

impl Gains {
    /// In pictures by this filter.
    pub fn of(filter: &Filter) -> Self {
        let alone = filter.spread_of_blocks(1);
        Self(SIDES.map(|side| filter.spread_of_blocks(side) / (alone * f64::from(side * side))))
    }
}

/// What watched samples teach of sharing: sums, which add up over tiles.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Lesson {
    /// First samples of their pixels, their rays, and how many of them have a vertex that takes samples of lights.
    pub firsts: f64,
    /// See `firsts`.
    pub rays: f64,
    /// See `firsts`.
    pub lit: f64,
    /// Samples.
    pub samples: f64,
    /// Samples that have something to share.
    pub shared: f64,
    /// Variances, as often as there are first samples, each relative to the brightness of its surroundings: of what is not shared,
    pub own: f64,
    /// of what samples of lights find, [`LIGHTS`] of them,
    pub direct: f64,
    /// and of what can be shared.
    pub reflected: f64,
}

impl Lesson {
    /// How many numbers it is.
    pub const NUMBERS: usize = 8;

    /// Its numbers.
    pub fn numbers(&self) -> [f64; Self::NUMBERS] {
        let Self { firsts, rays, lit, samples, shared, own, direct, reflected } = *self;
        [firsts, rays, lit, samples, shared, own, direct, reflected]
    }

    /// Of its numbers; `None` where they are none of a lesson.
    pub fn of_numbers(numbers: [f64; Self::NUMBERS]) -> Option<Self> {
        let [firsts, rays, lit, samples, shared, own, direct, reflected] = numbers;
        let sound = numbers.iter().all(|v| v.is_finite() && *v >= 0.0);
        sound.then_some(Self { firsts, rays, lit, samples, shared, own, direct, reflected })
    }

    /// This, if its numbers are some: squares of very bright light may be out of range.
    pub fn checked(self) -> Option<Self> {
        Self::of_numbers(self.numbers())
    }

    /// Adds what others teach.
    pub fn add(&mut self, other: &Self) {
        let (a, b) = (self.numbers(), other.numbers());
        *self = Self::of_numbers(std::array::from_fn(|i| a[i] + b[i])).unwrap_or(*self);
    }

    /// What makes variance times cost least, with at least `fewest` samples of lights; `None` where nothing is known.
    pub fn choose(&self, gains: &Gains, shares: bool, fewest: u32) -> Option<Choice> {
        if self.firsts == 0.0 {
            return None;
        }
        let sides = SIDES.into_iter().zip(gains.0).filter(|(side, _)| shares || *side == 1);
        let choices = sides.flat_map(|both| (fewest..=LIGHTS).rev().map(move |lights| (both, lights)));
        let mut best = (f64::INFINITY, Choice { side: 1, lights: LIGHTS });
        for ((side, gain), lights) in choices {
            let joins = if side > 1 { BUNDLE + JOIN * f64::from(side * side - 1) } else { 0.0 };
            let saved = LIGHT * f64::from(LIGHTS - lights) * self.lit;
            let cost = SAMPLE + (self.rays - saved) / self.firsts + self.shared / self.samples * joins;
            // Where nothing has varied yet cost decides.
            let own = self.own + self.direct * (f64::from(LIGHTS) / f64::from(lights) - 1.0);
            let variance = own + self.reflected * gain + f64::MIN_POSITIVE.sqrt();
            let work = cost * variance * if side > 1 { KEEPING } else { 1.0 };
            if work < best.0 {
                best = (work, Choice { side, lights });
            }
        }
        Some(best.1)
    }
}
