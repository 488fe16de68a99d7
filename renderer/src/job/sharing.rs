//! How pixels begin to share paths: by what samples of other groups found there in earlier passes. (How they go on a unit finds out by
//! itself.) Groups of even number go by what those of odd number found, and the other way round, since the samples of a group depend on
//! one another.

use super::plan::{LARGEST_TILE, PassPlan};
use super::settings::RenderSettings;
use super::unit::{Unit, UnitKind};
use crate::film::{Filter, Rect};
use crate::integrator::{Choice, Gains, Lesson};

/// Side of the cells for each of which it is decided, in pixels: each holds whole tiles, if the film is not so large that tiles of adaptive jobs are larger.
const CELL: u32 = LARGEST_TILE;

/// What the samples of a job have taught of sharing.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Sharing {
    /// For each cell, row by row, by groups of even number and by those of odd number. Empty while nothing is known.
    cells: Vec<[Lesson; 2]>,
}

/// The cell that a tile begins in.
fn cell_of(rect: &Rect, width: u32) -> usize {
    (rect.y0 / CELL * width.div_ceil(CELL) + rect.x0 / CELL) as usize
}

impl Sharing {
    /// Adds what a tile of a group has taught.
    pub fn add(&mut self, settings: &RenderSettings, rect: &Rect, replicate: u32, lesson: &Lesson) {
        let (width, height) = (settings.width, settings.height);
        if self.cells.is_empty() {
            let cells = width.div_ceil(CELL) as usize * height.div_ceil(CELL) as usize;
            self.cells = vec![Default::default(); cells];
        }
        if let Some(cell) = self.cells.get_mut(cell_of(rect, width)) {
            cell[replicate as usize % 2].add(lesson);
        }
    }

    /// What the next pass begins with: see [`PassPlan::sharing`].
    pub fn choices(&self, settings: &RenderSettings) -> Vec<[[u8; 2]; 2]> {
        let gains = Gains::of(&Filter::new(&settings.filter, settings.width, settings.height));
        let choice = |lesson: &Lesson| lesson.choose(&gains, true, 1).map_or([0, 0], Choice::to_bytes);
        self.cells.iter().map(|[even, odd]| [choice(odd), choice(even)]).collect()
    }

    /// The bits of its numbers.
    pub fn to_bits(&self) -> Vec<[u64; Lesson::NUMBERS]> {
        self.cells.iter().flatten().map(|lesson| lesson.numbers().map(f64::to_bits)).collect()
    }

    /// Of what [`Sharing::to_bits`] gave; `None` where it did not.
    pub fn of_bits(bits: &[[u64; Lesson::NUMBERS]]) -> Option<Self> {
        let lesson = |bits: &[u64; Lesson::NUMBERS]| Lesson::of_numbers(bits.map(f64::from_bits));
        let (pairs, rest) = bits.as_chunks::<2>();
        let cells = pairs.iter().map(|[even, odd]| Some([lesson(even)?, lesson(odd)?])).collect::<Option<_>>()?;
        rest.is_empty().then_some(Self { cells })
    }
}

/// What the first samples of a unit do, if the plan says so.
pub fn begin(plan: &PassPlan, unit: &Unit) -> Option<Choice> {
    let UnitKind::Tile { rect, .. } = &unit.kind else { return None };
    let cell = plan.sharing.get(cell_of(rect, plan.width))?;
    Choice::of_bytes(cell[unit.replicate as usize % 2])
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::integrator::IntegratorKind;
    use crate::job::RenderOptions;
    use crate::scene::desc::RenderDefaults;

    fn settings() -> RenderSettings {
        let options = RenderOptions { size: Some((300, 130)), ..RenderOptions::counting(IntegratorKind::Path, 64) };
        RenderSettings::resolve(&options, &RenderDefaults::default()).unwrap()
    }

    #[test]
    fn groups_go_by_what_the_others_found() {
        let s = settings();
        let mut sharing = Sharing::default();
        assert!(sharing.choices(&s).is_empty());
        let much = Lesson {
            firsts: 1.0,
            rays: 6.0,
            samples: 1.0,
            lit: 1.0,
            shared: 1.0,
            own: 0.01,
            reflected: 4.0,
            ..Lesson::default()
        };
        let none = Lesson { own: 1.0, direct: 9.0, reflected: 0.0, ..much };
        let rect = |x0, y0| Rect { x0, y0, x1: x0 + 32, y1: y0 + 2 };
        sharing.add(&s, &rect(288, 128), 4, &much);
        sharing.add(&s, &rect(288, 128), 7, &none);
        sharing.add(&s, &rect(96, 96), 1, &much);
        let choices = sharing.choices(&s);
        assert_eq!(choices.len(), 6);
        assert_eq!(choices[5][0], [1, 2], "even groups go by the odd, which found nothing to share and much to split");
        assert!(choices[5][1][0] >= 5 && choices[5][1][1] == 1, "{:?}", choices[5]);
        assert!(choices[0][0][0] >= 5 && choices[0][1] == [0, 0], "{:?}", choices[0]);
        assert_eq!(choices[1], [[0, 0]; 2]);
        assert_eq!(Sharing::of_bits(&sharing.to_bits()), Some(sharing.clone()));
        let mut bits = sharing.to_bits();
        bits[3][2] = f64::NAN.to_bits();
        assert_eq!(Sharing::of_bits(&bits), None);
        assert_eq!(Sharing::of_bits(&sharing.to_bits()[1..]), None);
    }
}
