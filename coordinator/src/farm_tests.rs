//! The scheduler against simulated workers: replies that get lost, workers that crash and hang, a coordinator that restarts.
//! Whatever happens, every unit is stored once, and when the faults end the job ends.

use super::*;
use crate::ids::Epoch;
use crate::outcome::{Interest, UnitAt};
use crate::sync::{Held, Poll, Report};
use renderer::integrator::IntegratorKind;
use renderer::integrator::mmlt::{ChainStart, Mismatch};
use renderer::job::{Learned, Part, Planner, RenderOptions, RenderSettings};
use renderer::scene::desc::RenderDefaults;
use uuid::Uuid;

struct Random(u64);

impl Random {
    fn below(&mut self, n: u32) -> u32 {
        self.0 = self.0.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
        ((self.0 >> 33) % u64::from(n.max(1))) as u32
    }

    fn chance(&mut self, percent: u32) -> bool {
        self.below(100) < percent
    }
}

fn at(seconds: f64) -> Duration {
    Duration::from_secs_f64(seconds)
}

/// A job of `side` x `side` pixels; of paths, one unit per 128 x 128 pixels in its first pass.
fn settings(integrator: IntegratorKind, side: u32) -> RenderSettings {
    let options = RenderOptions { size: Some((side, side)), ..RenderOptions::counting(integrator, 64) };
    RenderSettings::resolve(&options, &RenderDefaults::default()).unwrap()
}

fn job(id: JobId, priority: i32, settings: RenderSettings) -> Job {
    let zero = Digest([0; 32]);
    let spec = JobSpec {
        name: "job".into(),
        priority,
        manifest: zero,
        scene: zero,
        settings_json: String::new(),
        settings,
        lights: 1,
        payload: zero,
        submitted_ms: 0,
    };
    Farm::new_job(id, spec, JobState::Active)
}

/// The passes of a job as they could be: what the later ones depend on is made up.
fn plans(settings: &RenderSettings) -> Vec<Arc<PassPlan>> {
    let planner = Planner::new(settings.clone());
    let first = planner.first();
    let later = match settings.integrator {
        IntegratorKind::Path | IntegratorKind::Light => Vec::new(),
        IntegratorKind::Bdpt => planner.next(1, first.spp() as u32, Learned::default()).into_iter().collect(),
        IntegratorKind::Mmlt => {
            let groups = 0..settings.replicates;
            let pools = groups.clone().map(|replicate| Part::Bootstrap { replicate, samples: 10_000 }).collect();
            let chains = |replicate| {
                let starts = vec![ChainStart(1, 1, 0.5); 6];
                Part::Chains { replicate, edges: 3, b: 0.1, starts, mutations: 1 << 17 }
            };
            let chains = groups.map(chains).chain(first.parts.first().cloned()).collect();
            let pass = |pass, parts, chain_weight, last| PassPlan { pass, parts, chain_weight, last, ..first.clone() };
            vec![pass(1, pools, 0, false), pass(2, chains, 64, true)]
        }
    };
    std::iter::once(first).chain(later).map(Arc::new).collect()
}

fn job_id(n: u128) -> JobId {
    JobId(Uuid::from_u128(n))
}

/// A worker that does one unit at a time.
struct Sim {
    id: WorkerId,
    sequence: u64,
    held: BTreeMap<Epoch, (JobId, u32, UnitSet)>,
    /// Seconds per unit.
    pace: f64,
    next_call: f64,
    next_unit: f64,
    /// Holds units and calls, but never finishes any.
    hangs: bool,
    alive: bool,
}

struct World {
    farm: Farm,
    random: Random,
    sims: Vec<Sim>,
    /// Units of the pass under way that are stored.
    stored: BTreeMap<JobId, UnitSet>,
    /// Passes that are not begun yet.
    ahead: BTreeMap<JobId, Vec<Arc<PassPlan>>>,
    now: f64,
    faults: bool,
    generation: u32,
    workers_made: u128,
    epochs: BTreeSet<Epoch>,
    /// Faults that happened, by kind.
    fired: [u32; 6],
}

impl World {
    fn new(seed: u64) -> Self {
        Self {
            farm: Farm::new(Tuning::default(), 1),
            random: Random(seed),
            sims: Vec::new(),
            stored: BTreeMap::new(),
            ahead: BTreeMap::new(),
            now: 0.0,
            faults: true,
            generation: 1,
            workers_made: 0,
            epochs: BTreeSet::new(),
            fired: [0; 6],
        }
    }

