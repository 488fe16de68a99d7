//! The scenes that the project ships.

use crate::diagnostics::Diagnostics;
use crate::scene::Scene;
use crate::scene::bundle::DiskSource;
use std::path::Path;

#[test]
fn every_shipped_scene_loads_without_a_word_and_has_its_line() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../scenes");
    let readme = std::fs::read_to_string(folder.join("README.md")).unwrap();
    let mut count = 0;
    for entry in std::fs::read_dir(&folder).unwrap() {
        let path = entry.unwrap().path();
        if path.extension().is_none_or(|e| e != "toml") {
            continue;
        }
        count += 1;
        let (source, root) = DiskSource::for_scene(&path).unwrap();
        let (scene, Diagnostics { list }) = Scene::load(&source, &root).unwrap();
        assert!(list.is_empty(), "{root}: {list:#?}");
        assert!(scene.light_count() > 0, "{root} is dark");
        let size = scene.defaults.size.unwrap();
        assert!(scene.defaults.spp.is_some() && size.0 * size.1 <= 1 << 19, "{root} must say its size and stay small");
        assert!(readme.contains(&format!("lightfarm render scenes/{root}")), "README.md has no command for {root}");
    }
    assert!(count >= 5, "{count} scenes");
}
