//! Shadow rays end at the light: not on it, and not short of it.

use super::examples::square;
use crate::accel::Accel;
use crate::geometry::{Geometry, MeshId, Object, ObjectId, Shape};
use crate::light::{Emission, Light, LightContext};
use crate::math::{Anchor, DAffine3, DVec3, Transform, Vec3};
use crate::sampling::{IndependentSampler, Sampler, warp};
use crate::spectrum::Rgb;
use crate::texture::RgbParam;

const EMISSION: Emission = Emission { radiance: RgbParam::Const(Rgb::ONE), two_sided: true };

fn scene(shape: Shape, m: DAffine3) -> Geometry {
    let objects = vec![Object { shape, to_world: Transform::new(m).unwrap(), flip_normals: false }];
    Geometry::new(vec![square()], objects)
}

/// No light hides itself, at any scale, place, distance and angle.
#[test]
fn nothing_in_between() {
    let mut failures = Vec::new();
    for shape in [Shape::Mesh(MeshId(0)), Shape::Sphere, Shape::Disk] {
        for (scale, shift) in [(1.0, 0.0), (1e-3, 0.0), (1e6, 0.0), (1.0, 1e4), (1e-2, 1e3)] {
            for baked in [false, true] {
                let place = DAffine3::from_translation(DVec3::new(1.0, -0.7, 0.3) * shift);
                let turn = DAffine3::from_rotation_x(0.7) * DAffine3::from_rotation_z(0.3);
                let mut geometry = scene(shape, place * DAffine3::from_scale(DVec3::splat(scale)) * turn);
                if baked {
                    geometry.bake();
                }
                let accel = Accel::build(&geometry).unwrap();
                let light = Light::area(&geometry, ObjectId(0), &EMISSION).unwrap();
                let bounds = geometry.bounds();
                let ctx = LightContext { geometry: &geometry, textures: &[], bounds };
                let mut s = IndependentSampler::new([12]);
                let (mut hidden, mut total) = (0, 0);
                for i in 0..6000 {
                    let distance = [0.05f32, 0.5, 2.0, 100.0, 1e4, 1e6][i % 6] * bounds.radius;
                    let p = bounds.centre + warp::uniform_sphere(s.next_2d()) * distance;
                    let (uc, u) = (s.next_1d(), s.next_2d());
                    let Some(li) = light.sample_li(&ctx, p, uc, u) else { continue };
                    // Closer to the surface than its points are known, there is no telling on which side one is.
                    if (li.light.p - p).dot(li.light.ng).abs() < 2.0 * li.light.p_error.dot(li.light.ng.abs()) {
                        continue;
                    }
                    hidden += u32::from(accel.occluded(&li.shadow_ray(&Anchor::free(p))));
                    total += 1;
                }
                assert!(total > 4000);
                if hidden > 0 {
                    failures
                        .push(format!("{shape:?}, scale {scale}, shift {shift}, baked {baked}: {hidden} of {total}"));
                }
            }
        }
    }
    assert!(failures.is_empty(), "{}", failures.join("\n"));
}

/// A thin shade a hundred-thousandth of the distance in front of the light hides it; as near behind it does not.
#[test]
fn shades_close_to_the_light() {
    for (scale, distance) in [(1.0f64, 1.0f64), (1e-3, 10.0), (1e6, 3.0)] {
        for (offset, hides) in [(-1e-5f64, true), (1e-5, false)] {
            // A square light at z = distance, seen from the origin; the shade is 3 times as large.
            let at = |z: f64, size: f64| {
                DAffine3::from_translation(DVec3::Z * (z * scale)) * DAffine3::from_scale(DVec3::splat(size * scale))
            };
            let mut geometry = scene(Shape::Mesh(MeshId(0)), at(distance, 1.0));
            let shade = Transform::new(at(distance * (1.0 + offset), 3.0)).unwrap();
            geometry.objects.push(Object { to_world: shade, ..geometry.objects[0] });
            geometry.bake();
            let accel = Accel::build(&geometry).unwrap();
            let light = Light::area(&geometry, ObjectId(0), &EMISSION).unwrap();
            let ctx = LightContext { geometry: &geometry, textures: &[], bounds: geometry.bounds() };
            let mut s = IndependentSampler::new([13]);
            for _ in 0..1000 {
                let from = Anchor { p: Vec3::ZERO, p_error: Vec3::ZERO, ng: Vec3::Z };
                let li = light.sample_li(&ctx, from.p, s.next_1d(), s.next_2d()).unwrap();
                assert_eq!(accel.occluded(&li.shadow_ray(&from)), hides, "scale {scale}, distance {distance}");
            }
        }
    }
}
