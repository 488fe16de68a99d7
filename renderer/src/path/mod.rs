//! What all integrators share: walks from both ends, their vertices and connections, weights of multiple importance sampling, Russian
//! roulette.

mod connect;
mod counters;
pub mod mis;
mod scattering;
mod vertex;
mod walk;

pub use connect::{Always, Chance, Connection};
pub use counters::Counters;
pub use scattering::{MediumPoint, Scattering};
pub use vertex::{Edge, Escape, LightStart, Subpath, Vertex, VertexKind};
pub use walk::Tracer;

use crate::spectrum::Rgb;

/// Weight of a sample of density `pdf` that another technique could have made with density `other`: the power heuristic with
/// exponent 2 (Veach 1997, equation 9.11), formed from the ratio so that no square overflows.
#[inline]
pub fn power_heuristic(pdf: f32, other: f32) -> f32 {
    if other == 0.0 {
        return 1.0;
    }
    let r = other / pdf;
    1.0 / (1.0 + r * r)
}

/// Russian roulette: `None` ends the path, else what the throughput is multiplied by. `throughput` is the path's `beta` without the
/// `eta^2` of refractions, which a later refraction takes back.
#[inline]
pub fn roulette(throughput: Rgb, u: f32) -> Option<f32> {
    let q = throughput.max_component().min(0.95);
    (u < q).then(|| 1.0 / q)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_two_weights_of_a_sample_sum_to_one_over_the_whole_range() {
        for a in [1e-30f32, 1e-3, 1.0, 3.5, 1e12, 1e30] {
            for b in [1e-30f32, 1e-3, 1.0, 7.0, 1e12, 1e30] {
                let sum = power_heuristic(a, b) + power_heuristic(b, a);
                assert!((sum - 1.0).abs() < 1e-6, "{a} {b}: {sum}");
            }
        }
        assert_eq!(power_heuristic(2.0, 0.0), 1.0);
    }

    #[test]
    fn roulette_keeps_the_mean() {
        for value in [0.05f32, 0.3, 0.9, 4.0] {
            let n = 100_000;
            let sum: f64 = (0..n)
                .filter_map(|i| roulette(Rgb::new(value, 0.5 * value, 0.0), (i as f32 + 0.5) / n as f32))
                .map(f64::from)
                .sum();
            assert!((sum / f64::from(n) - 1.0).abs() < 2e-4, "{value}: {sum}");
        }
    }
}
