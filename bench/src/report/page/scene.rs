//! One scene of the page.

use super::super::document::{Curve, Document, Point, SceneReport};
use super::super::evaluate::OWN;
use super::super::truth::SHARE;
use super::plot::{Plot, Series};
use super::{colour, escape, notes, short, table, with_interval};
use crate::error::stats::Interval;
use std::fmt::Write;

/// Its section.
pub fn section(document: &Document, s: &SceneReport) -> String {
    let depth = if s.max_depth < 0 { "any number of".into() } else { format!("at most {}", s.max_depth) };
    let mut out = format!("<h2 id='{0}'>{0}</h2>", escape(&s.name));
    let _ = write!(
        out,
        "<p class='about'>{} · {} x {} pixels · paths of {depth} edges · {} threads · {} renders of each checkpoint{} · reference: {} \
         (its variance is a relMSE of {}){}</p>",
        escape(&s.file),
        s.size.0,
        s.size.1,
        s.threads,
        s.rounds,
        if s.cpu_clock { " · times are processor seconds over threads" } else { "" },
        escape(&s.reference.made_by),
        short(s.reference.relmse),
        s.reference.published.as_ref().map_or(String::new(), |p| format!(" · {}", escape(p)))
    );
    out += "<div class='plots'>";
    out += &figure(document, s, "relMSE against seconds", |p| p.relmse);
    out += &figure(document, s, "trimmed relMSE against seconds", |p| p.relmse_trimmed);
    out += "</div><details><summary>MAPE and FLIP against seconds</summary><div class='plots'>";
    out += &figure(document, s, "MAPE against seconds", |p| p.mape);
    out += &figure(document, s, "HDR-FLIP against seconds", |p| p.flip.unwrap_or(p.mape_unknown()));
    out += "</div></details>";
    out += &equal_error(s);
    out += &equal_time(s);
    out += &costs(s);
    out += &pictures(s);
    out += &notes(&s.notes);
    out + &checkpoints(s)
}

impl Point {
    fn mape_unknown(&self) -> Interval {
        Interval { value: f64::NAN, low: f64::NAN, high: f64::NAN }
    }
}

fn figure(document: &Document, s: &SceneReport, title: &str, y: fn(&Point) -> Interval) -> String {
    let series = |c: &Curve| Series {
        name: c.name.clone(),
        colour: colour(document, &c.name).into(),
        dashed: c.renderer != OWN,
        points: c
            .points
            .iter()
            .filter(|p| !p.rejected)
            .map(|p| (p.seconds.value, y(p).value, y(p).low, y(p).high))
            .collect(),
    };
    let name = title.split(" against").next().unwrap_or(title);
    let plot = Plot {
        x_label: if s.cpu_clock { "processor seconds / threads" } else { "seconds" }.into(),
        y_label: name.into(),
        series: s.curves.iter().map(series).collect(),
    };
    format!("<figure><figcaption>{title}</figcaption>{}</figure>", plot.svg())
}

fn equal_error(s: &SceneReport) -> String {
    let Some(by) = s.equal_error.first().map(|e| e.by.clone()) else { return String::new() };
    let mut rows = vec![
        ["time to the same error, over that of the best of lightfarm", "relMSE", "at relMSE", "trimmed relMSE"]
            .map(String::from)
            .to_vec(),
    ];
    for c in &s.curves {
        let of = |measure: &str| s.equal_error.iter().find(|e| e.name == c.name && e.measure == measure);
        let cell = |measure: &str| {
            of(measure).map_or("–".into(), |e| {
                let bound = match e.bound.as_str() {
                    ">=" => "≥ ",
                    "<=" => "≤ ",
                    _ => "",
                };
                format!("{bound}{}", with_interval(&e.ratio))
            })
        };
        let level = of("relMSE").map_or("–".into(), |e| short(e.error));
        rows.push(vec![escape(&c.name), cell("relMSE"), level, cell("trimmed relMSE")]);
    }
    format!("<h3>Equal error (best of lightfarm by relMSE: {})</h3>{}", escape(&by), table(&rows))
}

