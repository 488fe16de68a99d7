//! The board under random histories: whatever happens, no unit is lost, none counts twice, and work never runs out before the end.

use super::*;
use std::collections::BTreeSet;
use uuid::Uuid;

const FAST: Pace = Pace { threads: 2, unit_seconds: 0.1 };

fn worker(n: u32) -> WorkerId {
    WorkerId(Uuid::from_u128(u128::from(n) + 1))
}

fn seconds(n: f64) -> Duration {
    Duration::from_secs_f64(n)
}

struct Random(u64);

impl Random {
    fn below(&mut self, n: u32) -> u32 {
        self.0 = self.0.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
        ((self.0 >> 33) % u64::from(n.max(1))) as u32
    }
}

/// Each unit is in exactly one state, and both sides of holding agree.
fn check(board: &PassBoard) {
    let mut held: BTreeMap<u32, BTreeSet<Epoch>> = BTreeMap::new();
    for (epoch, lease) in board.leases() {
        assert!(!lease.units.is_empty(), "an empty lease");
        for unit in lease.units.iter() {
            held.entry(unit).or_default().insert(epoch);
        }
    }
    for unit in 0..board.count() {
        let states = [board.free().contains(unit), board.done().contains(unit), held.contains_key(&unit)];
        assert_eq!(states.iter().filter(|s| **s).count(), 1, "unit {unit}: {states:?}");
        let listed: BTreeSet<Epoch> = board.holders.get(&unit).into_iter().flatten().copied().collect();
        assert_eq!(listed, held.get(&unit).cloned().unwrap_or_default(), "unit {unit}");
        let workers: BTreeSet<WorkerId> = listed.iter().filter_map(|e| board.lease(*e)).map(|l| l.worker).collect();
        assert_eq!(workers.len(), listed.len(), "one worker holds unit {unit} twice");
    }
}

#[test]
fn any_history_keeps_every_unit_in_one_state() {
    for seed in 0..60 {
        let mut r = Random(seed);
        let count = 1 + r.below(40);
        let start: UnitSet = (0..count).filter(|_| r.below(4) == 0).collect();
        let mut board = PassBoard::new(count, start);
        let mut epochs = 0;
        let mut ended: Vec<(Epoch, WorkerId, UnitSet)> = Vec::new();
        for step in 0..400 {
            let now = seconds(f64::from(step) * 0.3);
            let who = worker(r.below(4));
            let any = board.leases().nth(r.below(4) as usize).map(|(e, l)| (e, l.worker, l.units.clone()));
            epochs += 1;
            match r.below(7) {
                0 | 1 => drop(board.grant(who, Epoch(epochs), r.below(6), now)),
                2 => drop(board.grant_second(who, Epoch(epochs), FAST, r.below(2) == 0, now, |_| None)),
                3 => {
                    let unit = r.below(count + 3);
                    let fresh = unit < count && !board.done().contains(unit);
                    assert_eq!(board.complete(unit, now).is_some(), fresh, "a unit counts once");
                }
                4 => {
                    if let Some((epoch, who, units)) = any {
                        assert!(board.release(epoch).is_some() && board.lease(epoch).is_none());
                        ended.push((epoch, who, units));
                    }
                }
                5 => {
                    if let Some((epoch, _, units)) = any {
                        let unit = units.first().unwrap();
                        assert!(board.give_back(epoch, unit, now) && !board.give_back(epoch, unit, now));
                    }
                }
                _ => {
                    // A worker that was thought lost comes back with what it held.
                    if let Some((epoch, who, units)) = ended.pop() {
                        let free: UnitSet = units.iter().filter(|u| board.free().contains(*u)).collect();
                        assert_eq!(board.adopt(who, epoch, &units, now), free);
                    }
                }
            }
            check(&board);
        }
    }
}