    fn add_job(&mut self, id: JobId, priority: i32, side: u32) {
        self.add_job_of(IntegratorKind::Path, id, priority, side);
    }

    fn add_job_of(&mut self, integrator: IntegratorKind, id: JobId, priority: i32, side: u32) {
        let settings = settings(integrator, side);
        self.ahead.insert(id, plans(&settings));
        self.farm.add_job(job(id, priority, settings));
        self.begin_next_pass(id);
    }

    fn begin_next_pass(&mut self, id: JobId) {
        let plan = self.ahead.get_mut(&id).unwrap().remove(0);
        self.farm.begin_pass(id, plan, Digest([1; 32]), UnitSet::default(), at(self.now));
        self.stored.insert(id, UnitSet::default());
    }

    /// Whether all units of the pass under way are stored.
    fn pass_complete(&self, id: JobId) -> bool {
        self.stored[&id].len() >= self.total(id)
    }

    fn add_worker(&mut self, pace: f64) {
        self.workers_made += 1;
        self.sims.push(Sim {
            id: WorkerId(Uuid::from_u128(1000 + self.workers_made)),
            sequence: 0,
            held: BTreeMap::new(),
            pace,
            next_call: self.now,
            next_unit: self.now + pace,
            hangs: false,
            alive: true,
        });
    }

    fn total(&self, id: JobId) -> u32 {
        self.farm.job(id).and_then(|j| j.pass.as_ref()).map_or(0, |p| p.board.count())
    }

    /// A worker's call: report, and an answer that may get lost.
    fn call(&mut self, n: usize) {
        let now = at(self.now);
        let lost = self.faults && self.random.chance(15);
        let sim = &mut self.sims[n];
        sim.sequence += 1;
        sim.next_call = self.now + 0.4;
        let held = sim.held.iter().map(|(e, (job, pass, units))| Held {
            job: *job,
            pass: *pass,
            epoch: *e,
            units: units.clone(),
        });
        let report = Report {
            worker: sim.id,
            name: "sim".into(),
            address: String::new(),
            threads: 1,
            sequence: sim.sequence,
            state: WorkerState::Ready,
            held: held.collect(),
        };
        assert!(self.farm.report(report, now));
        let Poll::Reply(reply) = self.farm.poll(sim.id, sim.sequence, true, now) else {
            panic!("a call goes unanswered")
        };
        for grant in &reply.grants {
            assert!(self.epochs.insert(grant.epoch), "an epoch was given out twice");
            assert!(!grant.units.is_empty());
            let under_way = self.farm.job(grant.job).and_then(|j| j.pass.as_ref()).map(|p| p.plan.pass);
            assert_eq!(under_way, Some(grant.pass), "units of another pass were given out");
            for unit in grant.units.clone() {
                assert!(!self.stored[&grant.job].contains(unit), "a stored unit was given out");
            }
        }
        if lost {
            return;
        }
        for (epoch, units) in reply.revoked {
            if let Some((.., held)) = sim.held.get_mut(&epoch) {
                let all = units.is_empty();
                *held = held.iter().filter(|u| !all && !units.contains(*u)).collect();
            }
        }
        for g in reply.grants {
            sim.held.insert(g.epoch, (g.job, g.pass, UnitSet::from_range(g.units)));
        }
        sim.held.retain(|_, (.., units)| !units.is_empty());
    }

    /// A worker finishes its next unit and delivers it; the acknowledgement may get lost, then it delivers again.
    fn finish(&mut self, n: usize) {
        let now = at(self.now);
        let lost = self.faults && self.random.chance(10);
        let sim = &mut self.sims[n];
        sim.next_unit = self.now + sim.pace;
        let Some((&epoch, (job, pass, units))) = sim.held.iter_mut().next() else { return };
        let (job, pass, unit) = (*job, *pass, units.first().unwrap());
        match self.farm.interest(job, pass, unit) {
            Interest::Later => return,
            Interest::Wanted(_) => {
                assert!(self.stored.get_mut(&job).unwrap().insert(unit), "unit {unit} was stored twice");
                self.farm.accepted(job, pass, unit, sim.id, sim.pace, now);
            }
            Interest::Stored => assert!(self.stored[&job].contains(unit)),
            Interest::Unwanted => {}
        }
        if !lost {
            units.remove(unit);
            if units.is_empty() {
                sim.held.remove(&epoch);
            }
        }
    }

