//! Small scenes, and their like at other scales and places.

use renderer::bsdf::{Distribution, Material, MaterialId, Roughness};
use renderer::geometry::{Mesh, MeshId};
use renderer::light::{Emission, LightDesc};
use renderer::math::{DAffine3, DMat3, DQuat, DVec3, Vec2, Vec3};
use renderer::medium::{Medium, MediumId};
use renderer::scene::desc::{CameraDesc, FovAxis, SceneDesc, ShapeDesc, ShapeKind};
use renderer::spectrum::Rgb;
use renderer::texture::{FloatParam, RgbParam};

/// A constant colour.
pub fn colour(r: f32, g: f32, b: f32) -> RgbParam {
    RgbParam::Const(Rgb::new(r, g, b))
}

/// A diffuse material.
pub fn diffuse(albedo: f32) -> Material {
    Material::Lambert { reflectance: colour(albedo, albedo, albedo) }
}

/// Roughness alike in all directions.
pub fn rough(distribution: Distribution, alpha: f32) -> Option<Roughness> {
    Some(Roughness { distribution, alpha_u: FloatParam::Const(alpha), alpha_v: FloatParam::Const(alpha) })
}

/// A metal that reflects everything.
pub fn metal(roughness: Option<Roughness>) -> Material {
    Material::Conductor { eta: Rgb::ZERO, k: Rgb::ONE, reflectance: colour(1.0, 1.0, 1.0), roughness }
}

/// Clear glass.
pub fn glass(roughness: Option<Roughness>) -> Material {
    let one = colour(1.0, 1.0, 1.0);
    Material::Dielectric { eta: 1.5, reflectance: one, transmittance: one, roughness }
}

/// A shape that does not emit.
pub fn shape(kind: ShapeKind, to_world: DAffine3, material: u32) -> ShapeDesc {
    ShapeDesc {
        name: format!("{kind:?}"),
        kind,
        to_world,
        flip_normals: false,
        material: MaterialId(material),
        emission: None,
        interior: None,
        priority: 0,
    }
}

/// A shape that emits from its front.
pub fn lamp(kind: ShapeKind, to_world: DAffine3, material: u32, radiance: f32) -> ShapeDesc {
    let emission = Emission { radiance: colour(radiance, radiance, radiance), two_sided: false };
    ShapeDesc { emission: Some(emission), ..shape(kind, to_world, material) }
}

/// The unit square in the plane through `centre`, scaled by `half` and facing `normal`.
pub fn facing(centre: DVec3, normal: DVec3, half: DVec3) -> DAffine3 {
    let turn = DQuat::from_rotation_arc(DVec3::Z, normal);
    DAffine3::from_translation(centre) * DAffine3::from_quat(turn) * DAffine3::from_scale(half)
}

/// Centre and uniform scale.
pub fn at(centre: DVec3, size: f64) -> DAffine3 {
    DAffine3::from_scale_rotation_translation(DVec3::splat(size), DQuat::IDENTITY, centre)
}

/// A pinhole at `from` that looks at `to`.
pub fn camera(from: DVec3, to: DVec3, fov: f64) -> CameraDesc {
    let back = (from - to).normalize();
    let up = if back.y.abs() > 0.9 { DVec3::Z } else { DVec3::Y };
    let right = up.cross(back).normalize();
    let to_world = DAffine3 { matrix3: DMat3::from_cols(right, back.cross(right), back), translation: from };
    CameraDesc { to_world, fov, fov_axis: FovAxis::Y, aperture_radius: 0.0, focus_distance: from.distance(to) }
}

/// A sphere of triangles: `rings` from pole to pole, twice as many around.
pub fn ball(rings: u32, radius: f32) -> Mesh {
    let around = 2 * rings;
    let mut mesh = Mesh::default();
    for i in 0..=rings {
        let theta = std::f32::consts::PI * i as f32 / rings as f32;
        for j in 0..=around {
            let phi = std::f32::consts::TAU * (j % around) as f32 / around as f32;
            // Both ends of a ring and all points of a pole are the same corners.
            let sin = if i == 0 || i == rings { 0.0 } else { theta.sin() };
            let n = Vec3::new(sin * phi.cos(), theta.cos(), sin * phi.sin());
            mesh.positions.push(n * radius);
            mesh.uvs.push(Vec2::new(j as f32 / around as f32, i as f32 / rings as f32));
        }
    }
    let row = around + 1;
    for i in 0..rings {
        for j in 0..around {
            let (a, b, c, d) = (i * row + j, i * row + j + 1, (i + 1) * row + j, (i + 1) * row + j + 1);
            if i > 0 {
                mesh.triangles.push([a, b, c]);
            }
            if i + 1 < rings {
                mesh.triangles.push([b, d, c]);
            }
        }
    }
    mesh
}

