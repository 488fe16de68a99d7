//! Opening a scene from the disk; all that is wrong with it is said at once.

use crate::exit::Failure;
use crate::output::Console;
use renderer::diagnostics::{Diagnostic, Severity};
use renderer::scene::Scene;
use renderer::scene::bundle::DiskSource;
use std::path::Path;

/// A scene with the files it came from: `files.into_bundle(root)` gives their manifest and contents.
pub struct Loaded {
    /// Ready to render.
    pub scene: Scene,
    /// What was read.
    pub files: DiskSource,
    /// The scene file's path within `files`.
    pub root: String,
}

/// Loads the scene file at `path` and shows warnings; errors are all shown, then end the command.
pub fn load(path: &Path, console: &Console) -> Result<Loaded, Failure> {
    let (files, root) =
        DiskSource::for_scene(path).map_err(|e| Failure::Input(format!("error: {}: {e}", path.display())))?;
    let (scene, diagnostics) = Scene::load(&files, &root).map_err(|e| {
        report(&e.0, console);
        let errors = e.0.iter().filter(|d| d.severity == Severity::Error).count();
        let plural = if errors == 1 { "error" } else { "errors" };
        Failure::Input(format!("{} can't be loaded: {errors} {plural}", path.display()))
    })?;
    report(&diagnostics.list, console);
    Ok(Loaded { scene, files, root })
}

/// Shows diagnostics: as text on standard error, and as JSON lines for scripts.
pub fn report(list: &[Diagnostic], console: &Console) {
    for d in list {
        console.note(d);
        let severity = match d.severity {
            Severity::Error => "error",
            Severity::Warning => "warning",
        };
        console.event(&serde_json::json!({
            "event": "diagnostic", "severity": severity, "file": d.file, "place": d.place,
            "message": d.message, "help": d.help,
        }));
    }
}
