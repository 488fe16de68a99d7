//! Where rays start, and what they meet.

use crate::probe::Probe;
use crate::scene::ball;
use renderer::accel::Accel;
use renderer::geometry::{Geometry, Mesh, MeshId, Object, ObjectId, Shape};
use renderer::math::{Anchor, DAffine3, DQuat, DVec3, Ray, Transform, Vec2, Vec3};
use renderer::sampling::{IndependentSampler, Sampler, warp};

fn number(s: &mut impl Sampler, low: f32, high: f32) -> f32 {
    low + (high - low) * s.next_1d()
}

/// Any sign, sizes over twelve decades.
fn coordinate(s: &mut impl Sampler) -> f32 {
    10f32.powf(number(s, -6.0, 6.0)) * if s.next_1d() < 0.5 { -1.0 } else { 1.0 }
}

fn point(s: &mut impl Sampler) -> Vec3 {
    Vec3::new(coordinate(s), coordinate(s), coordinate(s))
}

fn triangles(list: &[[Vec3; 3]]) -> Mesh {
    Mesh {
        positions: list.iter().flatten().copied().collect(),
        triangles: (0..list.len() as u32).map(|i| [3 * i, 3 * i + 1, 3 * i + 2]).collect(),
        ..Mesh::default()
    }
}

/// Objects of one mesh or shape each, with the tree over them.
struct World {
    geometry: Geometry,
    accel: Accel,
}

impl World {
    fn new(probe: &mut Probe, meshes: Vec<Mesh>, objects: Vec<(Shape, DAffine3)>) -> Option<Self> {
        let place = |(shape, m): (Shape, DAffine3)| {
            Transform::new(m).map(|to_world| Object { shape, to_world, flip_normals: false })
        };
        let objects = objects.into_iter().map(place).collect::<Option<Vec<_>>>();
        if !probe.holds(objects.is_some(), || "a transform is refused".into()) {
            return None;
        }
        let geometry = Geometry::new(meshes, objects?);
        match Accel::build(&geometry) {
            Ok(accel) => Some(Self { geometry, accel }),
            Err(e) => {
                probe.holds(false, || format!("no tree is built: {e}"));
                None
            }
        }
    }

    fn mesh(probe: &mut Probe, mesh: Mesh) -> Option<Self> {
        Self::new(probe, vec![mesh], vec![(Shape::Mesh(MeshId(0)), DAffine3::IDENTITY)])
    }

    /// A point of a primitive, with its normal.
    fn anchor(&self, object: u32, primitive: u32, u: Vec2) -> Anchor {
        let s = self.geometry.sample_area(ObjectId(object), primitive, u);
        Anchor { p: s.p, p_error: s.p_error, ng: s.ng }
    }
}

/// Rays from a surface do not meet it again, and meet what is as near as coordinates can tell.
pub fn offsets(probe: &mut Probe) {
    let count = probe.pick(3000, 30_000);
    own_triangles(probe, count);
    curved(probe, count);
    instances(probe, count);
    neighbours(probe, count);
    between(probe, count);
}

fn own_triangles(probe: &mut Probe, count: u64) {
    let mut s = IndependentSampler::new([1]);
    let (mut again, mut tried) = (0u64, 0u64);
    for _ in 0..count {
        let Some(world) = World::mesh(probe, triangles(&[[point(&mut s), point(&mut s), point(&mut s)]])) else {
            return;
        };
        for _ in 0..20 {
            let from = world.anchor(0, 0, s.next_2d());
            let ray = from.ray(warp::uniform_sphere(s.next_2d()));
            tried += 1;
            again += u64::from(world.accel.intersect(&ray).is_some() || world.accel.occluded(&ray));
        }
    }
    probe.holds(again == 0, || format!("{again} of {tried} rays from random triangles meet their own triangle"));
}

