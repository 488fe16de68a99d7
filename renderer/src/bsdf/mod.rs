//! BSDFs. The contract, which every file here keeps:
//!
//! * `wo` points to the previous vertex of the walk, `wi` to the next; both unit, outward, in the shading frame (z = ns).
//! * `f` is without the cosine. `pdf` is per solid angle of `wi`. Delta lobes are in neither: only `sample` returns them, with
//!   `pdf` the probability of the lobe and `f` such that `f |cos(wi)| / pdf` is the weight of the path.
//! * What `sample` returns for a lobe that is not delta equals `eval_pdf` of its direction.
//! * [`Transport`] says which quantity flows along `wo`: radiance is scaled by the squared ratio of the indices where it
//!   refracts, importance is not. `f_importance(wo, wi) = f_radiance(wi, wo)`.
//! * The correction for shading normals in importance transport is applied in `path/`, nowhere else.
//!
//! A new BSDF is one file (the type, `resolve`, [`Model`] with its examples) and one entry of the list below. The entry's fields
//! are what a scene describes; the type is what they come to at one point. The statistical tests draw from the same list.

mod conductor;
mod dielectric;
pub mod fresnel;
mod gltf;
mod lambert;
mod microfacet;
mod resolve;
mod shading;

pub use conductor::Conductor;
pub use dielectric::Dielectric;
pub use gltf::Gltf;
pub use lambert::Lambert;
pub use microfacet::{Microfacet, SMOOTH_ALPHA};
pub use shading::{DirectionSample, Even, MAX_NESTING, ShadingPoint, first_bad_nesting};

use crate::math::{Vec2, Vec3};
use crate::spectrum::Rgb;
use crate::texture::{FloatParam, RgbParam, TextureId};
use resolve::At;

/// Index of a material in the scene.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct MaterialId(pub u32);

/// Microfacet normal distribution.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Distribution {
    /// Trowbridge-Reitz.
    Ggx,
    /// Beckmann-Spizzichino.
    Beckmann,
}

/// Roughness of a microfacet surface; `alpha` is the slope parameter itself (not squared).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Roughness {
    /// The normal distribution.
    pub distribution: Distribution,
    /// Along the tangent `dpdu`.
    pub alpha_u: FloatParam,
    /// Across it.
    pub alpha_v: FloatParam,
}

/// What a path carries towards `wo`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Transport {
    /// Walks from the camera: radiance flows from `wi` to `wo`.
    Radiance,
    /// Walks from a light: importance flows from `wi` to `wo`.
    Importance,
}

impl Transport {
    /// What a path carries the other way.
    #[inline]
    pub const fn reversed(self) -> Self {
        match self {
            Self::Radiance => Self::Importance,
            Self::Importance => Self::Radiance,
        }
    }
}

/// Which part of a BSDF a direction was drawn from.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Lobe {
    /// A single direction: no density, no connections.
    pub delta: bool,
    /// To the other side of the surface.
    pub transmission: bool,
    /// Diffuse rather than glossy.
    pub diffuse: bool,
}

impl Lobe {
    /// Diffuse reflection.
    pub const DIFFUSE: Self = Self { delta: false, transmission: false, diffuse: true };

    /// Glossy or mirror-like scattering.
    #[inline]
    pub const fn specular(delta: bool, transmission: bool) -> Self {
        Self { delta, transmission, diffuse: false }
    }
}

/// How what a surface reflects depends on the direction from which it is seen.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Spread {
    /// Not at all, on one side of it.
    Even,
    /// Little: directions drawn for one are not bad for another, and all on the same side may be drawn. Nothing passes, and no lobe is
    /// delta.
    Broad,
    /// Perhaps strongly.
    Narrow,
}

/// What a surface reflects, roughly.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Lobes {
    /// Luminance of the albedo of a diffuse lobe.
    pub diffuse: f32,
    /// And of a rough one around the mirrored direction.
    pub specular: f32,
    /// Its roughness (Walter et al. 2007).
    pub alpha: f32,
}

/// A direction drawn from a BSDF, in the shading frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BsdfSample {
    /// Where the path goes on.
    pub wi: Vec3,
    /// Value without the cosine.
    pub f: Rgb,
    /// Density per solid angle; for a delta lobe its probability.
    pub pdf: f32,
    /// What was drawn.
    pub lobe: Lobe,
    /// Index of refraction on the side of `wi` over that on the side of `wo`; 1 for reflection.
    pub eta: f32,
}

/// What every BSDF can do, at one point of a surface, in the shading frame.
pub trait Model: Copy {
    /// Value and density of the lobes that are not delta.
    fn eval_pdf(&self, wo: Vec3, wi: Vec3, mode: Transport) -> (Rgb, f32);

    /// Draws `wi` given `wo`: `uc` chooses the lobe, `u` the direction. `None` absorbs the path.
    fn sample(&self, wo: Vec3, uc: f32, u: Vec2, mode: Transport) -> Option<BsdfSample>;

