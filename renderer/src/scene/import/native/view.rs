//! Camera and render settings.

use super::table::{Table, choose};
use super::transform;
use crate::scene::desc::{CameraDesc, FilterDesc, FovAxis};
use crate::scene::import::importer::Importer;
use crate::scene::import::number::Bound;
use crate::scene::import::transform::{half_turn, without_scale};

/// Names of the integrators, which belong to a higher layer: a test of the command compares the lists.
const INTEGRATORS: [(&str, &str); 5] =
    [("path", "path"), ("light", "light"), ("bdpt", "bdpt"), ("mmlt", "mmlt"), ("auto", "auto")];
/// Most pixels along a side.
const MAX_SIDE: i64 = 1 << 16;

/// The camera, from `from`, `to`, `up` or from `transform`.
pub(super) fn camera(importer: &mut Importer, mut table: Table) {
    let mut camera = CameraDesc::default();
    if table.has("transform") {
        let m = transform::of(importer, &mut table);
        camera.to_world = without_scale(m).unwrap_or(m);
    } else if let Some(m) = transform::look_at(importer, &mut table) {
        camera.to_world = m * half_turn();
        // What is looked at is sharp, unless told otherwise.
        camera.focus_distance = table.vector(importer, "to").map_or(1.0, |to| to.distance(m.translation));
    }
    let axes = [
        ("y", FovAxis::Y),
        ("x", FovAxis::X),
        ("smaller", FovAxis::Smaller),
        ("larger", FovAxis::Larger),
        ("diagonal", FovAxis::Diagonal),
    ];
    camera.fov_axis = table.choice(importer, "fov_axis", &axes);
    camera.fov = table.number_or(importer, "fov", Bound::Inside(0.0, 180.0), camera.fov);
    camera.aperture_radius = table.number_or(importer, "aperture_radius", Bound::NotNegative, 0.0);
    camera.focus_distance = table.number_or(importer, "focus_distance", Bound::Positive, camera.focus_distance);
    table.finish(importer);
    importer.scene.camera = camera;
}

/// What the command line can override.
pub(super) fn render(importer: &mut Importer, mut table: Table) {
    let integrator = table.string(importer, "integrator");
    let integrator = integrator.and_then(|(name, at)| choose(importer, at, "integrator", name, &INTEGRATORS));
    let spp = table.integer(importer, "spp", 1, 1 << 24).map(|v| v as u32);
    let size = table.get("size").and_then(|item| {
        let [width, height] = item.exactly(importer, "size", "[width, height]")?;
        let [width, height] = [width, height].map(|side| side.integer(importer, "size", 1, MAX_SIDE));
        Some((width? as u32, height? as u32))
    });
    let max_depth = table.integer(importer, "max_depth", -1, i64::from(i32::MAX)).map(|v| v as i32);
    let rr_depth = table.integer(importer, "rr_depth", 1, i64::from(u32::MAX)).map(|v| v as u32);
    let seed = table.integer(importer, "seed", 0, i64::MAX).map(|v| v as u64);
    let filter = table.table(importer, "filter").map(|t| filter(importer, t));
    table.finish(importer);
    let defaults = &mut importer.scene.defaults;
    defaults.integrator = integrator.map(String::from).or(defaults.integrator.take());
    defaults.spp = spp.or(defaults.spp);
    defaults.size = size.or(defaults.size);
    defaults.max_depth = max_depth.or(defaults.max_depth);
    defaults.rr_depth = rr_depth.or(defaults.rr_depth);
    defaults.seed = seed.or(defaults.seed);
    defaults.filter = filter.or(defaults.filter);
}

fn filter(importer: &mut Importer, mut table: Table) -> FilterDesc {
    #[derive(Clone, Copy)]
    enum Kind {
        Gaussian,
        Box,
        Tent,
        BlackmanHarris,
    }
    let kinds = [
        ("gaussian", Kind::Gaussian),
        ("box", Kind::Box),
        ("tent", Kind::Tent),
        ("blackman-harris", Kind::BlackmanHarris),
    ];
    let kind = table.choice(importer, "kind", &kinds);
    let mut number =
        |key, most, default| table.number_or(importer, key, Bound::Between(0.01, f64::from(most)), default) as f32;
    let mut radius = |default| number("radius", FilterDesc::MAX_RADIUS, default);
    let filter = match kind {
        Kind::Box => FilterDesc::Box { radius: radius(0.5) },
        Kind::Tent => FilterDesc::Tent { radius: radius(1.0) },
        Kind::BlackmanHarris => FilterDesc::BlackmanHarris { radius: radius(1.5) },
        Kind::Gaussian => FilterDesc::Gaussian { stddev: number("stddev", FilterDesc::MAX_STDDEV, 0.5) },
    };
    table.finish(importer);
    filter
}
