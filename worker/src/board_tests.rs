//! The board without threads: what is held, what is dropped, what is kept for delivery.

use super::*;
use renderer::diagnostics::Diagnostics;
use renderer::job::{Planner, RenderOptions, RenderSettings};
use renderer::scene::desc::{RenderDefaults, SceneDesc};

fn grant(epoch: u64, units: std::ops::Range<u32>, document: Digest) -> Grant {
    Grant { job: Uuid::from_u128(1), pass: 0, epoch, units, document }
}

fn context() -> (Digest, Arc<PassContext>) {
    let settings = RenderSettings::resolve(&RenderOptions::default(), &RenderDefaults::default()).unwrap();
    let plan = Planner::new(settings.clone()).first();
    let document = PassDocument::new(Digest::of(b"manifest"), settings, plan);
    let digest = Digest::of(&document.to_json().unwrap());
    (
        digest,
        Arc::new(PassContext {
            scene: Arc::new(Scene::build(SceneDesc::default(), "", &mut Diagnostics::default()).unwrap()),
            document,
        }),
    )
}

fn held(board: &Board) -> Vec<(u64, Vec<u32>)> {
    board.held().into_iter().map(|h| (h.epoch, h.units)).collect()
}

fn done(text: &'static str) -> Option<Result<bytes::Bytes, Failure>> {
    Some(Ok(bytes::Bytes::from_static(text.as_bytes())))
}

#[test]
fn a_unit_is_held_until_it_is_acknowledged() {
    let (document, context) = context();
    let board = Board::default();
    board.grant(vec![grant(7, 0..2, document)]);
    assert_eq!(board.next_wanted(), Some(document));
    board.set_ready(document, context);
    let first = board.next_task().unwrap();
    assert_eq!((first.epoch, first.unit.id), (7, 0));
    board.finished(&first, 0.1, done("zero"));
    assert_eq!(held(&board), [(7, vec![0, 1])]);

    // Cut off: it is sent again, with what came since.
    let batch = board.take_batch();
    let second = board.next_task().unwrap();
    board.finished(&second, 0.1, done("one"));
    assert_eq!(board.undelivered(), Some(2));
    board.sent(batch, true);
    let batch = board.take_batch();
    assert_eq!(batch.iter().map(|o| o.unit).collect::<Vec<_>>(), [0, 1]);
    assert_eq!(held(&board), [(7, vec![0, 1])]);
    board.sent(batch, false);
    assert_eq!((held(&board), board.undelivered()), (Vec::new(), Some(0)));

    // An answer that comes late does not bring the lease back.
    board.grant(vec![grant(7, 0..2, document)]);
    assert!(held(&board).is_empty());
}

#[test]
fn revoked_units_are_stopped_and_never_sent() {
    let (document, context) = context();
    let board = Board::default();
    board.grant(vec![grant(1, 0..3, document), grant(2, 5..7, document)]);
    board.set_ready(document, context);
    let (a, b) = (board.next_task().unwrap(), board.next_task().unwrap());
    board.finished(&a, 0.1, done("a"));
    let units = std::iter::once(0..2).collect();
    board.revoke(&[Revocation { epoch: 1, units }, Revocation { epoch: 2, units: Vec::new() }]);
    assert!(b.stop.stopped() && !a.stop.stopped());
    assert_eq!(held(&board), [(1, vec![2])]);
    board.finished(&b, 0.1, done("b"));
    assert!(board.take_batch().is_empty());
    assert_eq!(held(&board), [(1, vec![2])]);
    // Revoked while on its way, and the way was cut: not sent again.
    let c = board.next_task().unwrap();
    board.finished(&c, 0.1, done("c"));
    let batch = board.take_batch();
    board.revoke(&[Revocation { epoch: 1, units: Vec::new() }]);
    board.sent(batch, true);
    assert!(board.take_batch().is_empty() && held(&board).is_empty());
    assert_eq!(board.lock().outbox_bytes, 0);
}

#[test]
fn draining_keeps_what_runs() {
    let (document, context) = context();
    let board = Board::default();
    board.grant(vec![grant(1, 0..5, document)]);
    board.set_ready(document, context);
    let task = board.next_task().unwrap();
    board.drain();
    assert_eq!((held(&board), board.undelivered()), (vec![(1, vec![0])], None));
    board.grant(vec![grant(2, 5..6, document)]);
    assert_eq!(held(&board), [(1, vec![0])], "a draining worker takes nothing");
    board.finished(&task, 0.1, done("x"));
    assert_eq!(board.undelivered(), Some(1));
    assert!(!task.stop.stopped());
    board.quit();
    assert!(board.next_task().is_none() && board.next_wanted().is_none());
}

#[test]
fn a_pass_that_can_not_begin_is_given_up() {
    let (document, _) = context();
    let board = Board::default();
    board.grant(vec![grant(1, 0..5, document)]);
    assert_eq!(board.job_of(document), Some(Uuid::from_u128(1)));
    board.give_up(document);
    assert!(held(&board).is_empty() && board.job_of(document).is_none());
}
