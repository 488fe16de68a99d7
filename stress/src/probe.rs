//! What a row works with: checks, tests, and pictures that are tested against each other or against what is known.

use renderer::diagnostics::Diagnostics;
use renderer::film::MergedImage;
use renderer::integrator::IntegratorKind;
use renderer::job::{LocalOptions, RenderOptions, RenderSettings, Stop, render_local};
use renderer::scene::Scene;
use renderer::scene::desc::{FilterDesc, SceneDesc};
use statcheck::Estimate;

/// How much a row does.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Effort {
    /// All rows in two minutes or so.
    Quick,
    /// All that the matrix asks for.
    Full,
}

/// Replicate groups of each picture: their scatter tells its error.
const GROUPS: u32 = 16;
/// Half the 99 % interval of a block's mean, relative, up to which it is tested: beyond, a few bright paths decide.
const BLOCK_NOISE: f64 = 0.2;
/// A relative difference of means that rounding to single precision explains.
pub const ROUNDING: f64 = 3e-6;

/// A picture to render.
#[derive(Clone, Copy, Debug)]
pub struct Shot {
    /// Integrator.
    pub kind: IntegratorKind,
    /// Width and height in pixels.
    pub size: (u32, u32),
    /// Samples, light paths or mutations per pixel.
    pub count: u32,
    /// Edges of the longest path; -1 for no bound.
    pub depth: i32,
    /// Seed.
    pub seed: u64,
}

impl Shot {
    /// 16 samples of each of 32 x 32 pixels in each group.
    pub fn new(kind: IntegratorKind, count: u32, depth: i32, seed: u64) -> Self {
        Self { kind, size: (32, 32), count, depth, seed }
    }
}

/// Collects what a row finds.
#[derive(Debug)]
pub struct Probe {
    /// How much to do.
    pub effort: Effort,
    /// Render threads.
    pub threads: usize,
    pub(crate) checks: u64,
    pub(crate) tests: Vec<(String, f64)>,
    pub(crate) failures: Vec<String>,
    pub(crate) figures: Vec<String>,
}

impl Probe {
    /// Nothing found yet.
    pub fn new(effort: Effort, threads: usize) -> Self {
        Self { effort, threads, checks: 0, tests: Vec::new(), failures: Vec::new(), figures: Vec::new() }
    }

    /// One value for the quick form, another for the full one.
    pub fn pick<T>(&self, quick: T, full: T) -> T {
        if self.effort == Effort::Quick { quick } else { full }
    }

    /// An exact check; whether it holds.
    pub fn holds(&mut self, ok: bool, what: impl FnOnce() -> String) -> bool {
        self.checks += 1;
        if !ok {
            self.failures.push(what());
        }
        ok
    }

    /// A statistical test with its p-value.
    pub fn test(&mut self, what: impl Into<String>, p: f64) {
        self.tests.push((what.into(), p));
    }

    /// A figure for the table.
    pub fn figure(&mut self, text: impl Into<String>) {
        self.figures.push(text.into());
    }

    /// Builds a description that must be sound, without a warning.
    pub fn build(&mut self, what: &str, desc: SceneDesc) -> Option<Scene> {
        let mut diagnostics = Diagnostics::default();
        let scene = Scene::build(desc, what, &mut diagnostics);
        let said = || diagnostics.list.iter().map(ToString::to_string).collect::<Vec<_>>().join("; ");
        self.holds(scene.is_some() && diagnostics.list.is_empty(), || {
            format!("{what}: the scene is refused: {}", said())
        });
        scene
    }

    /// Builds a description that is sound, but of which a warning must be given that says `said`.
    pub fn build_warned(&mut self, what: &str, desc: SceneDesc, said: &str) -> Option<Scene> {
        let mut diagnostics = Diagnostics::default();
        let scene = Scene::build(desc, what, &mut diagnostics);
        let told = diagnostics.list.iter().any(|d| d.message.contains(said));
        self.holds(scene.is_some() && told, || format!("{what}: no warning says {said:?}: {:?}", diagnostics.list));
        scene
    }

    /// Renders; every value must be finite, and nothing may have been dropped.
    pub fn shoot(&mut self, what: &str, scene: &Scene, shot: &Shot) -> Option<MergedImage> {
        let options = RenderOptions {
            size: Some(shot.size),
            max_depth: Some(shot.depth),
            seed: Some(shot.seed),
            ..RenderOptions::counting(shot.kind, shot.count)
        };
        let what = format!("{what}, {}", shot.kind.name());
        let mut settings = match RenderSettings::resolve(&options, &scene.defaults) {
            Ok(settings) => settings,
            Err(e) => {
                self.holds(false, || format!("{what}: {e}"));
                return None;
            }
        };
        settings.filter = FilterDesc::Box { radius: 0.5 };
        settings.replicates = GROUPS.min(shot.count);
        let local = LocalOptions { threads: self.threads };
        let image = match render_local(scene, &settings, &local, &Stop::new(), &mut |_| {}) {
            Ok(outcome) => outcome.image,
            Err(e) => {
                self.holds(false, || format!("{what}: {e}"));
                return None;
            }
        };
        let c = image.counters;
        self.holds(c.non_finite == 0 && c.negative == 0, || {
            format!("{what}: {} contributions are not finite, {} negative", c.non_finite, c.negative)
        });
        let valid = |v: &f32| v.is_finite() && *v >= 0.0;
        let finite = image.mean.iter().chain(&image.std_error).flatten().all(valid);
        self.holds(finite, || format!("{what}: the image or its error is not finite"));
        let aovs = image.aovs.iter().all(|a| a.albedo.iter().chain(&a.normal).chain([&a.hits]).all(|v| v.is_finite()));
        self.holds(aovs, || format!("{what}: an auxiliary value is not finite"));
        Some(image)
    }

