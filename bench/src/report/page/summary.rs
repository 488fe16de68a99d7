//! The head of the page: times to equal error, all scenes.

use super::super::document::{Document, EqualError};
use super::super::evaluate::OWN;
use super::{escape, short, table};
use renderer::math::{exp64, ln64};

/// Its section.
pub fn section(document: &Document) -> String {
    if document.scenes.is_empty() {
        return String::new();
    }
    let mut out = String::from(
        "<h2 id='summary'>Summary</h2><p>How many times as long each takes as the best of lightfarm to the lowest relMSE that both \
         reach; above 1, lightfarm is sooner. ≥ where lightfarm was below that error at its first checkpoint already. The last \
         column is the geometric mean over the scenes that have a figure.</p>",
    );
    out += &ratios(document, "relMSE");
    out += "<h3>The same by trimmed relMSE (without the 0.1 % of pixels where it is largest)</h3>";
    out + &ratios(document, "trimmed relMSE")
}

fn ratios(document: &Document, measure: &str) -> String {
    let mut names: Vec<(&str, &str)> = Vec::new();
    for c in document.scenes.iter().flat_map(|s| &s.curves) {
        if !names.contains(&(c.name.as_str(), c.renderer.as_str())) {
            names.push((&c.name, &c.renderer));
        }
    }
    let head = [""].into_iter().chain(document.scenes.iter().map(|s| s.name.as_str())).chain(["geometric mean"]);
    let mut rows = vec![head.map(escape).collect::<Vec<_>>()];
    for (name, renderer) in names {
        let found: Vec<Option<&EqualError>> = document
            .scenes
            .iter()
            .map(|s| s.equal_error.iter().find(|e| e.name == name && e.measure == measure))
            .collect();
        let mut row = vec![escape(name)];
        row.extend(found.iter().map(|e| e.map_or("–".into(), |e| cell(e, renderer))));
        row.push(geometric_mean(found.iter().flatten().map(|e| e.ratio.value)).map_or("–".into(), short));
        rows.push(row);
    }
    table(&rows)
}

fn cell(e: &EqualError, renderer: &str) -> String {
    let bound = match e.bound.as_str() {
        ">=" => "≥ ",
        "<=" => "≤ ",
        _ => "",
    };
    let class = match e.ratio.value {
        _ if renderer == OWN => "",
        r if r > 1.0 => "good",
        _ => "bad",
    };
    format!("<td class='{class}'>{bound}{}</td>", short(e.ratio.value))
}

/// The geometric mean of what is positive.
pub fn geometric_mean(values: impl Iterator<Item = f64>) -> Option<f64> {
    let logs: Vec<f64> = values.filter(|v| *v > 0.0 && v.is_finite()).map(ln64).collect();
    (!logs.is_empty()).then(|| exp64(logs.iter().sum::<f64>() / logs.len() as f64))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_geometric_mean() {
        assert!((geometric_mean([2.0, 8.0, f64::NAN].into_iter()).unwrap() - 4.0).abs() < 1e-12);
        assert_eq!(geometric_mean([].into_iter()), None);
    }
}