/// Liveness: with one worker that finishes what it gets, every history ends with all units done.
#[test]
fn a_single_working_worker_finishes_any_pass() {
    for seed in 0..40 {
        let mut r = Random(seed ^ 0x5a5a);
        let count = 1 + r.below(60);
        let mut board = PassBoard::new(count, UnitSet::default());
        // Others take units and are never heard of again.
        for n in 0..r.below(8) {
            board.grant(worker(10 + n), Epoch(u64::from(n) + 1), 1 + r.below(9), seconds(0.0));
        }
        let (mut epoch, mut now) = (100, 0.0);
        while board.done().len() < count {
            epoch += 1;
            now += 0.2;
            let me = worker(0);
            let range = board
                .grant(me, Epoch(epoch), 3, seconds(now))
                .or_else(|| board.grant_second(me, Epoch(epoch), FAST, false, seconds(now), |_| None));
            for unit in range.into_iter().flatten() {
                assert!(board.complete(unit, seconds(now)).is_some(), "unit {unit} was given out although it is done");
            }
            check(&board);
            assert!(now < 1000.0, "the pass never ends");
        }
        assert_eq!(board.leases().count(), 0);
    }
}

#[test]
fn units_go_out_in_order() {
    let mut board = PassBoard::new(10, [3, 4].into_iter().collect());
    let now = seconds(0.0);
    assert_eq!(board.grant(worker(0), Epoch(1), 2, now), Some(0..2));
    assert_eq!(board.grant(worker(0), Epoch(2), 5, now), Some(2..3), "a range does not span what is done");
    assert_eq!(board.grant(worker(1), Epoch(3), 100, now), Some(5..10));
    assert_eq!(board.grant(worker(1), Epoch(4), 100, now), None);
    board.release(Epoch(2));
    assert_eq!(board.grant(worker(1), Epoch(5), 100, now), Some(2..3));
}

#[test]
fn a_second_lease_goes_where_it_helps() {
    let mut board = PassBoard::new(12, UnitSet::default());
    let slow = Pace { threads: 1, unit_seconds: 1.0 };
    let pace_of = |w: WorkerId| Some(if w == worker(0) { slow } else { FAST });
    board.grant(worker(0), Epoch(1), 8, seconds(0.0));
    board.grant(worker(1), Epoch(2), 4, seconds(0.0));
    // The slow worker has eight seconds left: the second half of its units go out again.
    let range = board.grant_second(worker(2), Epoch(3), FAST, false, seconds(0.5), pace_of);
    assert_eq!(range, Some(4..8));
    let range = board.grant_second(worker(3), Epoch(4), FAST, false, seconds(0.5), pace_of);
    assert_eq!(range, Some(0..4), "two are enough while they get on");
    assert_eq!(board.grant_second(worker(2), Epoch(5), slow, false, seconds(0.5), pace_of), None, "it would be slower");
    assert_eq!(board.complete(5, seconds(0.6)), Some(vec![(Epoch(1), worker(0)), (Epoch(3), worker(2))]));
    // Only a lease that stands still is overdue.
    assert_eq!(board.grant_second(worker(3), Epoch(6), FAST, true, seconds(1.0), pace_of), None);
    assert_eq!(board.grant_second(worker(3), Epoch(6), FAST, true, seconds(9.0), pace_of), Some(6..8));
}

#[test]
fn when_all_who_hold_a_unit_stand_still_another_gets_it() {
    let mut board = PassBoard::new(1, UnitSet::default());
    board.grant(worker(0), Epoch(1), 1, seconds(0.0));
    assert_eq!(board.grant_second(worker(1), Epoch(2), FAST, true, seconds(10.0), |_| Some(FAST)), Some(0..1));
    assert_eq!(board.grant_second(worker(2), Epoch(3), FAST, false, seconds(11.0), |_| Some(FAST)), None);
    assert_eq!(board.grant_second(worker(1), Epoch(3), FAST, true, seconds(20.0), |_| Some(FAST)), None, "its own");
    assert_eq!(board.grant_second(worker(2), Epoch(3), FAST, true, seconds(20.0), |_| Some(FAST)), Some(0..1));
    check(&board);
    assert_eq!(board.complete(0, seconds(21.0)).map(|holders| holders.len()), Some(3));
    check(&board);
}
