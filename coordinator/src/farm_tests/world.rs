//! A farm whose workers are simulated: replies that get lost, workers that crash and hang, a coordinator that restarts.

use super::super::*;
use crate::ids::Epoch;
use crate::outcome::Interest;
use crate::sync::{Held, Poll, Report};
use renderer::integrator::IntegratorKind;
use renderer::integrator::mmlt::ChainStart;
use renderer::job::{Learned, Part, Planner, RenderOptions, RenderSettings};
use renderer::scene::desc::RenderDefaults;
use uuid::Uuid;

pub struct Random(pub u64);

impl Random {
    pub fn below(&mut self, n: u32) -> u32 {
        self.0 = self.0.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
        ((self.0 >> 33) % u64::from(n.max(1))) as u32
    }

    pub fn chance(&mut self, percent: u32) -> bool {
        self.below(100) < percent
    }
}

pub fn at(seconds: f64) -> Duration {
    Duration::from_secs_f64(seconds)
}

/// A job of `side` x `side` pixels; of paths, one unit per 128 x 128 pixels in its first pass.
pub fn settings(integrator: IntegratorKind, side: u32) -> RenderSettings {
    let options = RenderOptions { size: Some((side, side)), ..RenderOptions::counting(integrator, 64) };
    RenderSettings::resolve(&options, &RenderDefaults::default()).unwrap()
}

pub fn job(id: JobId, priority: i32, settings: RenderSettings) -> Job {
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
pub fn plans(settings: &RenderSettings) -> Vec<Arc<PassPlan>> {
    let planner = Planner::new(settings.clone());
    let first = planner.first();
    let later = match settings.integrator {
        IntegratorKind::Path | IntegratorKind::Light | IntegratorKind::Auto | IntegratorKind::Moments => Vec::new(),
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

pub fn job_id(n: u128) -> JobId {
    JobId(Uuid::from_u128(n))
}

/// A worker that does one unit at a time.
pub struct Sim {
    pub id: WorkerId,
    pub sequence: u64,
    pub held: BTreeMap<Epoch, (JobId, u32, UnitSet)>,
    /// Seconds per unit.
    pub pace: f64,
    pub next_call: f64,
    pub next_unit: f64,
    /// Holds units and calls, but never finishes any.
    pub hangs: bool,
    pub alive: bool,
}

pub struct World {
    pub farm: Farm,
    pub random: Random,
    pub sims: Vec<Sim>,
    /// Units of the pass under way that are stored.
    pub stored: BTreeMap<JobId, UnitSet>,
    /// Passes that are not begun yet.
    pub ahead: BTreeMap<JobId, Vec<Arc<PassPlan>>>,
    pub now: f64,
    pub faults: bool,
    pub generation: u32,
    pub workers_made: u128,
    pub epochs: BTreeSet<Epoch>,
    /// Faults that happened, by kind.
    pub fired: [u32; 6],
}

impl World {
    pub fn new(seed: u64) -> Self {
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

    /// A job, and a worker that has taken up its first units; nothing goes wrong.
    pub fn with_one_worker() -> Self {
        let mut world = Self::new(1);
        world.faults = false;
        world.add_job(job_id(1), 0, 1536);
        world.add_worker(1.0);
        world.call(0);
        world
    }

    pub fn add_job(&mut self, id: JobId, priority: i32, side: u32) {
        self.add_job_of(IntegratorKind::Path, id, priority, side);
    }

    pub fn add_job_of(&mut self, integrator: IntegratorKind, id: JobId, priority: i32, side: u32) {
        let settings = settings(integrator, side);
        self.ahead.insert(id, plans(&settings));
        self.farm.add_job(job(id, priority, settings));
        self.begin_next_pass(id);
    }

    pub fn begin_next_pass(&mut self, id: JobId) {
        let plan = self.ahead.get_mut(&id).unwrap().remove(0);
        self.farm.begin_pass(id, plan, Digest([1; 32]), UnitSet::default(), at(self.now));
        self.stored.insert(id, UnitSet::default());
    }

    /// Whether all units of the pass under way are stored.
    pub fn pass_complete(&self, id: JobId) -> bool {
        self.stored[&id].len() >= self.total(id)
    }

    pub fn add_worker(&mut self, pace: f64) {
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

    pub fn total(&self, id: JobId) -> u32 {
        self.farm.job(id).and_then(|j| j.pass.as_ref()).map_or(0, |p| p.board.count())
    }

    /// A worker's call: report, and an answer that may get lost.
    pub fn call(&mut self, n: usize) {
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
    pub fn finish(&mut self, n: usize) {
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

    pub fn fault(&mut self) {
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
    pub fn restart(&mut self) {
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
    pub fn run(&mut self, faults_end: f64, patience: f64) {
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
