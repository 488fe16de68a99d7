//! The environment: its orientation, and light where there is density and density where there is light.

use crate::light::{EnvironmentLight, Light, LightDesc, LightError, roster};
use crate::math::{DAffine3, DMat3, DVec3, Vec3};
use crate::sampling::{IndependentSampler, Sampler, warp};
use crate::spectrum::Rgb;
use crate::texture::{Image, Samples, Texels};
use std::sync::Arc;

/// An 8 x 4 picture with one white texel.
fn one_texel(x: usize, y: usize) -> Image {
    let mut texels = vec![Rgb::ZERO; 32];
    texels[y * 8 + x] = Rgb::ONE;
    Image { width: 8, height: 4, texels: texels.into() }
}

fn sky(image: Image, to_world: DAffine3) -> Result<Option<Light>, LightError> {
    Light::from_desc(&LightDesc::Environment { image: Arc::new(image), scale: Rgb::ONE, to_world })
}

/// Row 0 is up; the centre column is -Z; columns go on to +X.
#[test]
fn orientation() {
    let angles = |x: f64, y: f64| {
        let (theta, phi) = (std::f64::consts::PI * (y + 0.5) / 4.0, std::f64::consts::TAU * ((x + 0.5) / 8.0 - 0.5));
        DVec3::new(libm::sin(theta) * libm::sin(phi), libm::cos(theta), -libm::sin(theta) * libm::cos(phi))
    };
    assert!(angles(3.5, 1.5).abs_diff_eq(-DVec3::Z, 1e-12) && angles(5.5, 1.5).abs_diff_eq(DVec3::X, 1e-12));
    let mirror = DAffine3::from_mat3(DMat3::from_diagonal(DVec3::new(-2.0, 2.0, 2.0)));
    let quarter = DAffine3::from_rotation_y(std::f64::consts::FRAC_PI_2);
    for to_world in [DAffine3::IDENTITY, quarter, mirror, mirror * quarter] {
        for (x, y) in [(0, 0), (4, 1), (7, 3)] {
            let light = sky(one_texel(x, y), to_world).unwrap().unwrap();
            let w = to_world.transform_vector3(angles(x as f64, y as f64)).normalize().as_vec3();
            assert!((light.le_infinite(w).r - 1.0).abs() < 1e-5);
            let beside = to_world.transform_vector3(angles(x as f64 + 0.5, y as f64)).normalize().as_vec3();
            assert!((light.le_infinite(beside).r - 0.5).abs() < 1e-5);
            let far = to_world.transform_vector3(angles(x as f64 + 4.0, y as f64)).normalize().as_vec3();
            assert_eq!(light.le_infinite(far).r, 0.0);
        }
    }
}

#[test]
fn density_wherever_there_is_light() {
    for example in roster().iter().filter(|e| matches!(e.light, Light::Environment(_))) {
        let mut s = IndependentSampler::new([14]);
        let mut lit = 0;
        for _ in 0..20_000 {
            let w = warp::uniform_sphere(s.next_2d());
            let (light, pdf) = (example.light.le_infinite(w).luminance(), example.light.pdf_li_escaped(w));
            assert_eq!(light > 0.0, pdf > 0.0, "{}: {w}", example.name);
            lit += u32::from(light > 0.0);
        }
        assert!(lit > 100, "{}: {lit}", example.name);
    }
    // Straight up and down, where the picture's coordinates are singular.
    let light = sky(one_texel(2, 0), DAffine3::IDENTITY).unwrap().unwrap();
    for w in [Vec3::Y, Vec3::NEG_Y] {
        assert!(light.le_infinite(w).is_valid() && light.pdf_li_escaped(w).is_finite());
    }
}

#[test]
fn bad_pictures() {
    let size = |width, height, n: usize| Image { width, height, texels: vec![Rgb::ONE; n].into() };
    assert_eq!(sky(size(2, 2, 3), DAffine3::IDENTITY).unwrap_err(), LightError::Picture);
    assert_eq!(sky(size(0, 2, 0), DAffine3::IDENTITY).unwrap_err(), LightError::Picture);
    assert_eq!(sky(size(2, 1, 2), DAffine3::from_scale(DVec3::ZERO)).unwrap_err(), LightError::Transform);
    let bright = Image { width: 2, height: 1, texels: vec![Rgb::ONE, Rgb::new(1.0, f32::INFINITY, 1.0)].into() };
    assert_eq!(sky(bright, DAffine3::IDENTITY).unwrap_err(), LightError::Emission);
    static BLACK: [f32; 256] = [0.0; 256];
    let side = 16384;
    let bytes = Samples::new(vec![0u8; side * (side / 2 + 1)], 1, &BLACK).unwrap();
    let vast = Image { width: side as u32, height: side as u32 / 2 + 1, texels: Texels::Bytes(bytes) };
    let refused = sky(vast, DAffine3::IDENTITY).unwrap_err();
    assert_eq!(refused.to_string(), "its picture has more than 134217728 texels, too many to sample");
    // Black, also after negative texels count as zero.
    let black = Image { width: 2, height: 1, texels: vec![Rgb::splat(-1.0); 2].into() };
    assert!(EnvironmentLight::new(Arc::new(black), Rgb::ONE, &DAffine3::IDENTITY).unwrap().is_none());
}
