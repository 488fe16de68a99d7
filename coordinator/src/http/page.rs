//! The page: plain HTML that loads itself again.

use proto::json::state_name;
use proto::{JobState, JobStatus, WorkerStatus};
use renderer::integrator::IntegratorKind;
use std::fmt::Write;

const STYLE: &str = "body{font:15px/1.5 system-ui,sans-serif;margin:2rem;color:#222;background:#fafafa}\
table{border-collapse:collapse;margin:1rem 0}td,th{padding:.3rem .8rem;text-align:left;border-bottom:1px solid #ddd;vertical-align:top}\
th{font-weight:600}img{max-width:20rem;max-height:12rem;display:block}progress{width:10rem}.n{text-align:right}\
small{color:#777}.bad{color:#a00;max-width:40rem}";

/// The page. `query` is that of its own address: it may carry the token, which the previews need too.
pub fn render(jobs: &[JobStatus], workers: &[WorkerStatus], query: &str) -> String {
    let mut page = format!(
        "<!doctype html><html lang=en><meta charset=utf-8><meta http-equiv=refresh content=4>\
         <meta name=viewport content=\"width=device-width\"><title>lightfarm</title><style>{STYLE}</style><h1>lightfarm</h1>"
    );
    page += "<h2>Jobs</h2><table><tr><th>Preview<th>Job<th>State<th>Done<th>Per pixel<th>Error<th>Workers<th>Time";
    jobs.iter().for_each(|j| job(&mut page, j, query));
    if jobs.is_empty() {
        page += "<tr><td colspan=8>none; submit one with <code>lightfarm submit SCENE --coordinator URL</code>";
    }
    page += "</table><h2>Workers</h2><table><tr><th>Name<th>State<th>Threads<th>Units<th>Holds<th>Failures<th>Heard<th>Address";
    workers.iter().for_each(|w| worker(&mut page, w));
    if workers.is_empty() {
        page += "<tr><td colspan=8>none; start one with <code>lightfarm worker --coordinator URL</code>";
    }
    page += "</table></html>";
    page
}

fn job(page: &mut String, s: &JobStatus, query: &str) {
    let link = if query.is_empty() { String::new() } else { format!("?{}", escape(query)) };
    let (id, name, state) = (escape(&s.id), escape(&s.name), state_name(s.state()));
    let shown = s.samples > 0 && !matches!(s.state(), JobState::Failed | JobState::Cancelled);
    let image = if shown { format!("<img src=\"/jobs/{id}/preview.png{link}\" alt=\"\">") } else { String::new() };
    let per_pixel = s.samples as f64 / (f64::from(s.width) * f64::from(s.height)).max(1.0);
    let samples = rendered_by(s).parse().map_or("samples", IntegratorKind::sample_name);
    let integrator = if s.chosen.is_empty() { s.integrator.clone() } else { format!("{}: {}", s.integrator, s.chosen) };
    let error = s.error.map_or_else(String::new, |e| format!("{e:.4}"));
    let left = s.seconds_left.map_or_else(String::new, |t| format!("<br><small>{t:.0} s left</small>"));
    let message = match s.message.as_str() {
        "" => String::new(),
        m => format!("<div class=bad>{}</div>", escape(m)),
    };
    // Writing to a string can't fail.
    let _ = write!(
        page,
        "<tr><td>{image}<td>{name}<br><small>{id}<br>{} x {}, {}, priority {}</small>{message}<td>{state}\
         <td><progress max=1 value={:.4}></progress> {:.0} %{left}<td class=n>{per_pixel:.1}<br><small>{samples}</small><td class=n>{error}\
         <td class=n>{}<td class=n>{:.0} s",
        s.width,
        s.height,
        escape(&integrator),
        s.priority,
        s.fraction,
        100.0 * s.fraction,
        s.workers,
        s.seconds
    );
}

/// The integrator that renders.
fn rendered_by(s: &JobStatus) -> &str {
    if s.chosen.is_empty() { &s.integrator } else { &s.chosen }
}

fn worker(page: &mut String, w: &WorkerStatus) {
    let message = match w.message.as_str() {
        "" => String::new(),
        m => format!("<div class=bad>{}</div>", escape(m)),
    };
    let _ = write!(
        page,
        "<tr><td>{}{message}<td>{}<td class=n>{}<td class=n>{}<td class=n>{}<td class=n>{}<td class=n>{:.0} s ago<td>{}",
        escape(&w.name),
        escape(&w.state),
        w.threads,
        w.units,
        w.held_units,
        w.failures,
        w.silent_seconds,
        escape(&w.address)
    );
}

/// Text as HTML, in attributes too.
fn escape(text: &str) -> String {
    let mut out = String::with_capacity(text.len());
    for c in text.chars() {
        match c {
            '&' => out.push_str("&amp;"),
            '<' => out.push_str("&lt;"),
            '>' => out.push_str("&gt;"),
            '"' => out.push_str("&quot;"),
            '\'' => out.push_str("&#39;"),
            c => out.push(c),
        }
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn jobs_of_chains_tell_of_mutations() {
        let page = |integrator: &str| {
            let s =
                JobStatus { samples: 1640, width: 10, height: 10, integrator: integrator.into(), ..Default::default() };
            render(&[s], &[], "")
        };
        assert!(page("path").contains("16.4<br><small>samples</small>"));
        assert!(page("mmlt").contains("16.4<br><small>samples and mutations</small>"));
    }

    #[test]
    fn names_and_messages_can_not_break_out() {
        let evil = "<script>\"'&";
        let s = JobStatus { id: "x".into(), name: evil.into(), message: evil.into(), samples: 1, ..Default::default() };
        let w = WorkerStatus { name: evil.into(), message: evil.into(), address: evil.into(), ..Default::default() };
        let page = render(&[s], &[w], "token=\"><script>");
        assert!(!page.contains("<script>"), "{page}");
        assert_eq!(page.matches("&lt;script&gt;&quot;&#39;&amp;").count(), 5);
    }
}
