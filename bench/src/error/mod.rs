//! Error against time, by many short independent renders (Celarek, Jakob, Wimmer, Lehtinen 2019).

pub mod measure;
mod preset;
pub mod process;
pub mod reference;
mod report;
pub mod runs;
pub mod stats;
mod table;
pub mod variant;

pub use report::Report;

use crate::load;
use preset::Preset;
use reference::{Pool, Reference, ReferencePicture};
use renderer::job::RenderSettings;
use renderer::scene::Scene;
use runs::Run;
use std::path::PathBuf;
use variant::{Budget, Variant};

/// Compares integrators by the error that they leave in the time that they take.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// The scene.
    #[arg(required_unless_present = "preset", conflicts_with = "preset")]
    scene: Option<PathBuf>,
    /// A comparison that the project states figures of: water-caustic, veach-ajar, cornell-box or cornell-diffuse.
    #[arg(long, value_name = "NAME", value_parser = preset::find)]
    preset: Option<Preset>,
    /// An integrator, with options after a colon: `path:spp=16`, `mmlt:mpp=64,plain`, `light:time=2`. May be given many times.
    #[arg(short, long = "variant", value_name = "KIND[:OPTION,...]")]
    variants: Vec<String>,
    /// A picture taken for the truth (its layer `variance` or `stderror` tells its error). Without one, every render is compared with the
    /// mean of all others.
    #[arg(long, value_name = "EXR")]
    reference: Option<PathBuf>,
    /// Without a reference: only the renders of this variant stand in for it.
    #[arg(long, value_name = "VARIANT", conflicts_with = "reference")]
    reference_by: Option<String>,
    /// Size of the pictures [default: the reference's, else the scene's].
    #[arg(long, value_name = "WxH", value_parser = size)]
    size: Option<(u32, u32)>,
    /// Edges of the longest path; -1 = unbounded [default: the scene's].
    #[arg(long, value_name = "N", allow_negative_numbers = true)]
    max_depth: Option<i32>,
    /// Samples per pixel of variants that say nothing else [default: 64].
    #[arg(long, value_name = "N")]
    spp: Option<u32>,
    /// Seconds of variants that say nothing else.
    #[arg(long, value_name = "SECONDS", value_parser = variant::seconds)]
    time: Option<f64>,
    /// Renders of each variant.
    #[arg(long, value_name = "J", default_value_t = 8, value_parser = clap::value_parser!(u32).range(2..=10_000))]
    rounds: u32,
    /// Seed of the first render; the others count on from it.
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// Render threads.
    #[arg(long, default_value_t = 2)]
    threads: usize,
}

/// The size of a picture, written as `WxH`.
pub fn size(text: &str) -> Result<(u32, u32), String> {
    let sides = text.split_once('x').and_then(|(w, h)| Some((w.parse().ok()?, h.parse().ok()?)));
    sides.ok_or_else(|| format!("{text:?} is not WIDTHxHEIGHT, such as 640x480"))
}

/// What the command line and the preset come to.
struct Plan {
    scene: PathBuf,
    picture: Option<(PathBuf, ReferencePicture)>,
    size: Option<(u32, u32)>,
    max_depth: Option<i32>,
    variants: Vec<Variant>,
    notes: Vec<String>,
}

