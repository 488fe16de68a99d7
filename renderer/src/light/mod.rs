//! Lights. Everything is in world space; directions are unit vectors.
//!
//! Two ways to sample a light: *towards a point* (`sample_li`, density per solid angle at that point) and *outward* (`sample_le`,
//! density per area of the emitting surface times density per solid angle there). Conventions:
//! * radiance is in W / (m^2 sr), intensity in W / sr, irradiance in W / m^2, power in W, each as linear Rec.709;
//! * a delta distribution counts as density 1 in a sample and as 0 in `pdf_*`, since no other technique can hit it;
//! * a light is one file and one line in the list below.

mod area;
mod constant;
mod desc;
mod directional;
mod environment;
mod learn;
mod place;
mod point;
mod sample;
mod select;
mod sphere;
mod spot;
#[cfg(test)]
mod tests;
mod tree;

pub use area::AreaLight;
pub use constant::ConstantLight;
pub use desc::{Emission, LightDesc, SpotFalloff};
pub use directional::DirectionalLight;
pub use environment::EnvironmentLight;
pub use learn::{LightLessons, selection_weights};
pub use place::{Gloss, LightBounds, Place};
pub use point::PointLight;
pub use sample::{LeSample, LiSample, LightContext, LightFlags};
pub use select::LightSelector;
pub use spot::SpotLight;

use crate::geometry::{Geometry, Interaction, ObjectId};
use crate::math::{Anchor, Vec2, Vec3};
use crate::spectrum::Rgb;

/// Why a light was refused.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum LightError {
    /// A coordinate or an angle is NaN or infinite, or too large for f32.
    #[error("its position, direction, angles or transform is not finite (as 32-bit numbers)")]
    NotFinite,
    /// The direction has no length.
    #[error("its direction is the zero vector")]
    NoDirection,
    /// Radiance, intensity or irradiance is negative or not finite.
    #[error("what it emits is negative or not a finite number")]
    Emission,
    /// Spot angles out of order or range.
    #[error("its angles must be 0 <= beam <= cutoff <= 180 degrees, cutoff > 0")]
    Angles,
    /// The environment's to_world is singular.
    #[error("its transform is singular")]
    Transform,
    /// The environment's picture has so many texels that the tables to sample it don't fit.
    #[error("its picture has more than {} texels, too many to sample", environment::MAX_TEXELS)]
    Large,
    /// The environment's picture is empty or its length is not width times height.
    #[error("its picture has no texels, or not width times height of them")]
    Picture,
}

/// What a light does; the methods of [`Light`] say more.
trait Emitter {
    fn flags(&self) -> LightFlags;
    fn sample_li(&self, ctx: &LightContext, p: Vec3, uc: f32, u: Vec2) -> Option<LiSample>;
    fn sample_le(&self, ctx: &LightContext, uc: f32, u_pos: Vec2, u_dir: Vec2) -> Option<LeSample>;
    fn pdf_le(&self, ctx: &LightContext, ng: Vec3, w: Vec3) -> (f32, f32);
    fn power(&self, ctx: &LightContext) -> Rgb;

    fn bounds(&self, _ctx: &LightContext) -> Option<LightBounds> {
        None
    }
    fn pdf_li(&self, _ctx: &LightContext, _p: Vec3, _at: &Anchor) -> f32 {
        0.0
    }
    fn radiance(&self, _ctx: &LightContext, _hit: &Interaction, _w: Vec3) -> Rgb {
        Rgb::ZERO
    }
    fn pdf_li_escaped(&self, _w: Vec3) -> f32 {
        0.0
    }
    fn le_infinite(&self, _w: Vec3) -> Rgb {
        Rgb::ZERO
    }

    /// Lights of this kind on which all the statistical tests run.
    #[cfg(test)]
    fn examples() -> Vec<tests::Example>;
}

