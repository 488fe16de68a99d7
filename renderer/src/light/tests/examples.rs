//! Emitting objects and skies.

use crate::geometry::{Geometry, Mesh, MeshId, Object, Shape};
use crate::light::Emission;
use crate::math::{DAffine3, DMat3, DVec3, Transform, Vec3};
use crate::sampling::{IndependentSampler, Sampler};
use crate::spectrum::Rgb;
use crate::texture::{Image, RgbParam, Texture, TextureId, UvTransform};

fn geometry(mesh: Option<Mesh>, shape: Shape, m: DAffine3, flip_normals: bool) -> Geometry {
    let to_world = Transform::new(m).unwrap();
    Geometry::new(mesh.into_iter().collect(), vec![Object { shape, to_world, flip_normals }])
}

fn mesh(positions: &[[f32; 3]], triangles: &[[u32; 3]]) -> Mesh {
    Mesh {
        positions: positions.iter().copied().map(Vec3::from).collect(),
        triangles: triangles.to_vec(),
        ..Mesh::default()
    }
}

/// Two triangles: [-1, 1]^2 in xy, facing +z.
pub(super) fn square() -> Mesh {
    let mut square =
        mesh(&[[-1.0, -1.0, 0.0], [1.0, -1.0, 0.0], [1.0, 1.0, 0.0], [-1.0, 1.0, 0.0]], &[[0, 1, 2], [0, 2, 3]]);
    square.uvs = [[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]].map(|v| v.into()).to_vec();
    square
}

/// A closed mesh of four quite different triangles.
fn tetrahedron() -> Mesh {
    mesh(
        &[[0.0, 0.0, 0.0], [2.0, 0.1, 0.0], [0.1, 1.0, 0.2], [0.3, 0.2, 0.4]],
        &[[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]],
    )
}

/// Two squares at a right angle, which hide each other in part.
fn corner() -> Mesh {
    mesh(
        &[[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [1.0, 1.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.5], [0.0, 1.0, 1.5]],
        &[[0, 1, 2], [0, 2, 3], [0, 3, 5], [0, 5, 4]],
    )
}

/// A placement with rotation, uneven scale and shear; mirrored if asked.
fn placed(mirror: bool) -> DAffine3 {
    let x = DVec3::new(0.9, 0.2, -0.1) * if mirror { -1.0 } else { 1.0 };
    let m = DMat3::from_cols(x, DVec3::new(-0.1, 1.3, 0.3), DVec3::new(0.2, -0.2, 0.6));
    DAffine3 { matrix3: m, translation: DVec3::new(0.4, -0.3, 0.2) }
}

/// Name, geometry with the emitting object, textures, emission.
pub(in crate::light) fn emitters() -> Vec<(&'static str, Geometry, Vec<Texture>, Emission)> {
    let plain = Emission { radiance: RgbParam::Const(Rgb::new(1.0, 2.0, 0.5)), two_sided: false };
    let both = Emission { two_sided: true, ..plain };
    let textured = Emission { radiance: RgbParam::Texture(TextureId(0), Rgb::new(0.5, 1.0, 1.0)), ..plain };
    let squares = Texture::Checkerboard {
        a: Rgb::new(0.2, 0.3, 0.4),
        b: Rgb::new(3.0, 2.0, 1.0),
        uv: UvTransform([2.0, 0.0, 0.1, 0.0, 2.0, 0.3]),
    };
    let ball = DAffine3::from_scale_rotation_translation(
        DVec3::splat(0.7),
        glam::DQuat::from_rotation_x(0.4),
        DVec3::new(0.3, -0.2, 0.5),
    );
    let m = Shape::Mesh(MeshId(0));
    vec![
        ("square", geometry(Some(square()), m, placed(false), false), vec![], plain),
        ("square, textured", geometry(Some(square()), m, placed(false), false), vec![squares.clone()], textured),
        ("tetrahedron", geometry(Some(tetrahedron()), m, placed(false), false), vec![], plain),
        ("tetrahedron, mirrored", geometry(Some(tetrahedron()), m, placed(true), false), vec![], plain),
        ("corner, flipped", geometry(Some(corner()), m, placed(false), true), vec![], plain),
        ("corner, two-sided", geometry(Some(corner()), m, DAffine3::IDENTITY, false), vec![], both),
        ("sphere", geometry(None, Shape::Sphere, ball, false), vec![], plain),
        ("sphere, textured", geometry(None, Shape::Sphere, ball, false), vec![squares], textured),
        ("sphere, inward", geometry(None, Shape::Sphere, ball, true), vec![], plain),
        ("sphere, two-sided", geometry(None, Shape::Sphere, ball, false), vec![], both),
        ("disk", geometry(None, Shape::Disk, placed(false), false), vec![], plain),
        ("disk, two-sided", geometry(None, Shape::Disk, placed(true), false), vec![], both),
    ]
}

/// Name, picture, placement.
pub(in crate::light) fn environments() -> Vec<(&'static str, Image, DAffine3)> {
    let mut sampler = IndependentSampler::new([2]);
    let mut texels = |count: usize, lit: f32| {
        let texel = |s: &mut IndependentSampler| {
            let on = if s.next_1d() < lit { 1.0 } else { 0.0 };
            Rgb::new(s.next_1d(), s.next_1d(), s.next_1d()) * on
        };
        (0..count).map(|_| texel(&mut sampler)).collect::<Vec<Rgb>>()
    };
    let picture = |width: u32, height: u32, texels: Vec<Rgb>| Image { width, height, texels: texels.into() };
    let turned = DAffine3::from_quat(glam::DQuat::from_euler(glam::EulerRot::XYZ, 0.4, 1.1, -0.7));
    let mut sun = texels(16 * 8, 0.0);
    sun[3 * 16 + 15] = Rgb::splat(50.0);
    let mut pole = texels(5 * 4, 0.0);
    pole[2] = Rgb::ONE;
    vec![
        ("sky, 8 x 5", picture(8, 5, texels(40, 1.0)), turned),
        (
            "sky, mostly black",
            picture(9, 6, texels(54, 0.2)),
            DAffine3::from_scale(DVec3::new(-3.0, 3.0, 3.0)) * turned,
        ),
        ("sky, one texel", picture(1, 1, texels(1, 1.0)), DAffine3::IDENTITY),
        ("sky, one row", picture(4, 1, texels(4, 1.0)), turned),
        ("sky, one column", picture(1, 6, texels(6, 1.0)), turned),
        ("sky, sun at the seam", picture(16, 8, sun), turned),
        ("sky, light at the pole", picture(5, 4, pole), DAffine3::IDENTITY),
    ]
}
