//! The BSDF at a hit, in world space: frame, sides, normal maps.

use super::resolve::At;
use super::{Bsdf, Lambert, Lobe, Lobes, Material, MaterialId, Transport};
use crate::geometry::Interaction;
use crate::math::{Frame, Vec2, Vec3};
use crate::spectrum::Rgb;
use crate::texture::Texture;

/// How many materials may wrap one another ([`first_bad_nesting`]).
pub const MAX_NESTING: usize = 4;

/// A direction drawn at a surface, in world space.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DirectionSample {
    /// Where the path goes on.
    pub wi: Vec3,
    /// Value without the cosine.
    pub f: Rgb,
    /// Density per solid angle; for a delta lobe its probability.
    pub pdf: f32,
    /// `|cos|` of the angle between `wi` and the shading normal.
    pub cos_theta: f32,
    /// What was drawn.
    pub lobe: Lobe,
    /// Index of refraction on the side of `wi` over that on the side of `wo`; 1 for reflection.
    pub eta: f32,
}

impl DirectionSample {
    /// `f |cos| / pdf`: what the path's throughput is multiplied by.
    #[inline]
    pub fn weight(&self) -> Rgb {
        self.f * (self.cos_theta / self.pdf)
    }
}

/// A surface that reflects evenly, from the side from which it is seen: directions on the upper side of both normals have the same value,
/// all others none; they are drawn in proportion to the cosine.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Even {
    /// Value without the cosine.
    pub f: Rgb,
    /// Unit shading normal.
    pub n: Vec3,
    /// Unit geometric normal.
    pub ng: Vec3,
}

/// Which pairs of directions a surface may join, where shading and geometric normal disagree. Every rule treats the two alike,
/// so that paths from the camera and from the light see the same BSDF.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Sides {
    /// Any: energy must not vanish inside smooth glass.
    Any,
    /// `wo` and `wi` on the same geometric side: no light leaks through opaque surfaces.
    Same,
    /// Each on the same side of both normals: a bent normal must not exchange inside and outside of glass.
    Consistent,
}

/// What scatters light at a hit: the BSDF with its shading frame, seen from `wo`.
#[derive(Clone, Copy, Debug)]
pub struct ShadingPoint {
    /// The shading frame, turned and bent as the material asks; mirrored (left-handed) behind a two-sided material.
    pub frame: Frame,
    /// Unit geometric normal.
    pub ng: Vec3,
    /// Direction to the previous vertex, in `frame`.
    pub wo: Vec3,
    /// The BSDF in `frame`.
    pub bsdf: Bsdf,
    wo_dot_ng: f32,
    sides: Sides,
}

impl ShadingPoint {
    /// Evaluates `material` at `hit` for the world-space unit direction `wo` towards the previous vertex.
    #[inline]
    pub fn new(
        materials: &[Material],
        textures: &[Texture],
        material: MaterialId,
        hit: &Interaction,
        wo: Vec3,
    ) -> Self {
        let at = At { textures, uv: hit.uv };
        let mut frame = hit.frame;
        let mut material = &materials[material.0 as usize];
        let mut bent = false;
        // Unwrap two-sided materials and normal maps.
        for _ in 0..MAX_NESTING {
            match *material {
                Material::TwoSided { front, back } => {
                    let is_front = wo.dot(frame.n) > 0.0;
                    if !is_front {
                        frame.n = -frame.n;
                    }
                    material = &materials[if is_front { front } else { back }.0 as usize];
                }
                Material::NormalMap { inner, texture, scale, mirrors_with_uv } => {
                    let colour = textures[texture.0 as usize].eval(hit.uv);
                    let mirrored = mirrors_with_uv && hit.frame.n.dot(hit.dpdu.cross(hit.dpdv)) > 0.0;
                    if let Some(f) = bent_frame(&frame, hit, colour, scale, mirrored) {
                        frame = f;
                        bent = true;
                    }
                    material = &materials[inner.0 as usize];
                }
                _ => break,
            }
        }
        let seen = |bsdf: Bsdf| Self::seen(frame, hit.ng, wo, bsdf, bent);
        // Apart from the others, whose BSDFs come through memory and would be copied.
        match *material {
            Material::Lambert { reflectance } => seen(Bsdf::Lambert(Lambert::resolve(&at, reflectance))),
            _ => seen(material.resolve(&at)),
        }
    }

    /// The geometric normal on the side of `wo`, if light counts from there only; else zero.
    #[inline]
    pub fn up(&self) -> Vec3 {
        match self.sides {
            Sides::Same => self.ng * self.wo_dot_ng.signum(),
            Sides::Any | Sides::Consistent => Vec3::ZERO,
        }
    }

    /// Unit direction to the previous vertex, and what of it is reflected.
    #[inline]
    pub fn lobes(&self) -> Option<(Vec3, Lobes)> {
        Some((self.frame.to_world(self.wo), self.bsdf.lobes(self.wo)?))
    }

    /// What `bsdf` in `frame` is from `wo`; `bent`: the frame is that of a normal map.
    #[inline(always)]
    fn seen(frame: Frame, ng: Vec3, wo: Vec3, bsdf: Bsdf, bent: bool) -> Self {
        let sides = match (bsdf.transmits(), bent) {
            (false, _) => Sides::Same,
            (true, false) => Sides::Any,
            (true, true) => Sides::Consistent,
        };
        Self { frame, ng, wo: frame.to_local(wo), bsdf, wo_dot_ng: wo.dot(ng), sides }
    }

