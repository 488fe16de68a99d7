//! Against brute force, and against the faults that acceleration structures have.

use super::simd::Simd;
use super::*;
use crate::geometry::triangle::Shear;
use crate::geometry::{MeshId, Object};
use crate::math::{DAffine3, DQuat, DVec3, Transform};
use crate::sampling::{IndependentSampler, Sampler, warp};

fn vec3(s: &mut impl Sampler) -> Vec3 {
    Vec3::new(s.next_1d(), s.next_1d(), s.next_1d()) * 2.0 - Vec3::ONE
}

fn mesh_of(triangles: &[[Vec3; 3]]) -> Mesh {
    Mesh {
        positions: triangles.iter().flatten().copied().collect(),
        triangles: (0..triangles.len() as u32).map(|i| [3 * i, 3 * i + 1, 3 * i + 2]).collect(),
        ..Mesh::default()
    }
}

/// Triangles of all sizes, some of them needles, some without area, some exactly alike.
fn soup(count: usize, seed: u64) -> Vec<[Vec3; 3]> {
    let mut s = IndependentSampler::new([seed]);
    (0..count)
        .map(|i| {
            let (p, size) = (vec3(&mut s), 0.02 + 0.3 * s.next_1d() * s.next_1d());
            let (a, b) = (vec3(&mut s) * size, vec3(&mut s) * size);
            match i % 20 {
                0 => [p, p + a, p + a],
                1 => [p, p + a, p + a * 0.5 + b * 1e-6],
                2 => [Vec3::ZERO, Vec3::X * 0.5, Vec3::Y * 0.5],
                _ => [p, p + a, p + b],
            }
        })
        .collect()
}

/// A closed ball of `2 n^2` triangles that share their vertices.
fn ball(n: u32, radius: f32) -> Mesh {
    let mut mesh = Mesh::default();
    for j in 0..=n {
        for i in 0..n {
            let (phi, theta) =
                (std::f32::consts::TAU * i as f32 / n as f32, std::f32::consts::PI * j as f32 / n as f32);
            let ((sp, cp), (st, ct)) = (crate::math::sin_cos(phi), crate::math::sin_cos(theta));
            let pole = j == 0 || j == n;
            mesh.positions.push(if pole { Vec3::Y * ct } else { Vec3::new(st * cp, ct, st * sp) } * radius);
        }
    }
    for j in 0..n {
        for i in 0..n {
            let (a, b) = (j * n + i, j * n + (i + 1) % n);
            mesh.triangles.extend([[a, b, a + n], [b, b + n, a + n]]);
        }
    }
    mesh
}

fn object(shape: Shape, to_world: DAffine3) -> Object {
    Object { shape, to_world: Transform::new(to_world).unwrap(), flip_normals: false }
}

fn single(mesh: Mesh) -> Geometry {
    Geometry::new(vec![mesh], vec![object(Shape::Mesh(MeshId(0)), DAffine3::IDENTITY)])
}

/// The nearest hit, by testing every triangle with the reference test.
fn brute_force(triangles: &[[Vec3; 3]], ray: &Ray) -> Option<(f32, u32)> {
    let shear = Shear::new(ray.o, ray.d);
    let mut best: Option<(f32, u32)> = None;
    for (i, t) in triangles.iter().enumerate() {
        let [a, b, c] = t.map(|p| shear.axes.map(|k| p[k]));
        if let Some(h) = shear.intersect(a, b, c, ray.t_max.next_down())
            && best.is_none_or(|(t, _)| h.t < t)
        {
            best = Some((h.t, i as u32));
        }
    }
    best
}

/// Rays from and to everywhere, among them axis-parallel ones with zeros of both signs.
fn rays(count: usize, seed: u64) -> Vec<Ray> {
    let mut s = IndependentSampler::new([seed, 1]);
    (0..count)
        .map(|i| {
            let o = vec3(&mut s) * 1.5;
            let mut d = vec3(&mut s) * 0.5 - o;
            match i % 4 {
                0 => d = [Vec3::X, -Vec3::X, -Vec3::Y, Vec3::Z][i / 4 % 4],
                1 => d.x = -0.0,
                _ => {}
            }
            let mut ray = Ray::new(o, d);
            ray.d = d; // with its negative zeros
            if i % 5 == 0 {
                ray.t_max = s.next_1d();
            }
            ray
        })
        .collect()
}

