//! Numerical stress: scenes and numbers at the ends of their ranges, each with what must come out.
//!
//! A *row* is a family of such cases: one file of `rows/`, one line of the list there. `lightfarm stress` runs them and prints a
//! table; a test runs their quick form. What they show is either exact (finite values, equal bits, refused files) or statistical: then
//! every test has its p-value, and all rows together reject by chance with a probability of 1 %.

#![allow(clippy::disallowed_methods, reason = "the bits of expectations need not agree between machines")]

mod oracle;
mod probe;
mod report;
mod rows;
mod scene;

pub use probe::{Effort, Probe};
pub use report::{Outcome, Report};
pub use rows::{ROWS, Row};

use std::panic::{AssertUnwindSafe, catch_unwind};
use std::time::Instant;

/// What to run.
#[derive(Clone, Debug)]
pub struct Options {
    /// How much.
    pub effort: Effort,
    /// Only rows with one of these words in their name; all where it is empty.
    pub only: Vec<String>,
    /// Render threads.
    pub threads: usize,
}

impl Options {
    /// The rows that are meant, or the first word that means none.
    pub fn rows(&self) -> Result<Vec<&'static Row>, String> {
        let meant = |word: &str| ROWS.iter().any(|r| r.name.contains(word));
        if let Some(word) = self.only.iter().find(|w| !meant(w)) {
            let known: Vec<&str> = ROWS.iter().map(|r| r.name).collect();
            return Err(format!("no row's name contains {word:?}; there are: {}", known.join(", ")));
        }
        Ok(ROWS
            .iter()
            .filter(|r| self.only.is_empty() || self.only.iter().any(|w| r.name.contains(w.as_str())))
            .collect())
    }
}

/// Runs rows one after the other; `told` sees each as it ends.
pub fn run(rows: &[&'static Row], options: &Options, told: &mut dyn FnMut(&Outcome)) -> Report {
    let level = statcheck::sidak(report::FAMILY, ROWS.len());
    let mut outcomes = Vec::new();
    for row in rows {
        let started = Instant::now();
        let mut probe = Probe::new(options.effort, options.threads);
        // A panic is a finding like any other.
        let end = catch_unwind(AssertUnwindSafe(|| (row.run)(&mut probe)));
        if let Err(cause) = end {
            let text = cause.downcast_ref::<String>().cloned();
            let text = text.or_else(|| cause.downcast_ref::<&str>().map(ToString::to_string)).unwrap_or_default();
            probe.holds(false, || format!("it panicked: {text}"));
        }
        let outcome = Outcome::new(row, probe, level, started.elapsed().as_secs_f64());
        told(&outcome);
        outcomes.push(outcome);
    }
    Report::new(outcomes)
}
