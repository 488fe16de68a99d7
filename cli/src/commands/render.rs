//! `lightfarm render`: plan, render and merge in this process.

use crate::exit::{Failure, Outcome};
use crate::options::{OutputArgs, RenderArgs, ThreadArgs};
use crate::output::Console;
use crate::pictures::{Pictures, Summary};
use crate::preview::Preview;
use crate::progress::{Moment, Progress};
use crate::{save, scene_file, signals};
use renderer::film::png;
use renderer::integrator::IntegratorKind;
use renderer::job::{
    LocalEvent, LocalOptions, LocalOutcome, Merger, RenderSettings, Stop, UnitError, render_local, render_strategies,
};
use renderer::scene::Scene;
use std::path::{Path, PathBuf};
use std::time::Instant;

/// What to render and where to put it.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// The scene: .gltf, .glb, .toml or .xml
    scene: PathBuf,
    #[command(flatten)]
    render: RenderArgs,
    #[command(flatten)]
    threads: ThreadArgs,
    #[command(flatten)]
    output: OutputArgs,
    /// For debugging bdpt: also write what each strategy (s, t) makes, with and without its weight, as strategies.png and
    /// strategies-unweighted.png into this folder: a row for each path length from 2 edges, a column for each s from 0
    #[arg(long, value_name = "FOLDER")]
    strategies: Option<PathBuf>,
}

static STOP: Stop = Stop::new();

/// Runs it.
pub fn run(args: Args, console: &Console) -> Outcome {
    let started = Instant::now();
    signals::stop_on_interrupt(&STOP)
        .map_err(|e| Failure::Machine(format!("error: the handlers of signals can't be installed: {e}")))?;
    let pictures = Pictures::new(&args.output, &args.scene)?;
    pictures.check()?;
    let loaded = scene_file::load(&args.scene, console)?;
    let settings = args.render.resolve(&loaded.scene.defaults)?;
    let (manifest, _) = loaded.files.into_bundle(loaded.root);
    let options = LocalOptions { threads: args.threads.count() };
    if let Some(folder) = &args.strategies {
        write_strategies(folder, &loaded.scene, &settings, options.threads, pictures.exposure, console)?;
    }
    let mut session = Session { progress: Progress::new(console), settings: &settings };
    let mut preview = Preview::new(pictures.png.clone(), pictures.exposure, started);
    let outcome = session.render(&loaded.scene, &options, &mut preview);
    session.progress.finish();
    let seconds = session.progress.seconds();
    let outcome = outcome.map_err(|e| Failure::Machine(format!("error: {e}")))?;
    if outcome.image.counters.samples == 0 {
        console.note("nothing was finished: no picture is written");
        return Err(Failure::Interrupted);
    }
    let saved = pictures.save(&outcome.image, &settings.provenance(manifest.digest(), outcome.choice.as_ref()))?;
    let about = (manifest.digest(), &loaded.scene.features);
    let summary = Summary::new(&outcome, &settings, about, seconds, &saved);
    let summary = summary.with_first_preview(preview.first());
    console.result(&summary, &summary);
    match saved.failure {
        Some(failure) => Err(failure),
        None if outcome.interrupted => Err(Failure::Interrupted),
        None => Ok(()),
    }
}

/// Samples per pixel of the strategies' pictures, where the job does not say.
const STRATEGY_SAMPLES: u32 = 64;

/// Renders and writes the pictures of the strategies.
fn write_strategies(
    folder: &Path,
    scene: &Scene,
    settings: &RenderSettings,
    threads: usize,
    exposure: f64,
    console: &Console,
) -> Outcome {
    if settings.integrator != IntegratorKind::Bdpt {
        return Err(Failure::Usage("error: --strategies shows those of bdpt; give --integrator bdpt".into()));
    }
    std::fs::create_dir_all(folder).map_err(|e| save::failure(folder, &e))?;
    let spp = settings.budget.spp.unwrap_or(STRATEGY_SAMPLES);
    let Some(pictures) = render_strategies(scene, settings, spp, threads, &STOP) else {
        return Err(Failure::Interrupted);
    };
    for (name, weighted) in [("strategies.png", true), ("strategies-unweighted.png", false)] {
        let path = folder.join(name);
        let (width, height, pixels) = pictures.pyramid(weighted);
        let bytes = png::encode_pixels(width, height, &pixels, exposure)
            .map_err(|e| Failure::Machine(format!("error: {}: {e}", path.display())))?;
        save::write(&path, &bytes).map_err(|e| save::failure(&path, &e))?;
        console.note(path.display());
    }
    Ok(())
}

/// A render with progress and previews.
struct Session<'a> {
    progress: Progress,
    settings: &'a RenderSettings,
}

impl Session<'_> {
    fn render(
        &mut self,
        scene: &Scene,
        options: &LocalOptions,
        preview: &mut Preview,
    ) -> Result<LocalOutcome, UnitError> {
        render_local(scene, self.settings, options, &STOP, &mut |event| {
            let (LocalEvent::Progress(merger) | LocalEvent::PassDone(merger)) = event;
            if let Err(e) = preview.update(merger) {
                self.progress.note(&format!("warning: no preview: {e}"));
            }
            self.show(merger, preview);
        })
    }

    fn show(&mut self, merger: &Merger, preview: &Preview) {
        let pixels = u64::from(self.settings.width) * u64::from(self.settings.height);
        // Of several budgets, the one that is nearest to its end tells how far the job is.
        let time = self.settings.budget.time_s.map_or(0.0, |t| self.progress.seconds() / t);
        let counted = self.settings.budget.spp.or(self.settings.budget.mpp).is_some();
        let count = if counted { merger.fraction() } else { 0.0 };
        let fraction = if merger.finished() { 1.0 } else { count.max(time).min(1.0) };
        let samples = merger.counters().samples;
        let samples_name = merger.integrator().sample_name();
        self.progress.show(&Moment { fraction, samples, samples_name, pixels, error: preview.error() });
    }
}
