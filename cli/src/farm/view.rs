//! Jobs and workers as text.

use crate::progress::{duration, quantity};
use proto::json::state_name;
use proto::{JobDetail, JobState, JobStatus, WorkerStatus};
use renderer::integrator::IntegratorKind;
use std::time::{SystemTime, UNIX_EPOCH};

/// Rows with aligned columns; the last column is not padded.
pub fn table(rows: &[Vec<String>]) -> String {
    let columns = rows.iter().map(Vec::len).max().unwrap_or(0);
    let width = |c: usize| rows.iter().filter_map(|r| r.get(c)).map(|t| t.chars().count()).max().unwrap_or(0);
    let widths: Vec<usize> = (0..columns).map(width).collect();
    let line = |row: &Vec<String>| {
        let cells = row.iter().enumerate().map(|(c, text)| format!("{text:<w$}", w = widths[c]));
        cells.collect::<Vec<_>>().join("  ").trim_end().to_string()
    };
    rows.iter().map(line).collect::<Vec<_>>().join("\n")
}

fn row<const N: usize>(cells: [&str; N]) -> Vec<String> {
    cells.map(String::from).to_vec()
}

/// `lightfarm jobs`.
pub fn jobs(list: &[JobStatus]) -> String {
    let mut rows = vec![row(["ID", "NAME", "STATE", "PRIORITY", "DONE", "PER PIXEL", "WORKERS", "TIME", "SUBMITTED"])];
    for s in list {
        rows.push(vec![
            s.id.clone(),
            s.name.clone(),
            state_name(s.state()).into(),
            s.priority.to_string(),
            format!("{:.0} %", 100.0 * s.fraction),
            samples(s),
            s.workers.to_string(),
            duration(s.seconds),
            ago(s.submitted_unix_ms),
        ]);
    }
    table(&rows)
}

/// `lightfarm workers`.
pub fn workers(list: &[WorkerStatus]) -> String {
    let mut rows = vec![row(["NAME", "STATE", "THREADS", "UNITS", "HELD", "BUSY", "FAILURES", "HEARD", "ADDRESS"])];
    for w in list {
        rows.push(vec![
            w.name.clone(),
            w.state.clone(),
            w.threads.to_string(),
            w.units.to_string(),
            w.held_units.to_string(),
            duration(w.busy_seconds),
            w.failures.to_string(),
            format!("{} ago", duration(w.silent_seconds)),
            w.address.clone(),
        ]);
        if !w.message.is_empty() {
            rows.push(vec![String::new(), w.message.clone()]);
        }
    }
    table(&rows)
}

/// `lightfarm show`.
pub fn detail(d: &JobDetail) -> String {
    let Some(s) = &d.status else { return String::new() };
    let mut lines = vec![format!("{}  {}", s.id, s.name), format!("state       {}", state_line(s))];
    lines.push(format!("image       {} x {}, {}", s.width, s.height, s.integrator));
    if !s.chosen.is_empty() {
        lines.push(format!("chosen      {}: {}", s.chosen, s.chosen_because));
    }
    lines.push(format!("sampling    {} per pixel, {} rays", samples(s), quantity(s.rays as f64).trim()));
    if s.units > 0 {
        lines.push(format!(
            "pass        {}: {} of {} units stored, {} merged",
            s.pass, s.units_stored, s.units, s.units_folded
        ));
    }
    if let (Some(e), Some(upper)) = (s.error, s.error_upper) {
        lines.push(format!("error       {e:.4} relative (below {upper:.4} at 95 %)"));
    }
    lines.push(format!("dropped     {} not finite, {} negative", s.non_finite, s.negative));
    lines.push(format!("priority    {}", s.priority));
    lines.push(format!("submitted   {}", ago(s.submitted_unix_ms)));
    lines.push(format!("scene       {}", s.scene));
    lines.push(format!("settings    {}", d.settings));
    lines.push(format!("stored      {} bytes", d.stored_bytes));
    let mut rows = vec![row(["WORKER", "UNITS", "HELD", "FAILURES", ""])];
    rows.extend(d.workers.iter().map(|w| {
        let counts = [w.units, u64::from(w.held_units), u64::from(w.failures)].map(|n| n.to_string());
        std::iter::once(w.name.clone()).chain(counts).chain([w.blocked.clone()]).collect()
    }));
    lines.push(table(&rows));
    lines.extend(d.attention.iter().map(|a| format!("! {a}")));
    lines.join("\n")
}

/// One line on how far a job is.
pub fn state_line(s: &JobStatus) -> String {
    let mut text = format!("{}, {:.0} %, {} per pixel", state_name(s.state()), 100.0 * s.fraction, samples(s));
    if s.state() == JobState::Active {
        text += &format!(", {} per second on {} workers", quantity(s.rate), s.workers);
        if let Some(left) = s.seconds_left {
            text += &format!(", {} left", duration(left));
        }
    }
    if let Some(e) = s.error {
        text += &format!(", relative error {e:.4}");
    }
    if !s.message.is_empty() {
        text += &format!(": {}", s.message);
    }
    text
}

/// How many samples each pixel has, and of which kind.
pub fn samples(s: &JobStatus) -> String {
    let per_pixel = s.samples as f64 / (f64::from(s.width) * f64::from(s.height)).max(1.0);
    let integrator = if s.chosen.is_empty() { &s.integrator } else { &s.chosen };
    format!("{per_pixel:.1} {}", integrator.parse().map_or("samples", IntegratorKind::sample_name))
}

fn ago(unix_ms: u64) -> String {
    let now = SystemTime::now().duration_since(UNIX_EPOCH).map_or(0, |d| d.as_millis() as u64);
    format!("{} ago", duration(now.saturating_sub(unix_ms) as f64 / 1e3))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn columns_line_up() {
        let text = table(&[row(["A", "LONG", "x"]), row(["abc", "d", ""])]);
        assert_eq!(text, "A    LONG  x\nabc  d");
    }

    #[test]
    fn jobs_of_chains_tell_of_mutations() {
        let job = |kind: IntegratorKind| JobStatus {
            width: 10,
            height: 10,
            samples: 1640,
            integrator: kind.name().into(),
            ..Default::default()
        };
        let text = jobs(&[job(IntegratorKind::Path), job(IntegratorKind::Mmlt)]);
        let lines: Vec<&str> = text.lines().collect();
        assert!(lines[0].contains("PER PIXEL") && !text.to_lowercase().contains("spp"), "{text}");
        assert!(lines[1].contains("16.4 samples  ") && lines[2].contains("16.4 samples and mutations  "), "{text}");
        assert!(state_line(&job(IntegratorKind::Mmlt)).contains("16.4 samples and mutations per pixel"));
    }

    #[test]
    fn a_waiting_job_says_why() {
        let s = JobStatus {
            state: JobState::Active.into(),
            width: 10,
            height: 10,
            samples: 250,
            fraction: 0.25,
            message: "no worker is connected".into(),
            ..Default::default()
        };
        assert_eq!(
            state_line(&s),
            "active, 25 %, 2.5 samples per pixel, 0.00 per second on 0 workers: no worker is connected"
        );
    }
}
