//! Chains whose starts are not what the pool says: some machine computes differently than the others. The first that disagrees is
//! quarantined; when a second machine disagrees as well, the pool is wrong.

use crate::farm::Farm;
use crate::ids::WorkerId;
use crate::outcome::UnitAt;
use renderer::integrator::mmlt::Mismatch;
use std::time::Duration;

/// A worker that disagrees with a pool.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Disagreement {
    /// Its name.
    name: String,
    /// Which unit and sample, what was expected and what was found.
    what: String,
}

impl Disagreement {
    fn new(name: String, at: &UnitAt, m: &Mismatch) -> Self {
        let what = format!(
            "unit {} of pass {} of job {}: sample {} of the pool for paths of {} edges was {:?} for the worker that made the pool, \
             and is {:?} here",
            at.unit, at.pass, at.job, m.index, m.edges, m.expected, m.found
        );
        Self { name, what }
    }

    /// What its user is told.
    fn quarantine(&self) -> String {
        format!(
            "{}. This machine or build computes differently: see that all workers run the same binary, test its memory and processor, \
             then start the worker again. What it delivered before stays in its jobs; those that matter should be submitted again",
            self.what
        )
    }
}

impl Farm {
    /// A worker's replay of a start disagrees with the pool: the worker is quarantined, and others do the unit. Returns why the job
    /// fails, if it does: workers on two machines disagree, and quarantining one after the other would not help.
    pub fn start_mismatched(&mut self, at: UnitAt, by: WorkerId, m: &Mismatch, now: Duration) -> Option<String> {
        let job = self.jobs.get_mut(&at.job)?;
        let p = job.pass.as_mut().filter(|p| p.plan.pass == at.pass && !p.board.done().contains(at.unit))?;
        p.board.give_back(at.epoch, at.unit, now);
        if p.pools_are_wrong {
            return None;
        }
        let w = self.workers.get_mut(&by)?;
        w.failures += 1;
        self.totals.failures += 1;
        let new = Disagreement::new(w.name.clone(), &at, m);
        let w = self.workers.get(&by)?;
        let elsewhere = |id: &WorkerId| self.workers.get(id).is_none_or(|o| !o.same_machine(w));
        let Some((_, old)) = p.mismatches.iter().find(|(id, _)| elsewhere(id)) else {
            let why = p.mismatches.entry(by).or_insert(new).quarantine();
            self.quarantine(by, &why);
            return None;
        };
        let why = format!(
            "workers {} and {} both disagree with the pools that the chains start from, so these are wrong: a worker that made them \
             computed differently. See that all workers run the same binary, test their machines, then submit the job again. \
             {}, {}; {}, {}",
            old.name, new.name, old.name, old.what, new.name, new.what
        );
        // What others report until the job has failed is no fault of theirs, nor was it of those who were quarantined for it.
        p.pools_are_wrong = true;
        for (id, d) in std::mem::take(&mut p.mismatches) {
            if let Some(w) = self.workers.get_mut(&id) {
                w.quarantined.take_if(|said| *said == d.quarantine());
            }
        }
        self.wake_all();
        Some(why)
    }
}
