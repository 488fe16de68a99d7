//! The page for people: one HTML file that needs nothing else.

mod growth;
mod plot;
mod scene;
mod summary;

use super::document::Document;
use crate::error::stats::Interval;
use std::fmt::Write;

/// Makes text safe between tags and in attributes.
fn escape(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;").replace('"', "&quot;").replace('\'', "&#39;")
}

/// A number with three significant digits.
fn short(x: f64) -> String {
    match x.abs() {
        _ if !x.is_finite() => "–".into(),
        0.0 => "0".into(),
        a if !(1e-4..1e5).contains(&a) => format!("{x:.2e}"),
        a if a >= 99.95 => format!("{x:.0}"),
        a if a >= 9.995 => format!("{x:.1}"),
        a if a >= 0.9995 => format!("{x:.2}"),
        a if a >= 0.09995 => format!("{x:.3}"),
        a if a >= 0.009_995 => format!("{x:.4}"),
        a if a >= 0.000_999_5 => format!("{x:.5}"),
        _ => format!("{x:.6}"),
    }
}

/// A value with its interval in small print.
fn with_interval(i: &Interval) -> String {
    if i.low.is_finite() && i.high.is_finite() {
        format!("{} <small>[{}, {}]</small>", short(i.value), short(i.low), short(i.high))
    } else {
        short(i.value)
    }
}

/// A table of cells that are HTML already; the first row is the head.
fn table(rows: &[Vec<String>]) -> String {
    let mut out = String::from("<div class='scroll'><table>");
    for (i, row) in rows.iter().enumerate() {
        let tag = if i == 0 { "th" } else { "td" };
        out += "<tr>";
        for cell in row {
            // A cell may bring its own tag, for its class.
            if cell.starts_with("<td") {
                out += cell;
            } else {
                let _ = write!(out, "<{tag}>{cell}</{tag}>");
            }
        }
        out += "</tr>";
    }
    out + "</table></div>"
}

fn notes(list: &[String]) -> String {
    if list.is_empty() {
        return String::new();
    }
    let items: String = list.iter().map(|n| format!("<li>{}</li>", escape(n))).collect();
    format!("<ul class='notes'>{items}</ul>")
}

/// Colours for the integrators of lightfarm and for other renderers, in the order in which they come.
const OWN: [&str; 5] = ["#1f77b4", "#2ca02c", "#d62728", "#9467bd", "#17becf"];
const OTHER: [&str; 6] = ["#ff7f0e", "#8c564b", "#e377c2", "#7f7f7f", "#bcbd22", "#393b79"];

/// The colour of a contender, the same on the whole page.
fn colour(document: &Document, name: &str) -> &'static str {
    let (mut own, mut other): (Vec<&str>, Vec<&str>) = (Vec::new(), Vec::new());
    for c in document.scenes.iter().flat_map(|s| &s.curves) {
        let list = if c.renderer == super::evaluate::OWN { &mut own } else { &mut other };
        if !list.contains(&c.name.as_str()) {
            list.push(&c.name);
        }
    }
    let of = |list: &[&str], colours: &[&'static str]| {
        list.iter().position(|n| *n == name).map(|i| colours[i % colours.len()])
    };
    of(&own, &OWN).or_else(|| of(&other, &OTHER)).unwrap_or("#888")
}

/// The whole page.
pub fn html(document: &Document) -> String {
    let about = &document.about;
    let mut out = String::from(
        "<!doctype html><html lang='en'><meta charset='utf-8'><meta name='viewport' content='width=device-width'>",
    );
    let _ = write!(out, "<title>lightfarm: error against time</title><style>{}</style>", include_str!("style.css"));
    let _ = write!(
        out,
        "<h1>lightfarm {}: error against time</h1><p class='soft'>{}, {} cores · <code>{}</code></p>",
        escape(&about.version),
        escape(&about.processor),
        about.cores,
        escape(&about.command)
    );
    let link = |id: &str, name: &str| format!("<a href='#{}'>{}</a>", escape(id), escape(name));
    out += "<nav>";
    out += &link("summary", "Summary");
    document.scenes.iter().for_each(|s| out += &link(&s.name, &s.name));
    if !document.scaling.is_empty() {
        out += &link("growth", "Growth of cost");
    }
    out += "</nav>";
    out += &notes(&document.notes);
    out += &summary::section(document);
    for s in &document.scenes {
        out += &scene::section(document, s);
    }
    out += &growth::section(&document.scaling);
    out + "</html>\n"
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_have_three_digits() {
        let numbers = [0.0, 1.0, 12.345, 0.012_345, 1234.5, 1.5e-7, f64::NAN, 0.5];
        assert_eq!(numbers.map(short), ["0", "1.00", "12.3", "0.0123", "1234", "1.50e-7", "–", "0.500"]);
    }
}
