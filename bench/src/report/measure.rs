//! Many short renders by all contenders in turn, at sample counts that double.

use super::external::{External, Request};
use super::scene::{BenchScene, Budget};
use crate::error::process;
use crate::error::runs;
use crate::error::variant::{self, Variant};
use renderer::job::RenderSettings;
use renderer::scene::Scene;

/// What the time of a render is.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
pub enum Clock {
    /// Seconds on the wall.
    Wall,
    /// Processor seconds of all threads over the number of threads: what an idle machine would take at best. For machines that do other
    /// things as well.
    Cpu,
}

/// What makes the pictures.
#[derive(Clone, Debug)]
pub enum Maker {
    /// An integrator of this build, in this process.
    Own(Variant),
    /// Another program.
    Other(External),
}

/// One that is measured.
#[derive(Clone, Debug)]
pub struct Contender {
    /// Its name.
    pub name: String,
    /// What makes its pictures.
    pub maker: Maker,
}

/// One render.
#[derive(Debug)]
pub struct Shot {
    /// Wall seconds, without reading the scene.
    pub seconds: f64,
    /// Processor seconds of all threads.
    pub cpu_seconds: Option<f64>,
    /// Seconds to read the scene.
    pub load_s: Option<f64>,
    /// Seconds of compilation and warming up that are not in `seconds`.
    pub warmup_s: Option<f64>,
    /// Largest resident memory.
    pub peak_mib: Option<f64>,
    /// The picture.
    pub pixels: Vec<[f32; 3]>,
}

/// All renders with one sample count.
#[derive(Debug)]
pub struct Level {
    /// Samples, light paths or mutations per pixel.
    pub count: u32,
    /// One for each round.
    pub shots: Vec<Shot>,
}

/// All renders of one contender.
#[derive(Debug)]
pub struct Track {
    /// Who.
    pub contender: Contender,
    /// By rising sample count.
    pub levels: Vec<Level>,
    /// Why it was given up.
    pub failed: Option<String>,
}

/// A scene that is ready to render.
pub struct Stage<'a> {
    /// What it is.
    pub bench: &'a BenchScene,
    /// The scene, loaded.
    pub scene: &'a Scene,
    /// Seconds that took.
    pub load_s: f64,
    /// Resident memory of this process since then.
    pub resident_mib: f64,
    /// Width and height in pixels.
    pub size: (u32, u32),
    /// Render threads.
    pub threads: usize,
    /// The first seed.
    pub seed: u64,
    /// What times are.
    pub clock: Clock,
}

impl Stage<'_> {
    /// Settings of a render by lightfarm.
    pub fn settings(&self, v: &Variant, count: u32, seed: u64) -> Result<RenderSettings, String> {
        let shared = variant::Budget { spp: Some(count), ..Default::default() };
        let mut options = v.render_options(shared)?;
        (options.size, options.max_depth, options.seed) = (Some(self.size), Some(self.bench.max_depth), Some(seed));
        RenderSettings::resolve(&options, &self.scene.defaults).map_err(|e| format!("{}: {e}", v.name))
    }

    fn shoot(&self, maker: &Maker, count: u32, seed: u64, startup: (f64, f64)) -> Result<Shot, String> {
        let mut shot = match maker {
            Maker::Own(v) => {
                let run = runs::render(self.scene, &self.settings(v, count, seed)?, self.threads)?;
                Shot {
                    seconds: run.seconds,
                    cpu_seconds: run.cpu_seconds,
                    load_s: Some(self.load_s),
                    warmup_s: None,
                    peak_mib: run.peak_mib,
                    pixels: run.pixels,
                }
            }
            Maker::Other(e) => e.render(self.request(count, seed), startup)?,
        };
        if self.clock == Clock::Cpu {
            let told = shot.cpu_seconds.ok_or("it does not tell its processor time, which --clock cpu needs")?;
            shot.seconds = (told / self.threads as f64).max(1e-4);
        }
        Ok(shot)
    }

    fn request(&self, spp: u32, seed: u64) -> Request<'_> {
        Request { scene: self.bench, size: self.size, spp, seed, threads: self.threads }
    }
}

/// Renders until the budget is spent: in the first round each contender doubles its samples as long as the next render should stay
/// below the longest that is allowed; further rounds repeat the same with other seeds. Within a count all contenders take turns.
pub fn measure(stage: &Stage<'_>, contenders: &[Contender], budget: Budget, rounds: usize) -> Vec<Track> {
    let mut tracks: Vec<Track> =
        contenders.iter().map(|c| Track { contender: c.clone(), levels: Vec::new(), failed: None }).collect();
    let startups: Vec<(f64, f64)> = tracks.iter_mut().map(|t| startup(stage, t)).collect();
    for t in &tracks {
        // The first render of a process finds caches cold. What fails here fails again where it is reported.
        if matches!(t.contender.maker, Maker::Own(_)) {
            let _ = stage.shoot(&t.contender.maker, 1, stage.seed, (0.0, 0.0));
        }
    }
    for round in 0..rounds {
        let deepest = tracks.iter().map(|t| t.levels.len()).max().unwrap_or(0);
        let mut level = 0;
        loop {
            let mut rendered = false;
            for (track, startup) in tracks.iter_mut().zip(&startups) {
                rendered |= step(stage, track, *startup, (round, level), budget);
            }
            level += 1;
            if !rendered || (round > 0 && level >= deepest) {
                break;
            }
        }
        eprintln!("{}: round {} of {rounds}", stage.bench.name, round + 1);
    }
    tracks
}

fn startup(stage: &Stage<'_>, track: &mut Track) -> (f64, f64) {
    let Maker::Other(e) = &track.contender.maker else { return (0.0, 0.0) };
    e.startup(stage.request(1, stage.seed)).unwrap_or_else(|message| {
        track.failed = Some(message);
        (0.0, 0.0)
    })
}

/// One render of one contender, if its turn has come; whether there was one.
fn step(
    stage: &Stage<'_>,
    track: &mut Track,
    startup: (f64, f64),
    (round, level): (usize, usize),
    budget: Budget,
) -> bool {
    if track.failed.is_some() {
        return false;
    }
    let first = match &track.contender.maker {
        Maker::Own(_) => 1,
        Maker::Other(e) => e.first_spp(),
    };
    let count = first << level;
    if round == 0 {
        let last = track.levels.last().and_then(|l| l.shots.first()).map(|s| s.seconds);
        if last.is_some_and(|s| 2.0 * s > budget.longest_s()) || count > 1 << 20 {
            return false;
        }
    } else if level >= track.levels.len() {
        return false;
    }
    // Every render has a seed of its own.
    let seed = stage.seed + (round * 64 + level) as u64;
    // What the benchmark has come to keep since it loaded the scene is not the renderer's.
    let own = matches!(track.contender.maker, Maker::Own(_));
    let held = process::resident_mib().filter(|_| own).map_or(0.0, |now| now - stage.resident_mib);
    match stage.shoot(&track.contender.maker, count, seed, startup) {
        Ok(mut shot) => {
            shot.peak_mib = shot.peak_mib.map(|p| (p - held).max(0.0));
            if round == 0 {
                track.levels.push(Level { count, shots: Vec::new() });
            }
            track.levels[level].shots.push(shot);
            true
        }
        Err(message) => {
            eprintln!("{}: {} is given up: {message}", stage.bench.name, track.contender.name);
            track.failed = Some(message);
            track.levels.retain(|l| l.shots.len() > round);
            false
        }
    }
}
