//! Several samples of lights at the first vertex of a path: splitting (Arvo and Kirk 1990, "Particle Transport and Image Synthesis").

use crate::path::power_heuristic;

/// Samples of lights that a first vertex takes where direct light is noisy.
pub(in crate::integrator) const LIGHTS: u32 = 2;

/// Factor of a direction of density `pdf` in which there is light that each of `lights` samples of lights finds with density `light`: the
/// power heuristic for several samples (Veach 1997, section 9.2.2).
#[inline]
pub(super) fn of_direction(pdf: f32, light: f32, lights: u32) -> f32 {
    power_heuristic(pdf, lights as f32 * light)
}

/// Factor of each of `lights` samples of lights, of density `light`, in a direction that the BSDF has drawn with density `pdf`.
#[inline]
pub(super) fn of_light(light: f32, pdf: f32, lights: u32) -> f32 {
    power_heuristic(lights as f32 * light, pdf) / lights as f32
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Light found by both kinds is found once: so many samples times their factors add up to one.
    #[test]
    fn factors_of_both_kinds_add_up() {
        for lights in 1..=LIGHTS {
            for (pdf, light) in [(1.0f32, 1.0f32), (0.3, 20.0), (1e3, 1e-3), (2.0, 0.0)] {
                let by_lights = if light > 0.0 { lights as f32 * of_light(light, pdf, lights) } else { 0.0 };
                let sum = of_direction(pdf, light, lights) + by_lights;
                assert!((sum - 1.0).abs() < 1e-6, "{lights} {pdf} {light}: {sum}");
            }
        }
    }
}