    fn fault(&mut self) {
        let (now, n) = (at(self.now), self.random.below(self.sims.len() as u32) as usize);
        let kind = self.random.below(6);
        self.fired[kind as usize] += 1;
        match kind {
            // Crashed; the connection is seen to be cut.
            0 if self.sims.len() > 1 => {
                let sim = self.sims.swap_remove(n);
                self.farm.disconnected(sim.id, sim.sequence, now);
                let pace = 0.05 + 0.05 * f64::from(self.random.below(20));
                self.add_worker(pace);
            }
            // Silent, but not dead.
            1 => self.sims[n].next_call = self.now + 3.0 * f64::from(self.random.below(8)),
            // The connection is cut; the worker goes on.
            2 => self.farm.disconnected(self.sims[n].id, self.sims[n].sequence, now),
            3 if self.sims.len() > 1 && self.sims.iter().filter(|s| s.hangs).count() + 1 < self.sims.len() => {
                self.sims[n].hangs = true;
            }
            4 => self.restart(),
            _ => {
                let id = *self.stored.keys().nth(self.random.below(self.stored.len() as u32) as usize).unwrap();
                self.farm.pause(id, "", now);
                self.farm.tick(now);
                self.farm.resume(id);
            }
        }
    }

    /// The coordinator is killed: what is stored is all that is left.
    fn restart(&mut self) {
        let now = at(self.now);
        self.generation += 1;
        let old = std::mem::replace(&mut self.farm, Farm::new(Tuning::default(), self.generation));
        for (id, j) in old.jobs() {
            let mut job = job(*id, j.spec.priority, j.spec.settings.clone());
            job.state = JobState::Restoring { paused: false };
            self.farm.add_job(job);
            let plan = j.pass.as_ref().unwrap().plan.clone();
            self.farm.begin_pass(*id, plan, Digest([1; 32]), self.stored[id].clone(), now);
        }
    }

    /// Runs until all is stored; fails if that takes too long after the faults have ended.
    fn run(&mut self, faults_end: f64, patience: f64) {
        let jobs: Vec<JobId> = self.stored.keys().copied().collect();
        while !jobs.iter().all(|id| self.pass_complete(*id) && self.ahead[id].is_empty()) {
            self.now += 0.05;
            for id in &jobs {
                if self.pass_complete(*id) && !self.ahead[id].is_empty() {
                    self.begin_next_pass(*id);
                }
            }
            self.faults = self.now < faults_end;
            assert!(
                self.now < faults_end + patience,
                "the job never ends: {:?}",
                self.farm.attention(job_id(1), at(self.now))
            );
            self.farm.tick(at(self.now));
            if self.faults && self.random.chance(4) {
                self.fault();
            }
            for n in 0..self.sims.len() {
                if !self.sims[n].alive {
                    continue;
                }
                if self.sims[n].next_call <= self.now {
                    self.call(n);
                }
                if self.sims[n].next_unit <= self.now && !self.sims[n].hangs {
                    self.finish(n);
                }
            }
        }
    }
}

#[test]
fn whatever_happens_every_unit_is_stored_once_and_the_jobs_end() {
    let mut fired = [0; 6];
    for seed in 0..150 {
        let mut world = World::new(seed);
        world.add_job(job_id(1), 0, 1536);
        let priority = world.random.below(2) as i32;
        let kinds = [IntegratorKind::Path, IntegratorKind::Bdpt, IntegratorKind::Mmlt];
        let kind = kinds[seed as usize % kinds.len()];
        let side = if kind == IntegratorKind::Path { 640 } else { 256 };
        world.add_job_of(kind, job_id(2), priority, side);
        assert_eq!(world.ahead[&job_id(2)].len(), seed as usize % kinds.len(), "passes after the first");
        for n in 0..1 + world.random.below(4) {
            world.add_worker(0.05 + 0.1 * f64::from(n));
        }
        world.run(30.0, 400.0);
        for (id, units) in &world.stored {
            assert_eq!(units.len(), world.total(*id));
        }
        let last = plans(&settings(kind, side)).last().unwrap().unit_count();
        assert_eq!((world.total(job_id(1)), world.total(job_id(2))), (144, last));
        fired.iter_mut().zip(world.fired).for_each(|(sum, n)| *sum += n);
    }
    assert!(fired.iter().all(|n| *n > 150), "some faults hardly happened: {fired:?}");
}

