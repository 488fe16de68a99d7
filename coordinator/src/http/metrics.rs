//! Metrics in Prometheus' text format.

use crate::farm::Farm;
use crate::hub::Hub;
use crate::job::JobState;
use std::collections::BTreeMap;
use std::fmt::Write;

/// Everything that is measured.
pub fn render(hub: &Hub) -> String {
    let mut text = hub.with(|farm, _| of_farm(farm));
    let free = hub.budget.available_permits() * 1024;
    gauge(&mut text, "lightfarm_result_budget_free_bytes", "Memory left for results on their way to the disk", free);
    let _ = writeln!(
        text,
        "# HELP lightfarm_build_info The build, as a label\n# TYPE lightfarm_build_info gauge\n\
         lightfarm_build_info{{fingerprint=\"{}\"}} 1",
        hub.fingerprint
    );
    text
}

fn of_farm(farm: &Farm) -> String {
    let mut text = String::new();
    let mut jobs: BTreeMap<&str, usize> =
        ["active", "paused", "done", "failed", "cancelled"].into_iter().map(|s| (s, 0)).collect();
    let (mut free, mut leased) = (0u64, 0u64);
    for job in farm.jobs().values() {
        *jobs.entry(job.state.name()).or_default() += 1;
        if let Some(pass) = job.pass.as_ref().filter(|_| job.state == JobState::Active) {
            free += u64::from(pass.board.free().len());
            leased += pass.board.leases().map(|(_, l)| u64::from(l.units.len())).sum::<u64>();
        }
    }
    let mut workers: BTreeMap<&str, usize> =
        ["ready", "draining", "quarantined", "lost", "left"].into_iter().map(|s| (s, 0)).collect();
    farm.workers().values().for_each(|w| *workers.entry(w.state_name()).or_default() += 1);
    labelled(&mut text, "lightfarm_jobs", "Jobs by state", &jobs);
    labelled(&mut text, "lightfarm_workers", "Workers by state", &workers);
    gauge(&mut text, "lightfarm_units_free", "Units of active jobs that nobody works on", free);
    gauge(&mut text, "lightfarm_units_leased", "Units held by workers, those held twice counted twice", leased);
    let t = farm.totals();
    counter(&mut text, "lightfarm_units_accepted_total", "Units accepted since the start", t.accepted);
    counter(&mut text, "lightfarm_unit_failures_total", "Units that failed since the start", t.failures);
    counter(&mut text, "lightfarm_leases_lost_total", "Leases lost with their worker since the start", t.losses);
    counter(&mut text, "lightfarm_leases_granted_total", "Leases given out since the start", t.leases);
    counter(&mut text, "lightfarm_compute_seconds_total", "Compute time of accepted units since the start", t.seconds);
    text
}

fn head(text: &mut String, name: &str, help: &str, kind: &str) {
    // Writing to a string can't fail.
    let _ = writeln!(text, "# HELP {name} {help}\n# TYPE {name} {kind}");
}

fn gauge(text: &mut String, name: &str, help: &str, value: impl std::fmt::Display) {
    head(text, name, help, "gauge");
    let _ = writeln!(text, "{name} {value}");
}

fn counter(text: &mut String, name: &str, help: &str, value: impl std::fmt::Display) {
    head(text, name, help, "counter");
    let _ = writeln!(text, "{name} {value}");
}

fn labelled(text: &mut String, name: &str, help: &str, values: &BTreeMap<&str, usize>) {
    head(text, name, help, "gauge");
    for (state, n) in values {
        let _ = writeln!(text, "{name}{{state=\"{state}\"}} {n}");
    }
}