#[test]
fn hits_are_those_of_brute_force_with_any_instructions() {
    for count in [0, 1, 3, 9, 100, 3000, 6000] {
        let triangles = soup(count, 5);
        let mut tree = Tree::build(&triangles);
        let mut met = 0;
        for ray in rays(if count > 1000 { 4000 } else { 1500 }, count as u64) {
            let t_max = ray.t_max.next_down();
            let expected = brute_force(&triangles, &ray);
            met += usize::from(expected.is_some());
            let mut hits = Vec::new();
            for simd in Simd::all() {
                tree.set_simd(simd);
                hits.push(tree.closest(&ray, t_max));
                assert_eq!(hits[0].map(|h| (h.t, h.id)), expected, "{count} {ray:?}");
                assert_eq!(hits.last(), hits.first(), "every bit: {simd:?}");
                assert_eq!(tree.any(&ray, t_max), expected.is_some(), "{simd:?}");
            }
        }
        assert!(count < 100 || met > 50, "{count}: {met} rays met anything");
    }
}

/// Segments between points around `from` and points around `to`, some of them from or to the same point, some along an axis.
fn bundle(s: &mut impl Sampler, from: Vec3, to: Vec3, width: f32) -> Vec<Ray> {
    let one = s.next_1d() < 0.5;
    let count = bundle::MIN_RAYS + (s.next_1d() * (bundle::MAX_RAYS - bundle::MIN_RAYS + 1) as f32) as usize;
    (0..count)
        .map(|i| {
            let (o, q) = (from + vec3(s) * width, if one { to } else { to + vec3(s) * width });
            let d = if i % 8 == 0 { (q - o) * [Vec3::X, Vec3::Y, Vec3::Z][i / 8 % 3] } else { q - o };
            Ray::segment(o, if d == Vec3::ZERO { Vec3::X } else { d }, 0.2 + 1.8 * s.next_1d())
        })
        .collect()
}

#[test]
fn a_bundle_finds_what_each_ray_finds_with_any_instructions() {
    // Among triangles of all kinds, from and to points on them, too.
    for (count, scale, width) in [(3, 1.0, 0.3), (9, 1e-4, 0.1), (300, 1.0, 0.01), (3000, 1e4, 0.003), (3000, 1.0, 0.0)]
    {
        let triangles: Vec<_> = soup(count, 5).into_iter().map(|t| t.map(|p| p * scale)).collect();
        let mut tree = Tree::build(&triangles);
        let mut s = IndependentSampler::new([29, count as u64]);
        let (mut bundled, mut met, mut all) = (0, 0, 0);
        for i in 0..1200 {
            let on = |s: &mut IndependentSampler| triangles[(s.next_1d() * count as f32) as usize % count][i % 3];
            let from = if i % 3 == 0 { on(&mut s) } else { vec3(&mut s) * scale };
            let to = if i % 4 == 0 { on(&mut s) } else { vec3(&mut s) * scale };
            let rays = bundle(&mut s, from, to, width * scale);
            for simd in Simd::all() {
                tree.set_simd(simd);
                let Some(found) = tree.any_of_bundle(&rays) else { continue };
                bundled += 1;
                for (i, ray) in rays.iter().enumerate() {
                    let alone = tree.any(ray, ray.t_max.next_down());
                    assert_eq!(found >> i & 1 == 1, alone, "{count} triangles, {simd:?}, ray {i}: {ray:?}");
                    (met, all) = (met + usize::from(alone), all + 1);
                }
            }
        }
        assert!(
            bundled > 300 && met > all / 200 && met < all,
            "{count}: {bundled} bundles, {met} of {all} rays met anything"
        );
    }
}

#[test]
fn bundles_that_are_none_find_the_same() {
    // Among instances, spheres and disks; of rays that lead everywhere, have no end, or are no rays.
    let accel = Accel::build(&mixed()).unwrap();
    let mut s = IndependentSampler::new([31]);
    let mut met = 0;
    for i in 0..600 {
        let (from, to) = (vec3(&mut s), vec3(&mut s));
        let mut rays = bundle(&mut s, from, to, if i % 3 == 0 { 0.02 } else { 1.0 });
        match i % 4 {
            0 => rays[2].t_max = f32::INFINITY,
            1 => (rays[1].o, rays[2].d) = (Vec3::NAN, Vec3::ZERO),
            2 => rays.truncate(i / 4 % bundle::MIN_RAYS),
            _ => {}
        }
        if i % 4 == 3 {
            // More than one bundle.
            rays.extend(bundle(&mut s, to, from, 0.1));
        }
        assert_eq!(accel.occluded_each(&rays).count(), rays.len());
        for (i, (ray, found)) in rays.iter().zip(accel.occluded_each(&rays)).enumerate() {
            assert_eq!(found, accel.occluded(ray), "ray {i}: {ray:?}");
            met += u32::from(found);
        }
    }
    assert!(met > 1000, "{met} rays met anything");
}

