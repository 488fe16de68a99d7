//! The report for people.

use super::measure::Measure;
use super::report::{FLAG, Report, Row};
use super::stats::Interval;
use std::fmt::{Display, Formatter, Result};

/// What stands over the columns of errors.
const TITLES: [&str; 5] = ["MSE", "relMSE", "trimmed", "dark MSE", "dark relMSE"];

/// A number with four significant digits.
fn figure(x: f64) -> String {
    let size = x.abs();
    match size {
        _ if !size.is_finite() => "?".into(),
        0.0 => "0".into(),
        _ if !(1e-5..1e6).contains(&size) => format!("{x:.3e}"),
        _ => {
            let (mut decimals, mut scaled) = (0, size);
            while scaled < 999.95 {
                (decimals, scaled) = (decimals + 1, 10.0 * scaled);
            }
            format!("{x:.decimals$}")
        }
    }
}

fn interval(i: &Interval) -> String {
    format!("{} [{}, {}]", figure(i.value), figure(i.low), figure(i.high))
}

/// Value and half the interval's width in percent.
fn percent(i: &Interval) -> String {
    let half = 50.0 * (i.high - i.low) / i.value;
    if half.is_finite() { format!("{} ±{half:.1}%", figure(i.value)) } else { figure(i.value) }
}

impl Display for Report {
    fn fmt(&self, f: &mut Formatter<'_>) -> Result {
        let depth = self.max_depth.map_or("any number of".into(), |d| format!("at most {d}"));
        let (w, h) = self.size;
        writeln!(f, "{}, {w} x {h}, paths of {depth} edges, {} threads", self.scene, self.threads)?;
        writeln!(f, "{} renders of each, in turn; reference: {}", self.rounds, self.reference)?;
        self.costs(f)?;
        self.errors(f)?;
        self.pairs(f)?;
        self.notes.iter().try_for_each(|n| write!(f, "\nnote: {n}"))
    }
}

impl Report {
    fn name_width(&self) -> usize {
        let pair = |r: &super::report::Ratio| r.a.chars().count() + r.b.chars().count() + 3;
        let names = self.rows.iter().map(|r| r.variant.chars().count());
        names.chain(self.ratios.iter().map(pair)).max().unwrap_or(0)
    }

    fn costs(&self, f: &mut Formatter<'_>) -> Result {
        let n = self.name_width();
        let head = "relMSE x s [95 %]               relMSE x CPU s / thread         efficiency          s      CPU s";
        writeln!(f, "\n{:n$}  {head}  ksamples/s/core  krays/s     MiB", "")?;
        for r in &self.rows {
            let cpu = r.relmse_cpu_seconds.map_or("?".into(), |i| interval(&i));
            let (relmse, seconds) = (interval(r.error_seconds.of(Measure::RelMse)), figure(r.seconds.value));
            let cpu_seconds = r.cpu_seconds.map_or("?".into(), |i| figure(i.value));
            let rates = format!("{:15.1}  {:7.0}", r.samples_per_core_s / 1e3, r.rays_per_s / 1e3);
            let memory = r.peak_mib.map_or("?".into(), |m| format!("{m:.0}"));
            let efficiency = figure(r.efficiency);
            let name = &r.variant;
            writeln!(
                f,
                "{name:n$}  {relmse:30}  {cpu:30}  {efficiency:>10}  {seconds:>9}  {cpu_seconds:>9}  {rates}  {memory:>6}"
            )?;
        }
        Ok(())
    }

    fn errors(&self, f: &mut Formatter<'_>) -> Result {
        let n = self.name_width();
        let cells = |cells: [String; 5]| cells.map(|c| format!("{c:<17}")).join("  ");
        writeln!(f, "\n{:n$}  {}  mean / reference", "", cells(TITLES.map(String::from)))?;
        for r in &self.rows {
            let errors = cells(r.error.0.map(|i| percent(&i)));
            writeln!(f, "{:n$}  {errors}  {}{}", r.variant, percent(&r.mean_ratio), flag(r))?;
        }
        Ok(())
    }

    fn pairs(&self, f: &mut Formatter<'_>) -> Result {
        if self.ratios.is_empty() {
            return Ok(());
        }
        let n = self.name_width();
        writeln!(f, "\ntime to the same error, as a ratio (above 1: the second is faster)")?;
        let cells = |cells: Vec<String>| cells.iter().map(|c| format!("{c:<28}")).collect::<Vec<_>>().join("  ");
        let titles = ["relMSE", "relMSE, CPU time", "trimmed", "MSE", "dark MSE", "dark relMSE"];
        writeln!(f, "{:n$}  {}", "", cells(titles.map(String::from).to_vec()).trim_end())?;
        for r in &self.ratios {
            let by = |m| interval(r.seconds.of(m));
            let cpu = r.relmse_cpu_seconds.map_or("?".into(), |i| interval(&i));
            let others = [Measure::RelMseTrimmed, Measure::Mse, Measure::DarkMse, Measure::DarkRelMse];
            let columns = [by(Measure::RelMse), cpu].into_iter().chain(others.map(by)).collect();
            let mark = if r.flagged { "  (!)" } else { "" };
            writeln!(f, "{:n$}  {}{mark}", format!("{} / {}", r.a, r.b), cells(columns).trim_end())?;
        }
        Ok(())
    }
}

/// Says where the reference is too noisy to be overlooked.
fn flag(r: &Row) -> String {
    if !r.flagged() {
        return String::new();
    }
    let shares = r.reference_share.0.map(|s| if s.is_finite() { format!("{:.0}", 100.0 * s) } else { "?".into() });
    format!("  (!) the reference's variance is above {:.0} %: {} %", 100.0 * FLAG, shares.join(", "))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn figures_have_four_digits() {
        for (x, text) in [
            (0.012_345_6, "0.01235"),
            (1.0, "1.000"),
            (-2.345_67, "-2.346"),
            (9999.96, "10000"),
            (123_456.0, "123456"),
            (1.5e-7, "1.500e-7"),
            (f64::NAN, "?"),
        ] {
            assert_eq!(figure(x), text);
        }
    }
}
