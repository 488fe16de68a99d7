//! Where a path scatters: at a surface or in a medium.

use crate::bsdf::{ShadingPoint, Transport};
use crate::film::Aov;
use crate::geometry::Interaction;
use crate::math::{Anchor, Ray, Vec2, Vec3};
use crate::medium::Medium;
use crate::scene::{Enclosures, Scene};
use crate::spectrum::Rgb;

/// What scatters the path.
pub(super) enum Vertex<'a> {
    /// A surface.
    Surface { hit: Interaction, shading: ShadingPoint },
    /// A medium.
    Medium { p: Vec3, wo: Vec3, medium: &'a Medium },
}

/// Value, cosine and density for one direction.
pub(super) struct Scattering {
    /// BSDF without the cosine, or phase function; the albedo of a medium is in the weight of the flight that led into it.
    pub f: Rgb,
    /// `|cos|` at a surface, 1 in a medium.
    pub cos: f32,
    /// Density per solid angle.
    pub pdf: f32,
}

/// A direction in which the path goes on.
pub(super) struct Direction {
    pub wi: Vec3,
    /// What the throughput is multiplied by.
    pub weight: Rgb,
    /// Density per solid angle; for a delta lobe its probability.
    pub pdf: f32,
    /// Whether a delta lobe was drawn.
    pub delta: bool,
    /// Index of refraction on the side of `wi` over that on the side of `wo`.
    pub eta: f32,
}

impl Vertex<'_> {
    /// The surface at `hit`, seen from `wo`.
    #[inline]
    pub fn surface(scene: &Scene, hit: Interaction, wo: Vec3) -> Self {
        let material = scene.objects[hit.object.0 as usize].material;
        let shading = ShadingPoint::new(&scene.materials, &scene.textures, material, &hit, wo);
        Self::Surface { hit, shading }
    }

    /// Where it is.
    #[inline]
    pub fn anchor(&self) -> Anchor {
        match self {
            Self::Surface { hit, .. } => hit.anchor(),
            Self::Medium { p, .. } => Anchor::free(*p),
        }
    }

    /// Whether no light can be connected to it.
    #[inline]
    pub fn is_delta_only(&self) -> bool {
        match self {
            Self::Surface { shading, .. } => shading.is_delta_only(),
            Self::Medium { .. } => false,
        }
    }

    /// Scattering from the direction `wi`.
    #[inline]
    pub fn eval(&self, wi: Vec3) -> Scattering {
        match self {
            Self::Surface { shading, .. } => {
                let (f, pdf) = shading.eval_pdf(wi, Transport::Radiance);
                Scattering { f, cos: shading.abs_cos(wi), pdf }
            }
            Self::Medium { wo, medium, .. } => {
                let pdf = medium.phase.pdf(*wo, wi);
                Scattering { f: Rgb::splat(pdf), cos: 1.0, pdf }
            }
        }
    }

    /// Draws a direction: `uc` chooses between lobes, `u` the direction. `None` absorbs the path.
    #[inline]
    pub fn sample(&self, uc: f32, u: Vec2) -> Option<Direction> {
        match self {
            Self::Surface { shading, .. } => {
                let s = shading.sample(uc, u, Transport::Radiance)?;
                Some(Direction { wi: s.wi, weight: s.weight(), pdf: s.pdf, delta: s.lobe.delta, eta: s.eta })
            }
            Self::Medium { wo, medium, .. } => {
                let (wi, pdf) = medium.phase.sample(*wo, u);
                Some(Direction { wi, weight: Rgb::ONE, pdf, delta: false, eta: 1.0 })
            }
        }
    }

    /// The ray that leaves in direction `wi`.
    #[inline]
    pub fn ray(&self, wi: Vec3) -> Ray {
        match self {
            Self::Surface { hit, .. } => hit.spawn_ray(wi),
            Self::Medium { p, .. } => Ray::new(*p, wi),
        }
    }

    /// What encloses that ray, given what encloses the one that came.
    #[inline]
    pub fn around(&self, scene: &Scene, wi: Vec3, around: &Enclosures) -> Enclosures {
        match self {
            Self::Surface { hit, .. } => scene.beside(hit.object, hit.ng.dot(wi) < 0.0, around),
            Self::Medium { .. } => *around,
        }
    }

    /// What it shows in the auxiliary images of a camera at `o`. A medium has no normal.
    pub fn aov(&self, o: Vec3) -> Aov {
        let (p, albedo, normal) = match self {
            Self::Surface { hit, shading } => (hit.p, shading.bsdf.albedo(), shading.frame.n),
            Self::Medium { p, medium, .. } => (*p, medium.albedo, Vec3::ZERO),
        };
        Aov { albedo: albedo.to_array(), normal: normal.to_array(), depth: (p - o).length(), hits: 1.0 }
    }
}
