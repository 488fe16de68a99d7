//! Runs a loader under watch: time, memory, panics.

use std::alloc::{GlobalAlloc, Layout, System};
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Mutex, MutexGuard, PoisonError, mpsc};
use std::time::Duration;

/// No file may keep a loader busy longer.
const LONGEST: Duration = Duration::from_secs(10);
/// No file may make a loader hold more bytes than this at once.
const LARGEST: usize = 1 << 30;

/// Counts the bytes in use and their peak.
struct Counting;

static USED: AtomicUsize = AtomicUsize::new(0);
static PEAK: AtomicUsize = AtomicUsize::new(0);

// SAFETY: every call goes to the system's allocator with the same arguments; only counters are touched besides.
unsafe impl GlobalAlloc for Counting {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        grow(layout.size());
        // SAFETY: the caller's promises are those of `System::alloc`.
        unsafe { System.alloc(layout) }
    }

    unsafe fn alloc_zeroed(&self, layout: Layout) -> *mut u8 {
        grow(layout.size());
        // SAFETY: the caller's promises are those of `System::alloc_zeroed`.
        unsafe { System.alloc_zeroed(layout) }
    }

    unsafe fn realloc(&self, pointer: *mut u8, layout: Layout, size: usize) -> *mut u8 {
        grow(size);
        USED.fetch_sub(layout.size(), Ordering::Relaxed);
        // SAFETY: the caller's promises are those of `System::realloc`.
        unsafe { System.realloc(pointer, layout, size) }
    }

    unsafe fn dealloc(&self, pointer: *mut u8, layout: Layout) {
        USED.fetch_sub(layout.size(), Ordering::Relaxed);
        // SAFETY: the caller's promises are those of `System::dealloc`.
        unsafe { System.dealloc(pointer, layout) }
    }
}

fn grow(size: usize) {
    let used = USED.fetch_add(size, Ordering::Relaxed) + size;
    PEAK.fetch_max(used, Ordering::Relaxed);
}

#[global_allocator]
static ALLOCATOR: Counting = Counting;

/// What came of one input.
pub enum Outcome {
    Loaded,
    Refused(String),
}

/// One test at a time: the counters are shared.
pub fn alone() -> MutexGuard<'static, ()> {
    static ALONE: Mutex<()> = Mutex::new(());
    ALONE.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Runs `work` in a thread of its own and fails the test when it panics, or takes too long or too much memory.
pub fn guarded(name: &str, work: impl FnOnce() -> Outcome + Send + 'static) -> Outcome {
    let before = USED.load(Ordering::Relaxed);
    PEAK.store(before, Ordering::Relaxed);
    let (done, wait) = mpsc::channel();
    let worker = std::thread::spawn(move || {
        let outcome = work();
        // The receiver is gone only when the test failed already.
        let _ = done.send(());
        outcome
    });
    if wait.recv_timeout(LONGEST) == Err(mpsc::RecvTimeoutError::Timeout) {
        panic!("{name}: still busy after {LONGEST:?}");
    }
    let outcome = worker.join().unwrap_or_else(|_| panic!("{name}: panicked"));
    let peak = PEAK.load(Ordering::Relaxed).saturating_sub(before);
    assert!(peak <= LARGEST, "{name}: took {peak} bytes");
    if let Outcome::Refused(text) = &outcome {
        assert!(text.len() > 10, "{name}: an error must say something: {text:?}");
    }
    outcome
}

#[test]
fn the_guard_sees_memory_and_panics() {
    let _alone = alone();
    let hungry = std::panic::catch_unwind(|| {
        guarded("hungry", || {
            drop(std::hint::black_box(Vec::<u8>::with_capacity(LARGEST + LARGEST / 8)));
            Outcome::Loaded
        })
    });
    assert!(hungry.is_err());
    assert!(std::panic::catch_unwind(|| guarded("faulty", || panic!("on purpose"))).is_err());
}
