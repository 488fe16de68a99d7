use super::place::{Lanes, LightBounds, Place};
use super::tree::LightTree;
use crate::math::ONE_MINUS_EPSILON;
use crate::sampling::{Choice, Discrete};
use std::sync::Arc;

/// Chooses lights: with fixed probabilities, or for a place.
#[derive(Clone, Debug)]
pub struct LightSelector {
    kind: Kind,
    places: Option<Places>,
}

#[derive(Clone, Debug)]
enum Kind {
    None,
    /// The only light that can be chosen.
    One(usize),
    Table(Discrete),
}

/// What is known of where several lights are.
#[derive(Clone, Debug)]
struct Places {
    tree: Arc<LightTree>,
    /// Of the tree's nodes.
    strengths: Vec<Lanes>,
    /// The lights without a place.
    infinite: Option<Discrete>,
    /// What an infinite light of unit weight gives, in the measure of [`LightBounds`].
    unit: f32,
    /// What all infinite lights give.
    far: f32,
}

impl LightSelector {
    /// Probabilities proportional to `weights` (for instance power). Lights whose weight is not positive and finite are never
    /// chosen.
    pub fn new(weights: &[f32]) -> Self {
        let mut usable = (0..weights.len()).filter(|&i| weights[i] > 0.0 && weights[i].is_finite());
        let kind = match (usable.next(), usable.next()) {
            (Some(only), None) => Kind::One(only),
            _ => Discrete::new(weights).map_or(Kind::None, Kind::Table),
        };
        Self { kind, places: None }
    }

    /// The same, for lights in these places of a scene of this radius.
    pub fn placed(weights: &[f32], bounds: &[Option<LightBounds>], radius: f32) -> Self {
        let fixed = Self::new(weights);
        let Kind::Table(table) = &fixed.kind else { return fixed };
        let weights: Vec<f32> = (0..table.len()).map(|i| table.pmf(i)).collect();
        // Power reaches a scene through all of its sphere.
        let unit = (4.0 / (radius * radius)).min(f32::MAX);
        let places = LightTree::new(bounds, &weights).map(|tree| Places::new(Arc::new(tree), &weights, unit));
        Self { places, ..fixed }
    }

    /// This selector with probability 1/2, else in proportion to `weights`, which add up to 1. For learned weights, which may have missed a
    /// light: no variance is more than twice what it was.
    pub fn mixed(&self, weights: &[f32]) -> Self {
        let mixed: Vec<f32> = weights.iter().enumerate().map(|(i, w)| 0.5 * (self.pmf(i) + w)).collect();
        let places = self.places.as_ref().map(|p| Places::new(p.tree.clone(), &mixed, p.unit));
        Self { places, ..Self::new(&mixed) }
    }

    /// From now on all places are alike.
    pub fn forget_places(&mut self) {
        self.places = None;
    }

    /// Whether no light can be chosen.
    #[inline]
    pub fn is_empty(&self) -> bool {
        matches!(self.kind, Kind::None)
    }

    /// Probability of light `i`.
    #[inline]
    pub fn pmf(&self, i: usize) -> f32 {
        match &self.kind {
            Kind::None => 0.0,
            Kind::One(only) => f32::from(u8::from(i == *only)),
            Kind::Table(table) => table.pmf(i),
        }
    }

    /// Chooses a light by `u`; the choice's own `u` is what is left of it, again uniform. `None` when there is none to choose.
    #[inline]
    pub fn sample(&self, u: f32) -> Option<Choice> {
        match &self.kind {
            Kind::None => None,
            Kind::One(only) => Some(Choice { index: *only, pmf: 1.0, u }),
            Kind::Table(table) => Some(table.sample(u)),
        }
    }

    /// Whether it makes a difference for which place a light is chosen.
    #[inline]
    pub fn by_place(&self) -> bool {
        self.places.is_some()
    }

    /// Probability of light `i` for a place.
    #[inline]
    pub fn pmf_at(&self, place: &Place, i: usize) -> f32 {
        self.places.as_ref().map_or_else(|| self.pmf(i), |places| places.pmf(place, i))
    }

    /// Chooses a light for a place by `u`, as [`LightSelector::sample`] does; `None` also where no light gives any.
    #[inline]
    pub fn sample_at(&self, place: &Place, u: f32) -> Option<Choice> {
        match &self.places {
            None => self.sample(u),
            Some(places) => places.sample(place, u),
        }
    }

