//! What trials show, and which integrator that speaks for.

use super::measure::{Part, Sample};
use super::{Choice, GROUPS, Outcome};
use crate::film::{Counters, Filter};
use crate::integrator::{IntegratorKind, JOIN_RAY};
use crate::job::metropolis;
use crate::job::rendering::Rendering;
use crate::job::settings::RenderSettings;

/// How much better chains must look: what a short trial says of them is the least certain.
const MARGIN: f64 = 1.3;

/// What the trials so far show.
pub fn outcomes(trials: &[&Rendering]) -> Vec<Outcome> {
    let [path, alone, bdpt, moments, ..] = trials else { return Vec::new() };
    let (path_sample, bdpt_sample) = (Sample::new(path, Part::Whole), Sample::new(bdpt, Part::Whole));
    let weights = bdpt_sample.weights(&path_sample);
    let of_group = |r: &Rendering| f64::from(r.done_spp()) / f64::from(GROUPS);
    let each = |c: &Counters, kind| if c.samples == 0 { 0.0 } else { work_of(c, kind) / c.samples as f64 };
    let unit = {
        let of = |r: &Rendering| each(&r.spent().samples, IntegratorKind::Path);
        of(alone) + JOIN_RAY * (of(path) - of(alone)).max(0.0)
    };
    // What its own trial shows, or bidirectional samples of what it would find seldom, or has to miss.
    let seen = path_sample.relative_variance(&weights, false) * of_group(path);
    let s = path.settings();
    let spread = Filter::new(&s.filter, s.width, s.height).spread();
    let alone_sample = Sample::new(alone, Part::Whole);
    let seen_alone = alone_sample.relative_variance(&weights, false) * of_group(alone);
    let moments = Sample::new(moments, Part::Whole);
    let means = [&path_sample, &bdpt_sample];
    let excess = moments.relative_excess(&weights, means, spread, &alone_sample, of_group(alone));
    // What sharing takes from the noise that is seen it takes from that which is not, as far as is known.
    let left = if seen_alone > 0.0 { (seen / seen_alone).min(1.0) } else { 1.0 };
    let unseen = left * excess + path_sample.unseen(&bdpt_sample, f64::from(path.done_spp()));
    let own = |r: &Rendering, kind| each(&r.spent().samples, kind) / unit;
    let mut outcomes = vec![
        Outcome { integrator: IntegratorKind::Path, variance: seen + unseen, unseen, work: 1.0 },
        Outcome {
            integrator: IntegratorKind::Bdpt,
            variance: bdpt_sample.relative_variance(&weights, false) * of_group(bdpt),
            unseen: 0.0,
            work: own(bdpt, IntegratorKind::Bdpt),
        },
    ];
    if let [_, _, _, _, samples, mmlt] = trials {
        let s = mmlt.settings();
        let splats = Sample::new(mmlt, Part::Splats);
        let of_mutations = splats.relative_variance(&weights, true) * of_group(mmlt);
        let of_samples = Sample::new(samples, Part::Whole).relative_variance(&weights, false) * of_group(samples);
        let whole = Sample::new(mmlt, Part::Whole);
        let unseen = whole.unseen(&bdpt_sample, f64::from(mmlt.done_spp()));
        let spent = mmlt.spent();
        let work = metropolis::chain_share(s) * each(&spent.chains, IntegratorKind::Mmlt)
            + metropolis::pools_per_mutation(s) * each(&spent.pools, IntegratorKind::Mmlt);
        let of_sample = each(&spent.samples, IntegratorKind::Path);
        // As many ordinary samples as pay best, which the render's pilot comes near.
        let best = (of_samples * work / (of_mutations * of_sample)).sqrt();
        let direct = match f64::from(s.mmlt.direct_share) {
            0.0 if best.is_nan() => metropolis::MOST_SHARE,
            0.0 => best.clamp(metropolis::LEAST_SHARE, metropolis::MOST_SHARE),
            told => told,
        };
        let work = work + direct * of_sample;
        let variance = of_mutations + of_samples / direct + unseen;
        outcomes.push(Outcome { integrator: IntegratorKind::Mmlt, variance, unseen, work: work / unit });
    }
    outcomes
}

/// What was done, in the time of a ray of `path`. What goes on between two rays differs: as measured on cornell-box, veach-mis,
/// cornell-diffuse, plates, glossy-cornell and glass-caustic, a ray takes 1.1 to 1.4 times as long in `bdpt` and 1.05 to 1.2 in `mmlt`.
pub fn work_of(c: &Counters, kind: IntegratorKind) -> f64 {
    let ray = match kind {
        IntegratorKind::Bdpt | IntegratorKind::Moments => 1.2,
        IntegratorKind::Mmlt => 1.12,
        _ => 1.0,
    };
    ray * c.rays as f64
}

/// The choice and the settings of the render; `learning` is the work that went into knowing the lights.
pub fn choose(
    job: &RenderSettings,
    trials: &[&Rendering],
    outcomes: Vec<Outcome>,
    learning: f64,
) -> (Choice, RenderSettings) {
    let finite = |o: &&Outcome| o.cost().is_finite();
    let handicap = |o: &Outcome| o.cost() * if o.integrator == IntegratorKind::Mmlt { MARGIN } else { 1.0 };
    let best = outcomes.iter().filter(finite).min_by(|a, b| handicap(a).total_cmp(&handicap(b)));
    let best =
        best.copied().unwrap_or(Outcome { integrator: IntegratorKind::Path, variance: 0.0, unseen: 0.0, work: 1.0 });
    let kind = |r: &Rendering| r.settings().integrator;
    let spent_on = |r: &&Rendering| {
        let s = r.spent();
        work_of(&s.samples, if kind(r) == IntegratorKind::Mmlt { IntegratorKind::Path } else { kind(r) })
            + work_of(&s.pools, kind(r))
            + work_of(&s.chains, kind(r))
    };
    let path = &trials[0].spent().samples;
    let spent: f64 = (learning + trials.iter().map(spent_on).sum::<f64>())
        / (work_of(path, IntegratorKind::Path) / path.samples as f64);
    // `--spp` is what path would take: the trials come off it, and the rest is worth so many of the chosen one's samples.
    let count = job.budget.spp.map(|n| {
        let left = (f64::from(n) - spent / job.pixels()).max(0.0);
        (left / best.work).round().clamp(1.0, f64::from(1 << 24)) as u32
    });
    let share = job.budget.spp.map(|n| spent / (f64::from(n) * job.pixels()));
    let why = reason(&best, &outcomes);
    let choice = Choice { integrator: best.integrator, why, trials: outcomes, share };
    (choice, job.rendered_by(best.integrator, count))
}

/// Why `best` was chosen.
fn reason(best: &Outcome, outcomes: &[Outcome]) -> String {
    let others = outcomes.iter().filter(|o| o.integrator != best.integrator);
    let text = others.map(|o| {
        let ratio = o.cost() / best.cost();
        let unseen = if o.unseen > 0.5 * o.variance { ", as it misses light" } else { "" };
        if ratio.is_finite() {
            format!("{} would take {ratio:.2} times as long to the same error{unseen}", o.integrator.name())
        } else {
            format!("{} would take longer", o.integrator.name())
        }
    });
    text.collect::<Vec<_>>().join(", ")
}
