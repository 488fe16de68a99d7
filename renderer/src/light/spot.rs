use super::directional::unit;
use super::place::Cone;
use super::point::{POINT_FLAGS, direction_to};
use super::{
    Emitter, LeSample, LiSample, LightBounds, LightContext, LightDesc, LightError, LightFlags, SpotFalloff, emits,
};
use crate::math::{Anchor, Frame, Ray, Vec2, Vec3, cos64, pow, safe_asin, safe_sqrt, sin_cos, sin64, sqr};
use crate::spectrum::Rgb;
use std::f32::consts::{PI, TAU};

/// Point light with a cone. Angles are kept as `1 - cos`, which stays exact for narrow beams.
#[derive(Clone, Copy, Debug)]
pub struct SpotLight {
    position: Vec3,
    frame: Frame,
    intensity: Rgb,
    falloff: SpotFalloff,
    /// Half angles in radians.
    beam: f32,
    cutoff: f32,
    /// `1 - cos(beam)`.
    omc_beam: f32,
    /// `1 - cos(cutoff)`.
    omc_cutoff: f32,
    /// Probability of sampling the inner cone.
    pmf_beam: f32,
    /// Density per solid angle in the inner cone; in the ring times [`SpotLight::ring`].
    pdf_beam: f32,
}

impl SpotLight {
    /// Where it is.
    pub fn position(&self) -> Vec3 {
        self.position
    }

    /// From a [`LightDesc::Spot`]; `None` when black (or for other lights).
    pub fn new(desc: &LightDesc) -> Result<Option<Self>, LightError> {
        let &LightDesc::Spot { position, direction, intensity, beam, cutoff, falloff } = desc else { return Ok(None) };
        let position = position.as_vec3();
        if !position.is_finite() || !beam.is_finite() || !cutoff.is_finite() {
            return Err(LightError::NotFinite);
        }
        if !(0.0 <= beam && beam <= cutoff && cutoff <= 180.0 && cutoff > 0.0) {
            return Err(LightError::Angles);
        }
        let (beam, cutoff) = (beam.to_radians(), cutoff.to_radians());
        let one_minus_cos = |a: f64| {
            let s = sin64(0.5 * a);
            2.0 * s * s
        };
        let (omc_beam, omc_cutoff) = (one_minus_cos(beam), one_minus_cos(cutoff));
        // The ring's density is proportional to x (LinearAngle) or x^2 (SquaredCosine), x falling from 1 to 0 linearly in the cosine.
        let ring_mass = (omc_cutoff - omc_beam) / (1.0 + f64::from(exponent(falloff)));
        let mass = omc_beam + ring_mass;
        let frame = Frame::from_normal(unit(direction)?);
        if !emits(intensity)? {
            return Ok(None);
        }
        Ok(Some(Self {
            position,
            frame,
            intensity,
            falloff,
            beam: beam as f32,
            cutoff: cutoff as f32,
            omc_beam: omc_beam as f32,
            omc_cutoff: omc_cutoff as f32,
            pmf_beam: (omc_beam / mass) as f32,
            pdf_beam: (1.0 / (2.0 * std::f64::consts::PI * mass)) as f32,
        }))
    }

    /// Share of the intensity at an angle whose `1 - cos` is `omc`.
    fn share(&self, omc: f32) -> f32 {
        if omc <= self.omc_beam {
            return 1.0;
        }
        match self.falloff {
            SpotFalloff::SquaredCosine => sqr(self.ring(omc)),
            SpotFalloff::LinearAngle => {
                let theta = 2.0 * safe_asin(safe_sqrt(0.5 * omc));
                ((self.cutoff - theta) / (self.cutoff - self.beam)).clamp(0.0, 1.0)
            }
        }
    }

    /// 1 at the beam's angle, 0 at the cutoff, linear in the cosine.
    fn ring(&self, omc: f32) -> f32 {
        if omc <= self.omc_beam {
            return 1.0;
        }
        if omc >= self.omc_cutoff {
            return 0.0;
        }
        (self.omc_cutoff - omc) / (self.omc_cutoff - self.omc_beam)
    }

    /// Density per solid angle of `sample_le`'s direction.
    fn pdf_dir(&self, omc: f32) -> f32 {
        let x = self.ring(omc);
        self.pdf_beam * if exponent(self.falloff) == 1 { x } else { x * x }
    }
}

/// Exponent of the density in the ring between beam and cutoff. For [`SpotFalloff::LinearAngle`], whose own distribution can't be
/// inverted, the weight then stays between 1 / 2 and 1 up to 90 degrees.
fn exponent(falloff: SpotFalloff) -> u32 {
    match falloff {
        SpotFalloff::LinearAngle => 1,
        SpotFalloff::SquaredCosine => 2,
    }
}

/// `1 - cos` of the angle between two unit vectors, without cancellation.
fn one_minus_cos(a: Vec3, b: Vec3) -> f32 {
    0.5 * (a - b).length_squared()
}

