//! The tables as text.

use super::{Report, Row};
use crate::error::stats::Interval;
use std::fmt::{Formatter, Result};

fn interval(i: &Interval) -> String {
    format!("{:6.3} [{:5.3}, {:6.3}]", i.value, i.low, i.high)
}

/// One skip.
pub fn line(r: &Row) -> String {
    let instructions = r.instructions.map_or("-".into(), |n| format!("{n:.3}"));
    format!(
        "{:15}  {:5}  {:5}  {instructions:>6}  {}  {}  {}  {}: {}",
        r.name,
        r.integrator,
        r.count,
        interval(&r.seconds),
        interval(&r.error),
        interval(&r.cost),
        r.scene,
        r.what
    )
}

/// Both tables.
pub fn write(report: &Report, f: &mut Formatter<'_>) -> Result {
    writeln!(f, "Without the skip, over with it:")?;
    let ratios = format!("{:22}  {:22}  {:22}", "CPU s", "squared error", "CPU s to equal error");
    writeln!(f, "skip             by     count  instr.  {ratios}  scene: what is not computed")?;
    report.skips.iter().try_for_each(|r| writeln!(f, "{}", line(r)))?;
    if let Some(note) = &report.note {
        return write!(f, "{note}");
    }
    if let Some(first) = report.unused.first() {
        writeln!(f, "\nInstructions of {} with a feature that nothing uses, over those without it:", first.scene)?;
        report
            .unused
            .iter()
            .try_for_each(|u| writeln!(f, "{:32}  {:5}  {:.4}", u.name, u.integrator, u.instructions))?;
        let worst = report.unused.iter().map(|u| u.instructions).fold(0.0, f64::max);
        write!(f, "at most {worst:.4}")?;
    }
    Ok(())
}
