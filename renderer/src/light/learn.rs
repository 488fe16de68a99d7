//! What samples teach of the lights: which are worth selecting.

use crate::spectrum::Rgb;

/// More lights are selected by power alone: each would be learned from too few samples, and every result carries two numbers for each.
const MOST: usize = 1024;

/// What the samples of a unit teach of the lights.
///
/// Best is to select lights by the root of the second moment of what a sample of the light adds to the picture, over the root of what
/// it costs: by Cauchy and Schwarz that is the least variance for the time. Both are estimated without bias whatever the
/// probabilities are with which lights are selected meanwhile.
#[derive(Clone, Debug, Default)]
pub struct LightLessons {
    /// For each light the squares of its samples' contributions times its probability, then for each what its samples cost over its
    /// probability.
    sums: Vec<f64>,
}

impl LightLessons {
    /// Of so many lights; nothing is learned where there is no choice. (The default learns nothing.)
    pub fn new(lights: usize) -> Self {
        let learns = (2..=MOST).contains(&lights);
        Self { sums: vec![0.0; if learns { 2 * lights } else { 0 }] }
    }

    /// Whether anything is learned.
    #[inline]
    pub fn learns(&self) -> bool {
        !self.sums.is_empty()
    }

    /// A sample of a light was made, which was selected with probability `pmf`, and took so many rays.
    #[inline]
    pub fn tried(&mut self, light: usize, pmf: f32, rays: u64) {
        self.expected(light, pmf, rays as f64);
    }

    /// A sample of a light was made, which was selected with probability `pmf`; by the bound of its place it would give so much, squared.
    /// In place of [`LightLessons::tried`] where lights are selected by that bound: all samples cost the same then, and the weights are
    /// what lights give over what was expected of them.
    #[inline]
    pub fn expected(&mut self, light: usize, pmf: f32, square: f64) {
        let half = self.sums.len() / 2;
        if half > 0 && square.is_finite() {
            self.sums[half + light] += square / f64::from(pmf);
        }
    }

    /// A sample of whichever light was selected was made, so many times, each with one ray.
    pub fn tried_any(&mut self, times: u64) {
        let half = self.sums.len() / 2;
        self.sums[half..].iter_mut().for_each(|rays| *rays += times as f64);
    }

    /// A sample of a light, over its probability `pmf`, was added to the picture (unless it is no number).
    #[inline]
    pub fn gave(&mut self, light: usize, pmf: f32, contribution: Rgb) {
        if self.learns() && contribution.is_valid() {
            let luminance = f64::from(contribution.luminance());
            self.sums[light] += luminance * luminance * f64::from(pmf);
        }
    }

    /// The sums, for [`selection_weights`]; those of units are added.
    pub fn into_sums(self) -> Vec<f64> {
        self.sums
    }
}

/// Weights of the lights, which add up to 1, from sums over units. Empty where nothing is known.
pub fn selection_weights(sums: &[f64]) -> Vec<f32> {
    let (squares, rays) = sums.split_at(sums.len() / 2);
    let weight = |(square, rays): (&f64, &f64)| if *rays > 0.0 { (square / rays).sqrt() } else { 0.0 };
    let weights: Vec<f64> = squares.iter().zip(rays).map(weight).collect();
    let total: f64 = weights.iter().sum();
    if weights.len() < 2 || !(total > 0.0 && total.is_finite()) {
        return Vec::new();
    }
    weights.iter().map(|w| (w / total) as f32).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::light::LightSelector;

    #[test]
    fn lights_are_weighed_by_noise_over_the_root_of_cost() {
        // The second contributes four times the variance; the third as much as the first at a quarter of its cost; the last nothing.
        let w = selection_weights(&[1.0, 4.0, 1.0, 0.0, 8.0, 8.0, 2.0, 8.0]);
        assert!((0..4).all(|i| (w[i] - [0.2, 0.4, 0.4, 0.0][i]).abs() < 1e-6), "{w:?}");
        assert!(selection_weights(&[0.0; 4]).is_empty() && selection_weights(&[1.0, 1.0]).is_empty());
    }

    /// The same weights, however lights were selected when they were learned.
    #[test]
    fn probabilities_of_the_pilot_do_not_matter() {
        let learn = |weights: &[f32]| {
            let selector = LightSelector::new(weights);
            let mut lessons = LightLessons::new(2);
            for (light, value) in [(0, 1.0), (1, 3.0)] {
                let pmf = selector.pmf(light);
                let samples = (1e4 * pmf) as u32;
                for _ in 0..samples {
                    lessons.tried(light, pmf, 1);
                    lessons.gave(light, pmf, Rgb::splat(value) * (1.0 / pmf));
                }
            }
            selection_weights(&lessons.into_sums())
        };
        let (a, b) = (learn(&[1.0, 1.0]), learn(&[8.0, 2.0]));
        assert!((a[0] - 0.25).abs() < 1e-3 && (b[0] - 0.25).abs() < 1e-3, "{a:?} {b:?}");
    }
}
