//! A job in this process: the farm's planner, units and merger, with threads in place of workers.

use super::auto::Choice;
use super::merger::Merger;
use super::plan::PassPlan;
use super::run::{Stop, UnitError, run_unit};
use super::settings::RenderSettings;
use super::unit::UnitResult;
use crate::film::MergedImage;
use crate::integrator::mmlt::ChainStats;
use crate::scene::Scene;
use std::collections::BTreeMap;
use std::sync::{Condvar, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

/// How to run a job here.
#[derive(Clone, Copy, Debug)]
pub struct LocalOptions {
    /// Render threads, at least 1.
    pub threads: usize,
}

/// What an observer is told, on the calling thread.
#[derive(Debug)]
pub enum LocalEvent<'a> {
    /// Units were folded (or some 100 ms went by).
    Progress(&'a Merger),
    /// A pass is complete.
    PassDone(&'a Merger),
}

/// How a job ended.
#[derive(Debug)]
pub struct LocalOutcome {
    /// The image of everything that was finished.
    pub image: MergedImage,
    /// How the mutations of a Metropolis job fared.
    pub chains: ChainStats,
    /// What `auto` chose.
    pub choice: Option<Choice>,
    /// Whether it was stopped before its budget.
    pub interrupted: bool,
}

/// Renders a whole job; the observer sees each step. `stop` ends it early with what is finished.
pub fn render_local(
    scene: &Scene,
    settings: &RenderSettings,
    options: &LocalOptions,
    stop: &Stop,
    observer: &mut dyn FnMut(LocalEvent<'_>),
) -> Result<LocalOutcome, UnitError> {
    let started = Instant::now();
    let mut merger = Merger::new(settings.clone());
    loop {
        let plan = merger.plan().clone();
        run_pass(scene, settings, options, &plan, stop, &mut merger, observer)?;
        if stop.stopped() && !merger.pass_complete() {
            return Ok(outcome(&merger, true));
        }
        observer(LocalEvent::PassDone(&merger));
        let time_up = settings.budget.time_s.is_some_and(|t| started.elapsed().as_secs_f64() >= t);
        if merger.advance(time_up || stop.stopped()).is_none() {
            return Ok(outcome(&merger, stop.stopped()));
        }
    }
}

fn outcome(merger: &Merger, interrupted: bool) -> LocalOutcome {
    LocalOutcome { image: merger.image(), chains: merger.chain_stats(), choice: merger.choice().cloned(), interrupted }
}

/// What the threads of a pass share.
struct Board {
    /// The next unit to give out.
    claim: u32,
    /// Units below this number may be given out: bounds the results that wait for their turn.
    limit: u32,
    finished: BTreeMap<u32, UnitResult>,
    failed: Option<UnitError>,
}

/// Results that may wait for their turn, per thread.
const WINDOW: u32 = 16;

fn run_pass(
    scene: &Scene,
    settings: &RenderSettings,
    options: &LocalOptions,
    plan: &PassPlan,
    stop: &Stop,
    merger: &mut Merger,
    observer: &mut dyn FnMut(LocalEvent<'_>),
) -> Result<(), UnitError> {
    let count = plan.unit_count();
    let window = WINDOW * options.threads.max(1) as u32;
    let board = Mutex::new(Board { claim: 0, limit: window, finished: BTreeMap::new(), failed: None });
    let (work, done) = (Condvar::new(), Condvar::new());
    let abort = Stop::new();
    std::thread::scope(|scope| {
        for _ in 0..options.threads.max(1) {
            scope.spawn(|| {
                while let Some(id) = claim(&board, &work, count, stop, &abort) {
                    let Some(unit) = plan.unit(id) else { break };
                    let result = run_unit(scene, settings, plan, &unit, stop);
                    let mut b = lock(&board);
                    match result {
                        Ok(r) => drop(b.finished.insert(id, r)),
                        Err(UnitError::Stopped) => break,
                        Err(e) => {
                            b.failed.get_or_insert(e);
                            abort.stop();
                            work.notify_all();
                        }
                    }
                    done.notify_one();
                }
                done.notify_one();
            });
        }
        let outcome = fold_pass(&board, &work, &done, window, stop, merger, observer);
        abort.stop();
        work.notify_all();
        outcome
    })?;
    // Units that finished while others were stopped, out of their turn.
    for (id, result) in std::mem::take(&mut lock(&board).finished) {
        // A result made here for this plan always fits it.
        let _ = merger.fold_interrupted(id, &result);
    }
    Ok(())
}

fn lock(board: &Mutex<Board>) -> MutexGuard<'_, Board> {
    board.lock().unwrap_or_else(PoisonError::into_inner)
}

fn claim(board: &Mutex<Board>, work: &Condvar, count: u32, stop: &Stop, abort: &Stop) -> Option<u32> {
    let mut b = lock(board);
    loop {
        if b.claim >= count || stop.stopped() || abort.stopped() {
            return None;
        }
        if b.claim < b.limit {
            b.claim += 1;
            return Some(b.claim - 1);
        }
        b = work.wait_timeout(b, Duration::from_millis(100)).unwrap_or_else(PoisonError::into_inner).0;
    }
}

/// Folds results in their turn until the pass is complete, stopped or failed.
fn fold_pass(
    board: &Mutex<Board>,
    work: &Condvar,
    done: &Condvar,
    window: u32,
    stop: &Stop,
    merger: &mut Merger,
    observer: &mut dyn FnMut(LocalEvent<'_>),
) -> Result<(), UnitError> {
    while !merger.pass_complete() && !stop.stopped() {
        let mut batch = Vec::new();
        {
            let mut b = lock(board);
            if b.finished.first_key_value().is_none_or(|(id, _)| *id != merger.next_unit()) && b.failed.is_none() {
                b = done.wait_timeout(b, Duration::from_millis(100)).unwrap_or_else(PoisonError::into_inner).0;
            }
            if let Some(e) = b.failed.take() {
                return Err(e);
            }
            while let Some(r) = b.finished.remove(&(merger.next_unit() + batch.len() as u32)) {
                batch.push(r);
            }
            b.limit = merger.next_unit() + batch.len() as u32 + window;
        }
        work.notify_all();
        for result in batch {
            // A result made here for this plan, in its turn, always fits.
            let _ = merger.fold(merger.next_unit(), &result);
        }
        observer(LocalEvent::Progress(merger));
    }
    Ok(())
}
