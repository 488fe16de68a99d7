//! BSDFs. The contract: `wo` points to the previous vertex, `wi` to the next, both unit, outward, in the shading frame (z = ns).
//! `eval` is without the cosine; `pdf` is per solid angle and 0 for delta lobes.

use crate::spectrum::Rgb;
use crate::texture::{FloatParam, RgbParam, TextureId};

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

/// A BSDF as the scene describes it, parameters possibly textured.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Material {
    /// Ideal diffuse reflection on the front side, black from behind.
    Lambert {
        /// Albedo in [0, 1].
        reflectance: RgbParam,
    },
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
    },
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
    },
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
    },
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
    },
}