    /// Two pictures of the same: image mean, and blocks where they are quiet. The mean must be known to `share` of it.
    pub fn agree(&mut self, what: &str, a: &MergedImage, b: &MergedImage, share: f64) {
        for c in 0..3 {
            let (x, y) = (whole(a, c), whole(b, c));
            self.known_to(what, &x, share);
            self.known_to(what, &y, share);
            self.welch(format!("{what}, channel {c}"), &x, &y, ROUNDING);
        }
        for i in 0..a.blocks.std_error.len() {
            for c in 0..3 {
                let (x, y) = (block(a, i, c), block(b, i, c));
                if [&x, &y].iter().all(|e| e.mean > 0.0 && e.half_width(0.99) <= BLOCK_NOISE * e.mean) {
                    self.welch(format!("{what}, block {i}, channel {c}"), &x, &y, ROUNDING);
                }
            }
        }
    }

    /// The image mean against what it must be, known to `share` of it.
    pub fn is(&mut self, what: &str, image: &MergedImage, truth: [f64; 3], share: f64) {
        self.is_after(what, image, truth, share, ROUNDING);
    }

    /// The same where so many operations may have rounded, each alike, that their relative error is as large as `rounding`.
    pub fn is_after(&mut self, what: &str, image: &MergedImage, truth: [f64; 3], share: f64, rounding: f64) {
        for (c, truth) in truth.into_iter().enumerate() {
            let x = whole(image, c);
            self.known_to(what, &x, share);
            self.welch(format!("{what}, channel {c}"), &x, &Estimate::exact(truth), rounding);
        }
    }

    /// Whether two pictures have the same bits, errors included.
    pub fn same_bits(&mut self, what: &str, a: &MergedImage, b: &MergedImage) -> bool {
        let bits = |v: &[[f32; 3]]| v.as_flattened().iter().map(|x| x.to_bits()).collect::<Vec<_>>();
        let (x, y) = (bits(&a.mean), bits(&b.mean));
        let differ = x.iter().zip(&y).filter(|(a, b)| a != b).count();
        self.holds(x == y && bits(&a.std_error) == bits(&b.std_error), || {
            format!("{what}: {differ} of {} values have other bits", x.len())
        })
    }

    fn known_to(&mut self, what: &str, e: &Estimate, share: f64) {
        let half = e.half_width(0.99);
        self.holds(half <= share * e.mean, || {
            format!("{what}: the interval {} +- {half} is wider than {share} of it: too wide to tell", e.mean)
        });
    }

    fn welch(&mut self, what: String, x: &Estimate, y: &Estimate, rounding: f64) {
        let p = x.welch(y, rounding).map_or(f64::NAN, |w| w.p);
        self.test(format!("{what}: {:.6} and {:.6}", x.mean, y.mean), p);
    }
}

/// The mean of the image with its error between groups.
pub fn whole(image: &MergedImage, channel: usize) -> Estimate {
    let none = Estimate { mean: f64::NAN, variance: f64::NAN, dof: 1.0 };
    image.blocks.image.map_or(none, |m| Estimate {
        mean: m.mean[channel],
        variance: m.std_error[channel] * m.std_error[channel],
        dof: f64::from(m.groups) - 1.0,
    })
}

/// The mean of a block with its error between groups.
fn block(image: &MergedImage, index: usize, channel: usize) -> Estimate {
    let side = renderer::film::ERROR_BLOCK;
    let across = image.width.div_ceil(side);
    let (x0, y0) = (index as u32 % across * side, index as u32 / across * side);
    let (mut sum, mut count) = (0.0, 0.0);
    for y in y0..(y0 + side).min(image.height) {
        for x in x0..(x0 + side).min(image.width) {
            sum += f64::from(image.mean[(y * image.width + x) as usize][channel]);
            count += 1.0;
        }
    }
    let error = f64::from(image.blocks.std_error[index][channel]);
    let groups = image.blocks.image.map_or(1, |m| m.groups);
    Estimate { mean: sum / count, variance: error * error, dof: f64::from(groups) - 1.0 }
}
