use super::sample::disk_area;
use super::{Emitter, LeSample, LiSample, LightContext, LightError, LightFlags, emits};
use crate::math::{DVec3, Vec2, Vec3};
use crate::sampling::warp;
use crate::spectrum::Rgb;

/// Parallel light from infinitely far away.
#[derive(Clone, Copy, Debug)]
pub struct DirectionalLight {
    /// Where it travels.
    direction: Vec3,
    irradiance: Rgb,
}

const FLAGS: LightFlags = LightFlags { delta_position: false, delta_direction: true, infinite: true };

impl DirectionalLight {
    /// From the direction in which it travels (any length) and the irradiance on a surface facing it (W / m^2); `None` when black.
    pub fn new(direction: DVec3, irradiance: Rgb) -> Result<Option<Self>, LightError> {
        let direction = unit(direction)?;
        Ok(emits(irradiance)?.then_some(Self { direction, irradiance }))
    }
}

/// `v` as a unit vector.
pub(super) fn unit(v: DVec3) -> Result<Vec3, LightError> {
    if !v.is_finite() {
        return Err(LightError::NotFinite);
    }
    // Divided by the largest component first, so that no square overflows or underflows.
    let largest = v.abs().max_element();
    if !(largest > 0.0) {
        return Err(LightError::NoDirection);
    }
    Ok((v / largest).normalize().as_vec3())
}

impl Emitter for DirectionalLight {
    fn flags(&self) -> LightFlags {
        FLAGS
    }

    fn sample_li(&self, ctx: &LightContext, p: Vec3, _uc: f32, _u: Vec2) -> Option<LiSample> {
        Some(LiSample::infinite(&ctx.bounds, p, -self.direction, self.irradiance, 1.0, true))
    }

    fn sample_le(&self, ctx: &LightContext, _uc: f32, u_pos: Vec2, _u_dir: Vec2) -> Option<LeSample> {
        LeSample::infinite(&ctx.bounds, self.direction, warp::concentric_disk(u_pos), self.irradiance, 1.0, FLAGS)
    }

    fn pdf_le(&self, ctx: &LightContext, _ng: Vec3, _w: Vec3) -> (f32, f32) {
        (1.0 / disk_area(&ctx.bounds), 0.0)
    }

    fn power(&self, ctx: &LightContext) -> Rgb {
        self.irradiance * disk_area(&ctx.bounds)
    }

    #[cfg(test)]
    fn examples() -> Vec<super::tests::Example> {
        let light = Self { direction: Vec3::new(0.6, -0.8, 0.0), irradiance: Rgb::new(1.0, 2.0, 3.0) };
        vec![super::tests::Example::free("directional", light.into())]
    }
}
