//! References: a long render by another integrator, stored with its variance and made longer until it is quiet enough.

use super::measure::{Stage, Track};
use crate::error::measure::{Measure, Target, compare};
use crate::error::reference::ReferencePicture;
use crate::error::variant::Variant;
use renderer::film::exr;
use renderer::job::{LocalOptions, Stop, render_local};
use renderer::scene::bundle::Digest;
use std::path::{Path, PathBuf};
use std::time::Instant;

/// The largest share of the reference's variance in a measured relMSE; what is measured below is rejected.
pub const SHARE: f64 = 0.1;
/// References are seeded far from what they judge.
const SEED: u64 = 0x5eed_0000_0000;

/// A reference and how it came about.
#[derive(Clone)]
pub struct Truth {
    /// The estimate and its variance.
    pub target: Target,
    /// In words.
    pub about: String,
    /// The variance of the reference as a relMSE.
    pub relmse: f64,
    /// Agreement with a picture by another renderer, if that is not the reference itself.
    pub published: Option<String>,
}

/// A reference for the tracks: the picture by another renderer, where it is quiet enough; else lightfarm's, which begins with what is stored, or with 16 times the samples of the longest track of the same integrator,
/// and takes as many times two as the quietest track needs, within `limit_s` seconds.
pub fn find(stage: &Stage<'_>, digest: Digest, tracks: &[Track], folder: &Path, limit_s: f64) -> Result<Truth, String> {
    let published = stage.bench.published.as_ref().map(|p| published(stage, p)).transpose()?.flatten();
    if let Some(truth) = published.as_ref().filter(|t| t.relmse <= SHARE * quietest(tracks, &t.target)) {
        return Ok(truth.clone());
    }
    let mut truth = own(stage, digest, tracks, folder, limit_s)?;
    truth.published = published.and_then(|p| against(&truth, &p));
    Ok(truth)
}

fn quietest(tracks: &[Track], target: &Target) -> f64 {
    tracks.iter().filter_map(|t| error(t, target)).fold(f64::INFINITY, f64::min)
}

fn own(stage: &Stage<'_>, digest: Digest, tracks: &[Track], folder: &Path, limit_s: f64) -> Result<Truth, String> {
    let variant: Variant = stage.bench.reference.parse()?;
    let longest = tracks.iter().filter(|t| t.contender.name == variant.name).filter_map(|t| t.levels.last());
    let mut count = longest.map(|l| l.count).max().unwrap_or(16).saturating_mul(16);
    while path(stage, folder, 2 * count).is_file() {
        count *= 2;
    }
    let started = Instant::now();
    loop {
        let (truth, seconds) = render(stage, digest, &variant, count, folder)?;
        // A margin, as the next figure is not exactly what this one lets expect.
        let missing = truth.relmse / (0.8 * SHARE * quietest(tracks, &truth.target));
        if missing <= 1.0 {
            return Ok(truth);
        }
        let mut factor = 2;
        while f64::from(factor) < missing && factor < 1 << 20 {
            factor *= 2;
        }
        let left = limit_s - started.elapsed().as_secs_f64();
        while factor > 1 && seconds * f64::from(factor) > left {
            factor /= 2;
        }
        let Some(next) = count.checked_mul(factor).filter(|n| factor > 1 && *n <= 1 << 24) else { return Ok(truth) };
        count = next;
    }
}

/// The mean relMSE of a track's longest renders.
fn error(track: &Track, target: &Target) -> Option<f64> {
    let level = track.levels.last()?;
    let errors: Vec<f64> =
        level.shots.iter().filter_map(|s| Some(compare(&s.pixels, target)?.error(Measure::RelMse))).collect();
    let mean = errors.iter().sum::<f64>() / errors.len() as f64;
    (mean > 0.0).then_some(mean)
}