#[test]
fn a_hanging_worker_does_not_hold_up_the_end() {
    let mut world = World::new(1);
    world.add_job(job_id(1), 0, 1536);
    world.add_worker(0.05);
    world.add_worker(0.05);
    world.sims[1].hangs = true;
    world.run(0.0, 20.0);
}

#[test]
fn a_cut_connection_frees_the_units_at_once() {
    let mut world = World::new(1);
    world.faults = false;
    world.add_job(job_id(1), 0, 1536);
    world.add_worker(1.0);
    world.call(0);
    let board = |w: &World| w.farm.job(job_id(1)).unwrap().pass.as_ref().unwrap().board.clone();
    let count = board(&world).count();
    assert!(board(&world).free().len() < count);
    let held = world.sims[0].held.clone();
    world.farm.disconnected(world.sims[0].id, world.sims[0].sequence, at(0.1));
    assert_eq!(board(&world).free().len(), count);
    assert_eq!(world.farm.workers()[&world.sims[0].id].losses, 1);
    // It comes back and takes them up where it was, under the same lease.
    world.now = 0.5;
    world.call(0);
    for (epoch, (.., units)) in held {
        assert_eq!(world.sims[0].held[&epoch].2, units);
        assert_eq!(board(&world).lease(epoch).unwrap().units, units);
    }
}

#[test]
fn a_silent_worker_loses_its_leases_when_they_run_out() {
    let mut world = World::new(1);
    world.faults = false;
    world.add_job(job_id(1), 0, 1536);
    world.add_worker(1.0);
    world.call(0);
    let leases = |w: &World| w.farm.job(job_id(1)).unwrap().pass.as_ref().unwrap().board.leases().count();
    world.farm.tick(at(9.9));
    assert_eq!(leases(&world), 1);
    world.farm.tick(at(10.1));
    assert_eq!(leases(&world), 0);
    assert_eq!(world.farm.workers()[&world.sims[0].id].state, WorkerState::Lost);
}

#[test]
fn priorities_go_first_and_equals_share() {
    let mut world = World::new(1);
    world.faults = false;
    for n in 1..=2 {
        world.add_job(job_id(n), 0, 4096);
    }
    world.add_worker(0.5);
    let run = |world: &mut World, until: f64| {
        while world.now < until {
            world.now += 0.05;
            for n in 0..world.sims.len() {
                if world.sims[n].next_call <= world.now {
                    world.call(n);
                }
                if world.sims[n].next_unit <= world.now {
                    world.finish(n);
                }
            }
        }
    };
    run(&mut world, 120.0);
    let (a, b) = (world.stored[&job_id(1)].len(), world.stored[&job_id(2)].len());
    assert!(a.abs_diff(b) <= 60, "{a} and {b} units of equal jobs");
    world.add_job(job_id(3), 5, 2048);
    // What is held is finished first: some four seconds of work.
    run(&mut world, 128.0);
    let before = world.stored[&job_id(1)].len() + world.stored[&job_id(2)].len();
    run(&mut world, 134.0);
    let after = world.stored[&job_id(1)].len() + world.stored[&job_id(2)].len();
    assert!(world.stored[&job_id(3)].len() >= 10 && before == after, "the urgent job had to wait");
}

#[test]
fn units_and_workers_that_fail_are_told_apart() {
    let mut world = World::new(1);
    world.faults = false;
    world.add_job(job_id(1), 0, 1536);
    for _ in 0..3 {
        world.add_worker(1.0);
        world.call(world.sims.len() - 1);
    }
    let ids: Vec<WorkerId> = world.sims.iter().map(|s| s.id).collect();
    let failed = |world: &mut World, unit: u32, by: usize| {
        let unit = UnitAt { job: job_id(1), pass: 0, unit, epoch: Epoch(0) };
        world.farm.unit_failed(unit, ids[by], "boom", at(1.0))
    };
    // Three units on one worker: the worker is blocked, the job goes on.
    for unit in 0..3 {
        assert_eq!(failed(&mut world, unit, 0), None);
    }
    let blocked = |world: &World, n: usize| world.farm.workers()[&ids[n]].jobs[&job_id(1)].blocked.is_some();
    assert!(blocked(&world, 0));
    assert!(world.farm.workers()[&ids[0]].leases.is_empty(), "a blocked worker keeps nothing");
    let attention = world.farm.attention(job_id(1), at(2.0)).join("\n");
    assert!(attention.contains("boom") && !attention.contains("no worker may work"), "{attention}");
    // A unit that fails a third time, on whatever worker, fails the job.
    assert_eq!(failed(&mut world, 2, 1), None);
    let why = failed(&mut world, 2, 2).expect("the job fails");
    assert!(why.contains("unit 2") && why.contains("boom"), "{why}");
    // Losses are nobody's fault.
    world.farm.disconnected(ids[1], 1, at(3.0));
    assert!(!blocked(&world, 1));
    // With nobody left, the job says so.
    world.farm.machine_fault(job_id(1), ids[2], "disk full", at(3.0));
    world.farm.machine_fault(job_id(1), ids[2], "disk full", at(3.0));
    let attention = world.farm.attention(job_id(1), at(4.0)).join("\n");
    assert!(attention.contains("no worker may work on this job") && attention.contains("disk full"), "{attention}");
}

