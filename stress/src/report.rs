//! What came of the rows, and the table.

use crate::probe::Probe;
use crate::rows::Row;
use serde::Serialize;
use std::fmt::Write;

/// Probability that any test of any row rejects by chance.
pub const FAMILY: f64 = 0.01;
/// Failures of one row that are shown.
const SHOWN: usize = 8;

/// What came of a row.
#[derive(Clone, Debug, Serialize)]
pub struct Outcome {
    /// Its name.
    pub name: &'static str,
    /// What it is about.
    pub what: &'static str,
    /// Whether all of it holds.
    pub passed: bool,
    /// Exact checks made.
    pub checks: u64,
    /// Statistical tests made.
    pub tests: usize,
    /// The least of their p-values; 1 without any.
    pub least_p: f64,
    /// What it must not be below.
    pub allowed_p: f64,
    /// The test with the least p-value.
    pub least_test: String,
    /// Seconds it took.
    pub seconds: f64,
    /// Figures worth telling.
    pub figures: Vec<String>,
    /// What does not hold.
    pub failures: Vec<String>,
}

impl Outcome {
    /// Judges what a probe found; `level` is the row's share of [`FAMILY`].
    pub fn new(row: &Row, probe: Probe, level: f64, seconds: f64) -> Self {
        let Probe { checks, tests, mut failures, figures, .. } = probe;
        let allowed_p = statcheck::sidak(level, tests.len().max(1));
        let least = tests.iter().min_by(|a, b| a.1.total_cmp(&b.1)).cloned();
        let (least_test, least_p) = least.unwrap_or((String::new(), 1.0));
        // NaN fails, too.
        let rejected = tests.iter().filter(|t| !(t.1 >= allowed_p));
        failures.extend(rejected.map(|(what, p)| format!("{what}: p = {p:.2e}, at least {allowed_p:.2e} is allowed")));
        if checks == 0 && tests.is_empty() {
            failures.push("nothing was checked".into());
        }
        let (name, what, tests) = (row.name, row.what, tests.len());
        let passed = failures.is_empty();
        Self { name, what, passed, checks, tests, least_p, allowed_p, least_test, seconds, figures, failures }
    }

    /// Its line of the table, and below it what is to be said of it.
    pub fn line(&self) -> String {
        let p = if self.tests == 0 { "-".into() } else { format!("{:.1e}", self.least_p) };
        let verdict = if self.passed { "holds" } else { "FAILS" };
        let mut text = format!(
            "| {:<14} | {verdict} | {:>8} | {:>5} | {p:>7} | {:>6.1} | {} |",
            self.name, self.checks, self.tests, self.seconds, self.what
        );
        if !self.figures.is_empty() {
            let _ = write!(text, "\n|   | | | | | | {} |", self.figures.join("; "));
        }
        for failure in self.failures.iter().take(SHOWN) {
            let _ = write!(text, "\n|   | | | | | | **{failure}** |");
        }
        if self.failures.len() > SHOWN {
            let _ = write!(text, "\n|   | | | | | | **and {} more** |", self.failures.len() - SHOWN);
        }
        text
    }
}

/// All rows that ran.
#[derive(Clone, Debug, Serialize)]
pub struct Report {
    /// In the order of the list.
    pub rows: Vec<Outcome>,
    /// Whether all hold.
    pub passed: bool,
}

impl Report {
    /// Of these rows.
    pub fn new(rows: Vec<Outcome>) -> Self {
        let passed = rows.iter().all(|r| r.passed);
        Self { rows, passed }
    }

    /// The head of the table, in Markdown.
    pub const HEAD: &str = "| row            |       |   checks | tests | least p |      s | what must hold |\n\
                            |----------------|-------|---------:|------:|--------:|-------:|----------------|";

    /// One line for all.
    pub fn summary(&self) -> String {
        let failed: Vec<&str> = self.rows.iter().filter(|r| !r.passed).map(|r| r.name).collect();
        let checks: u64 = self.rows.iter().map(|r| r.checks).sum();
        let tests: usize = self.rows.iter().map(|r| r.tests).sum();
        let seconds: f64 = self.rows.iter().map(|r| r.seconds).sum();
        let rows = self.rows.len();
        let verdict = if failed.is_empty() { "all hold".into() } else { format!("these FAIL: {}", failed.join(", ")) };
        format!("{rows} rows, {checks} checks, {tests} tests (family-wise 99 %), {seconds:.0} s: {verdict}")
    }

    /// The whole table.
    pub fn table(&self) -> String {
        let mut text = Self::HEAD.to_string();
        for row in &self.rows {
            let _ = write!(text, "\n{}", row.line());
        }
        text + "\n\n" + &self.summary() + "\n"
    }
}
