//! Published scenes against references of another renderer (Mitsuba 3.9, with the variance of its mean), where they are at hand:
//! image mean and 16 x 16-pixel blocks, family-wise 99 %.

#![allow(clippy::unwrap_used, reason = "test helpers")]

mod common;

use renderer::film::MergedImage;
use renderer::film::exr::{Picture, decode};
use renderer::job::{RenderOptions, RenderSettings};
use renderer::scene::Scene;
use renderer::scene::bundle::DiskSource;
use std::path::PathBuf;

const BLOCK: usize = 16;
/// The references were splatted with a tent filter of radius 1: a sample lands in several pixels, so that neighbours correlate. The
/// variance of a block's sum is that of the samples; a pixel's own is smaller by the integral of the filter's square, 4 / 9.
const TENT_CORRELATION: f64 = 9.0 / 4.0;

fn folder() -> Option<PathBuf> {
    let path = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../../shared/data/scenes");
    if !path.is_dir() {
        println!("skipped: the published scenes are not at hand");
        return None;
    }
    Some(path)
}

fn render(folder: &std::path::Path, scene: &str, size: (u32, u32), spp: u32) -> MergedImage {
    let (source, root) = DiskSource::for_scene(&folder.join(scene).join("scene.xml")).unwrap();
    let (scene, _) = Scene::load(&source, &root).unwrap();
    let options = RenderOptions { size: Some(size), spp: Some(spp), seed: Some(7), ..Default::default() };
    let settings = RenderSettings::resolve(&options, &scene.defaults).unwrap();
    common::render_with(&scene, &settings, 2)
}

/// Sums over the pixels of a rectangle of one channel: ours, its variance, the reference's, its variance.
fn sums(ours: &MergedImage, theirs: &Picture, c: usize, x0: usize, y0: usize, x1: usize, y1: usize) -> [f64; 4] {
    let name = ["R", "G", "B"][c];
    let mean = theirs.channel(name).unwrap();
    let variance = theirs.channel(&format!("variance.{name}")).unwrap();
    let mut out = [0.0; 4];
    for i in (y0..y1).flat_map(|y| (x0..x1).map(move |x| y * ours.width as usize + x)) {
        let se = f64::from(ours.std_error[i][c]);
        let terms =
            [f64::from(ours.mean[i][c]), se * se, f64::from(mean[i]), f64::from(variance[i]) * TENT_CORRELATION];
        out.iter_mut().zip(terms).for_each(|(to, v)| *to += v);
    }
    out
}

/// Pixels of our image are independent of each other, so a block's variance has hundreds of degrees of freedom: the normal
/// distribution serves for its t.
fn compare(scene: &str, size: (u32, u32), spp: u32, reference: &str) {
    let Some(folder) = folder() else { return };
    let ours = render(&folder, scene, size, spp);
    let theirs = decode(&std::fs::read(folder.join(scene).join(reference)).unwrap()).unwrap();
    assert_eq!((theirs.width, theirs.height), size);
    let (w, h) = (size.0 as usize, size.1 as usize);
    let mut rectangles = vec![(0, 0, w, h)];
    rectangles.extend(
        (0..h / BLOCK)
            .flat_map(|y| (0..w / BLOCK).map(move |x| (x * BLOCK, y * BLOCK, x * BLOCK + BLOCK, y * BLOCK + BLOCK))),
    );
    let tests = rectangles.len() * 3;
    let limit = statcheck::normal_quantile(1.0 - 0.5 * statcheck::sidak(0.01, tests));
    let mut telling = 0;
    for (x0, y0, x1, y1) in rectangles {
        for c in 0..3 {
            let [a, va, b, vb] = sums(&ours, &theirs, c, x0, y0, x1, y1);
            let se = (va + vb).sqrt();
            // A block that is black, or the same emitter in every sample, has no variance: f32 rounding is what is left.
            let rounding = 4e-6 * b.abs();
            assert!(
                (a - b).abs() <= limit * se + rounding,
                "{scene}, pixels {x0}..{x1} x {y0}..{y1}, channel {c}: {a} against {b}, {} standard errors",
                (a - b) / se
            );
            telling += usize::from(limit * se < 0.25 * b);
        }
    }
    assert!(telling * 2 > tests, "most blocks must be known well enough to tell a difference: {telling} of {tests}");
}

#[test]
fn the_cornell_box_agrees() {
    compare("cornell-box", (256, 256), 16, "mitsuba-3.9-256x256.exr");
}

#[test]
fn rough_conductors_under_lamps_of_many_sizes_agree() {
    compare("veach-mis", (320, 180), 16, "mitsuba-3.9-320x180.exr");
}

#[test]
fn light_through_a_door_ajar_agrees() {
    compare("veach-ajar", (320, 180), 64, "mitsuba-3.9-320x180.exr");
}
