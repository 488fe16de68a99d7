//! Curves on logarithmic axes as SVG.

use super::escape;
use renderer::math::{exp64, ln64};
use std::fmt::Write;

/// One curve.
#[derive(Debug)]
pub struct Series {
    /// For the legend.
    pub name: String,
    /// CSS colour.
    pub colour: String,
    /// Whether it is dashed: other renderers.
    pub dashed: bool,
    /// x, y and the ends of y's interval; what is not positive is left out.
    pub points: Vec<(f64, f64, f64, f64)>,
}

/// A plot.
#[derive(Debug)]
pub struct Plot {
    /// Under the x axis.
    pub x_label: String,
    /// Beside the y axis.
    pub y_label: String,
    /// The curves.
    pub series: Vec<Series>,
}

const WIDTH: f64 = 560.0;
const HEIGHT: f64 = 360.0;
/// Left, right, top, bottom.
const MARGIN: [f64; 4] = [62.0, 16.0, 14.0, 44.0];

/// Decades of an axis.
struct Axis {
    low: f64,
    high: f64,
    from: f64,
    to: f64,
}

impl Axis {
    fn new(values: impl Iterator<Item = f64>, from: f64, to: f64) -> Option<Self> {
        let (mut low, mut high) = (f64::INFINITY, f64::NEG_INFINITY);
        for v in values.filter(|v| *v > 0.0 && v.is_finite()) {
            let l = ln64(v) / std::f64::consts::LN_10;
            (low, high) = (low.min(l), high.max(l));
        }
        let pad = 0.04 * (high - low).max(0.5);
        low.is_finite().then_some(Self { low: low - pad, high: high + pad, from, to })
    }

    fn at(&self, v: f64) -> f64 {
        let l = ln64(v) / std::f64::consts::LN_10;
        self.from + (l - self.low) / (self.high - self.low) * (self.to - self.from)
    }

    /// Whole decades, and 2 and 5 of each where there are few.
    fn ticks(&self) -> Vec<(f64, bool)> {
        let wide = self.high - self.low > 2.5;
        let step = if self.high - self.low > 9.0 { 2 } else { 1 };
        let mut ticks = Vec::new();
        for decade in self.low.floor() as i32..=self.high.ceil() as i32 {
            for digit in 1..10 {
                let value = f64::from(digit) * exp64(f64::from(decade) * std::f64::consts::LN_10);
                let l = ln64(value) / std::f64::consts::LN_10;
                let labelled = digit == 1 && decade % step == 0 || !wide && (digit == 2 || digit == 5);
                if l >= self.low && l <= self.high && (labelled || wide && step == 1) {
                    ticks.push((value, labelled));
                }
            }
        }
        ticks
    }
}

/// A number for an axis.
pub fn tick(v: f64) -> String {
    match v {
        v if (1e-3..1e4).contains(&v) => {
            let text = format!("{v:.3}");
            text.trim_end_matches('0').trim_end_matches('.').to_string()
        }
        v => {
            let text = format!("{v:.0e}");
            let (digit, exponent) = text.split_once('e').unwrap_or((&text, "0"));
            let exponent: String = exponent
                .chars()
                .map(|c| match c {
                    '-' => '⁻',
                    c => c.to_digit(10).map_or(c, |d| ['⁰', '¹', '²', '³', '⁴', '⁵', '⁶', '⁷', '⁸', '⁹'][d as usize]),
                })
                .collect();
            if digit == "1" { format!("10{exponent}") } else { format!("{digit}·10{exponent}") }
        }
    }
}

impl Plot {
    /// The SVG, or nothing where there is nothing to see.
    pub fn svg(&self) -> String {
        let usable = |s: &Series| s.points.iter().filter(|p| p.0 > 0.0 && p.1 > 0.0).copied().collect::<Vec<_>>();
        let all: Vec<(f64, f64, f64, f64)> = self.series.iter().flat_map(usable).collect();
        let [left, right, top, bottom] = MARGIN;
        let x = Axis::new(all.iter().map(|p| p.0), left, WIDTH - right);
        let y = Axis::new(all.iter().map(|p| p.1), HEIGHT - bottom, top);
        let (Some(x), Some(y)) = (x, y) else { return String::new() };
        let mut out = format!("<svg viewBox='0 0 {WIDTH} {HEIGHT}' role='img' aria-label='{}'>", escape(&self.y_label));
        grid(&mut out, &x, &y);
        for s in &self.series {
            draw(&mut out, s, &usable(s), &x, &y);
        }
        let (middle, foot) = (0.5 * (left + WIDTH - right), HEIGHT - 8.0);
        // Writing to a string can't fail, here and below.
        let _ = write!(
            out,
            "<text class='axis' x='{middle}' y='{foot}' text-anchor='middle'>{}</text>",
            escape(&self.x_label)
        );
        let middle = 0.5 * (top + HEIGHT - bottom);
        let _ = write!(
            out,
            "<text class='axis' transform='translate(14 {middle}) rotate(-90)' text-anchor='middle'>{}</text></svg>",
            escape(&self.y_label)
        );
        out + &legend(&self.series)
    }
}