fn path(stage: &Stage<'_>, folder: &Path, count: u32) -> PathBuf {
    let (b, (w, h)) = (stage.bench, stage.size);
    let integrator = b.reference.replace([':', ',', '='], "-");
    folder.join(format!("{}-{w}x{h}-depth{}-{integrator}-{count}.exr", b.name, b.max_depth))
}

/// Reads the reference of so many samples, or renders and stores it; and the seconds it took, if it took any.
fn render(
    stage: &Stage<'_>,
    digest: Digest,
    variant: &Variant,
    count: u32,
    folder: &Path,
) -> Result<(Truth, f64), String> {
    let path = path(stage, folder, count);
    let settings = stage.settings(variant, count, SEED)?;
    let provenance = settings.provenance(digest, None);
    let mut seconds = f64::from(count) * 1e-3;
    if !stored(&path, digest, &provenance.settings) {
        eprintln!("{}: reference by {}, {count} per pixel", stage.bench.name, variant.name);
        let started = Instant::now();
        let options = LocalOptions { threads: stage.threads };
        let outcome = render_local(stage.scene, &settings, &options, &Stop::new(), &mut |_| {});
        let image = outcome.map_err(|e| e.to_string())?.image;
        seconds = started.elapsed().as_secs_f64();
        let failed = |e: String| format!("{}: the reference can't be stored: {e}", path.display());
        let bytes = exr::encode(&image, &provenance).map_err(failed)?;
        std::fs::create_dir_all(folder)
            .and_then(|()| std::fs::write(&path, bytes))
            .map_err(|e| failed(e.to_string()))?;
    }
    let picture = ReferencePicture::read(&path)?;
    let relmse = own_relmse(&picture.target);
    let word = if variant.kind == renderer::integrator::IntegratorKind::Mmlt { "mutations" } else { "samples" };
    let about = format!("lightfarm {}, {count} {word} per pixel, other seeds", variant.name);
    Ok((Truth { target: picture.target, about, relmse, published: None }, seconds))
}

/// Whether a file holds this very reference, by this version.
fn stored(path: &Path, digest: Digest, settings: &serde_json::Value) -> bool {
    let Ok(picture) = compare::pair::read(path) else { return false };
    picture.metadata.is_some_and(|m| {
        m.scene == digest
            && m.settings == *settings
            && m.version == env!("CARGO_PKG_VERSION")
            && m.fingerprint == renderer::FINGERPRINT
    })
}

/// `mean Var / (R^2 + 0.01)`.
fn own_relmse(target: &Target) -> f64 {
    let picture: Vec<[f32; 3]> = target.mean.iter().map(|p| p.map(|v| v as f32)).collect();
    compare(&picture, target).map_or(f64::NAN, |d| d.reference[Measure::RelMse as usize])
}

/// The picture by another renderer, if it has the right size and tells its variance.
fn published(stage: &Stage<'_>, path: &Path) -> Result<Option<Truth>, String> {
    let picture = ReferencePicture::read(path)?;
    if (picture.width, picture.height) != stage.size || !picture.has_variance {
        return Ok(None);
    }
    let about = path.file_name().unwrap_or_default().to_string_lossy().into_owned();
    let relmse = own_relmse(&picture.target);
    Ok(Some(Truth { target: picture.target, about, relmse, published: None }))
}

/// How the reference compares with that picture: its mean over that picture's, and the relMSE between the two that their variances
/// don't explain.
fn against(truth: &Truth, other: &Truth) -> Option<String> {
    let picture: Vec<[f32; 3]> = truth.target.mean.iter().map(|p| p.map(|v| v as f32)).collect();
    let d = compare(&picture, &other.target)?;
    Some(format!(
        "against {}: ratio of means {:.5}; relMSE {:.3e}, of which {:.3e} is the variance of the two",
        other.about,
        d.mean_ratio,
        d.squared[Measure::RelMse as usize],
        truth.relmse + d.reference[Measure::RelMse as usize]
    ))
}
