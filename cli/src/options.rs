//! Options that several subcommands share.

use crate::exit::Failure;
use clap::Args;
use renderer::integrator::IntegratorKind;
use renderer::integrator::mmlt::MmltOptions;
use renderer::job::{RenderOptions, RenderSettings, SettingsError};
use renderer::scene::desc::RenderDefaults;
use std::path::{Path, PathBuf};

/// What to render: `render` and `submit` take it.
#[derive(Clone, Debug, Args)]
#[command(next_help_heading = "Render options")]
pub struct RenderArgs {
    /// Light transport algorithm (path, light, bdpt, mmlt, or auto: trials choose path, bdpt or mmlt)
    #[arg(long, value_name = "NAME")]
    pub integrator: Option<IntegratorKind>,
    /// Samples (or light paths) per pixel; auto renders for as long as path would take for so many
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=1 << 24))]
    pub spp: Option<u32>,
    /// Mutations per pixel (mmlt)
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=1 << 24))]
    pub mpp: Option<u32>,
    /// How mmlt runs its chains, for experiments: `plain` or `pbrt` = as published, or KEY=VALUE,...
    #[arg(long, value_name = "OPTIONS")]
    pub mmlt: Option<MmltOptions>,
    /// Wall time, such as 60s, 5m or 1h30m; ends with the pass in which it runs out
    #[arg(long, value_name = "TIME", value_parser = seconds)]
    pub time: Option<f64>,
    /// Stop when the upper 95 % bound of the relative error is below this, such as 0.02
    #[arg(long, value_name = "X", value_parser = positive)]
    pub target_error: Option<f64>,
    /// Give noisy tiles more samples and quiet ones fewer (path) [default: true with --target-error and with --time]
    #[arg(long, value_name = "BOOL", num_args = 0..=1, require_equals = true, default_missing_value = "true")]
    pub adaptive: Option<bool>,
    /// Share paths between the pixels of small blocks where that pays (path): less noise, alike in neighbours [default: true]
    #[arg(long, value_name = "BOOL", num_args = 0..=1, require_equals = true, default_missing_value = "true")]
    pub share: Option<bool>,
    /// Width and height in pixels, such as 640x480
    #[arg(long, value_name = "WxH", value_parser = size)]
    pub size: Option<(u32, u32)>,
    /// Edges of the longest path; -1 = unbounded, with Russian roulette
    #[arg(long, value_name = "N", allow_negative_numbers = true, value_parser = clap::value_parser!(i32).range(-1..))]
    pub max_depth: Option<i32>,
    /// Seed of all random numbers
    #[arg(long, value_name = "N")]
    pub seed: Option<u64>,
}

impl RenderArgs {
    /// The settings for a scene that asks for `scene`.
    pub fn resolve(&self, scene: &RenderDefaults) -> Result<RenderSettings, Failure> {
        let options = RenderOptions {
            integrator: self.integrator,
            spp: self.spp,
            mpp: self.mpp,
            mmlt: self.mmlt,
            time_s: self.time,
            target_error: self.target_error,
            adaptive: self.adaptive,
            share: self.share,
            size: self.size,
            max_depth: self.max_depth,
            seed: self.seed,
        };
        RenderSettings::resolve(&options, scene).map_err(|e| match e {
            SettingsError::Options(m) => Failure::Usage(format!("error: {m}")),
            SettingsError::Settings(m) => Failure::Input(format!("error: {m}")),
        })
    }
}

/// Where pictures go: `render`, `submit --wait` and `fetch` take it.
#[derive(Clone, Debug, Args)]
#[command(next_help_heading = "Output")]
pub struct OutputArgs {
    /// The EXR to write [default: the scene's name, in the current folder]
    #[arg(short, long = "output", value_name = "OUT.exr")]
    pub output: Option<PathBuf>,
    /// The PNG to write [default: beside the EXR]
    #[arg(long, value_name = "OUT.png")]
    pub png: Option<PathBuf>,
    /// Exposure of the PNG in stops
    #[arg(long, value_name = "EV", default_value_t = 0.0, allow_negative_numbers = true, value_parser = finite)]
    pub exposure: f64,
}

