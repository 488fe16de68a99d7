//! From renders to the figures of a scene.

use super::document::{Curve, EqualError, EqualTime, EqualTimeRow, Pictures, Point, ReferenceAbout, SceneReport};
use super::equal::{self, Line};
use super::measure::{Clock, Level, Maker, Stage, Track};
use super::picture;
use super::truth::{SHARE, Truth};
use crate::error::measure::{Deviation, Measure, Target, compare as deviation};
use crate::error::stats::{self, mean_without};
use compare::flip;
use compare::metrics::Metrics;
use compare::pair::Pair;

/// The name of the renderer that all integrators of this build belong to.
pub const OWN: &str = "lightfarm";

/// All figures of a scene.
pub fn evaluate(stage: &Stage<'_>, tracks: &[Track], truth: &Truth, budget: &str) -> Result<SceneReport, String> {
    let rounds = tracks.iter().flat_map(|t| &t.levels).map(|l| l.shots.len()).max().unwrap_or(0);
    let mut curves: Vec<Curve> = Vec::with_capacity(tracks.len());
    for track in tracks {
        curves.push(curve(stage, track, &truth.target)?);
    }
    let equal_time = equal_time(&curves);
    for (curve, track) in curves.iter_mut().zip(tracks) {
        curve.pictures = pictures(stage, track, truth, equal_time.seconds)?;
    }
    let made = truth.about.clone();
    let reference = ReferenceAbout {
        made_by: made,
        relmse: truth.relmse,
        published: truth.published.clone(),
        picture: picture::of_radiance(&truth.target.mean, stage.size)?,
    };
    Ok(SceneReport {
        name: stage.bench.name.clone(),
        file: stage.bench.file.display().to_string(),
        size: stage.size,
        max_depth: stage.bench.max_depth,
        threads: stage.threads,
        rounds,
        cpu_clock: stage.clock == Clock::Cpu,
        budget: budget.into(),
        equal_error: equal_errors(&curves, rounds),
        notes: notes(stage, &curves, &truth.about),
        reference,
        curves,
        equal_time,
    })
}

fn notes(stage: &Stage<'_>, curves: &[Curve], reference: &str) -> Vec<String> {
    let mut notes = Vec::new();
    let own = reference.starts_with(OWN);
    if own && curves.iter().any(|c| c.name == stage.bench.reference) {
        notes.push(format!(
            "the reference was made by {} itself, with other seeds: a bias of its own would not show",
            stage.bench.reference
        ));
    }
    for c in curves {
        if let Some(why) = &c.failed {
            notes.push(format!("{} was given up: {why}", c.name));
        }
        let rejected = c.points.iter().filter(|p| p.rejected).count();
        if rejected > 0 {
            let limit = 100.0 * SHARE;
            notes.push(format!(
                "{}: {rejected} checkpoints are rejected, as the reference's variance is more than {limit:.0} % of their error; \
                 a larger --budget makes a longer reference",
                c.name
            ));
        }
    }
    notes
}

fn curve(stage: &Stage<'_>, track: &Track, target: &Target) -> Result<Curve, String> {
    let shots = || track.levels.iter().flat_map(|l| &l.shots);
    let (renderer, covers) = match &track.contender.maker {
        Maker::Own(_) => (OWN.to_string(), "the job with its set-up; reading the scene is apart".to_string()),
        Maker::Other(e) => (e.name().to_string(), e.covers().to_string()),
    };
    let mut points = Vec::with_capacity(track.levels.len());
    for level in &track.levels {
        points.push(point(stage, level, target)?);
    }
    let line = line(&points, None, |p| &p.rounds_relmse);
    Ok(Curve {
        name: track.contender.name.clone(),
        renderer,
        covers,
        load_s: median(shots().filter_map(|s| s.load_s)),
        warmup_s: median(shots().filter_map(|s| s.warmup_s)),
        peak_mib: shots().filter_map(|s| s.peak_mib).reduce(f64::max),
        slope: line.slope(5),
        points,
        pictures: None,
        failed: track.failed.clone(),
    })
}

fn median(values: impl Iterator<Item = f64>) -> Option<f64> {
    let mut values: Vec<f64> = values.collect();
    values.sort_by(f64::total_cmp);
    values.get(values.len() / 2).copied()
}

fn point(stage: &Stage<'_>, level: &Level, target: &Target) -> Result<Point, String> {
    let reference: Vec<[f32; 3]> = target.mean.iter().map(|p| p.map(|v| v as f32)).collect();
    let (mut deviations, mut mapes, mut flips) = (Vec::<Deviation>::new(), Vec::new(), Vec::new());
    for shot in &level.shots {
        deviations.push(deviation(&shot.pixels, target).ok_or("no pixel of the reference is finite")?);
        let pair = Pair::from_pixels(stage.size.0, stage.size.1, shot.pixels.clone(), reference.clone());
        mapes.push(Metrics::of(&pair).map_or(f64::NAN, |m| m.mape));
        flips.extend(flip::hdr(&pair).map(|f| f.mean));
    }
    let of = |m: Measure| deviations.iter().map(|d| d.error(m)).collect::<Vec<f64>>();
    let positive = |values: &[f64]| stats::positive(values.len(), |j| mean_without(values, j));
    let seconds: Vec<f64> = level.shots.iter().map(|s| s.seconds).collect();
    let cpu: Option<Vec<f64>> = level.shots.iter().map(|s| s.cpu_seconds).collect();
    let relmse = of(Measure::RelMse);
    let mean = mean_without(&relmse, None);
    let share =
        deviations.iter().map(|d| d.reference[Measure::RelMse as usize]).sum::<f64>() / relmse.len() as f64 / mean;
    let wall = mean_without(&seconds, None);
    Ok(Point {
        count: level.count,
        seconds: stats::mean(&seconds),
        cpu_seconds: cpu.map(|c| mean_without(&c, None)),
        relmse: positive(&relmse),
        relmse_trimmed: positive(&of(Measure::RelMseTrimmed)),
        mse: positive(&of(Measure::Mse)),
        mape: stats::mean(&mapes),
        flip: (flips.len() == mapes.len()).then(|| stats::mean(&flips)),
        mean_ratio: stats::mean(&deviations.iter().map(|d| d.mean_ratio).collect::<Vec<_>>()),
        reference_share: share,
        // Also where the share is not a number.
        rejected: !(0.0..=SHARE).contains(&share),
        efficiency: 1.0 / (mean * wall * stage.threads as f64),
        rounds_trimmed: of(Measure::RelMseTrimmed),
        rounds_s: seconds,
        rounds_relmse: relmse,
    })
}