#[test]
fn directions_with_negative_zeros_hit_what_positive_zeros_hit() {
    let g = single(ball(24, 1.0));
    let a = Accel::build(&g).unwrap();
    for d in [Vec3::X, Vec3::Y, Vec3::Z] {
        for sign in [1.0, -1.0] {
            // Multiplying by -1 makes -0.0 of every zero.
            let d = d * sign;
            let mut ray = Ray::new(d * -3.0 + Vec3::new(0.01, 0.02, 0.03), d);
            ray.d = d;
            assert!(a.intersect(&ray).is_some(), "{d}");
            assert!(a.occluded(&ray), "{d}");
        }
    }
}

#[test]
fn nothing_is_culled_near_the_origin_of_a_ray() {
    for radius in [1e-3f32, 1e-5, 1e-9, 1e6] {
        let g = single(ball(16, radius));
        let a = Accel::build(&g).unwrap();
        let mut s = IndependentSampler::new([3]);
        for _ in 0..20_000 {
            let ray = Ray::new(vec3(&mut s) * radius * 0.3, warp::uniform_sphere(s.next_2d()));
            assert!(a.intersect(&ray).is_some(), "radius {radius}: {ray:?}");
        }
    }
}

#[test]
fn closed_meshes_do_not_leak_at_edges_and_vertices() {
    // A million rays from inside at shared edges and vertices, as exactly as f32 allows.
    let mesh = ball(20, 1.0);
    let g = single(mesh.clone());
    let a = Accel::build(&g).unwrap();
    let mut s = IndependentSampler::new([9]);
    let mut leaks = 0;
    for i in 0..1_000_000u32 {
        let t = mesh.triangles[i as usize % mesh.triangles.len()].map(|v| mesh.positions[v as usize]);
        let corner = i as usize / 7 % 3;
        let u = if i % 3 == 0 { 0.0 } else { s.next_1d() };
        let target = t[corner] + (t[(corner + 1) % 3] - t[corner]) * u;
        let o = if i % 2 == 0 { Vec3::ZERO } else { vec3(&mut s) * 0.4 };
        leaks += u32::from(a.intersect(&Ray::new(o, target - o)).is_none());
    }
    assert_eq!(leaks, 0);
}

#[test]
fn coincident_and_nested_geometry_builds_and_is_hit() {
    // Thousands of the same triangle, and triangles that shrink towards a point: trees degenerate to lists.
    let same = vec![[Vec3::ZERO, Vec3::X, Vec3::Y]; 100_000];
    let mut scale = 1.0f32;
    let nested: Vec<[Vec3; 3]> = (0..2000)
        .map(|_| {
            scale *= 0.97;
            [Vec3::ZERO, Vec3::X * scale, Vec3::Y * scale]
        })
        .collect();
    for triangles in [same, nested] {
        let tree = Tree::build(&triangles);
        let ray = Ray::new(Vec3::new(1e-30, 1e-30, -1.0), Vec3::Z);
        let hit = tree.closest(&ray, f32::MAX).unwrap();
        assert_eq!((hit.t, hit.id), (1.0, 0), "of equal hits the first");
        assert!(
            tree.ids.iter().zip(&tree.leaves).map(|(_, l)| l.used.count_ones()).sum::<u32>() >= triangles.len() as u32
        );
    }
}

#[test]
fn a_tree_is_the_same_whatever_the_number_of_threads() {
    let triangles = soup(5000, 8);
    let build = |threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        let tree = pool.install(|| Tree::build(&triangles));
        format!("{:?} {:?} {:?} {:?}", tree.nodes, tree.leaves, tree.ids, tree.root)
    };
    let one = build(1);
    assert!(one == build(2) && one == build(4));
}

