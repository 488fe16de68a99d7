//! How far a render is: a bar on a terminal, a line now and then elsewhere, JSON lines for scripts.

use crate::output::Console;
use indicatif::{ProgressBar, ProgressStyle};
use renderer::film::ErrorSummary;
use serde::Serialize;
use std::io::IsTerminal;
use std::time::{Duration, Instant};

/// Time between plain lines on standard error.
const LINE_INTERVAL: Duration = Duration::from_secs(5);
/// Time between JSON lines.
const JSON_INTERVAL: Duration = Duration::from_secs(1);

/// A moment of a render.
#[derive(Clone, Copy, Debug)]
pub struct Moment {
    /// Share of the budget that is done, as far as it is known.
    pub fraction: f64,
    /// Samples (light paths, mutations) so far.
    pub samples: u64,
    /// What they are called.
    pub samples_name: &'static str,
    /// Pixels of the film.
    pub pixels: u64,
    /// The error when it was last estimated.
    pub error: Option<ErrorSummary>,
}

/// Shows moments.
pub struct Progress {
    console: Console,
    bar: Option<ProgressBar>,
    started: Instant,
    shown: Instant,
}

/// The JSON line.
#[derive(Serialize)]
struct Event {
    event: &'static str,
    fraction: f64,
    spp: f64,
    samples_per_s: f64,
    seconds: f64,
    seconds_left: Option<f64>,
    relative_error: Option<f64>,
}

impl Progress {
    /// Starts the clock.
    pub fn new(console: &Console) -> Self {
        let bar = (std::io::stderr().is_terminal() && !console.json).then(|| {
            let bar = ProgressBar::new(10_000);
            // The template is fixed and valid; the default style serves otherwise.
            if let Ok(style) = ProgressStyle::with_template("{bar:32} {percent:>3} % {msg}") {
                bar.set_style(style.progress_chars("=> "));
            }
            bar
        });
        let now = Instant::now();
        Self { console: *console, bar, started: now, shown: now }
    }

    /// Seconds since the start.
    pub fn seconds(&self) -> f64 {
        self.started.elapsed().as_secs_f64()
    }

    /// Shows a moment, when it is time to.
    pub fn show(&mut self, m: &Moment) {
        if let Some(bar) = &self.bar {
            bar.set_position((m.fraction * 10_000.0) as u64);
            bar.set_message(self.describe(m));
            return;
        }
        let interval = if self.console.json { JSON_INTERVAL } else { LINE_INTERVAL };
        if self.shown.elapsed() < interval {
            return;
        }
        self.shown = Instant::now();
        if self.console.json {
            self.console.event(&Event {
                event: "progress",
                fraction: m.fraction,
                spp: m.samples as f64 / m.pixels as f64,
                samples_per_s: m.samples as f64 / self.seconds(),
                seconds: self.seconds(),
                seconds_left: self.left(m),
                relative_error: m.error.map(|e| e.relative),
            });
        } else {
            self.console.note(format!("{:3.0} % {}", 100.0 * m.fraction, self.describe(m)));
        }
    }

    /// Shows a remark without breaking the bar.
    pub fn note(&self, text: &str) {
        match &self.bar {
            Some(bar) => bar.suspend(|| self.console.note(text)),
            None => self.console.note(text),
        }
    }

    /// Takes the bar away.
    pub fn finish(&self) {
        if let Some(bar) = &self.bar {
            bar.finish_and_clear();
        }
    }

    fn left(&self, m: &Moment) -> Option<f64> {
        (m.fraction > 0.0).then(|| self.seconds() * (1.0 - m.fraction) / m.fraction)
    }

    fn describe(&self, m: &Moment) -> String {
        let per_pixel = m.samples as f64 / m.pixels as f64;
        let rate = quantity(m.samples as f64 / self.seconds());
        let mut text = format!("{per_pixel:.1} {} per pixel, {rate} per second", m.samples_name);
        if let Some(left) = self.left(m) {
            text += &format!(", {} left", duration(left));
        }
        if let Some(e) = m.error {
            text += &format!(", relative error {:.4}", e.relative);
        }
        text
    }
}

/// A number with three digits and k, M, G.
pub fn quantity(v: f64) -> String {
    let (scaled, unit) = match v {
        v if v >= 1e9 => (v / 1e9, " G"),
        v if v >= 1e6 => (v / 1e6, " M"),
        v if v >= 1e3 => (v / 1e3, " k"),
        v => (v, ""),
    };
    let digits = if scaled < 10.0 { 2 } else { usize::from(scaled < 100.0) };
    format!("{scaled:.digits$}{unit}")
}

/// A time for people: `4.2 s`, `3 min 20 s`, `2 h 5 min`.
pub fn duration(seconds: f64) -> String {
    let whole = seconds.round() as u64;
    match whole {
        0..60 => format!("{seconds:.1} s"),
        60..3600 => format!("{} min {} s", whole / 60, whole % 60),
        _ => format!("{} h {} min", whole / 3600, whole % 3600 / 60),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_and_times_are_short() {
        for (v, text) in [(7.0, "7.00"), (950.0, "950"), (12_345.0, "12.3 k"), (2.5e6, "2.50 M"), (3e9, "3.00 G")] {
            assert_eq!(quantity(v), text);
        }
        for (v, text) in [(4.21, "4.2 s"), (200.0, "3 min 20 s"), (7500.0, "2 h 5 min")] {
            assert_eq!(duration(v), text);
        }
    }
}
