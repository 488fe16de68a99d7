use crate::sampling::{Choice, Discrete};

/// Chooses lights with fixed probabilities.
#[derive(Clone, Debug)]
pub struct LightSelector {
    kind: Kind,
}

#[derive(Clone, Debug)]
enum Kind {
    None,
    /// The only light that can be chosen.
    One(usize),
    Table(Discrete),
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
        Self { kind }
    }

    /// A mixture: with probability `uniform` (in (0, 1]) any light alike, else in proportion to `weights`. For learned weights,
    /// which may have missed a light: none is left without a chance. When no weight is positive and finite, all lights alike.
    pub fn defensive(weights: &[f32], uniform: f32) -> Self {
        let usable = |w: f32| if w > 0.0 && w.is_finite() { f64::from(w) } else { 0.0 };
        let total: f64 = weights.iter().map(|&w| usable(w)).sum();
        let share = f64::from(uniform) / weights.len().max(1) as f64;
        let mixed: Vec<f32> = weights
            .iter()
            .map(|&w| if total > 0.0 { (share + (1.0 - f64::from(uniform)) * usable(w) / total) as f32 } else { 1.0 })
            .collect();
        Self::new(&mixed)
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
}
