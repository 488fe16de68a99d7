//! Falloffs of spots, and what light descriptions are refused.

use super::Example;
use crate::light::{Light, LightDesc, LightError, SpotFalloff};
use crate::math::{DVec3, Vec2, Vec3};
use crate::sampling::{IndependentSampler, Sampler};
use crate::spectrum::Rgb;

fn spot(beam: f64, cutoff: f64, falloff: SpotFalloff) -> LightDesc {
    let (position, direction) = (DVec3::ZERO, DVec3::NEG_Z * 5.0);
    LightDesc::Spot { position, direction, intensity: Rgb::ONE, beam, cutoff, falloff }
}

/// Intensity at an angle (degrees) from the axis.
fn intensity(desc: &LightDesc, angle: f64) -> f32 {
    let example = Example::free("spot", Light::from_desc(desc).unwrap().unwrap());
    let a = angle.to_radians();
    let p = DVec3::new(0.0, libm::sin(a), -libm::cos(a)).as_vec3() * 2.0;
    example.light.sample_li(&example.ctx(), p, 0.0, Vec2::ZERO).map_or(0.0, |li| li.radiance.g * 4.0)
}

#[test]
fn falloffs() {
    let linear = spot(20.0, 40.0, SpotFalloff::LinearAngle);
    for (angle, value) in [(0.0, 1.0), (19.9, 1.0), (25.0, 0.75), (30.0, 0.5), (39.0, 0.05), (40.1, 0.0), (170.0, 0.0)]
    {
        assert!((intensity(&linear, angle) - value).abs() < 1e-5, "{angle}");
    }
    let squared = spot(20.0, 40.0, SpotFalloff::SquaredCosine);
    for angle in [10.0f64, 25.0, 35.0, 50.0] {
        let cos = |a: f64| libm::cos(a.to_radians());
        let x = ((cos(angle) - cos(40.0)) / (cos(20.0) - cos(40.0))).clamp(0.0, 1.0);
        assert!((f64::from(intensity(&squared, angle)) - x * x).abs() < 1e-5, "{angle}");
    }
    let hard = spot(30.0, 30.0, SpotFalloff::LinearAngle);
    assert!(intensity(&hard, 29.99) == 1.0 && intensity(&hard, 30.01) == 0.0);
}

/// A laser of a thousandth of a degree has the power of its cone, and all its rays lie in it.
#[test]
fn narrow_beams() {
    for falloff in [SpotFalloff::LinearAngle, SpotFalloff::SquaredCosine] {
        let example = Example::free("laser", Light::from_desc(&spot(0.0005, 0.001, falloff)).unwrap().unwrap());
        let ctx = example.ctx();
        // In the limit of small angles, with beam = cutoff / 2.
        let cutoff = 0.001f64.to_radians();
        let cone = std::f64::consts::PI * cutoff * cutoff;
        let share = if falloff == SpotFalloff::LinearAngle { 7.0 / 12.0 } else { 0.25 + 0.75 / 3.0 };
        let power = f64::from(example.light.power(&ctx).g);
        assert!((power / (cone * share) - 1.0).abs() < 1e-4, "{falloff:?}: {power}");
        let mut s = IndependentSampler::new([15]);
        let mut mean = statcheck::Mean::default();
        for _ in 0..20_000 {
            let le = example.light.sample_le(&ctx, 0.0, Vec2::ZERO, s.next_2d()).unwrap();
            assert!((le.ray.d - Vec3::NEG_Z).length() < 1.001 * 0.001f32.to_radians());
            mean.push(f64::from(le.throughput().g));
        }
        assert!(mean.p_value(power, 1e-4) > 0.001, "{falloff:?}: {power} {mean:?}");
    }
}

#[test]
fn refused() {
    let is = |desc: LightDesc, error| assert_eq!(Light::from_desc(&desc).unwrap_err(), error);
    is(spot(50.0, 40.0, SpotFalloff::LinearAngle), LightError::Angles);
    is(spot(0.0, 0.0, SpotFalloff::LinearAngle), LightError::Angles);
    is(spot(10.0, 200.0, SpotFalloff::LinearAngle), LightError::Angles);
    is(spot(f64::NAN, 40.0, SpotFalloff::LinearAngle), LightError::NotFinite);
    is(LightDesc::Point { position: DVec3::splat(1e300), intensity: Rgb::ONE }, LightError::NotFinite);
    is(LightDesc::Point { position: DVec3::ZERO, intensity: Rgb::splat(-1.0) }, LightError::Emission);
    is(LightDesc::Directional { direction: DVec3::ZERO, irradiance: Rgb::ONE }, LightError::NoDirection);
    is(LightDesc::Constant { radiance: Rgb::splat(f32::NAN) }, LightError::Emission);
    for black in [
        LightDesc::Point { position: DVec3::ZERO, intensity: Rgb::ZERO },
        LightDesc::Constant { radiance: Rgb::ZERO },
        LightDesc::Directional { direction: DVec3::X, irradiance: Rgb::ZERO },
    ] {
        assert!(Light::from_desc(&black).unwrap().is_none());
    }
    // Tiny and huge directions are directions.
    let far = LightDesc::Directional { direction: DVec3::new(0.0, 1e-300, 0.0), irradiance: Rgb::ONE };
    assert!(Light::from_desc(&far).unwrap().is_some());
}
