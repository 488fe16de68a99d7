//! Samples where they are needed: tiles get them by the noise that is left of them, and what has converged gets few or none.
//!
//! Choosing the samples of a tile by what these very samples found is biased (Kirk and Arvo 1991, "Unbiased Sampling Techniques for Image
//! Synthesis"): a bright path found by chance calls for more samples, which thin it out; one that was missed does not. So the replicate
//! groups are halved, and each half deals its samples by the noise of the other: the number of a group's samples is independent of what
//! they find, and the group's expectation is the image. All groups count alike, whatever they were dealt.

use super::plan::Dealing;
use super::planner::CHECKPOINT_SAMPLES;
use super::settings::RenderSettings;
use crate::film::{GroupFilm, TileGrid, TiledFilm};

/// Samples of a pixel that each group has before its noise is believed, where their number is known to be small beside what is to come.
const PILOT: u32 = 2;
/// Share of the samples that goes to all pixels alike: what seems quiet may not have been found yet.
const UNIFORM_SHARE: f64 = 0.2;
/// Keeps relative errors from dividing by the darkness of black pixels, as in the error that is told.
const FLOOR: f64 = 0.01;

/// The films of the groups of an adaptive job; a job of another kind has none of these.
pub fn films(settings: &RenderSettings) -> Option<Vec<GroupFilm>> {
    let grid = settings.adapts().then(|| TileGrid::of_film(settings.width, settings.height))?;
    let film = || GroupFilm::Tiled(TiledFilm::new(grid, settings.reach()));
    Some((0..settings.replicates).map(|_| film()).collect())
}

/// Samples per pixel, in all groups, that go to all tiles alike. In a job that time or error ends, passes of whole groups wait until they
/// are small beside what is done.
pub fn pilot(settings: &RenderSettings) -> u32 {
    settings.replicates * if settings.budget.is_counted() { PILOT } else { CHECKPOINT_SAMPLES }
}

/// How the next pass deals `share` samples per pixel of each group, after `done` of all groups; `None` where that is the same for all
/// tiles: while there is nothing to go by.
pub fn deal(settings: &RenderSettings, films: &[GroupFilm], done: u32, share: u32) -> Option<Vec<Vec<[u32; 2]>>> {
    let g = settings.replicates;
    if g < 4 || done < pilot(settings) || !done.is_multiple_of(g) {
        return None;
    }
    let (even, odd) = (half(films, 0), half(films, 1));
    let total = done / g + share;
    Some(vec![ranges(even.first()?, &odd, total), ranges(odd.first()?, &even, total)])
}

/// The films of the groups of even or of odd number.
fn half(films: &[GroupFilm], odd: usize) -> Vec<&TiledFilm> {
    let tiled = films.iter().skip(odd).step_by(2).map(|f| match f {
        GroupFilm::Tiled(t) => Some(t),
        _ => None,
    });
    tiled.flatten().collect()
}

/// First sample and one past the last, for each tile of groups like `own`, by the noise of `others`; `total` samples per pixel afterwards.
fn ranges(own: &TiledFilm, others: &[&TiledFilm], total: u32) -> Vec<[u32; 2]> {
    let grid = own.grid();
    let tiles = || 0..grid.tiles();
    let areas: Vec<f64> = tiles().map(|t| grid.rect(t).area() as f64).collect();
    let done: Vec<f64> = tiles().map(|t| f64::from(own.samples(t))).collect();
    let wanted = wanted(&tiles().map(|t| need(others, t)).collect::<Vec<_>>(), &areas);
    // What rounding left out in earlier passes is made up for.
    let budget: f64 = areas.iter().zip(&done).map(|(area, done)| area * (f64::from(total) - done)).sum();
    let level = level(&wanted, &done, &areas, budget);

    // Round, and hand on what rounding leaves to the next tile that needs some; the last one takes the rest.
    let needs: Vec<f64> = wanted.iter().zip(&done).map(|(wanted, done)| (level * wanted - done).max(0.0)).collect();
    let last = needs.iter().rposition(|n| *n > 0.0);
    let mut left = 0.0;
    let range = |t: usize| {
        let most = done[t] + needs[t] + left / areas[t];
        let upto = if last == Some(t) {
            f64::max(most.floor(), done[t])
        } else if needs[t] > 0.0 {
            rounded(done[t], most)
        } else {
            done[t]
        };
        left += (done[t] + needs[t] - upto) * areas[t];
        [done[t] as u32, upto as u32]
    };
    (0..areas.len()).map(range).collect()
}

