//! Triangles that are hardly any, surfaces on top of each other, and very many of them.

use crate::probe::{Probe, Shot};
use crate::scene::{at, ball, camera, diffuse, facing, lamp, room, shape};
use renderer::geometry::{Mesh, MeshId};
use renderer::integrator::IntegratorKind::{self, Bdpt, Light, Mmlt, Path};
use renderer::light::LightDesc;
use renderer::math::{DVec3, Vec3};
use renderer::scene::desc::{SceneDesc, ShapeKind};
use renderer::spectrum::Rgb;
use std::time::Instant;

const ALL: [IntegratorKind; 4] = [Path, Light, Bdpt, Mmlt];

/// Adds triangles without area: of one point, of two, one whose area is lost to underflow; and of three points in a line, which stay
/// in one only where nothing turns them.
fn spoil(mesh: &mut Mesh, lines: bool) {
    let first = mesh.positions.len() as u32;
    let p = mesh.positions[mesh.triangles[0][0] as usize];
    mesh.positions.extend([p, p + Vec3::X, p + Vec3::X * 2.0, p + Vec3::X * 1e-25, p + Vec3::Y * 1e-25]);
    let all = [[0, 0, 0], [0, 1, 1], [0, 3, 4], [0, 1, 2], [2, 0, 1]].map(|t: [u32; 3]| t.map(|i| first + i));
    mesh.triangles.extend(&all[..if lines { 5 } else { 3 }]);
}

/// A square in the plane y = 0 as a mesh, its face upward.
fn square(half: f32) -> Mesh {
    strips(half, 1)
}

/// The same, cut into strips.
fn strips(half: f32, count: u32) -> Mesh {
    let mut mesh = Mesh::default();
    for i in 0..=count {
        let x = half * (2.0 * i as f32 / count as f32 - 1.0);
        mesh.positions.extend([Vec3::new(x, 0.0, -half), Vec3::new(x, 0.0, half)]);
    }
    for i in 0..count {
        mesh.triangles.extend([[2 * i, 2 * i + 1, 2 * i + 3], [2 * i, 2 * i + 3, 2 * i + 2]]);
    }
    mesh
}

/// The same, as triangles that all meet in one corner: the thinner, the more there are.
fn fan(half: f32, count: u32) -> Mesh {
    let mut mesh = Mesh { positions: vec![Vec3::new(-half, 0.0, -half)], ..Mesh::default() };
    let corners = [Vec3::new(-half, 0.0, half), Vec3::new(half, 0.0, half), Vec3::new(half, 0.0, -half)];
    for side in 0..2 {
        for i in 0..count {
            mesh.positions.push(corners[side].lerp(corners[side + 1], i as f32 / count as f32));
        }
    }
    mesh.positions.push(corners[2]);
    mesh.triangles.extend((1..=2 * count).map(|i| [0, i, i + 1]));
    mesh
}

/// A floor and a lamp above it, both meshes, and a ball between.
fn stage(floor: Mesh, lamp_mesh: Mesh) -> SceneDesc {
    let mut light = lamp(ShapeKind::Mesh(MeshId(1)), facing(DVec3::Y * 2.0, DVec3::Z, DVec3::ONE), 1, 3.0);
    light.flip_normals = true;
    SceneDesc {
        meshes: vec![floor, lamp_mesh],
        shapes: vec![
            shape(ShapeKind::Mesh(MeshId(0)), at(DVec3::ZERO, 1.0), 0),
            light,
            shape(ShapeKind::Sphere, at(DVec3::new(0.2, 0.4, 0.0), 0.4), 0),
        ],
        materials: vec![diffuse(0.5), diffuse(0.0)],
        camera: camera(DVec3::new(0.0, 1.5, 4.0), DVec3::Y * 0.3, 35.0),
        ..SceneDesc::default()
    }
}

