//! Images as files.

use crate::merge::Snapshot;
use renderer::film::exr::{self, Provenance};

/// The EXR of an image, exactly as `lightfarm render` writes it.
pub fn exr_of(snapshot: &Snapshot) -> Result<Vec<u8>, String> {
    let settings = serde_json::to_value(&snapshot.spec.settings).map_err(|e| e.to_string())?;
    let about = Provenance { scene: snapshot.spec.scene, seed: snapshot.spec.settings.seed, settings };
    exr::encode(&snapshot.image, &about)
}

/// The PNG of an image, for looking at.
pub fn png_of(snapshot: &Snapshot) -> Result<Vec<u8>, String> {
    renderer::film::png::encode(&snapshot.image, 0.0)
}
