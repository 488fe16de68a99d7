//! Against geometry that can be checked by hand.

use super::*;
use crate::geometry::{MeshId, Object};
use crate::math::{DVec3, Vec2};

fn cube() -> Mesh {
    let positions =
        (0..8).map(|i| Vec3::new((i & 1) as f32, (i >> 1 & 1) as f32, (i >> 2 & 1) as f32) * 2.0 - Vec3::ONE).collect();
    let triangles = vec![
        [0, 4, 6],
        [0, 6, 2],
        [1, 3, 7],
        [1, 7, 5],
        [0, 1, 5],
        [0, 5, 4],
        [2, 6, 7],
        [2, 7, 3],
        [0, 2, 3],
        [0, 3, 1],
        [4, 5, 7],
        [4, 7, 6],
    ];
    Mesh { positions, triangles, ..Mesh::default() }
}

#[test]
fn cube_from_outside_and_inside() {
    for (bake, scale) in [(true, 1e-3), (false, 1e-3), (true, 1.0), (false, 1e6)] {
        let m = DAffine3::from_scale_rotation_translation(
            DVec3::new(scale, scale, -scale),
            glam::DQuat::IDENTITY,
            DVec3::X * scale,
        );
        let mut g = Geometry {
            meshes: vec![cube()],
            objects: vec![Object {
                shape: Shape::Mesh(MeshId(0)),
                to_world: Transform::new(m).unwrap(),
                flip_normals: false,
            }],
        };
        if bake {
            g.bake();
        }
        let a = Accel::build(&g).unwrap();
        let s = scale as f32;
        for (d, sign) in [(Vec3::X, 1.0), (Vec3::NEG_Y, 1.0), (Vec3::Z, 1.0)] {
            let centre = Vec3::X * s;
            let outside = Ray::new(centre - d * 3.0 * s, d);
            let hit = a.intersect(&outside).unwrap();
            assert!((hit.t - 2.0 * s).abs() <= 1e-6 * s);
            let i = g.interaction(&outside, &hit);
            assert_eq!(i.ng * sign, -d);
            assert!(a.intersect(&i.spawn_ray(-d)).is_none());
            let on = i.spawn_ray(d);
            let hit = a.intersect(&on).unwrap();
            assert_eq!(g.interaction(&on, &hit).ng, d);
            assert!(g.area(hit.object, hit.primitive) > 1.99 * s * s);
            let sample = g.sample_area(hit.object, hit.primitive, Vec2::new(0.3, 0.6));
            assert!((sample.ng - d).length() < 1e-6);
        }
    }
}
