use crate::geometry::{BoundingSphere, Geometry};
use crate::math::{Anchor, Frame, Ray, Vec2, Vec3};
use crate::spectrum::Rgb;
use crate::texture::Texture;
use std::f32::consts::PI;

/// Area of a disk through the centre of the scene's bounds.
pub(super) fn disk_area(bounds: &BoundingSphere) -> f32 {
    PI * bounds.radius * bounds.radius
}

/// The parts of a scene that lights refer to.
#[derive(Clone, Copy, Debug)]
pub struct LightContext<'a> {
    /// All objects.
    pub geometry: &'a Geometry,
    /// All textures.
    pub textures: &'a [Texture],
    /// Contains every object; what infinite lights shine through.
    pub bounds: BoundingSphere,
}

/// What kind of light it is.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct LightFlags {
    /// All light comes from one point.
    pub delta_position: bool,
    /// All light goes in one direction.
    pub delta_direction: bool,
    /// It has no place: rays that leave the scene see it.
    pub infinite: bool,
}

impl LightFlags {
    /// Whether no other technique than sampling the light can find it.
    #[inline]
    pub fn is_delta(self) -> bool {
        self.delta_position || self.delta_direction
    }
}

/// A direction from a point towards a light. Its contribution is `f * radiance * |cos| * visibility / pdf`.
#[derive(Clone, Copy, Debug)]
pub struct LiSample {
    /// Unit direction towards the light.
    pub wi: Vec3,
    /// Distance to the light; infinite for infinite lights.
    pub dist: f32,
    /// Radiance that would arrive from there if nothing were in between. For delta lights, irradiance on a surface facing `wi`
    /// (intensity over squared distance).
    pub radiance: Rgb,
    /// Density of `wi` per solid angle; 1 for delta lights.
    pub pdf: f32,
    /// Whether `wi` is the light's only direction from there.
    pub delta: bool,
    /// The light vertex. For infinite lights a point outside the scene's bounds whose normal is `-wi`; for point lights without a
    /// normal (zero).
    pub light: Anchor,
}

impl LiSample {
    /// The ray that must be free for the light to arrive at `from`. It ends clear of the light's surface by rounding errors only.
    #[inline]
    pub fn shadow_ray(&self, from: &Anchor) -> Ray {
        if self.dist.is_infinite() { from.ray(self.wi) } else { from.segment_to(&self.light) }
    }

    /// The sample of an infinite light in direction `wi` from `p`.
    pub(super) fn infinite(bounds: &BoundingSphere, p: Vec3, wi: Vec3, radiance: Rgb, pdf: f32, delta: bool) -> Self {
        let out = p + wi * (2.0 * bounds.radius + (p - bounds.centre).length());
        let light = Anchor { p: out, p_error: Vec3::ZERO, ng: -wi };
        Self { wi, dist: f32::INFINITY, radiance, pdf, delta, light }
    }
}

/// A ray that leaves a light. Its throughput is `radiance * cos / (pdf_pos * pdf_dir)`.
#[derive(Clone, Copy, Debug)]
pub struct LeSample {
    /// The ray, clear of the light's surface; unit direction.
    pub ray: Ray,
    /// Where it starts. `ng` is the light's geometric normal (which side emits is told by `ray.d`); for point lights zero; for
    /// infinite lights the ray's direction (the point lies on a disk outside the scene).
    pub light: Anchor,
    /// Radiance along the ray of area, constant and environment lights; intensity of point lights and spots; irradiance on a
    /// surface facing it of directional lights.
    pub radiance: Rgb,
    /// Cosine between the ray and the normal of the emitting surface; 1 where there is none.
    pub cos: f32,
    /// Density of the point per area; 1 for a delta position.
    pub pdf_pos: f32,
    /// Density of the direction per solid angle; 1 for a delta direction.
    pub pdf_dir: f32,
    /// What kind of light it came from.
    pub flags: LightFlags,
}

impl LeSample {
    /// Emission over density, in W: its mean over samples is the light's power.
    #[inline]
    pub fn throughput(&self) -> Rgb {
        self.radiance * (self.cos / (self.pdf_pos * self.pdf_dir))
    }

    /// The ray of an infinite light that travels along `w` through the scene's bounds; `disk` is a point of the unit disk.
    pub(super) fn infinite(
        bounds: &BoundingSphere,
        w: Vec3,
        disk: Vec2,
        radiance: Rgb,
        pdf_dir: f32,
        flags: LightFlags,
    ) -> Option<Self> {
        if !(bounds.radius > 0.0) {
            return None;
        }
        let frame = Frame::from_normal(w);
        let p = bounds.centre + (frame.s * disk.x + frame.t * disk.y - w) * bounds.radius;
        let light = Anchor { p, p_error: Vec3::ZERO, ng: w };
        let pdf_pos = 1.0 / disk_area(bounds);
        Some(Self { ray: Ray::new(p, w), light, radiance, cos: 1.0, pdf_pos, pdf_dir, flags })
    }
}
