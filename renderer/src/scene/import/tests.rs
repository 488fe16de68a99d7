//! What the tests of all importers share.

use super::load;
use crate::diagnostics::Severity;
use crate::scene::bundle::{DiskSource, MemorySource};
use crate::scene::desc::SceneDesc;
use std::path::{Path, PathBuf};

/// A source of the given files.
pub(super) fn files(list: &[(&str, &[u8])]) -> MemorySource {
    MemorySource { files: list.iter().map(|(path, bytes)| (path.to_string(), (*bytes).into())).collect() }
}

/// The scene of the first file; panics on any error. With it, the warnings.
pub(super) fn scene(list: &[(&str, &[u8])]) -> (SceneDesc, Vec<String>) {
    match load(&files(list), list[0].0) {
        Ok((scene, diagnostics)) => (scene, diagnostics.list.iter().map(ToString::to_string).collect()),
        Err(e) => panic!("{e}"),
    }
}

/// All errors of loading the first file, as text.
pub(super) fn errors(list: &[(&str, &[u8])]) -> Vec<String> {
    match load(&files(list), list[0].0) {
        Ok(_) => Vec::new(),
        Err(e) => e.0.iter().filter(|d| d.severity == Severity::Error).map(ToString::to_string).collect(),
    }
}

/// Asserts that loading fails with one error that contains every one of `parts`.
pub(super) fn assert_error(list: &[(&str, &[u8])], parts: &[&str]) {
    let errors = errors(list);
    assert_eq!(errors.len(), 1, "{errors:#?}");
    for part in parts {
        assert!(errors[0].contains(part), "{part:?} is not in {:?}", errors[0]);
    }
}

/// The folder of shared test data, when it is there.
pub(super) fn shared(path: &str) -> Option<PathBuf> {
    let manifest = Path::new(env!("CARGO_MANIFEST_DIR"));
    let found = manifest.ancestors().map(|a| a.join("shared/data").join(path)).find(|p| p.exists());
    if found.is_none() {
        println!("skipped: shared/data/{path} is not there");
    }
    found
}

/// Loads a scene from disk.
pub(super) fn load_file(path: &Path) -> Result<(SceneDesc, Vec<String>), String> {
    let (source, root) = DiskSource::for_scene(path).map_err(|e| e.to_string())?;
    let (scene, diagnostics) = load(&source, &root).map_err(|e| e.to_string())?;
    Ok((scene, diagnostics.list.iter().map(ToString::to_string).collect()))
}

/// Calls `try_it` with thousands of damaged versions of `valid`: bytes flipped, cut out, doubled, cut off. Deterministic.
pub(super) fn damage(valid: &[u8], rounds: u32, mut try_it: impl FnMut(&[u8])) {
    let mut state = 0x9e37_79b9_7f4a_7c15u64;
    // SplitMix64 (Steele, Lea, Flood 2014).
    let mut below = |n: usize| {
        state = state.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = state;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        ((z ^ (z >> 31)) % n.max(1) as u64) as usize
    };
    for _ in 0..rounds {
        let mut bytes = valid.to_vec();
        for _ in 0..=below(3) {
            let at = below(bytes.len());
            let end = (at + below(12)).min(bytes.len());
            match below(6) {
                0 => bytes[at] ^= 1 << below(8),
                1 => bytes[at] = below(256) as u8,
                2 => bytes.truncate(at.max(1)),
                3 => drop(bytes.drain(at..end)),
                4 => {
                    let copy = bytes[at..end].to_vec();
                    let to = below(bytes.len());
                    bytes.splice(to..to, copy);
                }
                _ => {
                    let words: [&[u8]; 8] =
                        [b"-1", b"nan", b"1e999", b"4294967295", b"99999999999999999999", b"<", b"\"", b"$x"];
                    bytes.splice(at..end, words[below(words.len())].iter().copied());
                }
            }
            if bytes.is_empty() {
                bytes.push(b'x');
            }
        }
        try_it(&bytes);
    }
}
