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
    let list =
        |folder: &Path| std::fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path()).collect::<Vec<_>>();
    for path in [list(&folder), list(&folder.join("media"))].concat() {
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
        let name = path.strip_prefix(&folder).unwrap().display().to_string();
        assert!(readme.contains(&format!("lightfarm render scenes/{name}")), "README.md has no command for {name}");
    }
    assert!(count >= 5, "{count} scenes");
}