/// Runs the benchmark.
pub fn run(args: &Args) -> Result<Report, String> {
    let plan = plan(args)?;
    let scene = load::scene(&plan.scene)?;
    let mut jobs = Vec::with_capacity(plan.variants.len());
    for v in &plan.variants {
        jobs.push((v.name.as_str(), settings(args, &plan, v, &scene)?));
    }
    let first = jobs.first().ok_or("there is nothing to compare; give --variant or --preset")?.1.clone();
    let mut notes = plan.notes.clone();
    if let Some((path, picture)) = &plan.picture {
        if (picture.width, picture.height) != (first.width, first.height) {
            return Err(format!("{} has another size than the renders", path.display()));
        }
        notes.extend(picture.differences(&first));
        if !picture.has_variance {
            notes.push("the reference does not tell its variance, which is part of all errors here".into());
        }
    }
    let names: Vec<&str> = jobs.iter().map(|j| j.0).collect();
    let runs = runs::render_rounds(&scene, &jobs, args.rounds as usize, args.threads.max(1))?;
    let pictures: Vec<&[[f32; 3]]> = runs.iter().map(|r| r.pixels.as_slice()).collect();
    let (reference, told) = match &plan.picture {
        Some((path, picture)) => (Reference::Picture(picture), path.display().to_string()),
        None => {
            let (members, told) = members(args, &names, &runs)?;
            (Reference::Pool(Pool::new(&pictures, members)), told)
        }
    };
    let (rows, ratios) = report::evaluate(&names, &runs, args.threads.max(1), &reference)?;
    Ok(Report {
        scene: plan.scene.display().to_string(),
        size: (first.width, first.height),
        max_depth: first.max_depth,
        threads: args.threads.max(1),
        rounds: args.rounds as usize,
        reference: told,
        notes,
        rows,
        ratios,
    })
}

fn plan(args: &Args) -> Result<Plan, String> {
    let preset = args.preset.as_ref();
    let named = preset.and_then(|p| p.reference).map(PathBuf::from);
    // With a pool or a size asked for, the preset's picture is not it.
    let named = named.filter(|_| args.reference_by.is_none() && args.size.is_none());
    let picture = match args.reference.clone().or(named) {
        Some(path) => Some((path.clone(), ReferencePicture::read(&path)?)),
        None => None,
    };
    let (mut variants, mut notes) = (Vec::new(), Vec::new());
    if args.variants.is_empty() {
        // A preset names what there is to compare; a build that lacks some of it compares the rest.
        for name in preset.map_or(&[][..], |p| p.variants) {
            let parsed = name.parse().and_then(|v: Variant| v.render_options(Budget::default()).map(|_| v));
            match parsed {
                Ok(v) => variants.push(v),
                Err(e) => notes.push(format!("{name} is left out: {e}")),
            }
        }
    } else {
        variants = args.variants.iter().map(|v| v.parse()).collect::<Result<_, _>>()?;
    }
    let reference_size = picture.as_ref().map(|(_, p)| (p.width, p.height));
    Ok(Plan {
        scene: args.scene.clone().or(preset.map(|p| p.scene.into())).unwrap_or_default(),
        picture,
        size: args.size.or(reference_size).or(preset.and_then(|p| p.size)),
        max_depth: args.max_depth.or(preset.map(|p| p.max_depth)),
        variants,
        notes,
    })
}

fn settings(args: &Args, plan: &Plan, variant: &Variant, scene: &Scene) -> Result<RenderSettings, String> {
    let spp = args.spp.or(if args.time.is_none() { Some(64) } else { None });
    let mut options = variant.render_options(Budget { spp, mpp: None, time_s: args.time })?;
    (options.size, options.max_depth, options.seed) = (plan.size, plan.max_depth, Some(args.seed));
    RenderSettings::resolve(&options, &scene.defaults).map_err(|e| format!("{}: {e}", variant.name))
}

/// Which renders are in the pool, and what to call it.
fn members(args: &Args, names: &[&str], runs: &[Run]) -> Result<(Vec<Option<usize>>, String), String> {
    let Some(by) = &args.reference_by else {
        let told = "the mean of all other renders, its variance taken off";
        return Ok((runs.iter().map(|r| Some(r.variant)).collect(), told.into()));
    };
    let only = names.iter().position(|n| n == by).ok_or_else(|| format!("{by} is not among the variants"))?;
    let in_pool = |r: &Run| (r.variant == only).then_some(only);
    Ok((runs.iter().map(in_pool).collect(), format!("the mean of the (other) renders of {by}, its variance taken off")))
}
