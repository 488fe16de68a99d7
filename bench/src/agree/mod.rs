//! Do all integrators render the same picture? Each is compared with `path`, scene by scene, and with radiances that are known.

mod compare;
mod picture;
mod render;
mod report;
pub mod scenes;
#[cfg(test)]
mod tests;

pub use report::{Report, table};

use crate::load;
use compare::{Comparison, compare};
use picture::Picture;
use render::{Effort, Limits, Rendering, Task};
use renderer::integrator::IntegratorKind;
use renderer::scene::Scene;
use report::Row;
use scenes::Case;

/// Compares integrators with one another.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// Names or files of scenes [default: all that the budget does justice]
    #[arg(long, value_delimiter = ',')]
    scenes: Vec<String>,
    /// Integrators to compare with `path` [default: all]
    #[arg(long, value_delimiter = ',')]
    integrators: Vec<IntegratorKind>,
    /// How much to render
    #[arg(long, value_enum, default_value_t = Budget::Quick)]
    budget: Budget,
    /// Other pictures
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// Render threads
    #[arg(long, default_value_t = 2)]
    threads: usize,
}

/// How much to render.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
enum Budget {
    /// Two minutes or so: image means to 2 % and better, those of mmlt to 25 %
    Quick,
    /// Hours: image means to 0.3 %
    Full,
}

impl Budget {
    fn effort(self) -> Effort {
        match self {
            Self::Quick => Effort {
                pilot_spp: 32,
                least_spp: 256,
                aim: 0.005,
                samples: Limits { required: 0.02, rays: 3e6 },
                chains: Limits { required: 0.25, rays: 1.2e7 },
            },
            Self::Full => Effort {
                pilot_spp: 128,
                least_spp: 1024,
                aim: 0.002,
                samples: Limits { required: 0.003, rays: 1e9 },
                chains: Limits { required: 0.003, rays: 3e8 },
            },
        }
    }
}

/// Depth limit under which known radiances are tested, beside none.
const SHALLOW: u32 = 4;

/// Runs the comparison.
pub fn run(args: &Args) -> Result<Report, String> {
    let all = || IntegratorKind::ALL.iter().map(|(_, kind)| *kind).collect();
    let mut kinds = if args.integrators.is_empty() { all() } else { args.integrators.clone() };
    kinds.retain(|k| *k != IntegratorKind::Path);
    let cases = if args.scenes.is_empty() { defaults(args.budget) } else { scenes::chosen(&args.scenes)? };
    let mut rows = Vec::new();
    for case in &cases {
        let session = Session { case, scene: load::scene(&case.file)?, args, effort: args.budget.effort() };
        session.run(&kinds, &mut rows)?;
    }
    Ok(Report::new(rows))
}

/// The scenes at hand.
fn defaults(budget: Budget) -> Vec<Case> {
    let mut cases = scenes::all();
    cases.retain(|c| budget == Budget::Full || !c.full_only);
    cases.retain(|c| {
        if !c.file.exists() {
            eprintln!("not here, left out: {}", c.file.display());
        }
        c.file.exists()
    });
    cases
}

/// One scene.
struct Session<'a> {
    case: &'a Case,
    scene: Scene,
    args: &'a Args,
    effort: Effort,
}

impl Session<'_> {
    fn run(&self, kinds: &[IntegratorKind], rows: &mut Vec<Row>) -> Result<(), String> {
        let path = self.render(IntegratorKind::Path, None)?;
        let reference = path.picture();
        rows.push(self.row(&path, IntegratorKind::Path.name(), None));
        self.known(&path, IntegratorKind::Path, rows)?;
        if !self.scene.features.has_media() {
            let shared = self.task(IntegratorKind::Path, None, true).run(&self.effort)?;
            let comparison = compare(&shared.image, &shared.picture(), &reference);
            rows.push(self.row(&shared, "shared", Some(("path".into(), comparison))));
        }
        for &kind in kinds.iter().filter(|k| **k != IntegratorKind::Light || self.case.light) {
            let own = self.render(kind, None)?;
            let comparison = compare(&own.image, &own.picture(), &reference);
            rows.push(self.row(&own, kind.name(), Some(("path".into(), comparison))));
            self.known(&own, kind, rows)?;
        }
        Ok(())
    }

    /// Tests against the radiance that is known, with and without a depth limit.
    fn known(&self, own: &Rendering, kind: IntegratorKind, rows: &mut Vec<Row>) -> Result<(), String> {
        let Some(exact) = self.case.exact else { return Ok(()) };
        let mut test = |own: &Rendering, depth: Option<u32>| {
            let truth = exact(depth);
            let comparison = compare(&own.image, &own.picture(), &Picture::Exact(truth));
            let name = depth.map_or(format!("{truth}"), |d| format!("{truth} to depth {d}"));
            rows.push(self.row(own, kind.name(), Some((name, comparison))));
        };
        test(own, None);
        test(&self.render(kind, Some(SHALLOW))?, Some(SHALLOW));
        Ok(())
    }

    fn render(&self, kind: IntegratorKind, max_depth: Option<u32>) -> Result<Rendering, String> {
        // Of the others, `mmlt` takes several samples of lights then; the pixels of none share paths.
        self.task(kind, max_depth, kind != IntegratorKind::Path).run(&self.effort)
    }

    fn task(&self, kind: IntegratorKind, max_depth: Option<u32>, share: bool) -> Task<'_> {
        // No two of them share a random number.
        let number = IntegratorKind::ALL.iter().position(|(_, k)| *k == kind).unwrap_or_default() as u64;
        let shared_path = share && kind == IntegratorKind::Path;
        let number = if shared_path { IntegratorKind::ALL.len() as u64 } else { number };
        Task {
            scene: &self.scene,
            kind,
            share,
            size: self.case.size,
            max_depth,
            seed: self.args.seed << 6 | number,
            threads: self.args.threads,
        }
    }

    fn row(&self, own: &Rendering, name: &'static str, against: Option<(String, Comparison)>) -> Row {
        let (against, comparison) = against.unzip();
        let row = Row {
            scene: self.case.name.clone(),
            integrator: name,
            against,
            spp: own.spp,
            seconds: own.seconds,
            half_width: own.picture().half_width(),
            required: self.effort.limits(own.kind).required,
            dropped: own.image.counters.non_finite + own.image.counters.negative,
            comparison,
            verdict: report::Verdict::Agrees,
        };
        eprintln!("{}", report::figures(&row));
        row
    }
}
