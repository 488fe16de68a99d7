//! How cost grows: a plot and a table each.

use super::super::document::Growth;
use super::plot::{Plot, Series};
use super::{escape, notes, short, table, with_interval};
use std::fmt::Write;

/// Its section.
pub fn section(all: &[Growth]) -> String {
    if all.is_empty() {
        return String::new();
    }
    let mut out = String::from(
        "<h2 id='growth'>Growth of cost</h2><p>Medians of interleaved runs, with the least and the greatest in brackets; exponents by \
         least squares of the logarithms over the upper half of the range, with 95 % intervals.</p><div class='plots'>",
    );
    for g in all {
        let exponent = g.exponent.map_or(String::new(), |e| format!("; exponent {}", with_interval(&e)));
        let _ = write!(out, "<figure><figcaption>{}{exponent}</figcaption>", escape(&g.name));
        let points = g.rows.iter().map(|r| (r.x, r.cost.value, r.cost.low, r.cost.high)).collect();
        let series = Series { name: String::new(), colour: "#1f77b4".into(), dashed: false, points };
        let plot = Plot { x_label: g.name.clone(), y_label: g.unit.clone(), series: vec![series] };
        // One curve needs no legend.
        out += plot.svg().split("<div class='legend'>").next().unwrap_or_default();
        let _ = write!(out, "<p class='soft'>{}</p>", escape(&g.about));
        let more = g.rows.first().map_or(Vec::new(), |r| r.more.iter().map(|(n, _)| escape(n)).collect());
        let mut rows = vec![[escape(&g.name), escape(&g.unit)].into_iter().chain(more).collect::<Vec<_>>()];
        for r in &g.rows {
            let own = [short_count(r.x), with_interval(&r.cost)];
            rows.push(own.into_iter().chain(r.more.iter().map(|(_, v)| short(*v))).collect());
        }
        out += &table(&rows);
        out += &notes(&g.notes);
        out += "</figure>";
    }
    out + "</div>"
}

/// Whole numbers are written out.
fn short_count(x: f64) -> String {
    if x.fract() == 0.0 { format!("{x:.0}") } else { short(x) }
}
