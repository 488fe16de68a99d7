//! Instructions of a render, counted by valgrind: the same on a busy machine.

use super::render::{self, Arm};
use super::skips::{self, Skip};
use super::unused;
use std::process::Command;

/// Samples or mutations a pixel of a render that is counted: it takes fifty times as long.
const COUNT: u32 = 16;

/// Whether instructions can be counted here.
pub fn available() -> Result<(), String> {
    let found = Command::new("valgrind").arg("--version").output().is_ok_and(|o| o.status.success());
    if found { Ok(()) } else { Err("instructions were not counted: valgrind is not installed".into()) }
}

/// Instructions without a skip over those with it.
pub fn ratio(skip: &Skip, count: u32) -> Result<f64, String> {
    let count = count.min(COUNT);
    Ok(cost(&format!("{}:without", skip.name), count)? / cost(&format!("{}:with", skip.name), count)?)
}

/// Instructions of a render beyond those of the same process without it.
pub fn cost(what: &str, count: u32) -> Result<f64, String> {
    Ok(run(&format!("{what}:{count}"))? - run(&format!("{what}:0"))?)
}

/// Instructions of a process that makes one render and no more.
fn run(what: &str) -> Result<f64, String> {
    let program = std::env::current_exe().map_err(|e| e.to_string())?;
    let output = Command::new("valgrind")
        .args(["--tool=callgrind", "--callgrind-out-file=/dev/null"])
        .arg(program)
        .args(["ablation", "--only", what])
        .output()
        .map_err(|e| format!("valgrind: {e}"))?;
    let said = String::from_utf8_lossy(&output.stderr);
    if !output.status.success() {
        return Err(format!("valgrind failed: {said}"));
    }
    let mut collected =
        said.lines().filter_map(|l| l.split_once("Collected : ")).filter_map(|(_, n)| n.trim().parse().ok());
    collected.next_back().ok_or_else(|| format!("valgrind told no number of instructions: {said}"))
}

/// What runs under valgrind: `SKIP:with|without:COUNT`, or `UNUSED:FEATURE:COUNT`; 0 reads the scene and no more.
pub fn counted(what: &str) -> Result<(), String> {
    let mut parts = what.split(':');
    let (Some(name), Some(arm), Some(Ok(count))) = (parts.next(), parts.next(), parts.next().map(str::parse::<u32>))
    else {
        return Err(format!("{what:?} is not NAME:ARM:COUNT"));
    };
    if name == unused::NAME {
        return unused::counted(arm, count);
    }
    let skip = skips::find(name)?;
    let arm = if arm == "with" { Arm::With } else { Arm::Without };
    let scene = render::scene(skip, skip.scene, arm)?;
    if count > 0 {
        render::render(skip, &scene, arm, count, 1)?;
    }
    Ok(())
}