/// Instances of a ball under turns, mirrorings and uneven scales, with spheres and disks between.
fn mixed() -> Geometry {
    let mut s = IndependentSampler::new([17]);
    let mut objects = vec![object(Shape::Mesh(MeshId(1)), DAffine3::IDENTITY)];
    for i in 0..40 {
        let p = vec3(&mut s).as_dvec3();
        let turn =
            DQuat::from_rotation_y(f64::from(s.next_1d()) * 6.0) * DQuat::from_rotation_x(f64::from(s.next_1d()));
        let size = 0.05 + 0.2 * f64::from(s.next_1d());
        let (shape, scale) = match i % 4 {
            0 => (Shape::Sphere, DVec3::splat(size)),
            1 => (Shape::Disk, DVec3::new(size, 2.0 * size, 1.0)),
            2 => (Shape::Mesh(MeshId(0)), DVec3::new(size, -size, 0.5 * size)),
            _ => (Shape::Mesh(MeshId(0)), DVec3::splat(size)),
        };
        objects.push(object(shape, DAffine3::from_scale_rotation_translation(scale, turn, p)));
    }
    Geometry::new(vec![ball(10, 1.0), mesh_of(&soup(300, 2))], objects)
}

#[test]
fn instances_spheres_and_disks_are_hit_as_each_alone() {
    let g = mixed();
    let whole = Accel::build(&g).unwrap();
    // Every object in an accelerator of its own, the others moved out of the way by emptying the list.
    let alone: Vec<(usize, Geometry, Accel)> = (0..g.objects.len())
        .map(|i| {
            let one = Geometry::new(g.meshes.clone(), vec![g.objects[i]]);
            let accel = Accel::build(&one).unwrap();
            (i, one, accel)
        })
        .collect();
    let mut met = 0;
    for ray in rays(6000, 4) {
        let expected = alone
            .iter()
            .filter_map(|(i, _, a)| a.intersect(&ray).map(|h| (h.t, *i as u32, h.primitive)))
            .min_by(|a, b| a.0.total_cmp(&b.0).then((a.1, a.2).cmp(&(b.1, b.2))));
        let hit = whole.intersect(&ray).map(|h| (h.t, h.object.0, h.primitive));
        assert_eq!(hit, expected, "{ray:?}");
        assert_eq!(whole.occluded(&ray), expected.is_some());
        met += usize::from(expected.is_some());
    }
    assert!(met > 1000, "{met} rays met anything");
}

#[test]
fn rays_that_leave_a_convex_surface_never_meet_it_again() {
    let turned = DQuat::from_rotation_y(0.7) * DQuat::from_rotation_x(0.3);
    for (scale, shift) in [(1e-3, 0.0), (1.0, 0.0), (1.0, 1e3), (1e6, 0.0), (1e6, 3e6)] {
        let m =
            DAffine3::from_scale_rotation_translation(DVec3::splat(scale), turned, DVec3::new(shift, -shift, shift));
        for (shape, instanced) in
            [(Shape::Sphere, false), (Shape::Mesh(MeshId(0)), false), (Shape::Mesh(MeshId(0)), true)]
        {
            let mut g = Geometry::new(vec![ball(40, 1.0)], vec![object(shape, m)]);
            if !instanced {
                g.bake();
            }
            let a = Accel::build(&g).unwrap();
            let mut s = IndependentSampler::new([23]);
            let mut met = 0;
            for _ in 0..4000 {
                let out = warp::uniform_sphere(s.next_2d());
                let target = m.transform_point3((vec3(&mut s) * 0.5).as_dvec3()).as_vec3();
                let o = m.transform_point3((out * 3.0).as_dvec3()).as_vec3();
                let Some(hit) = a.intersect(&Ray::new(o, target - o)) else { continue };
                met += 1;
                let i = g.interaction(&Ray::new(o, target - o), &hit);
                let w = warp::uniform_sphere(s.next_2d());
                let w = if w.dot(i.ng) < 0.0 { -w } else { w };
                let again = a.intersect(&i.spawn_ray(w));
                assert!(again.is_none(), "scale {scale}, shift {shift}, {shape:?}: {again:?} along {w}");
            }
            assert!(met > 3900, "scale {scale}, shift {shift}: {met} rays met the ball from outside");
        }
    }
}

#[test]
fn what_is_too_large_or_not_a_ray_is_refused() {
    let mut mesh = ball(4, 1.0);
    mesh.positions[3].x = 1e20;
    assert_eq!(Accel::build(&single(mesh)).unwrap_err(), AccelError::TooLarge { object: 0 });
    let a = Accel::build(&single(ball(4, 1.0))).unwrap();
    for (o, d) in [(Vec3::ZERO, Vec3::ZERO), (Vec3::NAN, Vec3::X), (Vec3::ZERO, Vec3::new(f32::INFINITY, 0.0, 0.0))] {
        assert!(a.intersect(&Ray::new(o, d)).is_none() && !a.occluded(&Ray::new(o, d)));
    }
}
