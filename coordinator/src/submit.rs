//! A submission: checked, stored, started.

use crate::convert;
use crate::farm::Farm;
use crate::hub::Hub;
use crate::job::{JobSpec, JobState};
use crate::store::{Change, received};
use renderer::integrator::IntegratorKind;
use renderer::job::RenderSettings;
use renderer::scene::bundle::{Digest, Manifest};
use std::sync::Arc;
use std::time::{SystemTime, UNIX_EPOCH};
use tonic::Status;

/// The longest manifest, in bytes, and the most files in it.
const MAX_MANIFEST: u64 = 64 << 20;
const MAX_FILES: usize = 1 << 17;
/// The longest settings, in bytes.
const MAX_SETTINGS: usize = 1 << 16;
/// The most lights that a scene may have.
const MAX_LIGHTS: u32 = 1 << 24;
/// Jobs that may be unfinished at a time.
const MAX_UNFINISHED: usize = 10_000;

/// Takes a job on; `true` when it was there already.
pub async fn submit(hub: &Arc<Hub>, r: proto::SubmitRequest) -> Result<bool, Status> {
    let id = convert::job_id(&r.job)?;
    if r.fingerprint != hub.fingerprint {
        return Err(Status::failed_precondition(format!(
            "the coordinator is {}, the caller {}; use the same version of lightfarm on both sides",
            hub.fingerprint,
            convert::name(&r.fingerprint)
        )));
    }
    let bad = |what: String| Status::invalid_argument(what);
    if r.settings.len() > MAX_SETTINGS {
        return Err(bad(format!("settings of {} bytes are too long", r.settings.len())));
    }
    let settings: RenderSettings =
        serde_json::from_str(&r.settings).map_err(|e| bad(format!("the settings can't be read: {e}")))?;
    settings.validate().map_err(|e| bad(e.to_string()))?;
    if !IntegratorKind::names().any(|n| n == settings.integrator.name()) {
        return Err(bad(format!(
            "{} makes no picture; it only helps to choose an integrator",
            settings.integrator.name()
        )));
    }
    if r.lights > MAX_LIGHTS {
        return Err(bad(format!("a scene with {} lights is too large; at most {MAX_LIGHTS} are taken", r.lights)));
    }
    let digest = convert::digest(&r.manifest)?;
    let (checker, checked) = (hub.clone(), digest);
    let manifest = tokio::task::spawn_blocking(move || manifest(&checker, checked));
    let manifest = manifest.await.map_err(|e| Status::internal(e.to_string()))??;

    let payload = payload(digest, &r);
    let _turn = hub.submitting.lock().await;
    if let Some(known) = hub.with(|farm, _| farm.job(id).map(|j| j.spec.payload)) {
        if known == payload {
            return Ok(true);
        }
        return Err(Status::already_exists(format!("job {id} exists with other content; submit under a new id")));
    }
    if hub.with(|farm, _| farm.jobs().values().filter(|j| !j.state.ended()).count()) >= MAX_UNFINISHED {
        return Err(Status::resource_exhausted(format!("{MAX_UNFINISHED} jobs are unfinished; no more are taken")));
    }
    let spec = JobSpec {
        name: convert::name(&r.name),
        priority: r.priority,
        manifest: digest,
        scene: manifest.digest(),
        settings,
        settings_json: r.settings,
        lights: r.lights,
        payload,
        submitted_ms: SystemTime::now().duration_since(UNIX_EPOCH).map_or(0, |d| d.as_millis() as u64),
    };
    received(hub.store.change(Change::Add(id, Arc::new(spec.clone()))))
        .await
        .map_err(|e| crate::grpc::store_status(&e))?;
    let job = Farm::new_job(id, spec, JobState::Active);
    let spec = job.spec.clone();
    tracing::info!(job = %id, name = spec.name, priority = spec.priority, "submitted");
    hub.with(|farm, _| farm.add_job(job));
    hub.merge.start(id, spec, None);
    Ok(false)
}

/// Names everything that a submission says.
fn payload(manifest: Digest, r: &proto::SubmitRequest) -> Digest {
    let mut hasher = blake3::Hasher::new();
    for field in [&manifest.0[..], r.settings.as_bytes(), &r.lights.to_le_bytes(), &r.priority.to_le_bytes()] {
        hasher.update(&(field.len() as u64).to_le_bytes());
        hasher.update(field);
    }
    Digest(*hasher.finalize().as_bytes())
}

/// Reads a scene's manifest; all its files must be here.
fn manifest(hub: &Hub, digest: Digest) -> Result<Manifest, Status> {
    let bytes = hub
        .blobs
        .read(digest, MAX_MANIFEST)
        .map_err(|e| Status::failed_precondition(format!("the scene's manifest is not here: {e}")))?;
    let manifest: Manifest = serde_json::from_slice(&bytes)
        .map_err(|e| Status::invalid_argument(format!("the scene's manifest can't be read: {e}")))?;
    if manifest.files.len() > MAX_FILES {
        return Err(Status::invalid_argument(format!("a scene of {} files is too large", manifest.files.len())));
    }
    if !manifest.files.iter().any(|f| f.path == manifest.root) {
        return Err(Status::invalid_argument("the scene's manifest does not list its main file"));
    }
    for f in &manifest.files {
        match hub.blobs.len_of(f.digest) {
            Some(len) if len == f.len => {}
            Some(len) => {
                let (path, said) = (convert::name(&f.path), f.len);
                return Err(Status::invalid_argument(format!(
                    "{path} has {len} bytes, not the {said} of the manifest"
                )));
            }
            None => {
                let path = convert::name(&f.path);
                return Err(Status::failed_precondition(format!("{path} has not been uploaded ({})", f.digest)));
            }
        }
    }
    Ok(manifest)
}
