//! Homogeneous participating media: how far light flies in them, and how it scatters there. The contract:
//!
//! * A straight flight may cross several media; along it the optical depth `tau` of each colour channel adds up. What is sampled is a
//!   depth in one channel, chosen by [`Channels`], and the densities are means over them, so that every channel is estimated with
//!   every sample (one-sample multiple importance sampling; Veach 1997, section 9.2.4).
//! * Light is never absorbed by chance: what is lost is in the weight, `albedo` at each scattering.
//! * A medium that scatters no channel is not sampled at all: it only attenuates, and its depth is in no density.
//! * Weights are formed as ratios of exponentials, so that they are right where the exponentials themselves underflow; in a grey
//!   medium they are exactly `albedo` and 1.
//!
//! Of phase functions, see [`Phase`].

mod equiangular;
mod phase;

pub use equiangular::Equiangular;
pub use phase::{Example, Phase, roster};

use crate::math::{ONE_MINUS_EPSILON, exp, ln_1p};
use crate::spectrum::Rgb;

/// Largest extinction coefficient: densities of points in a medium are products of it, and must be finite.
pub const MAX_SIGMA: f32 = 1e12;

/// Index of a medium in the scene.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct MediumId(pub u32);

/// A homogeneous medium.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Medium {
    /// Extinction coefficient, per unit of length.
    pub sigma_t: Rgb,
    /// Share of the extinction that is scattering, in [0, 1].
    pub albedo: Rgb,
    /// Distribution of the scattered directions.
    pub phase: Phase,
}

/// Why a medium was refused.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum MediumError {
    /// A coefficient is negative, not finite or so large that sums of it would not be.
    #[error("its extinction is negative, not finite or above {MAX_SIGMA:e}")]
    Extinction,
    /// The albedo is out of range.
    #[error("its albedo is not from 0 to 1: a medium can't scatter more than it takes from the beam")]
    Albedo,
    /// The asymmetry is out of range.
    #[error(
        "g is not between -1 and 1, both excluded: at the ends nothing is scattered sideways (use a thinner medium instead)"
    )]
    Asymmetry,
}

impl Medium {
    /// Checks all that rendering relies on.
    pub fn new(sigma_t: Rgb, albedo: Rgb, phase: Phase) -> Result<Self, MediumError> {
        if !sigma_t.is_valid() || sigma_t.max_component() > MAX_SIGMA {
            return Err(MediumError::Extinction);
        }
        if !albedo.is_valid() || albedo.max_component() > 1.0 {
            return Err(MediumError::Albedo);
        }
        if !phase.is_valid() {
            return Err(MediumError::Asymmetry);
        }
        Ok(Self { sigma_t, albedo, phase })
    }

    /// From absorption and scattering.
    pub fn from_coefficients(sigma_a: Rgb, sigma_s: Rgb, phase: Phase) -> Result<Self, MediumError> {
        if !sigma_a.is_valid() || !sigma_s.is_valid() {
            return Err(MediumError::Extinction);
        }
        let sigma_t = sigma_a + sigma_s;
        let albedo = |s: f32, t: f32| if t > 0.0 { (s / t).min(1.0) } else { 0.0 };
        let albedo = Rgb::new(albedo(sigma_s.r, sigma_t.r), albedo(sigma_s.g, sigma_t.g), albedo(sigma_s.b, sigma_t.b));
        Self::new(sigma_t, albedo, phase)
    }

    /// Scattering coefficient.
    #[inline]
    pub fn sigma_s(&self) -> Rgb {
        self.albedo * self.sigma_t
    }

    /// Whether any channel is scattered; if not, no distance is sampled in it.
    #[inline]
    pub fn scatters(&self) -> bool {
        !self.sigma_s().is_black()
    }

    /// Whether the channels fly to different distances, so that one of them must be chosen.
    pub fn is_chromatic(&self) -> bool {
        let Rgb { r, g, b } = self.sigma_t;
        self.scatters() && (r != g || g != b)
    }

    /// Optical depth of a distance, which may be infinite.
    #[inline]
    pub fn tau(&self, distance: f32) -> Rgb {
        self.sigma_t.map(|sigma| if sigma > 0.0 { sigma * distance } else { 0.0 })
    }

