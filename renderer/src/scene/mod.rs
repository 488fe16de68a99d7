//! A scene: its description (what importers make), its files (what the farm ships), and the immutable renderable form.

pub mod bundle;
pub mod desc;
pub mod import;

use crate::diagnostics::{Diagnostics, SceneError};
use bundle::FileSource;
use desc::SceneDesc;

/// An immutable scene, ready to render; shared by all threads.
#[derive(Debug)]
pub struct Scene {
    /// What the scene file says of rendering.
    pub defaults: desc::RenderDefaults,
}

impl Scene {
    /// Loads a scene file and builds it; warnings come back beside the scene.
    pub fn load(files: &dyn FileSource, root: &str) -> Result<(Self, Diagnostics), SceneError> {
        let (desc, diagnostics) = import::load(files, root)?;
        Ok((Self::build(desc), diagnostics))
    }

    /// Builds the acceleration structure, lights and features of a description.
    pub fn build(desc: SceneDesc) -> Self {
        Self { defaults: desc.defaults }
    }

    /// Number of lights.
    pub fn light_count(&self) -> usize {
        0
    }
}
