//! `lightfarm submit`: hands a scene to a farm.

use crate::exit::{Failure, Outcome};
use crate::farm::watch::{verdict, watch};
use crate::farm::{Farm, FarmArgs, picture, upload};
use crate::options::{OutputArgs, RenderArgs};
use crate::output::Console;
use crate::{save, scene_file, signals};
use renderer::job::Stop;
use std::path::PathBuf;
use uuid::Uuid;

/// What to submit.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// The scene: .gltf, .glb, .toml or .xml
    scene: PathBuf,
    #[command(flatten)]
    render: RenderArgs,
    #[command(flatten)]
    farm: FarmArgs,
    /// Jobs of higher priority go first
    #[arg(long, value_name = "N", default_value_t = 0, allow_negative_numbers = true)]
    priority: i32,
    /// Wait for the end, then fetch the image
    #[arg(long)]
    wait: bool,
    /// Name the job: submitting again under the same id is the same job
    #[arg(long, value_name = "UUID")]
    id: Option<Uuid>,
    #[command(flatten)]
    output: OutputArgs,
}

static STOP: Stop = Stop::new();

/// Runs it.
pub fn run(args: Args, console: &Console) -> Outcome {
    let wait = args.wait || args.output.output.is_some();
    if wait {
        let (exr, png) = args.output.paths(&args.scene)?;
        save::check(&exr)?;
        save::check(&png)?;
    }
    let farm = Farm::open(&args.farm)?;
    let loaded = scene_file::load(&args.scene, console)?;
    let settings = args.render.resolve(&loaded.scene.defaults)?;
    let lights = u32::try_from(loaded.scene.light_count()).unwrap_or(u32::MAX);
    drop(loaded.scene);
    let (manifest, blobs) = loaded.files.into_bundle(loaded.root);
    let (digest, sent) = upload::upload(&farm, &manifest, blobs)?;
    let id = args.id.unwrap_or_else(Uuid::new_v4);
    let name = args.scene.file_stem().unwrap_or_default().to_string_lossy().into_owned();
    let settings = serde_json::to_string(&settings).map_err(|e| Failure::Input(format!("error: {e}")))?;
    let request = proto::SubmitRequest {
        job: bytes::Bytes::copy_from_slice(id.as_bytes()),
        name,
        manifest: bytes::Bytes::copy_from_slice(&digest.0),
        settings,
        lights,
        priority: args.priority,
        fingerprint: renderer::FINGERPRINT.into(),
    };
    // The same id every time: should the answer get lost, the job is not submitted twice.
    let answer = farm.call(|mut jobs| {
        let request = request.clone();
        async move { jobs.submit(request).await }
    })?;
    console.result(
        id,
        &serde_json::json!({
            "event": "submitted", "id": id.to_string(), "existed": answer.existed, "scene": manifest.digest(),
            "files_sent": sent.files, "bytes_sent": sent.bytes,
        }),
    );
    if !wait {
        return Ok(());
    }
    signals::stop_on_interrupt(&STOP).map_err(|e| Failure::Machine(format!("error: {e}")))?;
    let status = watch(&farm, &id.to_string(), console, || STOP.stopped()).inspect_err(|e| {
        if *e == Failure::Interrupted {
            console.note(format!("the job goes on; see: lightfarm watch {id}"));
        }
    })?;
    verdict(&status)?;
    super::fetch::save(&picture::fetch(&farm, &id.to_string())?, &args.output, console)
}