/// A room 2 units wide, open in front: coloured diffuse walls, a lamp in the ceiling, a point light, balls of rough metal and of
/// frosted glass, and a mesh that is placed twice.
pub fn room() -> SceneDesc {
    let wall = |centre: DVec3, normal: DVec3, material: u32| {
        shape(ShapeKind::Rectangle, facing(centre, normal, DVec3::ONE), material)
    };
    let under = DVec3::new(0.1, 0.95, 0.1);
    let shapes = vec![
        wall(-DVec3::Y, DVec3::Y, 0),
        wall(DVec3::Y, -DVec3::Y, 1),
        wall(-DVec3::X, DVec3::X, 2),
        wall(DVec3::X, -DVec3::X, 3),
        wall(-DVec3::Z, DVec3::Z, 1),
        lamp(ShapeKind::Disk, facing(under, -DVec3::Y, DVec3::splat(0.4)), 4, 3.0),
        shape(ShapeKind::Sphere, at(DVec3::new(-0.45, -0.6, -0.2), 0.4), 5),
        shape(ShapeKind::Sphere, at(DVec3::new(0.45, -0.65, 0.2), 0.35), 6),
        shape(ShapeKind::Mesh(MeshId(0)), at(DVec3::new(0.0, -0.2, -0.5), 1.0), 0),
        shape(ShapeKind::Mesh(MeshId(0)), at(DVec3::new(0.6, 0.3, -0.6), 0.7), 2),
    ];
    let point = LightDesc::Point { position: DVec3::new(-0.6, 0.5, 0.3), intensity: Rgb::new(0.3, 0.2, 0.1) };
    SceneDesc {
        meshes: vec![ball(8, 0.3)],
        shapes,
        materials: vec![
            diffuse(0.5),
            diffuse(0.7),
            Material::Lambert { reflectance: colour(0.6, 0.1, 0.1) },
            Material::Lambert { reflectance: colour(0.1, 0.5, 0.2) },
            diffuse(0.0),
            metal(rough(Distribution::Ggx, 0.3)),
            glass(rough(Distribution::Ggx, 0.4)),
        ],
        lights: vec![point],
        camera: camera(DVec3::new(0.0, 0.0, 3.5), DVec3::ZERO, 40.0),
        ..SceneDesc::default()
    }
}

/// The room with fog in a ball without a surface, the point light outside of it: in fog that has no finite variance.
pub fn foggy_room(extinction: f32) -> SceneDesc {
    let mut desc = room();
    let phase = renderer::medium::Phase::HenyeyGreenstein { g: 0.5 };
    desc.media = Medium::new(Rgb::splat(extinction), Rgb::new(0.9, 0.8, 0.7), phase).into_iter().collect();
    desc.materials.push(Material::Null);
    let null = desc.materials.len() as u32 - 1;
    let mut cloud = shape(ShapeKind::Sphere, at(DVec3::new(0.35, 0.4, 0.2), 0.35), null);
    cloud.interior = Some(MediumId(0));
    desc.shapes.push(cloud);
    desc
}

/// The scene scaled by `size`, turned by `turn` and then moved by `offset`; its picture stays the same.
pub fn moved(mut desc: SceneDesc, size: f64, turn: DQuat, offset: DVec3) -> SceneDesc {
    let map = DAffine3::from_scale_rotation_translation(DVec3::splat(size), turn, offset);
    desc.shapes.iter_mut().for_each(|s| s.to_world = map * s.to_world);
    let area = (size * size) as f32;
    for light in &mut desc.lights {
        match light {
            LightDesc::Point { position, intensity } => {
                *position = map.transform_point3(*position);
                *intensity *= area;
            }
            LightDesc::Spot { position, direction, intensity, .. } => {
                *position = map.transform_point3(*position);
                *direction = turn * *direction;
                *intensity *= area;
            }
            LightDesc::Directional { direction, .. } => *direction = turn * *direction,
            LightDesc::Constant { .. } => {}
            LightDesc::Environment { to_world, .. } => *to_world = DAffine3::from_quat(turn) * *to_world,
        }
    }
    for medium in &mut desc.media {
        medium.sigma_t *= (1.0 / size) as f32;
    }
    let c = &mut desc.camera;
    c.to_world.translation = map.transform_point3(c.to_world.translation);
    c.to_world.matrix3 = DMat3::from_quat(turn) * c.to_world.matrix3;
    c.aperture_radius *= size;
    c.focus_distance *= size;
    desc
}
