//! Does `auto` choose well? For each scene, what path, bdpt, mmlt and auto cost to the same error, and auto's ratio to the best.

use crate::agree::scenes;
use crate::load;
use renderer::integrator::IntegratorKind::{self, Auto, Bdpt, Mmlt, Path};
use renderer::job::{Choice, LocalOptions, LocalOutcome, RenderOptions, RenderSettings, Stop, render_local};
use renderer::math::exp64;
use renderer::scene::Scene;
use serde::Serialize;
use std::fmt;
use std::time::Instant;

/// Compares auto with what it chooses from.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// Names or files of scenes [default: all that are at hand]
    #[arg(long, value_delimiter = ',')]
    scenes: Vec<String>,
    /// Processor seconds of a render
    #[arg(long, default_value_t = 4.0)]
    seconds: f64,
    /// Renders by each integrator
    #[arg(long, default_value_t = 2)]
    rounds: u32,
    /// Processor seconds of each of the two pictures, by bdpt and mmlt, that make the reference
    #[arg(long, default_value_t = 20.0)]
    reference: f64,
    /// Pixels of a picture, about
    #[arg(long, default_value_t = 19_200.0)]
    pixels: f64,
    /// Edges of the longest path, where the scene leaves them unbounded
    #[arg(long, default_value_t = 12)]
    max_depth: i32,
    /// Other pictures
    #[arg(long, default_value_t = 1)]
    seed: u64,
}

/// Scenes beside those of `agree`.
const MORE: [&str; 13] = [
    "../shared/data/scenes/water-caustic/scene.xml",
    "scenes/cornell.toml",
    "scenes/cornell-diffuse.toml",
    "scenes/glass-and-mirrors.toml",
    "scenes/lamps.toml",
    "scenes/pawns.toml",
    "scenes/plates.toml",
    "scenes/sky.toml",
    "scenes/media/caustic.toml",
    "scenes/media/disco-ball.toml",
    "scenes/media/door-ajar.toml",
    "scenes/media/fog.toml",
    "scenes/media/fog-forward.toml",
];

/// What is compared.
const KINDS: [IntegratorKind; 4] = [Path, Bdpt, Mmlt, Auto];

/// One scene.
#[derive(Debug, Serialize)]
pub struct Row {
    scene: String,
    /// Relative squared error times processor seconds, for path, bdpt, mmlt and auto; auto's is that of what it chose, and its trials.
    cost: [f64; 4],
    /// The largest over the smallest of the renders' costs, for path, bdpt and mmlt.
    spread: [f64; 3],
    /// What auto chose in each round.
    chosen: Vec<Choice>,
    /// Auto over the best of the three.
    ratio: f64,
    /// Variance of the reference over the smallest error that was measured.
    reference_share: f64,
    /// Rays, samples and processor seconds of the renders of each.
    work: [[f64; 3]; 4],
}

/// All scenes.
#[derive(Debug, Serialize)]
pub struct Report {
    rows: Vec<Row>,
}

/// Runs the comparison.
pub fn run(args: &Args) -> Result<Report, String> {
    let names = if args.scenes.is_empty() {
        let known = scenes::all().into_iter().map(|c| c.file.display().to_string());
        known.chain(MORE.map(String::from)).filter(|f| std::path::Path::new(f).exists()).collect()
    } else {
        args.scenes.clone()
    };
    let mut rows = Vec::new();
    for case in scenes::chosen(&names)? {
        let scene = load::scene(&case.file)?;
        let started = Instant::now();
        let row = Session { name: &case.name, scene: &scene, args }.row()?;
        eprintln!("{} ({:.0} s)", row, started.elapsed().as_secs_f64());
        rows.push(row);
    }
    Ok(Report { rows })
}

/// The truth, as well as it is known.
struct Reference {
    mean: Vec<[f64; 3]>,
    variance: Vec<[f64; 3]>,
}

struct Session<'a> {
    name: &'a str,
    scene: &'a Scene,
    args: &'a Args,
}

