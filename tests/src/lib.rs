//! What the end-to-end tests share: the built `lightfarm` binary, farms on loopback, and ways to hurt them.

// Test code: to panic is to fail the test.
#![allow(clippy::expect_used, clippy::panic)]

mod binary;
mod farm;

pub use binary::{binary, lightfarm};
pub use farm::{Farm, Job, free_port};

use renderer::film::exr;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

/// The test scene: two files, lights of two kinds, a rough metal.
pub fn room() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes/room/scene.xml")
}

/// Waits until `what` holds, and fails the test if it takes too long.
pub fn until(what: &str, patience: Duration, mut holds: impl FnMut() -> bool) {
    let began = Instant::now();
    while !holds() {
        assert!(began.elapsed() < patience, "waited {patience:?} in vain: {what}");
        std::thread::sleep(Duration::from_millis(20));
    }
}

/// Fails unless two EXR files have the same channels with the same bits.
pub fn assert_same_pixels(a: &Path, b: &Path) {
    let read = |path: &Path| {
        let bytes = std::fs::read(path).unwrap_or_else(|e| panic!("{}: {e}", path.display()));
        exr::decode(&bytes).unwrap_or_else(|e| panic!("{}: {e}", path.display()))
    };
    let (x, y) = (read(a), read(b));
    assert_eq!((x.width, x.height), (y.width, y.height));
    assert!(x.channels.len() >= 4, "{}: too few channels", a.display());
    let names = |p: &exr::Picture| p.channels.iter().map(|(n, _)| n.clone()).collect::<Vec<_>>();
    assert_eq!(names(&x), names(&y));
    for ((name, p), (_, q)) in x.channels.iter().zip(&y.channels) {
        let differing = p.iter().zip(q).filter(|(u, v)| u.to_bits() != v.to_bits()).count();
        assert_eq!(differing, 0, "{} and {}: {differing} pixels of {name} differ", a.display(), b.display());
    }
    let lit = x.channel("G").is_some_and(|g| g.iter().filter(|v| **v > 0.0).count() * 2 > g.len());
    assert!(lit, "{}: the picture is mostly black", a.display());
}
