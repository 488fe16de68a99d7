//! What is confirmed survives; what is not confirmed leaves no trace.

use super::*;
use renderer::job::{Budget, RenderSettings};
use renderer::scene::desc::FilterDesc;
use uuid::Uuid;

fn spec() -> JobSpec {
    let settings = RenderSettings {
        integrator: renderer::integrator::IntegratorKind::Path,
        budget: Budget { spp: Some(4), ..Budget::default() },
        width: 8,
        height: 8,
        filter: FilterDesc::Box { radius: 0.5 },
        max_depth: None,
        rr_depth: 5,
        seed: 1,
        replicates: 2,
        adaptive: false,
        share: true,
        mmlt: Default::default(),
    };
    JobSpec {
        name: "scene".into(),
        priority: -3,
        manifest: Digest::of(b"manifest"),
        scene: Digest::of(b"scene"),
        settings_json: serde_json::to_string(&settings).unwrap(),
        settings,
        lights: 7,
        payload: Digest::of(b"payload"),
        submitted_ms: 1234,
    }
}

fn id(n: u128) -> JobId {
    JobId(Uuid::from_u128(n))
}

fn result(job: JobId, pass: u32, unit: u32, text: &str) -> NewResult {
    let bytes = Bytes::copy_from_slice(text.as_bytes());
    let digest = Digest::of(&bytes);
    NewResult { job, pass, unit, bytes, digest, worker: WorkerId(Uuid::from_u128(9)) }
}

fn add(store: &Store, job: JobId) {
    wait(store.change(Change::Add(job, Arc::new(spec())))).unwrap();
}

#[test]
fn what_is_confirmed_is_there_after_a_restart() {
    let folder = tempfile::tempdir().unwrap();
    let (store, guard, restored) = Store::open(folder.path()).unwrap();
    assert_eq!((restored.generation, restored.jobs.len()), (1, 0));
    assert!(matches!(Store::open(folder.path()), Err(StoreError::Locked(_))));
    add(&store, id(1));
    add(&store, id(2));
    // Many at once, so that some share a transaction; each unit twice.
    let receipts: Vec<_> =
        (0..200).map(|n| store.append(result(id(1), 0, n / 2, &format!("result {}", n / 2)))).collect();
    for (n, receipt) in receipts.into_iter().enumerate() {
        match wait(receipt).unwrap() {
            Appended::New(at) => assert_eq!((n % 2, at.unit as usize), (0, n / 2)),
            Appended::Existing(d) => assert_eq!((n % 2, d), (1, Digest::of(format!("result {}", n / 2).as_bytes()))),
        }
    }
    wait(store.change(Change::PassEnd(id(1), 0, true))).unwrap();
    let paused = Change::State {
        job: id(1),
        state: JobState::Paused,
        message: "why".into(),
        elapsed: Duration::from_millis(4321),
        progress: Progress {
            error: Some((0.5, 0.75)),
            choice: Some((renderer::integrator::IntegratorKind::Bdpt, "it is quicker".into())),
            ..Progress::default()
        },
    };
    wait(store.change(paused)).unwrap();
    drop(guard);

    let (store, _guard, restored) = Store::open(folder.path()).unwrap();
    assert_eq!(restored.generation, 2);
    let job = &restored.jobs[0];
    assert_eq!((job.id, &job.spec, job.state), (id(1), &spec(), JobState::Restoring { paused: true }));
    assert_eq!((job.message.as_str(), job.elapsed), ("why", Duration::from_millis(4321)));
    assert_eq!(job.progress.error, Some((0.5, 0.75)));
    assert_eq!(restored.jobs[1].id, id(2));
    assert_eq!((store.pass_end(id(1), 0).unwrap(), store.pass_end(id(1), 1).unwrap()), (Some(true), None));
    let (results, segment) = (store.results(id(1), 0).unwrap(), store.segment(id(1), 0).unwrap());
    assert_eq!(results.len(), 100);
    for (n, at) in results.iter().enumerate() {
        assert_eq!(segment.read(at).unwrap(), format!("result {n}").as_bytes());
    }
    let Appended::Existing(digest) = wait(store.append(result(id(1), 0, 5, "another"))).unwrap() else {
        panic!("a unit was stored twice")
    };
    assert_eq!(digest, Digest::of(b"result 5"));
    assert_eq!(wait(store.find(id(1), 0, 5)).unwrap(), Some(digest));
}