impl Session<'_> {
    fn row(&self) -> Result<Row, String> {
        let rates = [Path, Bdpt, Mmlt].map(|kind| self.rate(kind));
        let [path, bdpt, mmlt] = rates;
        let rates = [path?, bdpt?, mmlt?];
        let reference = self.reference(&rates)?;
        let mut row = Row {
            scene: self.name.into(),
            cost: [0.0; 4],
            spread: [1.0; 3],
            chosen: Vec::new(),
            ratio: 0.0,
            reference_share: 0.0,
            work: [[0.0; 3]; 4],
        };
        let (mut least, mut own) = (f64::INFINITY, 0.0);
        let mut costs: [Vec<[f64; 2]>; 3] = Default::default();
        let mut overheads = Vec::new();
        for (k, kind) in KINDS.into_iter().enumerate() {
            for round in 0..self.args.rounds {
                let (outcome, seconds) = self.render(kind, self.args.seconds * rates[k % 3], u64::from(round) + 10)?;
                let (error, share) = error(&outcome, &reference);
                (least, own) = if error < least { (error, share) } else { (least, own) };
                let c = outcome.image.counters;
                let work = [c.rays as f64, c.samples as f64, seconds];
                row.work[k].iter_mut().zip(work).for_each(|(to, v)| *to += v);
                let share = outcome.choice.as_ref().and_then(|c| c.share).unwrap_or(0.0);
                let chosen = outcome.choice.as_ref().map_or(kind, |c| c.integrator);
                let place = KINDS.iter().position(|k| *k == chosen).unwrap_or_default();
                costs[place].push([error, seconds * (1.0 - share)]);
                if kind == Auto {
                    overheads.push((place, 1.0 / (1.0 - share)));
                }
                row.chosen.extend(outcome.choice);
            }
        }
        // Renders that auto made are renders by the integrator that it chose, with other seeds: their errors are pooled, so that the
        // ratio tells of the choice and of what it cost, and not of luck.
        for (k, costs) in costs.iter().enumerate() {
            let mean = |i: usize| costs.iter().map(|c| c[i]).sum::<f64>() / costs.len() as f64;
            row.cost[k] = mean(0) * mean(1);
            let each = || costs.iter().map(|c| c[0] * c[1]);
            row.spread[k] = each().fold(0.0, f64::max) / each().fold(f64::INFINITY, f64::min);
        }
        row.cost[3] = overheads.iter().map(|(place, o)| row.cost[*place] * o).sum::<f64>() / overheads.len() as f64;
        row.ratio = row.cost[3] / row.cost[..3].iter().copied().fold(f64::INFINITY, f64::min);
        row.reference_share = own / least;
        Ok(row)
    }

    fn settings(&self, kind: IntegratorKind, count: u32, seed: u64) -> Result<RenderSettings, String> {
        let (w, h) = self.scene.defaults.size.unwrap_or((160, 120));
        let scale = (self.args.pixels / (f64::from(w) * f64::from(h))).sqrt();
        let size = Some(((f64::from(w) * scale).round() as u32, (f64::from(h) * scale).round() as u32));
        let bounded = self.scene.defaults.max_depth.is_some_and(|d| d >= 0);
        let max_depth = (!bounded).then_some(self.args.max_depth);
        let options = RenderOptions { size, max_depth, seed: Some(seed), ..RenderOptions::counting(kind, count) };
        RenderSettings::resolve(&options, &self.scene.defaults).map_err(|e| e.to_string())
    }

    fn render(&self, kind: IntegratorKind, count: f64, seed: u64) -> Result<(LocalOutcome, f64), String> {
        let number = KINDS.iter().position(|k| *k == kind).unwrap_or_default() as u64;
        let seed = self.args.seed << 16 | number << 8 | seed;
        let settings = self.settings(kind, count.round().clamp(1.0, f64::from(1 << 24)) as u32, seed)?;
        let before = crate::farm::cpu_seconds(std::process::id());
        let outcome = render_local(self.scene, &settings, &LocalOptions { threads: 1 }, &Stop::new(), &mut |_| {});
        let seconds = crate::farm::cpu_seconds(std::process::id())
            .zip(before)
            .map(|(a, b)| a - b)
            .ok_or("the processor time is not told")?;
        Ok((outcome.map_err(|e| e.to_string())?, seconds))
    }

    /// Samples (mutations) per pixel and processor second.
    fn rate(&self, kind: IntegratorKind) -> Result<f64, String> {
        let mut count = 4.0;
        loop {
            let (_, seconds) = self.render(kind, count, 1)?;
            if seconds > 0.3 {
                return Ok(count / seconds);
            }
            count *= if seconds > 0.1 { 0.4 / seconds } else { 4.0 };
        }
    }

    /// bdpt and mmlt, weighted by what they tell of their errors.
    fn reference(&self, rates: &[f64; 3]) -> Result<Reference, String> {
        let mut sum: Option<(Reference, f64)> = None;
        for (kind, rate) in [(Bdpt, rates[1]), (Mmlt, rates[2])] {
            let (outcome, _) = self.render(kind, self.args.reference * rate, 2)?;
            let image = outcome.image;
            let told = image.error.map_or(f64::NAN, |e| e.upper95);
            let weight = 1.0 / (told * told);
            let (reference, total) = sum.get_or_insert_with(|| {
                let black = vec![[0.0; 3]; image.mean.len()];
                (Reference { mean: black.clone(), variance: black }, 0.0)
            });
            *total += weight;
            for i in 0..image.mean.len() {
                for c in 0..3 {
                    let error = f64::from(image.std_error[i][c]);
                    reference.mean[i][c] += weight * f64::from(image.mean[i][c]);
                    reference.variance[i][c] += weight * weight * error * error;
                }
            }
        }
        let (mut reference, total) = sum.ok_or("there is no reference")?;
        reference.mean.iter_mut().flatten().for_each(|v| *v /= total);
        reference.variance.iter_mut().flatten().for_each(|v| *v /= total * total);
        Ok(reference)
    }
}

