//! Importers: glTF, lightfarm TOML and Mitsuba XML to a [`SceneDesc`].

mod gltf;
pub mod image;
mod importer;
mod medium;
mod mesh_file;
mod metals;
mod mitsuba;
mod native;
mod number;
mod obj;
mod ply;
mod transform;

#[cfg(test)]
mod mesh_tests;
#[cfg(test)]
mod tests;

use super::bundle::FileSource;
use super::desc::SceneDesc;
use crate::diagnostics::{Diagnostics, SceneError};
use importer::Importer;

/// Loads the scene file `root` of `files`; the kind is told by its extension. All errors are collected; warnings come back beside
/// the scene.
pub fn load(files: &dyn FileSource, root: &str) -> Result<(SceneDesc, Diagnostics), SceneError> {
    let extension = root.rsplit_once('.').map_or("", |(_, e)| e).to_ascii_lowercase();
    let mut importer = Importer::new(files);
    match extension.as_str() {
        "gltf" | "glb" => {
            let mut diagnostics = Diagnostics::default();
            return match gltf::load_gltf(files, root, &mut diagnostics) {
                Some(scene) => Ok((scene, diagnostics)),
                None => Err(SceneError(diagnostics.list)),
            };
        }
        "toml" => native::import(&mut importer, root),
        "xml" => mitsuba::import(&mut importer, root),
        _ => {
            let mut diagnostics = Diagnostics::default();
            let message = "the kind of scene file can't be told from its name";
            diagnostics.error(root, "", message, "use .gltf, .glb, .toml or .xml");
            return Err(SceneError(diagnostics.list));
        }
    }
    importer.finish()
}