    /// The same point seen from another direction on the same side of both normals, where two-sided materials are the same.
    #[inline]
    pub fn seen_from(&self, wo: Vec3) -> Self {
        Self { wo: self.frame.to_local(wo), wo_dot_ng: wo.dot(self.ng), ..*self }
    }

    /// Value without cosine and density per solid angle for the world-space direction `wi`; delta lobes are in neither.
    #[inline]
    pub fn eval_pdf(&self, wi: Vec3, mode: Transport) -> (Rgb, f32) {
        let local = self.frame.to_local(wi);
        if self.joins(wi, local) { self.bsdf.eval_pdf(self.wo, local, mode) } else { (Rgb::ZERO, 0.0) }
    }

    /// Value without cosine.
    #[inline]
    pub fn eval(&self, wi: Vec3, mode: Transport) -> Rgb {
        self.eval_pdf(wi, mode).0
    }

    /// Density per solid angle of drawing `wi`.
    #[inline]
    pub fn pdf(&self, wi: Vec3, mode: Transport) -> f32 {
        self.eval_pdf(wi, mode).1
    }

    /// Density per solid angle of drawing `wo` by a walk that comes from `wi` in `mode`.
    #[inline]
    pub fn pdf_reverse(&self, wi: Vec3, mode: Transport) -> f32 {
        let local = self.frame.to_local(wi);
        if self.joins(wi, local) { self.bsdf.pdf(local, self.wo, mode) } else { 0.0 }
    }

    /// Draws `wi`: `uc` chooses the lobe, `u` the direction. `None` absorbs the path.
    #[inline]
    pub fn sample(&self, uc: f32, u: Vec2, mode: Transport) -> Option<DirectionSample> {
        let sample = self.bsdf.sample(self.wo, uc, u, mode);
        let s = sample.as_ref()?;
        let wi = self.frame.to_world(s.wi).normalize();
        let cos_theta = s.wi.z.abs();
        self.joins(wi, s.wi).then_some(DirectionSample { wi, f: s.f, pdf: s.pdf, cos_theta, lobe: s.lobe, eta: s.eta })
    }

    /// If it reflects evenly, what it does.
    pub fn even(&self) -> Option<Even> {
        let f = self.bsdf.even().filter(|_| self.wo.z > 0.0)?;
        let ng = if self.wo_dot_ng < 0.0 { -self.ng } else { self.ng };
        Some(Even { f, n: self.frame.n, ng })
    }

    /// `|cos|` of the angle between the world-space direction `w` and the shading normal.
    #[inline]
    pub fn abs_cos(&self, w: Vec3) -> f32 {
        self.frame.n.dot(w).abs()
    }

    /// `|wo.ns| |wi.ng| / (|wo.ng| |wi.ns|)`, by which importance (not radiance) is multiplied at a vertex with a shading
    /// normal (Veach 1997, section 5.3); 0 where it has no value.
    #[inline]
    pub fn adjoint_correction(&self, wi: Vec3) -> f32 {
        let denominator = (self.wo_dot_ng * self.frame.n.dot(wi)).abs();
        if denominator > 0.0 { (self.wo.z * self.ng.dot(wi)).abs() / denominator } else { 0.0 }
    }

    /// Whether nothing but delta lobes is there: no light can be connected to such a point.
    #[inline]
    pub fn is_delta_only(&self) -> bool {
        self.bsdf.is_delta_only()
    }

    /// Whether the surface may join `wo` to `wi`, given in world space and in the frame.
    #[inline]
    fn joins(&self, wi: Vec3, local: Vec3) -> bool {
        let wi_dot_ng = wi.dot(self.ng);
        match self.sides {
            Sides::Any => true,
            Sides::Same => self.wo_dot_ng * wi_dot_ng > 0.0,
            // Behind a two-sided material the frame's normal points against the geometric one.
            Sides::Consistent => {
                let front = self.frame.n.dot(self.ng);
                self.wo_dot_ng * self.wo.z * front > 0.0 && wi_dot_ng * local.z * front > 0.0
            }
        }
    }
}

/// The frame bent by a normal-map texel; `None` keeps the surface's own where the texel means no direction of its upper side.
/// It does not depend on `wo`, which would break reciprocity.
fn bent_frame(frame: &Frame, hit: &Interaction, colour: Rgb, scale: f32, mirrored: bool) -> Option<Frame> {
    let t = colour * 2.0 - Rgb::ONE;
    let y = if mirrored { -t.g } else { t.g };
    let local = Vec3::new(t.r * scale, y * scale, t.b);
    let length = local.length();
    if !(local.z > 1e-3 * length) || !length.is_finite() {
        return None;
    }
    let n = frame.to_world(local / length).normalize();
    (n.dot(hit.ng) * frame.n.dot(hit.ng) > 0.0).then(|| Frame::from_normal_tangent(n, hit.dpdu))
}

/// The first material that wraps more than [`MAX_NESTING`] levels deep (or itself), or that names one past the end.
pub fn first_bad_nesting(materials: &[Material]) -> Option<MaterialId> {
    fn fits(materials: &[Material], id: MaterialId, levels: usize) -> bool {
        match materials.get(id.0 as usize) {
            None => false,
            Some(Material::TwoSided { front, back }) => {
                levels > 0 && fits(materials, *front, levels - 1) && fits(materials, *back, levels - 1)
            }
            Some(Material::NormalMap { inner, .. }) => levels > 0 && fits(materials, *inner, levels - 1),
            Some(_) => true,
        }
    }
    (0..materials.len() as u32).map(MaterialId).find(|id| !fits(materials, *id, MAX_NESTING))
}
