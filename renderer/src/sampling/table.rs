//! Distributions given by tables of weights: discrete choices and piecewise-constant densities.
//!
//! Sums run in f64. Weights that are not positive and finite count as zero, and what has weight zero is never drawn.

use crate::math::{ONE_MINUS_EPSILON, Vec2};

/// An index drawn from a [`Discrete`] table.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Choice {
    /// Which entry.
    pub index: usize,
    /// Its probability.
    pub pmf: f32,
    /// What is left of the random number: again uniform in [0, 1), independent of `index`.
    pub u: f32,
}

/// A discrete distribution over `0..len`, drawn by binary search of its cumulative weights.
#[derive(Clone, Debug, PartialEq)]
pub struct Discrete {
    /// `cumulative[i]` = sum of the weights before `i`; one entry more than weights.
    cumulative: Vec<f64>,
}

impl Discrete {
    /// From non-negative weights; `None` when they are all zero or there are none.
    pub fn new(weights: &[f32]) -> Option<Self> {
        let mut sum = 0.0f64;
        let mut cumulative = Vec::with_capacity(weights.len() + 1);
        cumulative.push(0.0);
        for &w in weights {
            sum += if w.is_finite() && w > 0.0 { f64::from(w) } else { 0.0 };
            cumulative.push(sum);
        }
        (sum > 0.0).then_some(Self { cumulative })
    }

    /// Number of entries.
    #[inline]
    pub fn len(&self) -> usize {
        self.cumulative.len() - 1
    }

    /// Never: a distribution has an entry with a weight.
    #[inline]
    pub fn is_empty(&self) -> bool {
        false
    }

    /// Sum of the weights.
    #[inline]
    pub fn total(&self) -> f64 {
        self.cumulative[self.len()]
    }

    /// Probability of an entry.
    #[inline]
    pub fn pmf(&self, index: usize) -> f32 {
        ((self.cumulative[index + 1] - self.cumulative[index]) / self.total()) as f32
    }

    /// A number by which [`Discrete::sample`] draws `index`, which must have a weight; uniform among them for a uniform `rest`.
    pub fn locate(&self, index: usize, rest: f32) -> f32 {
        let (low, high) = (self.cumulative[index], self.cumulative[index + 1]);
        let at = |rest: f64| ((low + (high - low) * rest) / self.total()) as f32;
        let u = at(f64::from(rest));
        // Rounding may lead into a neighbour.
        if self.sample(u).index == index { u } else { at(0.5) }
    }

    /// Draws an entry by `u` in [0, 1).
    #[inline]
    pub fn sample(&self, u: f32) -> Choice {
        // u < 1 keeps the target below the total in f64, so the entry found has a weight: its upper sum exceeds its lower.
        let u = if u > 0.0 { u.min(ONE_MINUS_EPSILON) } else { 0.0 };
        let target = f64::from(u) * self.total();
        let index = self.cumulative.partition_point(|&c| c <= target) - 1;
        let (low, high) = (self.cumulative[index], self.cumulative[index + 1]);
        let rest = ((target - low) / (high - low)) as f32;
        Choice { index, pmf: ((high - low) / self.total()) as f32, u: rest.clamp(0.0, ONE_MINUS_EPSILON) }
    }
}

/// A point drawn from a [`Distribution1D`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Cell1D {
    /// The point in [0, 1).
    pub x: f32,
    /// Density there; equal to [`Distribution1D::pdf`] of `x`.
    pub pdf: f32,
    /// The cell that holds it.
    pub index: usize,
}

/// A piecewise-constant density over [0, 1) with cells of equal width; at most 2^20 of them.
#[derive(Clone, Debug, PartialEq)]
pub struct Distribution1D {
    table: Discrete,
}

impl Distribution1D {
    /// From the cells' weights; `None` when all are zero.
    pub fn new(weights: &[f32]) -> Option<Self> {
        Discrete::new(weights).map(|table| Self { table })
    }

    /// The uniform density, of one cell.
    fn uniform() -> Self {
        Self { table: Discrete { cumulative: vec![0.0, 1.0] } }
    }

    /// Number of cells.
    #[inline]
    pub fn cells(&self) -> usize {
        self.table.len()
    }

    /// Mean of the weights: the integral over [0, 1).
    #[inline]
    pub fn integral(&self) -> f64 {
        self.table.total() / self.table.len() as f64
    }

    /// Draws a point by `u` in [0, 1).
    #[inline]
    pub fn sample(&self, u: f32) -> Cell1D {
        let choice = self.table.sample(u);
        let x = point_in_cell(choice.index, choice.u, self.cells());
        Cell1D { x, pdf: choice.pmf * self.cells() as f32, index: choice.index }
    }

    /// Density at `x` in [0, 1).
    #[inline]
    pub fn pdf(&self, x: f32) -> f32 {
        self.table.pmf(cell_of(x, self.cells())) * self.cells() as f32
    }
}

/// A point drawn from a [`Distribution2D`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Cell2D {
    /// The point in [0, 1)^2.
    pub p: Vec2,
    /// Density there; equal to [`Distribution2D::pdf`] of `p`.
    pub pdf: f32,
    /// Column and row of the cell that holds it.
    pub cell: [usize; 2],
}

/// A piecewise-constant density over the unit square, row by row.
#[derive(Clone, Debug, PartialEq)]
pub struct Distribution2D {
    /// Over y.
    rows: Distribution1D,
    /// Over x within each row; uniform where the row is black and never drawn.
    columns: Vec<Distribution1D>,
}

impl Distribution2D {
    /// From `width * height` weights, row-major; `None` when all are zero or their number is another.
    pub fn new(width: usize, height: usize, weights: &[f32]) -> Option<Self> {
        if width == 0 || width.checked_mul(height) != Some(weights.len()) {
            return None;
        }
        let rows: Vec<_> = weights.chunks_exact(width).map(Distribution1D::new).collect();
        let means: Vec<f32> = rows.iter().map(|r| r.as_ref().map_or(0.0, |r| r.integral() as f32)).collect();
        let columns = rows.into_iter().map(|r| r.unwrap_or_else(Distribution1D::uniform)).collect();
        Some(Self { rows: Distribution1D::new(&means)?, columns })
    }

    /// Mean of the weights: the integral over the unit square.
    #[inline]
    pub fn integral(&self) -> f64 {
        self.rows.integral()
    }

    /// Draws a point by `u` in [0, 1)^2: `u.y` chooses the row.
    #[inline]
    pub fn sample(&self, u: Vec2) -> Cell2D {
        let row = self.rows.sample(u.y);
        let column = self.columns[row.index].sample(u.x);
        Cell2D { p: Vec2::new(column.x, row.x), pdf: column.pdf * row.pdf, cell: [column.index, row.index] }
    }

    /// Density at `p` in [0, 1)^2.
    #[inline]
    pub fn pdf(&self, p: Vec2) -> f32 {
        let row = cell_of(p.y, self.rows.cells());
        self.columns[row].pdf(p.x) * self.rows.pdf(p.y)
    }
}

/// The cell of `n` that holds `x`.
#[inline]
fn cell_of(x: f32, n: usize) -> usize {
    ((x * n as f32) as usize).min(n - 1)
}

/// The point at `u` in [0, 1) of cell `i` of `n`, kept in that cell whatever the rounding.
#[inline]
fn point_in_cell(i: usize, u: f32, n: usize) -> f32 {
    let mut x = ((i as f32 + u) / n as f32).min(ONE_MINUS_EPSILON);
    while cell_of(x, n) > i {
        x = x.next_down();
    }
    while cell_of(x, n) < i {
        x = x.next_up();
    }
    x
}
