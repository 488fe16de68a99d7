//! `lightfarm diff`: how far a picture is from a reference.

use crate::exit::{Failure, Outcome};
use crate::options;
use crate::output::Console;
use crate::save;
use compare::pair::{self, Pair};
use compare::significance::{self, Agreement, Assumptions};
use compare::{exact, flip, map, metrics::Metrics};
use renderer::film::exr::Picture;
use renderer::scene::desc::FilterDesc;
use serde::Serialize;
use std::fmt::Write;
use std::path::PathBuf;

/// What to compare.
#[derive(Debug, clap::Args)]
#[command(
    after_long_help = "Pixels that are NaN or infinite in either picture are left out and counted. Means run over pixels and channels:
  rmse            sqrt(mean (A - B)^2)
  relmse          mean (A - B)^2 / (B^2 + 0.01)
  relmse trimmed  the same without the 0.1 % of pixels where it is largest
  mape            mean |A - B| / (|B| + 0.01)
  flip            LDR-FLIP (Andersson et al. 2020) of the values clamped to [0, 1]
  hdr flip        HDR-FLIP (Andersson et al. 2021), ACES tone map, automatic exposures
Where both files tell their error (lightfarm's do; others by variance.R/G/B = variance of the mean), Welch's t-tests of
the image mean and of blocks of 16 x 16 pixels say whether they agree, at 99 % for the whole family (Sidak)."
)]
pub struct Args {
    /// The picture judged
    a: PathBuf,
    /// The reference
    b: PathBuf,
    /// Exit with status 1 when relMSE is above this
    #[arg(long, value_name = "X", value_parser = options::positive)]
    max_relmse: Option<f64>,
    /// Exit with status 1 when the t-tests reject, or can't be made
    #[arg(long)]
    require_agreement: bool,
    /// Only compare bits: exit with status 1 unless all channels are equal
    #[arg(long, conflicts_with_all = ["max_relmse", "require_agreement", "save_map"])]
    bit_exact: bool,
    /// Write a picture of the FLIP error: dark = none, bright = large, green = left out
    #[arg(long, value_name = "OUT.png")]
    save_map: Option<PathBuf>,
    /// Independent images behind a `variance` layer
    #[arg(long, value_name = "N", default_value_t = 8, value_parser = clap::value_parser!(u32).range(2..))]
    replicates: u32,
    /// Filter (box, tent, gaussian) that splatted the samples of a file with a `variance` layer [default: as its comments say]
    #[arg(long, value_name = "NAME", value_parser = filter)]
    splat_filter: Option<FilterDesc>,
}

fn filter(name: &str) -> Result<FilterDesc, String> {
    significance::filter_by_name(name).ok_or_else(|| "expected box, tent or gaussian".into())
}

/// All that is found, as `--json` shows it.
#[derive(Serialize)]
struct Report {
    #[serde(flatten)]
    metrics: Metrics,
    flip: f64,
    hdr_flip: Option<f64>,
    masked_pixels: usize,
    agreement: Option<Agreement>,
}

/// Runs it.
pub fn run(args: Args, console: &Console) -> Outcome {
    let input = |message: String| Failure::Input(format!("error: {message}"));
    let (a, b) = (pair::read(&args.a).map_err(input)?, pair::read(&args.b).map_err(input)?);
    if args.bit_exact {
        return bit_exact(&a, &b, console);
    }
    let pair = Pair::new(&a, &b).map_err(input)?;
    let metrics = Metrics::of(&pair).ok_or_else(|| {
        Failure::Input("error: no pixel is finite in both pictures: there is nothing to compare".into())
    })?;
    let ldr = flip::ldr(&pair);
    let hdr = flip::hdr(&pair);
    if let Some(path) = &args.save_map {
        let png = map::encode(&hdr.as_ref().unwrap_or(&ldr).map, &pair).map_err(Failure::Machine)?;
        save::write(path, &png).map_err(|e| save::failure(path, &e))?;
    }
    let assumptions = Assumptions { replicates: args.replicates, filter: args.splat_filter };
    let report = Report {
        metrics,
        flip: ldr.mean,
        hdr_flip: hdr.map(|f| f.mean),
        masked_pixels: pair.masked(),
        agreement: significance::test(&pair, &a, &b, &assumptions),
    };
    console.result(text(&report), &report);
    judge(&args, &report)
}

