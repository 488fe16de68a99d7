//! What the formats that describe media share.

use super::importer::{Importer, Place};
use super::number::Bound;
use crate::medium::{Medium, MediumError, MediumId, Phase};
use crate::scene::desc::SceneDesc;
use crate::spectrum::Rgb;

/// What a file says of a medium, by the names that the formats agree on.
pub(super) trait Parameters {
    /// Whether `name` is given.
    fn has(&self, name: &str) -> bool;
    /// The colour `name`, if it is given and right.
    fn rgb(&mut self, importer: &mut Importer, name: &'static str, bound: Bound) -> Option<Rgb>;
}

/// How a file gives the coefficients of a medium.
#[derive(Clone, Copy, Debug)]
pub(super) enum Coefficients {
    /// Extinction and the share of scattering in it.
    Extinction { sigma_t: Rgb, albedo: Rgb },
    /// Absorption and scattering.
    Parts { sigma_a: Rgb, sigma_s: Rgb },
}

impl Coefficients {
    /// `sigma_a` and `sigma_s`, or `sigma_t` (by default 1) and `albedo`.
    pub fn read(importer: &mut Importer, at: Place, from: &mut impl Parameters, albedo: f32) -> Self {
        if !from.has("sigma_a") && !from.has("sigma_s") {
            let sigma_t = from.rgb(importer, "sigma_t", Bound::NotNegative).unwrap_or(Rgb::ONE);
            let albedo = from.rgb(importer, "albedo", Bound::Unit).unwrap_or(Rgb::splat(albedo));
            return Self::Extinction { sigma_t, albedo };
        }
        if from.has("sigma_t") || from.has("albedo") {
            importer.error(at, "give either `sigma_a` and `sigma_s`, or `sigma_t` and `albedo`", "");
        }
        let mut part = |name| from.rgb(importer, name, Bound::NotNegative).unwrap_or(Rgb::ZERO);
        Self::Parts { sigma_a: part("sigma_a"), sigma_s: part("sigma_s") }
    }

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
            Ok(medium) => Some(push(&mut self.scene, medium)),
            Err(e) => {
                self.error(at, format!("the medium can't be used: {e}"), "");
                None
            }
        }
    }
}

/// Adds a medium that was checked.
pub(super) fn push(scene: &mut SceneDesc, medium: Medium) -> MediumId {
    scene.media.push(medium);
    MediumId(scene.media.len() as u32 - 1)
}
