//! The units of one pass and who works on them: a pure state machine. Time comes in as an argument; nothing is read or written.
//!
//! Every unit is free, held (by one lease or more, of different workers) or done. Holding is only a hint about who should work on
//! what: a result counts whoever brings it, once.

use crate::ids::{Epoch, WorkerId};
use crate::units::UnitSet;
use std::collections::{BTreeMap, BTreeSet};
use std::ops::Range;
use std::time::Duration;

/// Units that a worker was given together.
#[derive(Clone, Debug)]
pub struct Lease {
    /// Who holds it.
    pub worker: WorkerId,
    /// Those whose outcome has not come yet.
    pub units: UnitSet,
    /// When it was given out, or its latest outcome came.
    pub progress: Duration,
}

/// How fast a worker gets through the units of a job.
#[derive(Clone, Copy, Debug)]
pub struct Pace {
    /// Units at a time.
    pub threads: u32,
    /// Seconds that one takes.
    pub unit_seconds: f64,
}

/// The units of one pass.
#[derive(Clone, Debug)]
pub struct PassBoard {
    count: u32,
    free: UnitSet,
    done: UnitSet,
    leases: BTreeMap<Epoch, Lease>,
    /// The leases that hold a unit.
    holders: BTreeMap<u32, Vec<Epoch>>,
}

impl PassBoard {
    /// `count` units, of which `done` need no work.
    pub fn new(count: u32, done: UnitSet) -> Self {
        let mut free = UnitSet::default();
        let mut from = 0;
        for range in done.ranges() {
            free.insert_range(from..range.start.min(count));
            from = range.end;
        }
        free.insert_range(from..count.max(from));
        Self { count, free, done, leases: BTreeMap::new(), holders: BTreeMap::new() }
    }

    /// Number of units.
    pub fn count(&self) -> u32 {
        self.count
    }

    /// Units that are done.
    pub fn done(&self) -> &UnitSet {
        &self.done
    }

    /// Units that nobody works on.
    pub fn free(&self) -> &UnitSet {
        &self.free
    }

    /// The lease of an epoch.
    pub fn lease(&self, epoch: Epoch) -> Option<&Lease> {
        self.leases.get(&epoch)
    }

    /// Every lease.
    pub fn leases(&self) -> impl Iterator<Item = (Epoch, &Lease)> {
        self.leases.iter().map(|(e, l)| (*e, l))
    }

    /// Leases the first free units, `most` at most.
    pub fn grant(&mut self, worker: WorkerId, epoch: Epoch, most: u32, now: Duration) -> Option<Range<u32>> {
        let range = self.free.take_first(most)?;
        self.add_lease(worker, epoch, range.clone(), now);
        Some(range)
    }

    /// Leases a second time what `thief` would finish sooner than who holds it: the last units, at most half, of the lease that ends
    /// last. With `overdue` only what nobody gets on with: held by leases that stand still for far longer than a unit takes.
    pub fn grant_second(
        &mut self,
        thief: WorkerId,
        epoch: Epoch,
        pace: Pace,
        overdue: bool,
        now: Duration,
        pace_of: impl Fn(WorkerId) -> Option<Pace>,
    ) -> Option<Range<u32>> {
        let waited = |l: &Lease| now.saturating_sub(l.progress).as_secs_f64();
        let its = |l: &Lease| pace_of(l.worker).unwrap_or(pace);
        let stands_still = |l: &Lease| waited(l) > 4.0 * its(l).unit_seconds + 2.0;
        let stalled: BTreeSet<Epoch> = self.leases.iter().filter(|(_, l)| stands_still(l)).map(|(e, _)| *e).collect();
        let own: BTreeSet<Epoch> = self.leases.iter().filter(|(_, l)| l.worker == thief).map(|(e, _)| *e).collect();
        // Two at a unit are enough as long as one of them gets on.
        let open = |unit: u32| {
            let Some(holders) = self.holders.get(&unit) else { return false };
            let stuck = holders.iter().all(|e| stalled.contains(e));
            (stuck || !overdue && holders.len() == 1) && !holders.iter().any(|e| own.contains(e))
        };
        let mut best: Option<(f64, Range<u32>)> = None;
        for (e, lease) in self.leases.iter().filter(|(_, l)| l.worker != thief) {
            let Some(range) = last_run(&lease.units, open) else { continue };
            // When its holder will be through, were it alone; never, if it stands still.
            let rounds = f64::from(lease.units.len().div_ceil(its(lease).threads.max(1)));
            let alone = rounds * its(lease).unit_seconds - waited(lease);
            let left = if stalled.contains(e) { f64::INFINITY } else { alone };
            let n = (range.len() as u32).min(lease.units.len().div_ceil(2)).max(1);
            let needs = f64::from(n.div_ceil(pace.threads.max(1))) * pace.unit_seconds;
            if needs < left && best.as_ref().is_none_or(|(l, _)| left > *l) {
                best = Some((left, range.end - n..range.end));
            }
        }
        let (_, range) = best?;
        self.add_lease(thief, epoch, range.clone(), now);
        Some(range)
    }