/// The largest number of samples not above `upto` of those that a tile may have after `done`: powers of two and what lies half-way between
/// them, since samples fill the space of numbers most evenly then, and what a tile's first samples teach of its paths is used by many.
fn rounded(done: f64, upto: f64) -> f64 {
    let (mut n, mut next, mut step) = (done, 1.0, 1.0);
    while next <= upto {
        n = f64::max(n, next);
        // 1, 2, 3, 4, 6, 8, 12, 16, ...
        let twice = next >= 4.0 * step;
        step *= if twice { 2.0 } else { 1.0 };
        next += step;
    }
    n
}

/// What a tile should have of the samples, up to a factor: the noise of one sample over the square root of what a sample costs (Neyman
/// 1934), noise being the relative error of a pixel that the image's error is the mean square of.
fn need(films: &[&TiledFilm], tile: u32) -> f64 {
    let n = films.first().map_or(0, |f| f.samples(tile));
    let count = films.len() as f64;
    let Some(grid) = films.first().map(|f| f.grid()) else { return 0.0 };
    let (rect, width) = (grid.rect(tile), grid.width());
    let mut sum = 0.0;
    for (x, y) in rect.pixels() {
        let i = y as usize * width as usize + x as usize;
        let values: Vec<[f64; 3]> = films.iter().filter_map(|f| f.pixel(i)).collect();
        for c in 0..3 {
            let mean = values.iter().map(|v| v[c]).sum::<f64>() / count;
            let scatter: f64 = values.iter().map(|v| (v[c] - mean) * (v[c] - mean)).sum();
            sum += scatter / ((count - 1.0) * (mean * mean + FLOOR));
        }
    }
    let rays: u64 = films.iter().map(|f| f.rays(tile)).sum();
    let cost = rays as f64 / (count * f64::from(n.max(1)) * rect.area() as f64);
    (sum * f64::from(n) / (rect.area() as f64 * cost.max(1.0))).sqrt()
}

/// Shares of a mean of 1 per pixel, of which some is the same for all.
fn wanted(needs: &[f64], areas: &[f64]) -> Vec<f64> {
    let mean = needs.iter().zip(areas).map(|(n, a)| n * a).sum::<f64>() / areas.iter().sum::<f64>();
    let part = |n: &f64| if mean > 0.0 { n / mean } else { 1.0 };
    needs.iter().map(|n| UNIFORM_SHARE + (1.0 - UNIFORM_SHARE) * part(n)).collect()
}

/// The total per pixel to which `budget` samples fill up: `sum area max(0, level wanted - done) = budget`.
fn level(wanted: &[f64], done: &[f64], areas: &[f64], budget: f64) -> f64 {
    let mut tiles: Vec<usize> = (0..wanted.len()).collect();
    tiles.sort_by(|a, b| (done[*a] / wanted[*a]).total_cmp(&(done[*b] / wanted[*b])).then(a.cmp(b)));
    let (mut slope, mut offset, mut level) = (0.0, budget, 0.0);
    for t in tiles {
        if slope > 0.0 && done[t] / wanted[t] >= level {
            break;
        }
        slope += areas[t] * wanted[t];
        offset += areas[t] * done[t];
        level = offset / slope;
    }
    level
}

/// The dealing of a pass.
pub fn dealing(settings: &RenderSettings, ranges: Vec<Vec<[u32; 2]>>) -> Option<Dealing> {
    settings.adapts().then(|| Dealing { grid: TileGrid::of_film(settings.width, settings.height), ranges })
}

#[cfg(test)]
mod tests {
    use super::rounded;

    #[test]
    fn samples_end_at_powers_of_two_and_half_way_between() {
        let mut ends: Vec<f64> = (0..=100).map(|upto| rounded(0.0, f64::from(upto))).collect();
        ends.dedup();
        assert_eq!(ends, [0.0, 1.0, 2.0, 3.0, 4.0, 6.0, 8.0, 12.0, 16.0, 24.0, 32.0, 48.0, 64.0, 96.0]);
        // What a tile has stays where the next number is out of reach.
        assert_eq!([rounded(5.0, 5.9), rounded(5.0, 6.0), rounded(70.0, 95.9)], [5.0, 6.0, 70.0]);
    }
}