/// Spheres and disks at all scales and places: a ray to the outside meets nothing, one to the inside the far side.
fn curved(probe: &mut Probe, count: u64) {
    let mut s = IndependentSampler::new([2]);
    let (mut again, mut missed, mut disks) = (0u64, 0u64, 0u64);
    for _ in 0..count / 3 {
        let radius = f64::from(10f32.powf(number(&mut s, -6.0, 6.0)));
        // Up to where coordinates still resolve the sphere.
        let centre =
            warp::uniform_sphere(s.next_2d()).as_dvec3() * radius * f64::from(10f32.powf(number(&mut s, -3.0, 4.0)));
        let m = DAffine3::from_translation(centre) * DAffine3::from_scale(DVec3::splat(radius));
        for (k, shape) in [Shape::Sphere, Shape::Disk].into_iter().enumerate() {
            let Some(world) = World::new(probe, Vec::new(), vec![(shape, m)]) else { return };
            for _ in 0..10 {
                let from = world.anchor(0, 0, s.next_2d());
                let w = warp::uniform_sphere(s.next_2d());
                let hit = world.accel.intersect(&from.ray(w));
                if k == 1 {
                    disks += u64::from(hit.is_some());
                } else if w.dot(from.ng) > 0.0 {
                    again += u64::from(hit.is_some());
                } else if w.dot(from.ng) < -0.1 {
                    // A chord of a tenth of the diameter at least.
                    missed += u64::from(!hit.is_some_and(|h| f64::from(h.t) > 0.05 * radius));
                }
            }
        }
    }
    probe.holds(again == 0, || format!("{again} rays from spheres meet them again"));
    probe.holds(missed == 0, || format!("{missed} rays into spheres do not meet their far side"));
    probe.holds(disks == 0, || format!("{disks} rays from disks meet them again"));
}

/// A triangle under a transform that is not baked in.
fn instances(probe: &mut Probe, count: u64) {
    let mut s = IndependentSampler::new([3]);
    let (mut again, mut tried) = (0u64, 0u64);
    for _ in 0..count / 3 {
        let triangle = [0, 1, 2]
            .map(|_| Vec3::new(number(&mut s, -1.0, 1.0), number(&mut s, -1.0, 1.0), number(&mut s, -1.0, 1.0)));
        let turn = DQuat::from_axis_angle(
            warp::uniform_sphere(s.next_2d()).as_dvec3().normalize(),
            f64::from(6.0 * s.next_1d()),
        );
        let scale = DVec3::from_array([0, 1, 2].map(|_| f64::from(10f32.powf(number(&mut s, -3.0, 3.0)))));
        let place = point(&mut s).as_dvec3() * 1e-2;
        let m = DAffine3::from_scale_rotation_translation(scale, turn, place);
        let Some(world) = World::new(probe, vec![triangles(&[triangle])], vec![(Shape::Mesh(MeshId(0)), m)]) else {
            return;
        };
        for _ in 0..20 {
            let from = world.anchor(0, 0, s.next_2d());
            let ray = from.ray(warp::uniform_sphere(s.next_2d()));
            tried += 1;
            again += u64::from(world.accel.intersect(&ray).is_some());
        }
    }
    probe.holds(again == 0, || format!("{again} of {tried} rays from placed triangles meet their own triangle"));
}

/// A second surface some steps of the coordinates in front of the first is met from there, and from far away the nearer of the two is.
fn neighbours(probe: &mut Probe, count: u64) {
    /// In units of the rounding of the largest coordinate.
    const GAP: f32 = 24.0;
    let mut s = IndependentSampler::new([4]);
    let (mut missed, mut wrong, mut tried) = (0u64, 0u64, 0u64);
    for _ in 0..count {
        let size = 10f32.powf(number(&mut s, -6.0, 6.0));
        let centre = Vec3::new(number(&mut s, -1.0, 1.0), number(&mut s, -1.0, 1.0), number(&mut s, -1.0, 1.0)) * size;
        let side = size * 10f32.powf(number(&mut s, -2.0, 0.0));
        let ng = warp::uniform_sphere(s.next_2d());
        let frame = renderer::math::Frame::from_normal(ng);
        let corners = [frame.s, frame.t, -frame.s - frame.t].map(|d| centre + d * side);
        let gap = GAP * f32::EPSILON * 2.0 * size;
        let above = corners.map(|p| p + ng * gap);
        let Some(world) = World::mesh(probe, triangles(&[corners, above])) else { return };
        for _ in 0..5 {
            // Away from the edges, over which the ray might pass.
            let u = Vec2::new(number(&mut s, 0.2, 0.8), number(&mut s, 0.2, 0.8));
            let from = world.anchor(0, 0, u);
            let hit = world.accel.intersect(&from.ray(from.ng));
            tried += 1;
            missed += u64::from(hit.is_none_or(|h| h.primitive != 1));
            let eye = from.p + from.ng * size;
            let hit = world.accel.intersect(&Ray::new(eye, (from.p - eye).normalize()));
            wrong += u64::from(hit.is_none_or(|h| h.primitive != 1));
        }
    }
    probe.holds(missed == 0, || format!("{missed} of {tried} rays miss a surface just above the one that they leave"));
    probe.holds(wrong == 0, || format!("{wrong} of {tried} rays from afar meet the farther of two surfaces"));
    probe.figure(format!("surfaces {GAP} roundings of the scene's extent apart are told apart"));
}

