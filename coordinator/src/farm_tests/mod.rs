//! The scheduler against simulated workers. Whatever happens, every unit is stored once, and when the faults end the job ends.

mod world;

use super::*;
use crate::ids::Epoch;
use crate::outcome::UnitAt;
use crate::sync::Poll;
use renderer::integrator::IntegratorKind;
use renderer::integrator::mmlt::Mismatch;
use world::{World, at, job_id, plans, settings};

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
        assert_eq!((world.total(job_id(1)), world.total(job_id(2))), (288, last));
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
    let mut world = World::with_one_worker();
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
    let mut world = World::with_one_worker();
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
    let mut world = World::with_one_worker();
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
    // Nor for what they find until the job has failed.
    assert_eq!(mismatch(&mut world, unit + 3, 0), None);
    assert!(quarantined(&world, 0).is_none());
}