    /// What light `i` may be expected to give to a place if its weight is 1; for all lights 1 if that is not known.
    #[inline]
    pub fn expected(&self, place: &Place, i: usize) -> f32 {
        self.places.as_ref().map_or(1.0, |places| places.expected(place, i))
    }
}

impl Places {
    fn new(tree: Arc<LightTree>, weights: &[f32], unit: f32) -> Self {
        let strengths = tree.strengths(weights);
        let far: Vec<f32> = weights.iter().enumerate().map(|(i, w)| if tree.holds(i) { 0.0 } else { *w }).collect();
        let infinite = Discrete::new(&far);
        let far = unit * infinite.as_ref().map_or(0.0, |table| table.total() as f32);
        Self { tree, strengths, infinite, unit, far }
    }

    /// Probability of the infinite lights together; `None` where no light gives any.
    #[inline]
    fn share(&self, place: &Place) -> Option<f32> {
        if self.infinite.is_none() {
            return Some(0.0);
        }
        let near = self.tree.total(&self.strengths, place);
        let sum = 0.5 * self.far + 0.5 * near;
        (sum > 0.0 && sum.is_finite()).then(|| 0.5 * self.far / sum)
    }

    fn pmf(&self, place: &Place, i: usize) -> f32 {
        let Some(far) = self.share(place) else { return 0.0 };
        if self.tree.holds(i) {
            return (1.0 - far) * self.tree.pmf(&self.strengths, place, i);
        }
        self.infinite.as_ref().map_or(0.0, |table| far * table.pmf(i))
    }

    fn sample(&self, place: &Place, u: f32) -> Option<Choice> {
        let far = self.share(place)?;
        let (choice, share) = match &self.infinite {
            Some(table) if u < far => (table.sample(u / far), far),
            _ => {
                let u = ((u - far) / (1.0 - far)).clamp(0.0, ONE_MINUS_EPSILON);
                (self.tree.sample(&self.strengths, place, u)?, 1.0 - far)
            }
        };
        let pmf = share * choice.pmf;
        (pmf > 0.0).then_some(Choice { pmf, ..choice })
    }

    fn expected(&self, place: &Place, i: usize) -> f32 {
        if self.tree.holds(i) { self.tree.alone(i, place) } else { self.unit }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sampling::{IndependentSampler, Sampler};

    #[test]
    fn frequencies_are_the_probabilities() {
        let weights = [0.0f32, 3.0, 1e-3, 0.5, f32::NAN, 8.0, -1.0, f32::INFINITY];
        let power = LightSelector::new(&weights);
        for selector in [power.mixed(&[0.1, 0.2, 0.0, 0.3, 0.0, 0.4, 0.0, 0.0]), power] {
            let pmf: Vec<f64> = (0..weights.len()).map(|i| f64::from(selector.pmf(i))).collect();
            assert!((pmf.iter().sum::<f64>() - 1.0).abs() < 1e-6);
            let n = 200_000;
            let (mut counts, mut rest) = (vec![0.0; weights.len()], vec![0.0; 16]);
            let mut s = IndependentSampler::new([16]);
            for _ in 0..n {
                let choice = selector.sample(s.next_1d()).unwrap();
                assert_eq!(choice.pmf, selector.pmf(choice.index));
                counts[choice.index] += 1.0;
                rest[(choice.u * 16.0) as usize] += 1.0;
            }
            let expected: Vec<f64> = pmf.iter().map(|p| p * f64::from(n)).collect();
            assert!(statcheck::chi2_test(&counts, &expected).p > 0.001, "{counts:?} {expected:?}");
            assert!(statcheck::chi2_test(&rest, &[f64::from(n) / 16.0; 16]).p > 0.001, "{rest:?}");
        }
    }

    #[test]
    fn none_one_and_left_out() {
        assert!(LightSelector::new(&[]).sample(0.5).is_none());
        assert!(LightSelector::new(&[0.0, f32::NAN]).is_empty());
        let one = LightSelector::new(&[0.0, 7.0, 0.0]);
        assert_eq!(one.sample(0.3), Some(Choice { index: 1, pmf: 1.0, u: 0.3 }));
        assert_eq!([0, 1, 2].map(|i| one.pmf(i)), [0.0, 1.0, 0.0]);
        // What was learned to be dark keeps half of its share.
        let learned = LightSelector::new(&[2.0, 6.0, 2.0]).mixed(&[0.0, 0.9, 0.1]);
        for (i, pmf) in [0.1, 0.75, 0.15].into_iter().enumerate() {
            assert!((learned.pmf(i) - pmf).abs() < 1e-6);
        }
    }
}