/// The way between two points of different triangles is free.
fn between(probe: &mut Probe, count: u64) {
    let mut s = IndependentSampler::new([5]);
    let (mut blocked, mut tried) = (0u64, 0u64);
    for _ in 0..count {
        let size = 10f32.powf(number(&mut s, -6.0, 6.0));
        let mut one = |at: Vec3| [0, 1, 2].map(|_| at + warp::uniform_sphere(s.next_2d()) * (0.4 * size));
        let list = [one(Vec3::ZERO), one(Vec3::new(1.0, 0.3, -0.2) * size)];
        let Some(world) = World::mesh(probe, triangles(&list)) else { return };
        for _ in 0..10 {
            let (a, b) = (world.anchor(0, 0, s.next_2d()), world.anchor(0, 1, s.next_2d()));
            tried += 1;
            blocked += u64::from(world.accel.occluded(&a.segment_to(&b)) || world.accel.occluded(&b.segment_to(&a)));
        }
    }
    probe.holds(blocked == 0, || format!("{blocked} of {tried} ways between two triangles are blocked by themselves"));
}

/// Zeros of both signs, rays along axes and in the planes of surfaces.
pub fn directions(probe: &mut Probe) {
    let corner = |i: u32| Vec3::new((i & 1) as f32, (i >> 1 & 1) as f32, (i >> 2 & 1) as f32) * 2.0 - Vec3::ONE;
    let quads = [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]];
    let list: Vec<[Vec3; 3]> =
        quads.iter().flat_map(|q| [[q[0], q[1], q[2]], [q[0], q[2], q[3]]]).map(|t| t.map(corner)).collect();
    let mut s = IndependentSampler::new([6]);
    for size in [1e-6f32, 1.0, 1e6] {
        let scaled: Vec<_> = list.iter().map(|t| t.map(|p| p * size)).collect();
        let Some(world) = World::mesh(probe, triangles(&scaled)) else { return };
        for _ in 0..probe.pick(500, 5000) {
            let o = Vec3::new(number(&mut s, -0.9, 0.9), number(&mut s, -0.9, 0.9), number(&mut s, -0.9, 0.9)) * size;
            for axis in 0..3 {
                for sign in [1.0f32, -1.0] {
                    let mut hits = Vec::new();
                    for zeros in 0..4 {
                        let zero = |bit: u32| if zeros >> bit & 1 == 1 { -0.0f32 } else { 0.0 };
                        let mut d = Vec3::ZERO;
                        d[axis] = sign;
                        d[(axis + 1) % 3] = zero(0);
                        d[(axis + 2) % 3] = zero(1);
                        hits.push(world.accel.intersect(&Ray { o, d, t_max: f32::INFINITY }));
                    }
                    let expected = (sign * size - o[axis]) * sign;
                    probe.holds(hits.iter().all(|h| *h == hits[0]), || {
                        format!("zeros of another sign, another hit: {hits:?}")
                    });
                    let near = hits[0].is_some_and(|h| (h.t - expected).abs() <= 4.0 * f32::EPSILON * size);
                    probe.holds(near, || format!("along axis {axis} from {o}: {:?}, expected {expected}", hits[0]));
                }
            }
            // Into the edges and corners of the box, and along its faces.
            let to = corner((s.next_1d() * 8.0) as u32) * size;
            let edge = Vec3::new(to.x, to.y, o.z);
            for end in [to, edge, Vec3::new(to.x, o.y, o.z)] {
                let hit = world.accel.intersect(&Ray::new(o, end - o));
                probe.holds(hit.is_some(), || format!("from {o} to {end}: nothing is met"));
            }
            let face = Vec3::new(size, o.y, o.z);
            let hit = world.accel.intersect(&Ray::new(face, Vec3::Y));
            probe.holds(hit.is_none_or(|h| h.t.is_finite() && h.b.iter().all(|b| b.is_finite())), || {
                format!("in a face: {hit:?}")
            });
        }
    }
    reversed(probe);
}

