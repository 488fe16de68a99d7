//! What the formats that describe media share.

use super::importer::{Importer, Place};
use crate::medium::{Medium, MediumError, MediumId, Phase};
use crate::spectrum::Rgb;

/// How a file gives the coefficients of a medium.
#[derive(Clone, Copy, Debug)]
pub(super) enum Coefficients {
    /// Extinction and the share of scattering in it.
    Extinction { sigma_t: Rgb, albedo: Rgb },
    /// Absorption and scattering.
    Parts { sigma_a: Rgb, sigma_s: Rgb },
}

impl Coefficients {
    /// The medium when all coefficients are multiplied by `scale`.
    fn medium(self, scale: f32, phase: Phase) -> Result<Medium, MediumError> {
        match self {
            Self::Extinction { sigma_t, albedo } => Medium::new(sigma_t * scale, albedo, phase),
            Self::Parts { sigma_a, sigma_s } => Medium::from_coefficients(sigma_a * scale, sigma_s * scale, phase),
        }
    }
}

impl Importer<'_> {
    /// Adds a medium described at `at`, or says what is wrong with it.
    pub fn add_medium(&mut self, at: Place, coefficients: Coefficients, scale: f64, phase: Phase) -> Option<MediumId> {
        match coefficients.medium(scale as f32, phase) {
            Ok(medium) => {
                self.scene.media.push(medium);
                Some(MediumId(self.scene.media.len() as u32 - 1))
            }
            Err(e) => {
                self.error(at, format!("the medium can't be used: {e}"), "");
                None
            }
        }
    }
}
