use super::sample::disk_area;
use super::{Emitter, LeSample, LiSample, LightContext, LightError, LightFlags, emits};
use crate::math::{INV_4PI, Vec2, Vec3};
use crate::sampling::warp;
use crate::spectrum::Rgb;
use std::f32::consts::PI;

/// The same radiance from every direction of the sky.
#[derive(Clone, Copy, Debug)]
pub struct ConstantLight {
    radiance: Rgb,
}

pub(super) const SKY_FLAGS: LightFlags = LightFlags { delta_position: false, delta_direction: false, infinite: true };

impl ConstantLight {
    /// From its radiance; `None` when black.
    pub fn new(radiance: Rgb) -> Result<Option<Self>, LightError> {
        Ok(emits(radiance)?.then_some(Self { radiance }))
    }
}

impl Emitter for ConstantLight {
    fn flags(&self) -> LightFlags {
        SKY_FLAGS
    }

    fn sample_li(&self, ctx: &LightContext, p: Vec3, _uc: f32, u: Vec2) -> Option<LiSample> {
        Some(LiSample::infinite(&ctx.bounds, p, warp::uniform_sphere(u), self.radiance, INV_4PI, false))
    }

    fn pdf_li_escaped(&self, _w: Vec3) -> f32 {
        INV_4PI
    }

    fn le_infinite(&self, _w: Vec3) -> Rgb {
        self.radiance
    }

    fn sample_le(&self, ctx: &LightContext, _uc: f32, u_pos: Vec2, u_dir: Vec2) -> Option<LeSample> {
        let w = warp::uniform_sphere(u_dir);
        LeSample::infinite(&ctx.bounds, w, warp::concentric_disk(u_pos), self.radiance, INV_4PI, SKY_FLAGS)
    }

    fn pdf_le(&self, ctx: &LightContext, _ng: Vec3, _w: Vec3) -> (f32, f32) {
        (1.0 / disk_area(&ctx.bounds), INV_4PI)
    }

    fn power(&self, ctx: &LightContext) -> Rgb {
        self.radiance * (4.0 * PI * disk_area(&ctx.bounds))
    }

    #[cfg(test)]
    fn examples() -> Vec<super::tests::Example> {
        vec![super::tests::Example::free("constant", Self { radiance: Rgb::new(0.5, 1.0, 2.0) }.into())]
    }
}