impl Emitter for SpotLight {
    fn flags(&self) -> LightFlags {
        POINT_FLAGS
    }

    fn sample_li(&self, _ctx: &LightContext, p: Vec3, _uc: f32, _u: Vec2) -> Option<LiSample> {
        let (wi, dist) = direction_to(self.position, p)?;
        let share = self.share(one_minus_cos(-wi, self.frame.n));
        let radiance = self.intensity * (share / (dist * dist));
        (share > 0.0).then_some(LiSample {
            wi,
            dist,
            radiance,
            pdf: 1.0,
            delta: true,
            light: Anchor::free(self.position),
        })
    }

    fn sample_le(&self, _ctx: &LightContext, _uc: f32, _u_pos: Vec2, u_dir: Vec2) -> Option<LeSample> {
        // Choose the inner cone or the ring, and an angle in it.
        let omc = if u_dir.x < self.pmf_beam {
            self.omc_beam * (u_dir.x / self.pmf_beam)
        } else {
            let u = ((1.0 - u_dir.x) / (1.0 - self.pmf_beam)).clamp(0.0, 1.0);
            let x = if exponent(self.falloff) == 1 { u.sqrt() } else { pow(u, 1.0 / 3.0) };
            self.omc_cutoff - x * (self.omc_cutoff - self.omc_beam)
        };
        let (sin_phi, cos_phi) = sin_cos(TAU * u_dir.y);
        let sin = safe_sqrt(omc * (2.0 - omc));
        let w = self.frame.to_world(Vec3::new(sin * cos_phi, sin * sin_phi, 1.0 - omc));
        let pdf_dir = self.pdf_dir(omc);
        (pdf_dir > 0.0).then_some(LeSample {
            ray: Ray::new(self.position, w),
            light: Anchor::free(self.position),
            radiance: self.intensity * self.share(omc),
            cos: 1.0,
            pdf_pos: 1.0,
            pdf_dir,
            flags: POINT_FLAGS,
        })
    }

    fn pdf_le(&self, _ctx: &LightContext, _ng: Vec3, w: Vec3) -> (f32, f32) {
        (0.0, self.pdf_dir(one_minus_cos(w, self.frame.n)))
    }

    fn bounds(&self, _ctx: &LightContext) -> Option<LightBounds> {
        let normals = Cone { axis: self.frame.n, angle: self.beam.min(PI) };
        // About as if it filled the cone halfway between beam and cutoff.
        let gain = 4.0 / (self.omc_beam + self.omc_cutoff);
        Some(LightBounds { normals, spread: self.cutoff - self.beam, gain, ..LightBounds::point(self.position) })
    }

    fn power(&self, _ctx: &LightContext) -> Rgb {
        let ring = match self.falloff {
            SpotFalloff::SquaredCosine => f64::from(self.omc_cutoff - self.omc_beam) / 3.0,
            SpotFalloff::LinearAngle => linear_ring(f64::from(self.beam), f64::from(self.cutoff)),
        };
        self.intensity * (2.0 * PI * (self.omc_beam + ring as f32))
    }

    #[cfg(test)]
    fn examples() -> Vec<super::tests::Example> {
        let spot = |name, beam, cutoff, falloff| {
            let desc = LightDesc::Spot {
                position: glam::DVec3::new(-0.2, 1.5, 0.1),
                direction: glam::DVec3::new(0.2, -1.0, 0.3),
                intensity: Rgb::new(3.0, 2.0, 1.0),
                beam,
                cutoff,
                falloff,
            };
            super::tests::Example::free(name, Self::new(&desc).unwrap().unwrap().into())
        };
        use SpotFalloff::{LinearAngle, SquaredCosine};
        vec![
            spot("spot, linear angle", 20.0, 40.0, LinearAngle),
            spot("spot, linear angle, no inner cone", 0.0, 30.0, LinearAngle),
            spot("spot, squared cosine", 20.0, 40.0, SquaredCosine),
            spot("spot, squared cosine, wide", 0.0, 90.0, SquaredCosine),
            spot("spot, hard edge", 35.0, 35.0, LinearAngle),
            spot("spot, wider than a hemisphere", 60.0, 150.0, LinearAngle),
        ]
    }
}

/// Integral of `(cutoff - theta) / (cutoff - beam) sin(theta)` from beam to cutoff:
/// `cos(beam) - (sin(cutoff) - sin(beam)) / (cutoff - beam)`, with the differences written as products.
fn linear_ring(beam: f64, cutoff: f64) -> f64 {
    let half = 0.5 * (cutoff - beam);
    if !(half > 0.0) {
        return 0.0;
    }
    let mid = 0.5 * (cutoff + beam);
    let sinc = sin64(half) / half;
    // cos(beam) - cos(mid) sinc(half) = (cos(beam) - cos(mid)) + cos(mid) (1 - sinc(half)).
    let cos_difference = 2.0 * sin64(0.5 * (mid + beam)) * sin64(0.5 * (mid - beam));
    cos_difference + cos64(mid) * (1.0 - sinc)
}