/// Triangles without area change nothing; needles make the same surface.
pub fn triangles(probe: &mut Probe) {
    let count = probe.pick(48, 512);
    let plain = stage(square(1.5), square(0.5));
    let mut spoiled = plain.clone();
    spoil(&mut spoiled.meshes[0], true);
    spoil(&mut spoiled.meshes[1], false);
    let (a, b) = (probe.build("plain", plain), probe.build("with triangles without area", spoiled));
    let (Some(plain), Some(spoiled)) = (a, b) else { return };
    let mut reference = None;
    for kind in ALL {
        let shot = Shot { size: (24, 24), ..Shot::new(kind, count, 6, 61) };
        let (a, b) = (probe.shoot("plain", &plain, &shot), probe.shoot("with triangles without area", &spoiled, &shot));
        if let (Some(a), Some(b)) = (a, b) {
            probe.same_bits(&format!("triangles without area, {}", kind.name()), &a, &b);
            reference = reference.or(Some(a));
        }
    }
    let Some(reference) = reference else { return };
    let many = probe.pick(3000, 100_000);
    for (what, floor, lamp_mesh) in
        [("strips", strips(1.5, many), strips(0.5, 300)), ("fan", fan(1.5, many), fan(0.5, 300))]
    {
        let what = format!("{what} of {many}");
        let Some(scene) = probe.build(&what, stage(floor, lamp_mesh)) else { continue };
        for kind in ALL {
            let shot = Shot { size: (24, 24), ..Shot::new(kind, count, 6, 62) };
            if let Some(image) = probe.shoot(&what, &scene, &shot) {
                let share = if kind == Mmlt { 0.2 } else { 0.06 };
                probe.agree(&format!("{what}, {}", kind.name()), &image, &reference, share);
            }
        }
    }
}

/// Everything twice in the same place is the same picture; surfaces as near as can be are told apart.
pub fn coincident(probe: &mut Probe) {
    let count = probe.pick(64, 512);
    let mut twice = room();
    let again: Vec<_> = twice.shapes.iter().filter(|s| s.emission.is_none()).cloned().collect();
    twice.shapes.extend(again);
    let (Some(once), Some(twice)) = (probe.build("once", room()), probe.build("twice", twice)) else { return };
    for kind in ALL {
        let shot = Shot::new(kind, count, 6, 63);
        if let (Some(a), Some(b)) = (probe.shoot("once", &once, &shot), probe.shoot("twice", &twice, &shot)) {
            probe.same_bits(&format!("all surfaces twice, {}", kind.name()), &a, &b);
        }
    }
    // A lamp that all but touches the ceiling.
    let hung = |gap: f64| {
        let mut desc = room();
        desc.lights.clear();
        desc.shapes[5].to_world.translation.y = 1.0 - gap;
        desc
    };
    let Some(reference) = probe.build("a lamp 1e-3 below", hung(1e-3)) else { return };
    let Some(reference) = probe.shoot("a lamp 1e-3 below", &reference, &Shot::new(Path, 4 * count, 6, 64)) else {
        return;
    };
    for gap in [1e-5, 1e-6] {
        let what = format!("a lamp {gap:e} below the ceiling");
        let Some(scene) = probe.build(&what, hung(gap)) else { continue };
        for kind in ALL {
            if let Some(image) = probe.shoot(&what, &scene, &Shot::new(kind, 2 * count, 6, 65)) {
                let share = if kind == Mmlt { 0.2 } else { 0.1 };
                probe.agree(&format!("{what}, {}", kind.name()), &image, &reference, share);
            }
        }
    }
    // In the same plane there is no telling which is in front; who writes that is told so.
    probe.build_warned("a lamp in the plane of the ceiling", hung(0.0), "same place");
}

/// A million placements of one mesh.
pub fn instances(probe: &mut Probe) {
    let side = probe.pick(40u32, 100);
    let place = |i: u32| {
        let step = |k: u32| f64::from(k % side) - 0.5 * f64::from(side - 1);
        shape(ShapeKind::Mesh(MeshId(0)), at(DVec3::new(step(i), step(i / side), step(i / side / side)), 1.0), 0)
    };
    let desc = SceneDesc {
        meshes: vec![ball(8, 0.4)],
        shapes: (0..side * side * side).map(place).collect(),
        materials: vec![diffuse(0.6)],
        lights: vec![LightDesc::Constant { radiance: Rgb::ONE }],
        camera: camera(DVec3::new(0.4, 0.7, 0.8) * f64::from(side), DVec3::ZERO, 40.0),
        ..SceneDesc::default()
    };
    let what = format!("{} placements", side * side * side);
    let started = Instant::now();
    let Some(scene) = probe.build(&what, desc) else { return };
    let seconds = started.elapsed().as_secs_f64();
    probe.figure(format!("{what} of {} triangles: built in {seconds:.1} s", scene.geometry.meshes[0].triangles.len()));
    let shot = |kind, seed| Shot { size: (24, 24), ..Shot::new(kind, probe.pick(64, 256), 4, seed) };
    let shots = [shot(Path, 66), shot(Bdpt, 67), shot(Mmlt, 68)];
    let Some(reference) = probe.shoot(&what, &scene, &shots[0]) else { return };
    for shot in &shots[1..] {
        if let Some(image) = probe.shoot(&what, &scene, shot) {
            let share = if shot.kind == Mmlt { 0.2 } else { 0.05 };
            probe.agree(&format!("{what}, {}", shot.kind.name()), &image, &reference, share);
        }
    }
}
