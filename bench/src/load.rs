//! Scenes read from files.

use renderer::scene::Scene;
use renderer::scene::bundle::DiskSource;
use std::path::Path;

/// Reads a scene.
pub fn scene(file: &Path) -> Result<Scene, String> {
    with_source(file).map(|(scene, ..)| scene)
}

/// Reads a scene, and keeps the files that it was read from and the name of the first of them.
pub fn with_source(file: &Path) -> Result<(Scene, DiskSource, String), String> {
    let (source, root) = DiskSource::for_scene(file).map_err(|e| format!("{}: {e}", file.display()))?;
    let (scene, _) = Scene::load(&source, &root).map_err(|e| e.to_string())?;
    Ok((scene, source, root))
}
