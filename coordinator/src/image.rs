//! Images as files.

use crate::merge::Snapshot;
use renderer::film::exr;

/// The EXR of an image, exactly as `lightfarm render` writes it.
pub fn exr_of(snapshot: &Snapshot) -> Result<Vec<u8>, String> {
    let about = snapshot.spec.settings.provenance(snapshot.spec.scene, snapshot.choice.as_ref());
    exr::encode(&snapshot.image, &about)
}