fn equal_time(s: &SceneReport) -> String {
    if s.equal_time.rows.is_empty() {
        return String::new();
    }
    let mut rows = vec![["", "relMSE", "trimmed relMSE", "MAPE", "HDR-FLIP"].map(String::from).to_vec()];
    for r in &s.equal_time.rows {
        let figures = [r.relmse, r.relmse_trimmed, r.mape, r.flip].map(short);
        rows.push([escape(&r.name)].into_iter().chain(figures).collect());
    }
    format!("<h3>Equal time: errors after {} s</h3>{}", short(s.equal_time.seconds), table(&rows))
}

fn costs(s: &SceneReport) -> String {
    let heads = [
        "",
        "efficiency 1 / (relMSE x core-seconds)",
        "ksamples/s",
        "slope",
        "mean / reference",
        "reading s",
        "warming up s",
        "MiB",
    ];
    let mut rows = vec![heads.map(String::from).to_vec()];
    let pixels = f64::from(s.size.0) * f64::from(s.size.1);
    for c in &s.curves {
        let Some(last) = c.points.iter().rfind(|p| !p.rejected).or(c.points.last()) else { continue };
        let optional = |v: Option<f64>| v.map_or("–".into(), short);
        let mark = if last.rejected { "–".into() } else { short(last.efficiency) };
        let rate = pixels * f64::from(last.count) / last.seconds.value / 1e3;
        rows.push(vec![
            escape(&c.name),
            mark,
            short(rate),
            c.slope.map_or("–".into(), |v| format!("{v:.2}")),
            with_interval(&last.mean_ratio),
            optional(c.load_s),
            optional(c.warmup_s),
            optional(c.peak_mib),
        ]);
    }
    let covers: std::collections::BTreeSet<String> =
        s.curves.iter().map(|c| format!("times of {} cover {}", c.renderer, c.covers)).collect();
    let covers: Vec<String> = covers.into_iter().collect();
    format!("<h3>Cost, at the last checkpoint</h3>{}{}", table(&rows), notes(&covers))
}

fn pictures(s: &SceneReport) -> String {
    let mut out = String::from("<h3>Pictures at about equal time</h3><div class='pictures'><div></div>");
    out += "<div class='head'>render</div><div class='head'>relative deviation over all renders</div><div class='head'>FLIP</div>";
    let image = |data: &str, what: &str| format!("<img alt='{what}' src='data:image/png;base64,{data}'>");
    for c in &s.curves {
        let Some(p) = &c.pictures else { continue };
        let _ = write!(
            out,
            "<div class='who'><b>{}</b><br>{} per pixel<br>{} s</div>",
            escape(&c.name),
            p.count,
            short(p.seconds)
        );
        out += &image(&p.render, "render");
        out += &image(&p.deviation, "deviation");
        out += &image(&p.flip, "FLIP");
    }
    let _ = write!(out, "<div class='who'><b>reference</b></div>{}", image(&s.reference.picture, "reference"));
    out += "<div class='about'><div class='ramp'></div>0 to 1; the deviation's square root is shown: 0.01 is a tenth of the way. Green \
            can't be compared.</div><div></div></div>";
    out
}

fn checkpoints(s: &SceneReport) -> String {
    let heads = ["", "per pixel", "s", "CPU s", "MSE", "relMSE", "trimmed", "MAPE", "HDR-FLIP", "reference's share"];
    let mut rows = vec![heads.map(String::from).to_vec()];
    for c in &s.curves {
        for p in &c.points {
            let share = format!("{:.1} %{}", 100.0 * p.reference_share, if p.rejected { " (rejected)" } else { "" });
            let figures = [Some(p.mse), Some(p.relmse), Some(p.relmse_trimmed), Some(p.mape), p.flip];
            let mut row = vec![
                escape(&c.name),
                p.count.to_string(),
                short(p.seconds.value),
                p.cpu_seconds.map_or("–".into(), short),
            ];
            row.extend(figures.map(|f| f.map_or("–".into(), |i| with_interval(&i))));
            row.push(share);
            rows.push(row);
        }
    }
    let limit = 100.0 * SHARE;
    format!(
        "<details><summary>All checkpoints (rejected where the reference's variance is above {limit:.0} % of relMSE)</summary>{}</details>",
        table(&rows)
    )
}