impl OutputArgs {
    /// The EXR and PNG to write for the scene at `scene`.
    pub fn paths(&self, scene: &Path) -> Result<(PathBuf, PathBuf), Failure> {
        let stem = scene.file_stem().unwrap_or(scene.as_os_str());
        let exr = self.output.clone().unwrap_or_else(|| Path::new(stem).with_added_extension("exr"));
        let png = self.png.clone().unwrap_or_else(|| exr.with_extension("png"));
        if exr == png {
            return Err(Failure::Usage(format!(
                "error: the EXR and the PNG would both be written to {}; give --png another name",
                exr.display()
            )));
        }
        Ok((exr, png))
    }
}

/// Threads that compute: `render` and `worker` take it.
#[derive(Clone, Copy, Debug, Args)]
pub struct ThreadArgs {
    /// Compute threads [default: one per core]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=4096))]
    threads: Option<u16>,
}

impl ThreadArgs {
    /// The number asked for, or what the machine offers.
    pub fn count(&self) -> usize {
        match self.threads {
            Some(n) => usize::from(n),
            None => std::thread::available_parallelism().map_or(1, usize::from),
        }
    }
}

fn finite(text: &str) -> Result<f64, String> {
    let v: f64 = text.parse().map_err(|_| format!("{text:?} is not a number"))?;
    if v.is_finite() && v.abs() <= 100.0 { Ok(v) } else { Err("expected a number from -100 to 100".into()) }
}

/// A positive, finite number.
pub fn positive(text: &str) -> Result<f64, String> {
    let v: f64 = text.parse().map_err(|_| format!("{text:?} is not a number"))?;
    if v > 0.0 && v.is_finite() { Ok(v) } else { Err("expected a positive number".into()) }
}

/// `WxH`.
fn size(text: &str) -> Result<(u32, u32), String> {
    let side = |s: &str| s.parse::<u32>().ok().filter(|n| (1..=1 << 16).contains(n));
    let sides = text.split_once(['x', 'X']).and_then(|(w, h)| Some((side(w)?, side(h)?)));
    sides.ok_or_else(|| format!("{text:?} is not WIDTHxHEIGHT, such as 640x480 (sides from 1 to 65536)"))
}

/// A time: numbers with units h, m, s or ms, largest first (`1h30m`, `2.5m`), or bare seconds.
fn seconds(text: &str) -> Result<f64, String> {
    let fail = || format!("{text:?} is not a time such as 60s, 5m, 1h30m or 500ms");
    if let Ok(v) = text.parse::<f64>() {
        return if v > 0.0 && v.is_finite() { Ok(v) } else { Err(fail()) };
    }
    let (mut rest, mut total, mut last_scale) = (text, 0.0, f64::INFINITY);
    while !rest.is_empty() {
        let digits = rest.find(|c: char| !(c.is_ascii_digit() || c == '.')).ok_or_else(fail)?;
        let value: f64 = rest[..digits].parse().map_err(|_| fail())?;
        let unit_len = rest[digits..].find(|c: char| !c.is_ascii_alphabetic()).unwrap_or(rest.len() - digits);
        let (unit, tail) = rest[digits..].split_at(unit_len);
        let scale = match unit {
            "h" => 3600.0,
            "m" | "min" => 60.0,
            "s" => 1.0,
            "ms" => 1e-3,
            _ => return Err(fail()),
        };
        if scale >= last_scale {
            return Err(fail());
        }
        (total, last_scale, rest) = (total + value * scale, scale, tail);
    }
    if total > 0.0 && total.is_finite() { Ok(total) } else { Err(fail()) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn times_are_read_with_their_units() {
        for (text, want) in
            [("60s", 60.0), ("5m", 300.0), ("1h30m", 5400.0), ("500ms", 0.5), ("2.5m", 150.0), ("7", 7.0)]
        {
            assert_eq!(seconds(text), Ok(want), "{text}");
        }
        for text in ["", "0", "-1", "s", "5x", "1m1h", "1s1s", "nan", "inf", "1..5s", "5 s", "½s"] {
            assert!(seconds(text).is_err(), "{text}");
        }
    }

    #[test]
    fn sizes_are_two_sides() {
        assert_eq!(size("640x480"), Ok((640, 480)));
        for text in ["640", "0x1", "1x0", "x", "1x2x3", "-1x5", "70000x1"] {
            assert!(size(text).is_err(), "{text}");
        }
    }
}
