//! Messages for scripts and web pages.

use crate::{JobDetail, JobState, JobStatus, WorkerStatus};
use serde_json::{Value, json};

/// A job state's name.
pub fn state_name(state: JobState) -> &'static str {
    match state {
        JobState::Unspecified => "unknown",
        JobState::Restoring => "restoring",
        JobState::Active => "active",
        JobState::Paused => "paused",
        JobState::Done => "done",
        JobState::Failed => "failed",
        JobState::Cancelled => "cancelled",
    }
}

/// A job's status.
pub fn job(s: &JobStatus) -> Value {
    json!({
        "id": s.id, "name": s.name, "state": state_name(s.state()), "priority": s.priority,
        "integrator": s.integrator, "width": s.width, "height": s.height, "scene": s.scene,
        "pass": s.pass, "units": s.units, "units_stored": s.units_stored, "units_folded": s.units_folded,
        "fraction": s.fraction, "spp_done": s.spp_done, "samples": s.samples, "rays": s.rays,
        "non_finite": s.non_finite, "negative": s.negative,
        "relative_error": s.error, "relative_error_upper95": s.error_upper,
        "seconds": s.seconds, "seconds_left": s.seconds_left, "samples_per_s": s.rate,
        "submitted_unix_ms": s.submitted_unix_ms, "workers": s.workers, "message": s.message,
        "chosen": s.chosen, "chosen_because": s.chosen_because,
    })
}

/// A job in detail.
pub fn detail(d: &JobDetail) -> Value {
    let workers: Vec<Value> = d
        .workers
        .iter()
        .map(|w| {
            json!({
                "name": w.name, "held_units": w.held_units, "units": w.units, "failures": w.failures,
                "blocked": w.blocked,
            })
        })
        .collect();
    let mut value = d.status.as_ref().map_or_else(|| json!({}), job);
    value["settings"] = serde_json::from_str(&d.settings).unwrap_or_default();
    value["workers"] = workers.into();
    value["attention"] = d.attention.clone().into();
    value["stored_bytes"] = d.stored_bytes.into();
    value
}

/// A worker.
pub fn worker(w: &WorkerStatus) -> Value {
    json!({
        "name": w.name, "id": w.id, "threads": w.threads, "state": w.state, "held_units": w.held_units,
        "units": w.units, "busy_seconds": w.busy_seconds, "silent_seconds": w.silent_seconds,
        "failures": w.failures, "losses": w.losses, "message": w.message, "address": w.address, "jobs": w.jobs,
    })
}