/// A ray back along the way it came finds the surface that it left.
fn reversed(probe: &mut Probe) {
    let mut s = IndependentSampler::new([7]);
    for size in [1e-6f32, 1.0, 1e6] {
        let Some(world) = World::mesh(probe, ball(16, size)) else { return };
        let mut lost = 0;
        for _ in 0..probe.pick(2000, 50_000) {
            let o = warp::uniform_sphere(s.next_2d()) * (0.5 * size);
            let ray = Ray::new(o, warp::uniform_sphere(s.next_2d()));
            let Some(hit) = world.accel.intersect(&ray) else {
                lost += 1;
                continue;
            };
            let at = world.geometry.interaction(&ray, &hit);
            let back = world.accel.intersect(&at.spawn_ray(-ray.d));
            // It starts inside the ball, and must cross it.
            let far = back.is_some_and(|b| b.t > 0.3 * size);
            lost += usize::from(!far);
        }
        probe.holds(lost == 0, || {
            format!("{lost} rays inside a ball of radius {size:e} are lost or stop where they start")
        });
    }
}

/// No ray slips out of a closed mesh, wherever it is aimed.
pub fn watertight(probe: &mut Probe) {
    let mut s = IndependentSampler::new([8]);
    let count = probe.pick(20_000, 1_000_000);
    for size in [1e-6f32, 1.0, 1e6] {
        for (offset, placed) in [(0.0, false), (100.0, false), (0.0, true), (100.0, true)] {
            let mesh = ball(24, 1.0);
            let at = Vec3::new(0.3, -0.7, 0.5) * offset * size;
            let m = DAffine3::from_translation(at.as_dvec3()) * DAffine3::from_scale(DVec3::splat(f64::from(size)));
            let objects = vec![(Shape::Mesh(MeshId(0)), m)];
            let Some(mut world) = World::new(probe, vec![mesh], objects) else { return };
            if !placed {
                world.geometry.bake();
                let Ok(accel) = Accel::build(&world.geometry) else { return };
                world.accel = accel;
            }
            let m = world.geometry.objects[0].to_world;
            let mesh = &world.geometry.meshes[0];
            let vertex = |i: u32| m.point(mesh.positions[i as usize]);
            let mut leaks = 0;
            for k in 0..count {
                let o = at + warp::uniform_sphere(s.next_2d()) * (0.6 * size * s.next_1d());
                let t = mesh.triangles[(s.next_1d() * mesh.triangles.len() as f32) as usize];
                let to = match k % 4 {
                    0 => o + warp::uniform_sphere(s.next_2d()) * size,
                    1 => vertex(t[0]),
                    2 => vertex(t[0]).lerp(vertex(t[1]), s.next_1d()),
                    _ => 0.5 * (vertex(t[1]) + vertex(t[2])),
                };
                let ray = Ray::new(o, to - o);
                leaks += u32::from(world.accel.intersect(&ray).is_none() || !world.accel.occluded(&ray));
            }
            probe.holds(leaks == 0, || {
                format!("size {size:e}, {offset} sizes away, placed {placed}: {leaks} of {count} rays leak")
            });
        }
    }
}