    fn add_lease(&mut self, worker: WorkerId, epoch: Epoch, range: Range<u32>, now: Duration) {
        for unit in range.clone() {
            self.holders.entry(unit).or_default().push(epoch);
        }
        self.leases.insert(epoch, Lease { worker, units: UnitSet::from_range(range), progress: now });
    }

    /// Takes over a lease that a worker says it holds (after a restart, or when it was thought lost), as far as its units are free.
    /// Returns the units that it now holds.
    pub fn adopt(&mut self, worker: WorkerId, epoch: Epoch, claimed: &UnitSet, now: Duration) -> UnitSet {
        let mut units = UnitSet::default();
        for unit in claimed.iter().filter(|u| self.free.contains(*u)) {
            units.insert(unit);
        }
        if units.is_empty() || self.leases.contains_key(&epoch) {
            return UnitSet::default();
        }
        for unit in units.iter() {
            self.free.remove(unit);
            self.holders.insert(unit, vec![epoch]);
        }
        self.leases.insert(epoch, Lease { worker, units: units.clone(), progress: now });
        units
    }

    /// A unit's result is stored: nobody needs to work on it. Returns who did; `None` when it was done before.
    pub fn complete(&mut self, unit: u32, now: Duration) -> Option<Vec<(Epoch, WorkerId)>> {
        if unit >= self.count || !self.done.insert(unit) {
            return None;
        }
        self.free.remove(unit);
        let mut freed = Vec::new();
        for epoch in self.holders.remove(&unit).unwrap_or_default() {
            if let Some(worker) = self.forget(epoch, unit, now) {
                freed.push((epoch, worker));
            }
        }
        Some(freed)
    }

    /// A lease gives a unit back undone.
    pub fn give_back(&mut self, epoch: Epoch, unit: u32, now: Duration) -> bool {
        let holds = self.leases.get(&epoch).is_some_and(|l| l.units.contains(unit));
        if holds {
            self.forget(epoch, unit, now);
            self.unhold(epoch, unit);
        }
        holds
    }

    /// Ends a lease; its units that nobody else holds are free again.
    pub fn release(&mut self, epoch: Epoch) -> Option<Lease> {
        let lease = self.leases.remove(&epoch)?;
        lease.units.iter().for_each(|u| self.unhold(epoch, u));
        Some(lease)
    }

    /// Takes a unit off a lease, and the lease off the board with its last unit.
    fn forget(&mut self, epoch: Epoch, unit: u32, now: Duration) -> Option<WorkerId> {
        let lease = self.leases.get_mut(&epoch)?;
        lease.units.remove(unit);
        lease.progress = now;
        let worker = lease.worker;
        if lease.units.is_empty() {
            self.leases.remove(&epoch);
        }
        Some(worker)
    }

    fn unhold(&mut self, epoch: Epoch, unit: u32) {
        let Some(holders) = self.holders.get_mut(&unit) else { return };
        holders.retain(|e| *e != epoch);
        if holders.is_empty() {
            self.holders.remove(&unit);
            self.free.insert(unit);
        }
    }
}

/// The last run of units for which `open` holds.
fn last_run(units: &UnitSet, open: impl Fn(u32) -> bool) -> Option<Range<u32>> {
    let end = units.iter().rev().find(|u| open(*u))? + 1;
    let run = (0..end).rev().take_while(|u| units.contains(*u) && open(*u)).count() as u32;
    Some(end - run..end)
}

#[cfg(test)]
#[path = "lease_tests.rs"]
mod tests;