#[test]
fn a_quarantined_worker_gets_nothing_more() {
    let mut world = World::new(1);
    world.faults = false;
    world.add_job(job_id(1), 0, 1536);
    world.add_worker(1.0);
    world.call(0);
    world.farm.quarantine(world.sims[0].id, "wrong bits");
    world.now = 1.0;
    world.call(0);
    assert!(world.sims[0].held.is_empty());
    let sim = &world.sims[0];
    let Poll::Reply(reply) = world.farm.poll(sim.id, sim.sequence, true, at(1.0)) else { panic!() };
    assert!(reply.grants.is_empty() && reply.notice.contains("wrong bits"));
}

#[test]
fn who_disagrees_with_a_pool_is_quarantined_unless_two_do() {
    let mut world = World::new(1);
    world.faults = false;
    world.add_job_of(IntegratorKind::Mmlt, job_id(1), 0, 256);
    while !world.ahead[&job_id(1)].is_empty() {
        world.begin_next_pass(job_id(1));
    }
    for name in ["good", "odd", "odd", "other"] {
        world.add_worker(1.0);
        let n = world.sims.len() - 1;
        world.call(n);
        world.farm.workers.get_mut(&world.sims[n].id).unwrap().name = name.into();
    }
    let ids: Vec<WorkerId> = world.sims.iter().map(|s| s.id).collect();
    let quarantined = |world: &World, n: usize| world.farm.workers()[&ids[n]].quarantined.clone();
    let mismatch = |world: &mut World, unit: u32, n: usize| {
        let held = world.sims[n].held.keys().next().copied().unwrap_or(Epoch(0));
        let at_unit = UnitAt { job: job_id(1), pass: 2, unit, epoch: held };
        let m = Mismatch { edges: 3, index: 17, expected: 0.5, found: 0.25 };
        world.farm.start_mismatched(at_unit, ids[n], &m, at(1.0))
    };
    // The unit is free for others, who can do it; it counts for nothing against it.
    let unit = world.sims[1].held.values().next().unwrap().2.first().unwrap();
    assert_eq!(mismatch(&mut world, unit, 1), None);
    let why = quarantined(&world, 1).expect("quarantined");
    for part in [&format!("unit {unit} of pass 2"), "sample 17", "3 edges", "0.5", "0.25", "same binary"] {
        assert!(why.contains(part), "{part} is not in: {why}");
    }
    let pass = world.farm.job(job_id(1)).unwrap().pass.as_ref().unwrap();
    assert!(pass.board.free().contains(unit) && pass.failures.is_empty());
    assert!(world.farm.attention(job_id(1), at(1.0)).iter().any(|a| a.contains("sample 17")));
    // The same machine again proves nothing new: its other units, or the worker after another start.
    assert_eq!(mismatch(&mut world, unit + 1, 1), None);
    assert_eq!(mismatch(&mut world, unit, 2), None);
    assert!(quarantined(&world, 2).is_some() && quarantined(&world, 0).is_none());
    // A second machine: the pools are wrong, and nobody is to blame for noticing.
    let why = mismatch(&mut world, unit + 2, 3).expect("the job fails");
    for part in ["workers odd and other", "pools", "are wrong", "submit the job again", "sample 17"] {
        assert!(why.contains(part), "{part} is not in: {why}");
    }
    assert!((0..4).all(|n| quarantined(&world, n).is_none()));
}
