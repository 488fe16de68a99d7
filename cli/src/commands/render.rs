//! `lightfarm render`: plan, render and merge in this process.

use crate::exit::{Failure, Outcome};
use crate::options::{OutputArgs, RenderArgs, ThreadArgs};
use crate::output::Console;
use crate::scene_file;
use crate::signals;
use renderer::job::{LocalOptions, RenderSettings, Stop, render_local};
use std::path::PathBuf;

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
    let (exr, png) = args.output.paths(&args.scene)?;
    signals::stop_on_interrupt(&STOP)
        .map_err(|e| Failure::Machine(format!("the handlers of signals can't be installed: {e}")))?;
    let loaded = scene_file::load(&args.scene, console)?;
    let settings = RenderSettings::resolve(&args.render.to_options(), &loaded.scene.defaults)
        .map_err(|e| Failure::Input(e.to_string()))?;
    let (manifest, _) = loaded.files.into_bundle(loaded.root);
    let options = LocalOptions { threads: args.threads.count() };
    let outcome = render_local(&loaded.scene, &settings, &options, &STOP, &mut |_| {})
        .map_err(|e| Failure::Machine(e.to_string()))?;
    console.result(
        format!("{} x {} pixels: {}, {}", settings.width, settings.height, exr.display(), png.display()),
        &serde_json::json!({"event": "done", "scene": manifest.digest(), "exr": exr, "png": png}),
    );
    if outcome.interrupted { Err(Failure::Interrupted) } else { Ok(()) }
}