/// An error of a checkpoint in every round.
type ByRound = fn(&Point) -> &Vec<f64>;

/// The curve of all rounds, or of all but one.
fn line(points: &[Point], left_out: Option<usize>, error: ByRound) -> Line {
    let kept = points.iter().filter(|p| !p.rejected);
    Line::new(kept.map(|p| (mean_without(&p.rounds_s, left_out), mean_without(error(p), left_out))))
}

/// Errors at the latest time that all curves reach; those that have no points don't count.
fn equal_time(curves: &[Curve]) -> EqualTime {
    let with = |value: fn(&Point) -> f64| {
        move |c: &Curve| Line::new(c.points.iter().filter(|p| !p.rejected).map(|p| (p.seconds.value, value(p))))
    };
    let relmse = with(|p| p.relmse.value);
    let seconds = curves.iter().filter_map(|c| relmse(c).end()).fold(f64::INFINITY, f64::min);
    if !seconds.is_finite() {
        return EqualTime::default();
    }
    let at = |line: Line| line.error_at(seconds).unwrap_or(f64::NAN);
    let rows = curves.iter().map(|c| EqualTimeRow {
        name: c.name.clone(),
        relmse: at(relmse(c)),
        relmse_trimmed: at(with(|p| p.relmse_trimmed.value)(c)),
        mape: at(with(|p| p.mape.value)(c)),
        flip: at(with(|p| p.flip.map_or(f64::NAN, |f| f.value))(c)),
    });
    EqualTime { seconds, rows: rows.collect() }
}

/// Each contender against the best of lightfarm; the intervals are those of the logarithms by the jackknife over rounds.
fn equal_errors(curves: &[Curve], rounds: usize) -> Vec<EqualError> {
    let mut all = Vec::new();
    let measures: [(&str, ByRound); 2] = [("relMSE", |p| &p.rounds_relmse), ("trimmed relMSE", |p| &p.rounds_trimmed)];
    for (measure, error) in measures {
        let of = |c: &Curve, left_out| line(&c.points, left_out, error);
        let Some(best) = best_own(curves, |c| of(c, None)) else { continue };
        for c in curves {
            let Some((_, level, bound)) = equal::ratio(&of(c, None), &of(best, None)) else { continue };
            // The error is held fixed, so that what is left out moves the times alone.
            let time = |c: &Curve, j| of(c, j).seconds_to(level).or_else(|| of(c, j).end()).unwrap_or(f64::NAN);
            let ratio = stats::positive(rounds, |j| time(c, j) / time(best, j));
            all.push(EqualError {
                measure: measure.into(),
                name: c.name.clone(),
                renderer: c.renderer.clone(),
                by: best.name.clone(),
                error: level,
                ratio,
                bound: bound.into(),
            });
        }
    }
    all
}

/// The integrator of this build that is sooner than all others.
fn best_own(curves: &[Curve], line: impl Fn(&Curve) -> Line) -> Option<&Curve> {
    let mut own = curves.iter().filter(|c| c.renderer == OWN && line(c).lowest().is_some());
    let first = own.next()?;
    Some(own.fold(first, |best, c| match equal::ratio(&line(c), &line(best)) {
        Some((ratio, ..)) if ratio < 1.0 => c,
        _ => best,
    }))
}

/// Pictures at the checkpoint whose time is closest to `seconds`.
fn pictures(stage: &Stage<'_>, track: &Track, truth: &Truth, seconds: f64) -> Result<Option<Pictures>, String> {
    use renderer::math::ln64;
    let mean = |l: &Level| l.shots.iter().map(|s| s.seconds).sum::<f64>() / l.shots.len() as f64;
    let distance = |l: &Level| (ln64(mean(l)) - ln64(seconds)).abs();
    let Some(level) = track.levels.iter().min_by(|a, b| distance(a).total_cmp(&distance(b))) else { return Ok(None) };
    let Some(shot) = level.shots.first() else { return Ok(None) };
    let shots: Vec<&[[f32; 3]]> = level.shots.iter().map(|s| s.pixels.as_slice()).collect();
    Ok(Some(Pictures {
        count: level.count,
        seconds: mean(level),
        render: picture::of_pixels(&shot.pixels, stage.size)?,
        deviation: picture::deviation(&shots, &truth.target, stage.size)?,
        flip: picture::flip(&shot.pixels, &truth.target.mean, stage.size)?,
    }))
}