fn grid(out: &mut String, x: &Axis, y: &Axis) {
    let [left, right, top, bottom] = MARGIN;
    for (value, labelled) in x.ticks() {
        let (at, class) = (x.at(value), if labelled { "major" } else { "minor" });
        let _ = write!(out, "<line class='{class}' x1='{at:.1}' x2='{at:.1}' y1='{top}' y2='{:.1}'/>", HEIGHT - bottom);
        if labelled {
            let _ = write!(
                out,
                "<text x='{at:.1}' y='{:.1}' text-anchor='middle'>{}</text>",
                HEIGHT - bottom + 16.0,
                tick(value)
            );
        }
    }
    for (value, labelled) in y.ticks() {
        let (at, class) = (y.at(value), if labelled { "major" } else { "minor" });
        let _ = write!(out, "<line class='{class}' y1='{at:.1}' y2='{at:.1}' x1='{left}' x2='{:.1}'/>", WIDTH - right);
        if labelled {
            let _ =
                write!(out, "<text x='{:.1}' y='{:.1}' text-anchor='end'>{}</text>", left - 6.0, at + 4.0, tick(value));
        }
    }
}

fn draw(out: &mut String, s: &Series, points: &[(f64, f64, f64, f64)], x: &Axis, y: &Axis) {
    let colour = &s.colour;
    let inside = |v: f64| y.at(v).clamp(MARGIN[2], HEIGHT - MARGIN[3]);
    // The band of the intervals.
    let known: Vec<_> = points.iter().filter(|p| p.2 > 0.0 && p.3.is_finite()).collect();
    let upper = known.iter().map(|p| format!("{:.1},{:.1}", x.at(p.0), inside(p.3)));
    let lower = known.iter().rev().map(|p| format!("{:.1},{:.1}", x.at(p.0), inside(p.2)));
    let band: Vec<String> = upper.chain(lower).collect();
    let _ = write!(out, "<polygon points='{}' fill='{colour}' opacity='0.14'/>", band.join(" "));
    let line: Vec<String> = points.iter().map(|p| format!("{:.1},{:.1}", x.at(p.0), y.at(p.1))).collect();
    let dash = if s.dashed { " stroke-dasharray='6 4'" } else { "" };
    let _ = write!(out, "<polyline points='{}' fill='none' stroke='{colour}' stroke-width='2'{dash}/>", line.join(" "));
    for p in points {
        let shape = format!("cx='{:.1}' cy='{:.1}' r='3' fill='{colour}'", x.at(p.0), y.at(p.1));
        let known = p.2.is_finite() && p.3.is_finite();
        let interval = if known { format!(" [{:.3e}, {:.3e}]", p.2, p.3) } else { String::new() };
        let title = format!("{}: {:.4} s, {:.4e}{interval}", escape(&s.name), p.0, p.1);
        let _ = write!(out, "<circle {shape}><title>{title}</title></circle>");
    }
}

fn legend(series: &[Series]) -> String {
    let mut out = String::from("<div class='legend'>");
    for s in series.iter().filter(|s| !s.points.is_empty()) {
        let dash = if s.dashed { " stroke-dasharray='6 4'" } else { "" };
        let colour = &s.colour;
        let line = format!("<line x1='0' x2='26' y1='6' y2='6' stroke='{colour}' stroke-width='2.5'{dash}/>");
        let _ = write!(out, "<span><svg class='key' viewBox='0 0 26 12'>{line}</svg>{}</span>", escape(&s.name));
    }
    out + "</div>"
}

#[cfg(test)]
mod tests {
    use super::*;

    fn plot(points: Vec<(f64, f64, f64, f64)>) -> String {
        let series = Series { name: "a<b".into(), colour: "red".into(), dashed: true, points };
        Plot { x_label: "x".into(), y_label: "y".into(), series: vec![series] }.svg()
    }

    #[test]
    fn a_curve_is_drawn_where_it_belongs() {
        let svg = plot(vec![(1.0, 1e-2, 9e-3, 2e-2), (100.0, 1e-4, f64::NAN, f64::NAN), (0.0, -1.0, 0.0, 0.0)]);
        assert_eq!(svg.matches("<circle").count(), 2);
        assert!(svg.contains("a&lt;b") && svg.contains(">10⁻⁴<") && svg.contains(">0.01<"), "{svg}");
        assert!(!svg.contains("NaN,") && !svg.contains(",NaN"));
        assert_eq!(plot(vec![]), "");
    }

    #[test]
    fn ticks_are_short() {
        assert_eq!([0.002, 0.5, 10.0, 2e-5, 1e6].map(tick), ["0.002", "0.5", "10", "2·10⁻⁵", "10⁶"]);
    }
}
