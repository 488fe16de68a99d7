//! Small scenes made in code, and rendering them.
#![allow(dead_code, reason = "each test binary uses its own part")]
#![allow(clippy::unwrap_used, clippy::panic, reason = "test helpers")]

use renderer::bsdf::{Material, MaterialId};
use renderer::diagnostics::Diagnostics;
use renderer::film::MergedImage;
use renderer::integrator::IntegratorKind;
use renderer::job::{LocalOptions, RenderOptions, RenderSettings, Stop, render_local};
use renderer::math::{DAffine3, DVec3};
use renderer::scene::Scene;
use renderer::scene::desc::{CameraDesc, Emission, FilterDesc, FovAxis, SceneDesc, ShapeDesc, ShapeKind};
use renderer::spectrum::Rgb;
use renderer::texture::RgbParam;

/// A diffuse material.
pub fn lambert(albedo: f32) -> Material {
    Material::Lambert { reflectance: RgbParam::Const(Rgb::splat(albedo)) }
}

/// A placed shape.
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

/// Constant emission from the front.
pub fn emission(radiance: f32) -> Option<Emission> {
    Some(Emission { radiance: RgbParam::Const(Rgb::splat(radiance)), two_sided: false })
}

/// A pinhole at `from` that looks at `at`.
pub fn camera(from: DVec3, at: DVec3, fov: f64) -> CameraDesc {
    let back = (from - at).normalize();
    let right = (if back.y.abs() > 0.9 { DVec3::Z } else { DVec3::Y }).cross(back).normalize();
    let mut to_world = DAffine3::from_mat3(renderer::math::DMat3::from_cols(right, back.cross(right), back));
    to_world.translation = from;
    CameraDesc { to_world, fov, fov_axis: FovAxis::Y, aperture_radius: 0.0, focus_distance: 1.0 }
}

/// Builds a description that must be sound.
pub fn build(desc: SceneDesc) -> Scene {
    let mut diagnostics = Diagnostics::default();
    match Scene::build(desc, "test", &mut diagnostics) {
        Some(scene) => scene,
        None => panic!("{:?}", diagnostics.list),
    }
}

/// Renders a scene.
pub fn render(scene: &Scene, kind: IntegratorKind, size: (u32, u32), spp: u32, depth: i32, seed: u64) -> MergedImage {
    let options = RenderOptions {
        size: Some(size),
        max_depth: Some(depth),
        seed: Some(seed),
        ..RenderOptions::counting(kind, spp)
    };
    let mut settings = RenderSettings::resolve(&options, &scene.defaults).unwrap();
    settings.filter = FilterDesc::Box { radius: 0.5 };
    render_with(scene, &settings, 2)
}

/// Renders with given settings and threads; nothing may be dropped.
pub fn render_with(scene: &Scene, settings: &RenderSettings, threads: usize) -> MergedImage {
    let outcome = render_local(scene, settings, &LocalOptions { threads }, &Stop::new(), &mut |_| {}).unwrap();
    assert_eq!((outcome.image.counters.non_finite, outcome.image.counters.negative), (0, 0));
    outcome.image
}

/// Two-sided 99.9 % Student's t for the number of groups.
pub fn t999(groups: u32) -> f64 {
    statcheck::student_quantile(1.0 - 0.0005, f64::from(groups - 1))
}

/// The image mean must be `truth` within its 99.9 % interval, whose half width must be below `share` of it.
pub fn assert_mean(image: &MergedImage, truth: f64, share: f64, what: &str) {
    let e = image.error.unwrap();
    let half = t999(e.groups) * e.mean_se;
    assert!(half <= share * truth, "{what}: the interval is too wide to tell: {} +- {half}", e.mean);
    let tolerance = half.max(2e-6 * truth); // f32 rounding, where an estimator has no variance at all
    assert!((e.mean - truth).abs() <= tolerance, "{what}: {} +- {half}, should be {truth}", e.mean);
}

/// Two images must have the same mean within the 99.9 % interval of their difference.
pub fn assert_same_mean(a: &MergedImage, b: &MergedImage, share: f64, what: &str) {
    let (ea, eb) = (a.error.unwrap(), b.error.unwrap());
    let se = (ea.mean_se * ea.mean_se + eb.mean_se * eb.mean_se).sqrt();
    let half = t999(ea.groups.min(eb.groups)) * se;
    assert!(half <= share * ea.mean, "{what}: the interval is too wide to tell: {} +- {half}", ea.mean);
    let tolerance = half.max(2e-6 * ea.mean.abs());
    assert!((ea.mean - eb.mean).abs() <= tolerance, "{what}: {} and {} differ by more than {half}", ea.mean, eb.mean);
}

/// Squared relative deviations of pixels from the mean of all renders (as of one that took no part in it), and the squares of the
/// errors that they tell: sums over the picture, by render.
pub fn deviations(renders: &[MergedImage]) -> (Vec<f64>, Vec<f64>) {
    let n = renders.len() as f64;
    let pixels = renders[0].mean.len();
    let mean: Vec<f64> =
        (0..pixels).map(|i| renders.iter().map(|r| f64::from(r.mean[i][1])).sum::<f64>() / n).collect();
    let relative = |i: usize, v: f64| v * v / (mean[i] * mean[i] + 0.01);
    let true_of = |r: &MergedImage| {
        (0..pixels).map(|i| relative(i, f64::from(r.mean[i][1]) - mean[i])).sum::<f64>() * n / (n - 1.0)
    };
    let told = |r: &MergedImage| (0..pixels).map(|i| relative(i, f64::from(r.std_error[i][1]))).sum();
    (renders.iter().map(true_of).collect(), renders.iter().map(told).collect())
}
