//! Weights of multiple importance sampling over all strategies that can make a path, formed from ratios of densities.
//!
//! **Densities.** The vertices of a path run from the light, x_0, to the lens, x_k. `light[i]` is the density with which a walk from the
//! light makes x_i once x_0 .. x_(i-1) are there, `camera[i]` that of a walk from the camera once x_k .. x_(i+1) are. Strategy s takes
//! x_0 .. x_(s-1) from the light and the rest from the camera, so neighbouring strategies differ by one ratio,
//! `p_(s+1) / p_s = light[s] / camera[s]` (Veach 1997, equation 10.9), and no product of densities is ever formed.
//!
//! All densities are per area, except that a light infinitely far away has its direction for a vertex, per solid angle. A walk that
//! went through a delta lobe has a Dirac density there, which both directions share and which cancels, up to the factor by which
//! refraction stretches solid angles; see [`delta_density`].
//!
//! **The sum.** Going outwards from the connection, each vertex multiplies the ratio of the strategies beyond it. So with `A_i` the sum
//! of the (squared) relative densities of all strategies whose connection lies at or beyond vertex i,
//! `A_i = r_i^2 (reach_i + A_(i-1))`, where `reach_i` is 1 when the strategy that connects just beyond vertex i exists. The walks carry
//! `A` along, and a connection needs only the ratios at its two ends and their neighbours: constant time, as in Georgiev's recursive
//! form (2012, "Implementing Vertex Connection and Merging"), yet with every density in plain sight.

/// How relative densities become weights.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default)]
pub enum Heuristic {
    /// Proportional to the density.
    Balance,
    /// Proportional to its square (Veach 1997, equation 9.11).
    #[default]
    Power,
    /// The power heuristic among the strategies that `path` does not have, s > 1, and the one at hand.
    Beyond,
}

/// One vertex on the way outwards from a connection.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Step {
    /// Density of the vertex when the walk from the other end makes it, over that of its own walk.
    pub ratio: f64,
    /// Whether the strategy that connects beyond this vertex exists: 0 or 1, times what its density has over the product form.
    pub reach: f64,
}

impl Heuristic {
    /// `A_i` from `A_(i-1)`.
    #[inline]
    pub fn fold(self, tail: f64, step: Step) -> f64 {
        let (ratio, reach) = match self {
            Self::Balance => (step.ratio, step.reach),
            Self::Power | Self::Beyond => (step.ratio * step.ratio, step.reach * step.reach),
        };
        let beyond = reach + tail;
        // Nothing lies beyond: the ratio may be infinite then.
        if beyond == 0.0 { 0.0 } else { ratio * beyond }
    }

    /// Whether the strategies of `path` (s = 0 and s = 1) count.
    #[inline]
    pub fn has_path(self) -> bool {
        self != Self::Beyond
    }

    /// Weight of a strategy from the sums on both sides of its connection, whose density is `own` times the product form.
    #[inline]
    pub fn weight(self, light: f64, camera: f64, own: f64) -> f64 {
        let own = match self {
            Self::Balance => own,
            Self::Power | Self::Beyond => own * own,
        };
        own / (own + light + camera)
    }
}

/// What a delta lobe's Dirac density is multiplied by when the walk from the camera goes through it, with that of the walk from the
/// light as the unit: the ratio of solid angles on its two sides, `cos_i n_i^2 / (cos_o n_o^2)`, i on the light's side. `eta` is the
/// index of refraction on the light's side over that on the camera's.
#[inline]
pub fn delta_density(cos_light: f32, cos_camera: f32, eta: f32) -> f64 {
    let factor = f64::from(cos_light * eta * eta) / f64::from(cos_camera);
    if factor.is_finite() { factor } else { 0.0 }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The recursion against products of densities in the logarithm, for all strategies of random paths.
    #[test]
    fn weights_are_those_of_the_products_and_sum_to_one() {
        use crate::sampling::{IndependentSampler, Sampler};
        for heuristic in [Heuristic::Balance, Heuristic::Power] {
            for trial in 0..200 {
                let mut u = IndependentSampler::new([41, trial]);
                let k = 2 + (u.next_1d() * 12.0) as usize;
                let mut density = || f64::from(u.next_1d() * 60.0 - 30.0);
                let (light, camera): (Vec<f64>, Vec<f64>) = (0..=k).map(|_| (density(), density())).unzip();
                let own = 3.0;
                let exists: Vec<bool> = (0..=k).map(|s| s == 1 || u.next_1d() < 0.7).collect();
                // In the logarithm.
                let log = |s: usize| {
                    light[..s].iter().sum::<f64>() + camera[s..].iter().sum::<f64>() + if s == 1 { own } else { 0.0 }
                };
                let p = if heuristic == Heuristic::Power { 2.0 } else { 1.0 };
                let mut sum = 0.0;
                for s in (0..=k).filter(|s| exists[*s]) {
                    let all: f64 = (0..=k).filter(|i| exists[*i]).map(|i| libm::exp(p * (log(i) - log(s)))).sum();
                    // By recursion from both ends.
                    let reach = |i: usize| f64::from(u8::from(exists[i])) * if i == 1 { libm::exp(own) } else { 1.0 };
                    let ratio = |a: &[f64], b: &[f64], i: usize| libm::exp(a[i] - b[i]);
                    let outwards =
                        |tail, i| heuristic.fold(tail, Step { ratio: ratio(&camera, &light, i), reach: reach(i) });
                    let inwards =
                        |tail, i| heuristic.fold(tail, Step { ratio: ratio(&light, &camera, i), reach: reach(i + 1) });
                    let a = (0..s).fold(0.0, outwards);
                    let b = (s..k).rev().fold(0.0, inwards);
                    let weight = heuristic.weight(a, b, if s == 1 { libm::exp(own) } else { 1.0 });
                    assert!((weight * all - 1.0).abs() < 1e-9, "{heuristic:?} {s} of {k}: {weight} {}", 1.0 / all);
                    sum += weight;
                }
                assert!((sum - 1.0).abs() < 1e-9);
            }
        }
    }
}