    /// Whether nothing but delta lobes is there: no light can be connected to such a point.
    fn is_delta_only(&self) -> bool {
        false
    }

    /// Whether `sample` looks at `uc`.
    fn chooses(&self) -> bool {
        true
    }

    /// Whether anything passes to the other side.
    fn transmits(&self) -> bool {
        false
    }

    /// How what it reflects depends on the direction from which it is seen.
    fn spread(&self) -> Spread {
        if self.even().is_some() { Spread::Even } else { Spread::Narrow }
    }

    /// The value of all directions on the upper side, seen from there, if it is the same for all of them, there is none elsewhere, and
    /// directions are drawn in proportion to the cosine.
    fn even(&self) -> Option<Rgb> {
        None
    }

    /// What its reflection in direction `wo` is made of, roughly, if one rough lobe stands out; it says nothing of what passes.
    fn lobes(&self, _wo: Vec3) -> Option<Lobes> {
        None
    }

    /// Rough reflectance for the albedo image, in [0, 1].
    fn albedo(&self) -> Rgb;

    /// Instances that the statistical tests examine, extreme parameters among them.
    fn examples() -> Vec<(&'static str, Self)>;
}

/// A named instance of a BSDF, for tests.
#[derive(Clone, Debug)]
pub struct Example {
    /// Type and parameters in words.
    pub name: String,
    /// The instance.
    pub bsdf: Bsdf,
}

macro_rules! bsdfs {
    (
        models { $($(#[$doc:meta])* $name:ident { $($(#[$field_doc:meta])* $field:ident: $ty:ty,)* })* }
        wrappers { $($wrappers:tt)* }
    ) => {
        bsdfs!(@material [$($wrappers)*] $($(#[$doc])* $name { $($(#[$field_doc])* $field: $ty,)* },)*);

        /// A BSDF with all its parameters known.
        #[derive(Clone, Copy, Debug, PartialEq)]
        pub enum Bsdf {
            $($(#[$doc])* $name($name),)*
        }

        $(impl From<$name> for Bsdf {
            fn from(model: $name) -> Self { Self::$name(model) }
        })*

        impl Material {
            /// The name of its kind.
            pub fn kind(&self) -> &'static str {
                match self {
                    $(Self::$name { .. } => stringify!($name),)*
                    Self::TwoSided { .. } => "TwoSided",
                    Self::NormalMap { .. } => "NormalMap",
                    Self::Null => "Null",
                }
            }

            /// The BSDF at one point; black for materials that only wrap others.
            #[inline]
            fn resolve(&self, at: &At) -> Bsdf {
                match *self {
                    $(Self::$name { $($field),* } => Bsdf::$name($name::resolve(at, $($field),*)),)*
                    Self::TwoSided { .. } | Self::NormalMap { .. } | Self::Null => {
                        Bsdf::Lambert(Lambert { reflectance: Rgb::ZERO })
                    }
                }
            }
        }

        impl Bsdf {
            /// Value without cosine and density per solid angle of the lobes that are not delta.
            #[inline]
            pub fn eval_pdf(&self, wo: Vec3, wi: Vec3, mode: Transport) -> (Rgb, f32) {
                match self { $(Self::$name(m) => m.eval_pdf(wo, wi, mode),)* }
            }

            /// Draws `wi` given `wo`: `uc` chooses the lobe, `u` the direction. `None` absorbs the path.
            #[inline]
            pub fn sample(&self, wo: Vec3, uc: f32, u: Vec2, mode: Transport) -> Option<BsdfSample> {
                match self { $(Self::$name(m) => m.sample(wo, uc, u, mode),)* }
            }

            /// Whether nothing but delta lobes is there: no light can be connected to such a point.
            #[inline]
            pub fn is_delta_only(&self) -> bool {
                match self { $(Self::$name(m) => m.is_delta_only(),)* }
            }

            /// Whether `sample` looks at `uc`.
            #[inline]
            pub fn chooses(&self) -> bool {
                match self { $(Self::$name(m) => m.chooses(),)* }
            }

            /// Whether anything passes to the other side.
            #[inline]
            pub fn transmits(&self) -> bool {
                match self { $(Self::$name(m) => m.transmits(),)* }
            }

            /// How what it reflects depends on the direction from which it is seen.
            #[inline]
            pub fn spread(&self) -> Spread {
                match self { $(Self::$name(m) => m.spread(),)* }
            }

            /// The value of all directions on the upper side; see [`Model::even`].
            #[inline]
            pub fn even(&self) -> Option<Rgb> {
                match self { $(Self::$name(m) => m.even(),)* }
            }

            /// What its reflection is made of; see [`Model::lobes`].
            #[inline]
            pub fn lobes(&self, wo: Vec3) -> Option<Lobes> {
                match self { $(Self::$name(m) => m.lobes(wo),)* }
            }

            /// Rough reflectance for the albedo image, in [0, 1].
            pub fn albedo(&self) -> Rgb {
                match self { $(Self::$name(m) => m.albedo(),)* }
            }
        }

        /// The instances of every BSDF in the list that the statistical tests examine.
        pub fn roster() -> Vec<Example> {
            let mut all = Vec::new();
            $(all.extend($name::examples().into_iter().map(|(label, model)| {
                Example { name: format!("{}, {label}", stringify!($name)), bsdf: model.into() }
            }));)*
            all
        }
    };
    (@material [$($wrappers:tt)*] $($models:tt)*) => {
        /// A material as the scene describes it, parameters possibly textured.
        #[derive(Clone, Copy, Debug, PartialEq)]
        pub enum Material { $($models)* $($wrappers)* }
    };
}

bsdfs! {
    models {
        /// Ideal diffuse reflection on the front side, black from behind.
        Lambert {
            /// Albedo in [0, 1].
            reflectance: RgbParam,
        }
        /// Metal; black from behind.
        Conductor {
            /// Real index of refraction, relative to the outside.
            eta: Rgb,
            /// Absorption index, relative to the outside.
            k: Rgb,
            /// Multiplies the Fresnel reflectance.
            reflectance: RgbParam,
            /// `None` = a smooth mirror.
            roughness: Option<Roughness>,
        }
        /// Glass, water: reflects and refracts.
        Dielectric {
            /// Index inside (below the surface) over index outside.
            eta: f32,
            /// Multiplies reflection.
            reflectance: RgbParam,
            /// Multiplies transmission.
            transmittance: RgbParam,
            /// `None` = smooth.
            roughness: Option<Roughness>,
        }
        /// glTF metallic-roughness with KHR_materials_ior and KHR_materials_transmission; both sides.
        Gltf {
            /// Base colour.
            base_color: RgbParam,
            /// 0 dielectric, 1 metal.
            metallic: FloatParam,
            /// Perceptual roughness; alpha is its square.
            roughness: FloatParam,
            /// Index of refraction of the dielectric part.
            ior: f32,
            /// Share of transmission in the dielectric's base layer.
            transmission: FloatParam,
            /// Thin-walled: transmission does not refract (no KHR_materials_volume thickness).
            thin: bool,
        }
    }
    wrappers {
        /// Another material on each side; seen from behind, the back material's front is seen.
        TwoSided {
            /// Where `dot(wo, ns) > 0`.
            front: MaterialId,
            /// On the other side.
            back: MaterialId,
        },
        /// Bends the shading normal by a tangent-space normal map.
        NormalMap {
            /// The bent material; not itself a normal map.
            inner: MaterialId,
            /// RGB in [0, 1] maps to xyz in [-1, 1].
            texture: TextureId,
            /// Multiplies x and y.
            scale: f32,
            /// Whether the map's y axis turns round where the texture coordinates are mirrored (glTF); otherwise it is always
            /// the normal times the tangent (Mitsuba).
            mirrors_with_uv: bool,
        },
        /// Nothing at all: light passes straight on. The surface only bounds a medium; rays are not stopped by it, so that
        /// nothing is ever shaded there.
        Null,
    }
}

impl Material {
    /// Whether light may come to the inside of a body of this material: it refracts, or is no surface at all. What a thin sheet lets
    /// through is on its other side, not inside.
    pub fn admits(&self, materials: &[Self]) -> bool {
        let mut left = [Some(*self), None];
        for _ in 0..MAX_NESTING {
            let inner = |id: MaterialId| materials.get(id.0 as usize).copied();
            left = match left {
                [Some(Self::TwoSided { front, back }), None] => [inner(front), inner(back)],
                [Some(Self::NormalMap { inner: id, .. }), other] => [inner(id), other],
                [other, Some(Self::NormalMap { inner: id, .. })] => [other, inner(id)],
                _ => break,
            };
        }
        left.iter().flatten().any(|m| match m {
            Self::Dielectric { .. } | Self::Null => true,
            Self::Gltf { transmission, thin, .. } => !thin && *transmission != FloatParam::Const(0.0),
            _ => false,
        })
    }

    /// Whether the surface is not there: null, or untinted glass of the same index as its surroundings.
    pub fn is_invisible(&self) -> bool {
        match *self {
            Self::Null => true,
            Self::Dielectric { eta, transmittance, .. } => eta == 1.0 && transmittance == RgbParam::Const(Rgb::ONE),
            _ => false,
        }
    }
}

const _: () = assert!(std::mem::size_of::<Bsdf>() <= 96, "a Bsdf is copied at every hit");

impl Bsdf {
    /// Value without cosine of the lobes that are not delta.
    #[inline]
    pub fn eval(&self, wo: Vec3, wi: Vec3, mode: Transport) -> Rgb {
        self.eval_pdf(wo, wi, mode).0
    }

    /// Density per solid angle of `wi` given `wo`, of the lobes that are not delta.
    #[inline]
    pub fn pdf(&self, wo: Vec3, wi: Vec3, mode: Transport) -> f32 {
        self.eval_pdf(wo, wi, mode).1
    }
}