/// Relative squared error, without what the reference adds; and what it adds.
fn error(outcome: &LocalOutcome, reference: &Reference) -> (f64, f64) {
    let (mut sum, mut own) = (0.0, 0.0);
    for ((i, r), v) in outcome.image.mean.iter().zip(&reference.mean).zip(&reference.variance) {
        for c in 0..3 {
            let d = f64::from(i[c]) - r[c];
            sum += d * d / (r[c] * r[c] + 0.01);
            own += v[c] / (r[c] * r[c] + 0.01);
        }
    }
    let n = 3.0 * reference.mean.len() as f64;
    ((sum - own) / n, own / n)
}

impl fmt::Display for Row {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{:24}", self.scene.rsplit('/').next().unwrap_or_default().trim_end_matches(".toml"))?;
        self.cost.iter().try_for_each(|c| write!(f, " {c:9.5}"))?;
        let chosen: Vec<&str> = self.chosen.iter().map(|c| c.integrator.name()).collect();
        write!(f, "  {:7.3}  {:4.0} %  {}", self.ratio, 100.0 * self.reference_share, chosen.join(" "))?;
        for c in self.chosen.iter().take(1) {
            for o in &c.trials {
                write!(f, "  {} {:.3}*{:.2}", o.integrator.name(), o.variance, o.work)?;
            }
        }
        Ok(())
    }
}

impl fmt::Display for Report {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(f, "relMSE x CPU s                path      bdpt      mmlt      auto    ratio   ref  chosen")?;
        self.rows.iter().try_for_each(|r| writeln!(f, "{r}"))?;
        let worst = self.rows.iter().map(|r| r.ratio).fold(0.0, f64::max);
        let mean = exp64(self.rows.iter().map(|r| renderer::math::ln64(r.ratio)).sum::<f64>() / self.rows.len() as f64);
        write!(f, "auto against the best: {mean:.3} in the mean, {worst:.3} at worst, of {} scenes", self.rows.len())
    }
}
