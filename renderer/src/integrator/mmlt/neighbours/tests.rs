//! The factors from which sets of paths are made, against each other.

use super::*;
use crate::diagnostics::Diagnostics;
use crate::integrator::View;
use crate::integrator::mmlt::{Depth, MmltOptions};
use crate::sampling::{IndependentSampler, PrimarySpace, Sampler};
use crate::scene::Scene;
use crate::scene::bundle::DiskSource;
use crate::scene::desc::FilterDesc;
use std::path::Path;

/// Kinds of paths: joined by the lens, by the two walks, by a later vertex; and any of them by way of a mirror or glass.
const KINDS: usize = 4;
/// Rounding at grazing angles, of places that are found in two ways.
const TOLERANCE: f32 = 2e-3;

/// Calls `see` with the tails of many independent paths, their evaluator, their kinds, and what deals them.
fn each_tail(name: &str, mut see: impl FnMut(&Evaluator<'_>, &Proposal, &Tail, &mut Neighbours<'_>, usize)) {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../scenes").join(name);
    let (source, root) = DiskSource::for_scene(&path).unwrap();
    let (mut scene, Diagnostics { .. }) = Scene::load(&source, &root).unwrap();
    scene.camera.aperture_radius = 0.02;
    let view = View::new(&scene, 96, 64, FilterDesc::Box { radius: 0.5 }).unwrap();
    let c = UnitContext::of_all_paths(&scene, &view, 8);
    let depths = (3..=6u32).map(|edges| Depth { edges, techniques: vec![1.0; edges as usize + 1] }).collect();
    let constants = ChainConstants { depths, columns: 6, target: Vec::new(), threshold: 0.0, direct_share: 1.0 };
    let mut neighbours = Neighbours::new(&c, &constants);
    for edges in 3..=6 {
        let mut evaluator = Evaluator::new(&c, &constants, &MmltOptions::default(), edges).unwrap();
        let mut space = PrimarySpace::new(edges as usize);
        for key in 0..150_000 {
            space.propose_large(u64::from(edges) << 32 | key);
            let path = evaluator.evaluate(&mut space);
            let Some(tail) = evaluator.tail(&path) else { continue };
            let left = edges + 1 - path.technique - tail.passed;
            let kind = if tail.passed > 0 { 3 } else { left.min(3) as usize - 1 };
            see(&evaluator, &path, &tail, &mut neighbours, kind);
        }
    }
}

fn alike(a: Rgb, b: Rgb) -> bool {
    a.to_array().iter().zip(b.to_array()).all(|(a, b)| (a - b).abs() <= TOLERANCE * a.max(b))
}

/// A path is of its own set: what its vertices say is what the camera ray through its raster position finds.
#[test]
fn a_path_is_found_again_by_its_camera_ray() {
    for name in ["glass-and-mirrors.toml", "cornell.toml", "stress/glossy-cornell.toml"] {
        let mut counts = [(0, 0); KINDS];
        each_tail(name, |_, path, tail, neighbours, kind| {
            let found = neighbours.end(tail, path.raster).and_then(|end| tail.joined(&end, false));
            let (all, same) = &mut counts[kind];
            *all += 1;
            *same += u32::from(found.is_some_and(|found| alike(found, tail.own)));
        });
        for (kind, (all, same)) in counts.into_iter().enumerate() {
            // At silhouettes the ray back may pass what the walk met.
            assert!(f64::from(same) >= 0.98 * f64::from(all), "{name}, kind {kind}: {same} of {all}");
            assert!(all > 100 || kind == 3 && name != "glass-and-mirrors.toml", "{name}, kind {kind}: only {all}");
        }
    }
}

/// The vertex in common as the light's walk sees it, and as a camera's would: the same up to a factor that all paths of a set share.
#[test]
fn who_found_the_vertex_in_common_does_not_matter() {
    for name in ["glass-and-mirrors.toml", "cornell.toml", "stress/glossy-cornell.toml"] {
        let (mut all, mut same) = (0, 0);
        each_tail(name, |e, path, tail, neighbours, _| {
            let s = path.technique as usize;
            let onward = match e.edges + 1 - s - tail.passed as usize {
                1 if s > 3 => e.light.vertices[s - 3].anchor.p,
                2 if s > 2 => e.light.vertices[s - 2].anchor.p,
                _ => return,
            };
            // The same tail, its vertex seen from where the path comes from.
            let scene = neighbours.c.scene;
            let Some(end) = neighbours.end(tail, path.raster) else { return };
            let ray = end.anchor.ray((tail.anchor.p - end.anchor.p).normalize());
            let Some(hit) = scene.accel.intersect(&ray).map(|hit| scene.geometry.interaction(&ray, &hit)) else {
                return;
            };
            let material = scene.objects[hit.object.0 as usize].material;
            let shading = ShadingPoint::new(&scene.materials, &scene.textures, material, &hit, -ray.d);
            let onward = Some((onward - tail.anchor.p).normalize());
            let mut other = Tail { shading, onward, ..*tail };
            let Some(own) = other.joined(&end, false) else { return };
            other.own = own;
            let mut numbers = IndependentSampler::new([path.raster.x.to_bits().into()]);
            for _ in 0..4 {
                let raster = numbers.next_2d() * Vec2::new(96.0, 64.0);
                let Some(end) = neighbours.end(tail, raster) else { continue };
                let (Some(a), Some(b)) = (tail.joined(&end, false), other.joined(&end, false)) else { continue };
                all += 1;
                same += u32::from(alike(a / tail.own, b / other.own));
            }
        });
        assert!(all > 300 && f64::from(same) >= 0.98 * f64::from(all), "{name}: {same} of {all}");
    }
}

#[test]
fn weights_add_up_to_the_number_of_mutations() {
    for (period, mutations) in [(32, 1000), (1, 7), (5, 5), (3, 1 << 16)] {
        let weights = Period::new(period, mutations).unwrap();
        let sum: f64 = (0..mutations).map(|i| weights.weight(weights.has(i))).sum();
        assert!((sum / f64::from(mutations) - 1.0).abs() < 1e-9, "{period} {mutations}: {sum}");
    }
    assert!(Period::new(0, 100).is_none() && Period::new(32, 31).is_none());
}