#[test]
fn bytes_of_an_interrupted_append_are_cut_off() {
    let folder = tempfile::tempdir().unwrap();
    let (store, guard, _) = Store::open(folder.path()).unwrap();
    add(&store, id(1));
    wait(store.append(result(id(1), 0, 0, "first"))).unwrap();
    drop(guard);
    let path = folder.path().join("jobs").join(id(1).to_string()).join("0.results");
    let mut bytes = std::fs::read(&path).unwrap();
    bytes.extend(b"torn");
    std::fs::write(&path, &bytes).unwrap();
    let (store, _guard, _) = Store::open(folder.path()).unwrap();
    wait(store.append(result(id(1), 0, 1, "second"))).unwrap();
    assert_eq!(std::fs::read(&path).unwrap(), b"firstsecond");
    assert_eq!(store.stored_bytes(id(1)), 11);
}

#[test]
fn a_damaged_result_is_found_out_and_can_be_forgotten() {
    let folder = tempfile::tempdir().unwrap();
    let (store, _guard, _) = Store::open(folder.path()).unwrap();
    add(&store, id(1));
    wait(store.append(result(id(1), 0, 0, "first"))).unwrap();
    let path = folder.path().join("jobs").join(id(1).to_string()).join("0.results");
    std::fs::write(&path, "fIrst").unwrap();
    let at = store.results(id(1), 0).unwrap()[0];
    assert!(store.segment(id(1), 0).unwrap().read(&at).is_err());
    wait(store.change(Change::Forget(id(1), 0, vec![0]))).unwrap();
    assert!(store.results(id(1), 0).unwrap().is_empty());
    assert!(matches!(wait(store.append(result(id(1), 0, 0, "first"))).unwrap(), Appended::New(_)));
}

#[test]
fn an_ended_job_keeps_its_image_and_takes_no_results() {
    let folder = tempfile::tempdir().unwrap();
    let (store, _guard, _) = Store::open(folder.path()).unwrap();
    add(&store, id(1));
    wait(store.append(result(id(1), 0, 0, "first"))).unwrap();
    store.write_image(id(1), b"image").unwrap();
    let done = Change::State {
        job: id(1),
        state: JobState::Done,
        message: String::new(),
        elapsed: Duration::ZERO,
        progress: Progress::default(),
    };
    wait(store.change(done)).unwrap();
    assert_eq!(wait(store.append(result(id(1), 0, 1, "late"))), Err(StoreError::Ended));
    assert_eq!(store.stored_bytes(id(1)), 5);
    assert_eq!(std::fs::read(store.image_path(id(1))).unwrap(), b"image");
}

#[test]
fn a_checkpoint_frees_what_is_folded_and_nothing_else() {
    let folder = tempfile::tempdir().unwrap();
    let (store, guard, _) = Store::open(folder.path()).unwrap();
    add(&store, id(1));
    let large = "x".repeat(40 << 20);
    for unit in 0..5 {
        wait(store.append(result(id(1), 0, unit, &format!("{unit}{large}")))).unwrap();
    }
    wait(store.change(Change::PassEnd(id(1), 0, false))).unwrap();
    wait(store.append(result(id(1), 1, 0, "next pass"))).unwrap();
    wait(store.append(result(id(1), 1, 3, "further on"))).unwrap();
    let before = store.stored_bytes(id(1));
    assert_eq!(store.write_checkpoint(id(1), 1, |f| f.write_all(b"state").map(|()| 5)).unwrap(), 5);
    wait(store.change(Change::Checkpoint(id(1), 1, 1, 1))).unwrap();
    store.write_checkpoint(id(1), 2, |f| f.write_all(b"newer").map(|()| 5)).unwrap();
    wait(store.change(Change::Checkpoint(id(1), 2, 1, 1))).unwrap();
    let after = store.stored_bytes(id(1));
    assert!(before > 200 << 20 && after < 81 << 20, "{before} bytes, then {after}");
    assert!(store.read_checkpoint(id(1), 1).is_err());
    drop(guard);

    let (store, _guard, restored) = Store::open(folder.path()).unwrap();
    assert_eq!(restored.jobs[0].checkpoint, Some(2));
    assert_eq!(store.read_checkpoint(id(1), 2).unwrap(), b"newer");
    let left = store.results(id(1), 1).unwrap();
    assert_eq!(left.iter().map(|r| r.unit).collect::<Vec<_>>(), [3]);
    assert_eq!(store.segment(id(1), left[0].segment).unwrap().read(&left[0]).unwrap(), b"further on");
    assert!(store.results(id(1), 0).unwrap().is_empty());
    wait(store.append(result(id(1), 1, 4, "after the restart"))).unwrap();
    let left = store.results(id(1), 1).unwrap();
    assert_eq!(store.segment(id(1), left[1].segment).unwrap().read(&left[1]).unwrap(), b"after the restart");
    assert_eq!(store.segment(id(1), left[0].segment).unwrap().read(&left[0]).unwrap(), b"further on");
}