macro_rules! lights {
    ($($(#[$doc:meta])* $variant:ident($light:ty),)*) => {
        /// A light of the scene.
        #[derive(Clone, Debug)]
        pub enum Light {
            $($(#[$doc])* $variant($light),)*
        }

        $(impl From<$light> for Light {
            fn from(light: $light) -> Self {
                Self::$variant(light)
            }
        })*

        #[cfg(test)]
        fn roster() -> Vec<tests::Example> {
            [$(<$light as Emitter>::examples(),)*].into_iter().flatten().collect()
        }

        impl Light {
            /// The name of its kind.
            pub fn kind(&self) -> &'static str {
                match self { $(Self::$variant(_) => stringify!($variant),)* }
            }

            /// What kinds of delta distributions the light has, and whether it is infinitely far away.
            #[inline]
            pub fn flags(&self) -> LightFlags {
                match self { $(Self::$variant(l) => l.flags(),)* }
            }

            /// Samples a direction from `p` in which the light may be seen. `uc` chooses between parts of the light, `u` the point.
            /// `None`: no light arrives this way (the side that does not emit, or the numbers fell outside).
            #[inline]
            pub fn sample_li(&self, ctx: &LightContext, p: Vec3, uc: f32, u: Vec2) -> Option<LiSample> {
                match self { $(Self::$variant(l) => l.sample_li(ctx, p, uc, u),)* }
            }

            /// Density per solid angle at `p` with which `sample_li` gives the point `at` of this light's surface; 0 for lights
            /// without one.
            #[inline]
            pub fn pdf_li(&self, ctx: &LightContext, p: Vec3, at: &Anchor) -> f32 {
                match self { $(Self::$variant(l) => l.pdf_li(ctx, p, at),)* }
            }

            /// Radiance that the point `hit` of this light's surface emits in direction `w` (away from the surface).
            #[inline]
            pub fn radiance(&self, ctx: &LightContext, hit: &Interaction, w: Vec3) -> Rgb {
                match self { $(Self::$variant(l) => l.radiance(ctx, hit, w),)* }
            }

            /// Density per solid angle, the same at every point, with which `sample_li` of an infinite light gives the direction
            /// `w` (away from the point, towards the sky); 0 for other lights.
            #[inline]
            pub fn pdf_li_escaped(&self, w: Vec3) -> f32 {
                match self { $(Self::$variant(l) => l.pdf_li_escaped(w),)* }
            }

            /// Radiance that arrives from the direction `w` of the sky (a ray that left the scene along `w`).
            #[inline]
            pub fn le_infinite(&self, w: Vec3) -> Rgb {
                match self { $(Self::$variant(l) => l.le_infinite(w),)* }
            }

            /// Samples a ray that leaves the light: `uc` chooses between parts of the light, `u_pos` the point, `u_dir` the
            /// direction.
            #[inline]
            pub fn sample_le(&self, ctx: &LightContext, uc: f32, u_pos: Vec2, u_dir: Vec2) -> Option<LeSample> {
                match self { $(Self::$variant(l) => l.sample_le(ctx, uc, u_pos, u_dir),)* }
            }

            /// Densities `(pdf_pos, pdf_dir)` with which `sample_le` gives a point whose normal is `ng` (ignored by lights without
            /// a surface) and the direction `w` away from the light: per area (for infinite lights, area perpendicular to `w`) and
            /// per solid angle. Delta parts give 0.
            #[inline]
            pub fn pdf_le(&self, ctx: &LightContext, ng: Vec3, w: Vec3) -> (f32, f32) {
                match self { $(Self::$variant(l) => l.pdf_le(ctx, ng, w),)* }
            }

            /// Emitted power; of infinite lights, what passes through the scene's bounding sphere. Exact for untextured lights, else
            /// an estimate.
            pub fn power(&self, ctx: &LightContext) -> Rgb {
                match self { $(Self::$variant(l) => l.power(ctx),)* }
            }

            /// Where it is and where it shines; `None` of infinite lights.
            pub fn bounds(&self, ctx: &LightContext) -> Option<LightBounds> {
                match self { $(Self::$variant(l) => l.bounds(ctx),)* }
            }
        }
    };
}

lights! {
    /// An emitting object: a mesh, a sphere or a disk.
    Area(AreaLight),
    /// Isotropic point.
    Point(PointLight),
    /// Point with a cone.
    Spot(SpotLight),
    /// Parallel light.
    Directional(DirectionalLight),
    /// The same radiance from every direction.
    Constant(ConstantLight),
    /// Equirectangular picture.
    Environment(EnvironmentLight),
}

impl Light {
    /// Where it is, if it has no extent but a place.
    #[inline]
    pub fn position(&self) -> Option<Vec3> {
        match self {
            Self::Point(light) => Some(light.position()),
            Self::Spot(light) => Some(light.position()),
            _ => None,
        }
    }

    /// The emission of an object; `None` when it has no area or emits nothing (a constant black).
    pub fn area(geometry: &Geometry, object: ObjectId, emission: &Emission) -> Option<Self> {
        AreaLight::new(geometry, object, emission).map(Self::Area)
    }

    /// A light of the scene description; `Ok(None)` when it is black.
    pub fn from_desc(desc: &LightDesc) -> Result<Option<Self>, LightError> {
        Ok(match desc {
            LightDesc::Point { position, intensity } => PointLight::new(*position, *intensity)?.map(Self::Point),
            LightDesc::Spot { .. } => SpotLight::new(desc)?.map(Self::Spot),
            LightDesc::Directional { direction, irradiance } => {
                DirectionalLight::new(*direction, *irradiance)?.map(Self::Directional)
            }
            LightDesc::Constant { radiance } => ConstantLight::new(*radiance)?.map(Self::Constant),
            LightDesc::Environment { image, scale, to_world } => {
                EnvironmentLight::new(image.clone(), *scale, to_world)?.map(Self::Environment)
            }
        })
    }
}

/// Checks a colour that a light emits; `Ok(false)` for black.
fn emits(colour: Rgb) -> Result<bool, LightError> {
    if !colour.is_valid() {
        return Err(LightError::Emission);
    }
    Ok(!colour.is_black())
}