fn bit_exact(a: &Picture, b: &Picture, console: &Console) -> Outcome {
    let difference = exact::compare(a, b);
    let json = serde_json::json!({"equal": difference.is_none(), "difference": difference});
    let Some(d) = difference else {
        console.result(format!("equal: {} channels, bit for bit", a.channels.len()), &json);
        return Ok(());
    };
    let count = d.values.map_or(String::new(), |n| format!("{n} values differ, first "));
    console.event(&json);
    Err(Failure::Input(format!("different: {count}{}", d.first)))
}

fn judge(args: &Args, report: &Report) -> Outcome {
    if let Some(limit) = args.max_relmse.filter(|limit| report.metrics.relmse > *limit) {
        return Err(Failure::Input(format!("relMSE {} is above --max-relmse {limit}", report.metrics.relmse)));
    }
    match &report.agreement {
        Some(a) if args.require_agreement && !a.agree => Err(Failure::Input("the pictures do not agree".into())),
        None if args.require_agreement => {
            Err(Failure::Input("the pictures can't be tested: both must tell their error".into()))
        }
        _ => Ok(()),
    }
}

fn text(r: &Report) -> String {
    let m = &r.metrics;
    let ratio = |v: Option<f64>| v.map_or("-".to_string(), |v| format!("{v:.6}"));
    let [red, green, blue] = m.mean_ratio.map(ratio);
    let mut out = String::new();
    let mut line = |name: &str, value: String| {
        // Writing to a string can't fail.
        let _ = writeln!(out, "{name:<16}{value}");
    };
    line("rmse", format!("{:.6e}", m.rmse));
    line("relmse", format!("{:.6e}", m.relmse));
    line("relmse trimmed", format!("{:.6e}", m.relmse_trimmed));
    line("mape", format!("{:.6e}", m.mape));
    line("flip", format!("{:.6}", r.flip));
    line("hdr flip", r.hdr_flip.map_or("- (the reference is black)".into(), |v| format!("{v:.6}")));
    line("mean ratio", format!("{} (R {red}, G {green}, B {blue})", ratio(m.mean_ratio_all)));
    line("max |A - B|", format!("{:.6e} at column {}, row {}", m.max_abs, m.max_abs_at[0], m.max_abs_at[1]));
    if r.masked_pixels > 0 {
        line("left out", format!("{} pixels that are NaN or infinite", r.masked_pixels));
    }
    if let Some(a) = &r.agreement {
        line("errors of A", a.a.clone());
        line("errors of B", a.b.clone());
        for t in &a.image {
            let relative = 100.0 * (t.a / t.b - 1.0);
            line(
                &format!("image mean {}", t.channel),
                format!("{:.6} and {:.6} ({relative:+.3} %), t = {:+.2}, p = {:.3}", t.a, t.b, t.t, t.p),
            );
        }
        line(
            "blocks",
            format!(
                "{} tests of 16 x 16 pixels, rms z {:.2}, {} blocks left out",
                a.block_tests, a.block_rms_z, a.blocks_skipped
            ),
        );
        for t in a.worst.iter().filter(|t| t.block.is_some()).take(3) {
            let [x, y] = t.block.unwrap_or_default();
            line(
                &format!("  at {x}, {y} {}", t.channel),
                format!(
                    "{:.6} and {:.6}, t = {:+.2} with {:.0} degrees of freedom, p = {:.2e}",
                    t.a, t.b, t.t, t.dof, t.p
                ),
            );
        }
        let verdict = if a.agree { "the pictures agree" } else { "the pictures DIFFER" };
        line("verdict", format!("{verdict} (family-wise p = {:.3}, 99 % level)", a.family_p));
    }
    out.truncate(out.trim_end().len());
    out
}