    /// Density per unit of length of a scattering at optical depth `tau` (of scattering media, from the start of the flight to a
    /// point in this one), channels chosen alike.
    #[inline]
    pub fn scatter_density(&self, tau: Rgb) -> f32 {
        Channels::ALIKE.mean(self.sigma_t * transmittance(tau))
    }

    /// What a path's throughput is multiplied by when it scatters at optical depth `tau`: `sigma_s T / density`.
    #[inline]
    pub fn scatter_weight(&self, tau: Rgb, channels: &Channels) -> Rgb {
        let weighted = self.sigma_t * relative_transmittance(tau);
        self.albedo * (weighted / channels.mean(weighted))
    }
}

/// `exp(-tau)`.
#[inline]
pub fn transmittance(tau: Rgb) -> Rgb {
    if tau.r == tau.g && tau.g == tau.b { Rgb::splat(exp(-tau.r)) } else { tau.map(|t| exp(-t)) }
}

/// Probability that a sampled flight passes scattering media of optical depth `tau`, channels chosen alike.
#[inline]
pub fn passing_probability(tau: Rgb) -> f32 {
    Channels::ALIKE.mean(transmittance(tau))
}

/// What a path's throughput is multiplied by when its flight has passed scattering media of optical depth `tau`: the
/// transmittance over the probability.
#[inline]
pub fn passing_weight(tau: Rgb, channels: &Channels) -> Rgb {
    if tau.r == tau.g && tau.g == tau.b {
        return Rgb::ONE;
    }
    let e = relative_transmittance(tau);
    e / channels.mean(e)
}

/// `exp(-tau)` over its largest component, which may underflow itself.
#[inline]
fn relative_transmittance(tau: Rgb) -> Rgb {
    let least = tau.min_component();
    tau.map(|t| if t > least { exp(least - t) } else { 1.0 })
}

/// With which probabilities a flight takes its optical depth from a channel.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Channels(Rgb);

impl Channels {
    /// All alike.
    pub const ALIKE: Self = Self(Rgb::splat(1.0 / 3.0));

    /// In proportion to what a path carries in each. Where nothing is absorbed the sum over the channels then stays what it is,
    /// however often the path scatters, as if one channel were chosen for the whole path and the densities of all three combined
    /// (Wilkie et al. 2014, "Hero Wavelength Spectral Sampling"); chosen alike at each flight, weights would grow with every one.
    #[inline]
    pub fn by_throughput(beta: Rgb) -> Self {
        let scale = 1.0 / (beta.r + beta.g + beta.b);
        if scale.is_finite() && scale > 0.0 { Self(beta * scale) } else { Self::ALIKE }
    }

    /// Mean over the channels; of three equal numbers exactly that number.
    #[inline]
    fn mean(&self, v: Rgb) -> f32 {
        if v.r == v.g && v.g == v.b { v.r } else { self.0.r * v.r + self.0.g * v.g + self.0.b * v.b }
    }

    /// The channel that `u` chooses, and what is left of `u`, again uniform in [0, 1).
    #[inline]
    fn choose(&self, u: f32) -> (usize, f32) {
        let Rgb { r, g, b } = self.0;
        let (channel, low, p) = if u < r {
            (0, 0.0, r)
        } else if u < r + g || b == 0.0 {
            (1, r, g)
        } else {
            (2, r + g, b)
        };
        (channel, ((u - low) / p).clamp(0.0, ONE_MINUS_EPSILON))
    }
}

/// How far a flight goes: an optical depth in one channel, drawn with one number.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Reach {
    /// The channel.
    pub channel: usize,
    /// Optical depth that is left to spend; infinite where none is sampled.
    pub tau: f32,
}

impl Reach {
    /// The reach for `u` in [0, 1); `channels` where a medium of the scene is chromatic.
    ///
    /// Primary numbers have steps of 2^-24; half a step is added, so that thin media scatter as often as they should on average
    /// and no depth is 0.
    #[inline]
    pub fn new(u: f32, channels: Option<&Channels>) -> Self {
        let (channel, u) = channels.map_or((0, u), |c| c.choose(u));
        let u = (u + 0.25 * f32::EPSILON).min(ONE_MINUS_EPSILON);
        Self { channel, tau: -ln_1p(-u) }
    }

    /// The distance that the rest of the reach lasts in `medium`.
    #[inline]
    pub fn distance(&self, medium: &Medium) -> f32 {
        self.tau / medium.sigma_t[self.channel]
    }
}

#[cfg(test)]
mod tests;
