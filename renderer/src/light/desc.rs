use crate::math::{DAffine3, DVec3};
use crate::spectrum::Rgb;
use crate::texture::{Image, RgbParam};
use std::sync::Arc;

/// Emission of a surface: the same radiance in every direction of the hemisphere.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Emission {
    /// Radiance.
    pub radiance: RgbParam,
    /// Also from the back (glTF double-sided).
    pub two_sided: bool,
}

/// How a spot's intensity falls from its beam to its cutoff.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum SpotFalloff {
    /// Linear in the angle (Mitsuba).
    LinearAngle,
    /// `clamp((cos - cos_cutoff) / (cos_beam - cos_cutoff))` squared (KHR_lights_punctual).
    SquaredCosine,
}

/// A light that is not a shape.
#[derive(Clone, Debug)]
pub enum LightDesc {
    /// Isotropic point.
    Point {
        /// World space.
        position: DVec3,
        /// Radiant intensity, power per steradian.
        intensity: Rgb,
    },
    /// Point with a cone.
    Spot {
        /// World space.
        position: DVec3,
        /// Where it points.
        direction: DVec3,
        /// Radiant intensity on the axis.
        intensity: Rgb,
        /// Half angle of full intensity, degrees.
        beam: f64,
        /// Half angle of zero intensity, degrees; > beam or equal for a hard edge.
        cutoff: f64,
        /// In between.
        falloff: SpotFalloff,
    },
    /// Parallel light.
    Directional {
        /// The direction in which the light travels.
        direction: DVec3,
        /// Irradiance on a surface that faces it.
        irradiance: Rgb,
    },
    /// The same radiance from every direction.
    Constant {
        /// Radiance.
        radiance: Rgb,
    },
    /// An equirectangular picture: row 0 is +Y of the light's space; u = 0.5 + atan2(x, -z) / 2 pi, so that -Z is the centre column.
    Environment {
        /// Radiance.
        image: Arc<Image>,
        /// Multiplies it.
        scale: Rgb,
        /// Light space to world (rotation part used).
        to_world: DAffine3,
    },
}
