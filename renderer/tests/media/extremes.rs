//! Media so thin, dense, coloured or forward that numbers come to their end: nothing may become infinite or negative.

use crate::common::{emission, render};
use crate::scenes::{BLACK, GLASS, NULL, WHITE, ball, body, desc};
use renderer::integrator::IntegratorKind::{Bdpt, Light, Mmlt, Path};
use renderer::light::LightDesc;
use renderer::math::DVec3;
use renderer::medium::{MAX_SIGMA, Medium, MediumId, Phase};
use renderer::scene::desc::{SceneDesc, ShapeKind};
use renderer::spectrum::Rgb;

/// A ball of the medium, one of milk glass and a lamp over a white floor, in a second medium if `around`.
fn scene(medium: Medium, around: bool) -> SceneDesc {
    let mut lamp = body(ShapeKind::Disk, DVec3::new(0.0, 2.5, 0.0), DVec3::ONE, BLACK, None);
    lamp.to_world *= renderer::math::DAffine3::from_rotation_x(std::f64::consts::FRAC_PI_2);
    lamp.emission = emission(3.0);
    let shapes = vec![
        lamp,
        body(ShapeKind::Cube, DVec3::Y * -1.6, DVec3::new(3.0, 0.5, 3.0), WHITE, None),
        ball(DVec3::X * -0.7, 0.6, NULL, Some(0)),
        ball(DVec3::X * 0.7, 0.6, GLASS, Some(0)),
    ];
    let spot = LightDesc::Point { position: DVec3::new(-0.7, 0.1, 0.2), intensity: Rgb::ONE };
    let mut d = desc(shapes, vec![medium], vec![spot]);
    d.global_medium = around.then_some(MediumId(0));
    d.camera = crate::common::camera(DVec3::new(0.3, 0.6, 5.0), DVec3::ZERO, 40.0);
    d
}

#[test]
fn numbers_stay_finite_at_all_extremes() {
    let phases = [Phase::Isotropic, Phase::HenyeyGreenstein { g: 0.999_999 }, Phase::HenyeyGreenstein { g: -0.99999 }];
    let tiny = 1e-30;
    let colours = [[tiny; 3], [MAX_SIGMA; 3], [0.0, MAX_SIGMA, tiny], [1.0, 0.0, 1e6], [1e-6, 30.0, 1e12], [0.0; 3]];
    let albedos = [[1.0; 3], [0.0, 0.5, 1.0], [tiny; 3]];
    let mut seed = 0;
    for (i, sigma_t) in colours.into_iter().enumerate() {
        for (j, albedo) in albedos.into_iter().enumerate() {
            let medium = Medium::new(sigma_t.into(), albedo.into(), phases[(i + j) % 3]).unwrap();
            for kind in [Path, Light, Bdpt, Mmlt] {
                seed += 1;
                let scene = crate::common::build(scene(medium, (i + j) % 2 == 0));
                // What is not finite or negative is counted, and no count is allowed.
                let image = render(&scene, kind, (10, 10), 16, if i % 2 == 0 { -1 } else { 6 }, seed);
                assert!(image.mean.iter().flatten().all(|v| v.is_finite()), "{kind:?}, {medium:?}");
            }
        }
    }
}
