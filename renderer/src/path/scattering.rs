//! What scatters at a vertex, surface or medium, in one interface.

use crate::bsdf::{DirectionSample, Lobe, Lobes, Material, MaterialId, ShadingPoint, Transport};
use crate::geometry::Interaction;
use crate::light::{Gloss, Place};
use crate::math::{Vec2, Vec3};
use crate::medium::Medium;
use crate::sampling::Sampler;
use crate::spectrum::Rgb;
use crate::texture::Texture;

/// Share of a rough lobe that counts as diffuse where lights are selected: its shape is known roughly only.
const SURE: f32 = 0.01;

/// A point of a medium that scatters, seen from `wo`. The scattering coefficient is in the weight of the flight that came here; what is
/// left is the phase function.
#[derive(Clone, Copy, Debug)]
pub struct MediumPoint {
    /// The medium.
    pub medium: Medium,
    /// Unit direction to the previous vertex.
    pub wo: Vec3,
}

impl MediumPoint {
    /// Draws `wi`.
    #[inline]
    fn sample(&self, u: Vec2) -> DirectionSample {
        let (wi, pdf) = self.medium.phase.sample(self.wo, u);
        DirectionSample { wi, f: Rgb::splat(pdf), pdf, cos_theta: 1.0, lobe: Lobe::DIFFUSE, eta: 1.0 }
    }
}

/// What scatters at a vertex.
#[derive(Clone, Copy, Debug)]
pub enum Scattering {
    /// A BSDF.
    Surface(ShadingPoint),
    /// A phase function.
    Medium(MediumPoint),
}

impl Scattering {
    /// Evaluates `material` at `hit`, seen from `wo` ([`ShadingPoint::new`]).
    pub fn at_surface(
        materials: &[Material],
        textures: &[Texture],
        material: MaterialId,
        hit: &Interaction,
        wo: Vec3,
    ) -> Self {
        Self::Surface(ShadingPoint::new(materials, textures, material, hit, wo))
    }

    /// Draws a direction: `uc` chooses between lobes, `u` the direction. `None` absorbs the path.
    #[inline]
    pub fn sample(&self, uc: f32, u: Vec2, mode: Transport) -> Option<DirectionSample> {
        match self {
            Self::Surface(shading) => shading.sample(uc, u, mode),
            Self::Medium(point) => Some(point.sample(u)),
        }
    }

    /// What the throughput of a path that goes on by `s` is multiplied by. Phase functions are sampled perfectly.
    #[inline]
    pub fn weight(&self, s: &DirectionSample) -> Rgb {
        match self {
            Self::Surface(_) => s.weight(),
            Self::Medium(_) => Rgb::ONE,
        }
    }

    /// Value without cosine and density per solid angle for `wi`.
    #[inline(always)]
    pub fn eval_pdf(&self, wi: Vec3, mode: Transport) -> (Rgb, f32) {
        match self {
            Self::Surface(shading) => shading.eval_pdf(wi, mode),
            Self::Medium(point) => {
                let pdf = point.medium.phase.pdf(point.wo, wi);
                (Rgb::splat(pdf), pdf)
            }
        }
    }

    /// Density per solid angle of drawing `wo` by a walk that comes from `wi` in `mode`.
    #[inline]
    pub fn pdf_reverse(&self, wi: Vec3, mode: Transport) -> f32 {
        match self {
            Self::Surface(shading) => shading.pdf_reverse(wi, mode),
            Self::Medium(point) => point.medium.phase.pdf(wi, point.wo),
        }
    }

    /// `|cos|` of the angle between `w` and the shading normal; 1 in a medium.
    #[inline]
    pub fn abs_cos(&self, w: Vec3) -> f32 {
        match self {
            Self::Surface(shading) => shading.abs_cos(w),
            Self::Medium(_) => 1.0,
        }
    }

    /// By which importance is multiplied at a surface with a shading normal ([`ShadingPoint::adjoint_correction`]).
    #[inline]
    pub fn adjoint_correction(&self, wi: Vec3) -> f32 {
        match self {
            Self::Surface(shading) => shading.adjoint_correction(wi),
            Self::Medium(_) => 1.0,
        }
    }

    /// Whether nothing but delta lobes is there: nothing can be connected to it.
    #[inline]
    pub fn is_delta_only(&self) -> bool {
        match self {
            Self::Surface(shading) => shading.is_delta_only(),
            Self::Medium(_) => false,
        }
    }

    /// Whether `sample` looks at `uc`.
    #[inline]
    fn chooses(&self) -> bool {
        match self {
            Self::Surface(shading) => shading.bsdf.chooses(),
            Self::Medium(_) => false,
        }
    }

    /// What `sample` needs.
    #[inline]
    pub fn numbers(&self, sampler: &mut impl Sampler) -> (f32, Vec2) {
        if self.chooses() {
            return sampler.next_3();
        }
        sampler.skip_1d();
        (0.0, sampler.next_2d())
    }

    /// Rough share of light that is scattered, in [0, 1].
    pub fn albedo(&self) -> Rgb {
        match self {
            Self::Surface(shading) => shading.bsdf.albedo(),
            Self::Medium(point) => point.medium.albedo,
        }
    }

    /// The point `p` where it scatters, as lights are selected for it.
    #[inline]
    pub fn place(&self, p: Vec3) -> Place {
        let Self::Surface(shading) = self else { return Place::anywhere(p) };
        let up = shading.up();
        if up == Vec3::ZERO {
            return Place::anywhere(p);
        }
        let gloss = |(wo, lobes): (Vec3, Lobes)| {
            let n = shading.frame.n;
            let n = if wo.dot(n) < 0.0 { -n } else { n };
            let specular = lobes.specular;
            Gloss { n, wo, diffuse: lobes.diffuse + SURE * specular, specular, alpha2: lobes.alpha * lobes.alpha }
        };
        Place { p, up, lobe: shading.lobes().map(gloss) }
    }

    /// The shading normal; a medium has none, zero.
    pub fn normal(&self) -> Vec3 {
        match self {
            Self::Surface(shading) => shading.frame.n,
            Self::Medium(_) => Vec3::ZERO,
        }
    }
}
