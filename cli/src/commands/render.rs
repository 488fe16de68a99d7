//! `lightfarm render`: plan, render and merge in this process.

use crate::exit::{Failure, Outcome};
use crate::options::{OutputArgs, RenderArgs, ThreadArgs};
use crate::output::Console;
use crate::pictures::{Pictures, Summary};
use crate::preview::Preview;
use crate::progress::{Moment, Progress};
use crate::{scene_file, signals};
use renderer::job::{LocalEvent, LocalOptions, LocalOutcome, Merger, RenderSettings, Stop, UnitError, render_local};
use renderer::scene::Scene;
use std::path::PathBuf;
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
    let settings = RenderSettings::resolve(&args.render.to_options(), &loaded.scene.defaults)
        .map_err(|e| Failure::Input(format!("error: {e}")))?;
    let (manifest, _) = loaded.files.into_bundle(loaded.root);
    let options = LocalOptions { threads: args.threads.count() };
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
    let saved = pictures.save(&outcome.image, &settings.provenance(manifest.digest()))?;
    let summary = Summary::new(&outcome, &settings, manifest.digest(), seconds, &saved);
    let summary = summary.with_first_preview(preview.first());
    console.result(&summary, &summary);
    match saved.failure {
        Some(failure) => Err(failure),
        None if outcome.interrupted => Err(Failure::Interrupted),
        None => Ok(()),
    }
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
        let spp = if self.settings.budget.spp.is_some() { merger.fraction() } else { 0.0 };
        let fraction = if merger.finished() { 1.0 } else { spp.max(time).min(1.0) };
        let samples = merger.counters().samples;
        self.progress.show(&Moment { fraction, samples, pixels, error: preview.error() });
    }
}
