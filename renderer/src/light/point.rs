use super::{Emitter, LeSample, LiSample, LightBounds, LightContext, LightError, LightFlags, emits};
use crate::math::{Anchor, DVec3, INV_4PI, Ray, Vec2, Vec3};
use crate::sampling::warp;
use crate::spectrum::Rgb;
use std::f32::consts::PI;

/// Isotropic point light.
#[derive(Clone, Copy, Debug)]
pub struct PointLight {
    position: Vec3,
    intensity: Rgb,
}

impl PointLight {
    /// Where it is.
    pub fn position(&self) -> Vec3 {
        self.position
    }

    /// From position and radiant intensity (W / sr); `None` when black.
    pub fn new(position: DVec3, intensity: Rgb) -> Result<Option<Self>, LightError> {
        let position = position.as_vec3();
        if !position.is_finite() {
            return Err(LightError::NotFinite);
        }
        Ok(emits(intensity)?.then_some(Self { position, intensity }))
    }
}

/// Unit direction and distance from `p` to a point light at `position`; `None` when they coincide.
pub(super) fn direction_to(position: Vec3, p: Vec3) -> Option<(Vec3, f32)> {
    let d = position - p;
    let dist = d.length();
    (dist > 0.0 && dist.is_finite()).then(|| (d / dist, dist))
}

pub(super) const POINT_FLAGS: LightFlags = LightFlags { delta_position: true, delta_direction: false, infinite: false };

impl Emitter for PointLight {
    fn flags(&self) -> LightFlags {
        POINT_FLAGS
    }

    fn sample_li(&self, _ctx: &LightContext, p: Vec3, _uc: f32, _u: Vec2) -> Option<LiSample> {
        let (wi, dist) = direction_to(self.position, p)?;
        let radiance = self.intensity / (dist * dist);
        Some(LiSample { wi, dist, radiance, pdf: 1.0, delta: true, light: Anchor::free(self.position) })
    }

    fn sample_le(&self, _ctx: &LightContext, _uc: f32, _u_pos: Vec2, u_dir: Vec2) -> Option<LeSample> {
        let w = warp::uniform_sphere(u_dir);
        Some(LeSample {
            ray: Ray::new(self.position, w),
            light: Anchor::free(self.position),
            radiance: self.intensity,
            cos: 1.0,
            pdf_pos: 1.0,
            pdf_dir: INV_4PI,
            flags: POINT_FLAGS,
        })
    }

    fn pdf_le(&self, _ctx: &LightContext, _ng: Vec3, _w: Vec3) -> (f32, f32) {
        (0.0, INV_4PI)
    }

    fn bounds(&self, _ctx: &LightContext) -> Option<LightBounds> {
        Some(LightBounds::point(self.position))
    }

    fn power(&self, _ctx: &LightContext) -> Rgb {
        self.intensity * (4.0 * PI)
    }

    #[cfg(test)]
    fn examples() -> Vec<super::tests::Example> {
        let light = Self { position: Vec3::new(0.3, 1.2, -0.4), intensity: Rgb::new(3.0, 2.0, 1.0) };
        vec![super::tests::Example::free("point", light.into())]
    }
}
