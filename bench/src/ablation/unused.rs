//! Features that a scene file has and that nothing in the picture uses.

use super::render;
use super::{Unused, count};
use renderer::integrator::IntegratorKind;
use renderer::scene::Scene;
use renderer::scene::bundle::FileSource;
use std::io;
use std::sync::Arc;

/// What these renders are called among those that are counted.
pub const NAME: &str = "unused";
/// The scene that they are added to.
const SCENE: &str = "scenes/cornell-diffuse.toml";
const INTEGRATORS: [IntegratorKind; 3] = [IntegratorKind::Path, IntegratorKind::Bdpt, IntegratorKind::Mmlt];
/// Samples or mutations a pixel.
const COUNT: u32 = 8;

/// What is added to the scene file.
const FEATURES: &[(&str, &str)] = &[
    ("nothing", ""),
    ("a texture", "[textures.unused]\nkind = \"checkerboard\"\na = 0.2\nb = 0.8\n"),
    ("a rough metal", "[materials.unused]\nkind = \"conductor\"\nmetal = \"Cu\"\nalpha = 0.2\n"),
    ("a glass", "[materials.unused]\nkind = \"dielectric\"\nior = 1.5\n"),
    ("a medium", "[media.unused]\nsigma_a = 0.1\nsigma_s = 0.5\n"),
    ("a black lamp", "[[lights]]\nkind = \"point\"\nposition = [0.0, 1.0, 0.0]\nintensity = 0.0\n"),
    ("a black sky", "[[lights]]\nkind = \"constant\"\nradiance = 0.0\n"),
    (
        "a ball behind the camera",
        "[materials.unused]\nkind = \"diffuse\"\nreflectance = 0.5\n[[shapes]]\nname = \"unused\"\nkind = \"sphere\"\n\
         material = \"unused\"\ncenter = [0.0, 1.0, 40.0]\nradius = 0.1\n",
    ),
    (
        "a block behind the camera",
        "[materials.unused]\nkind = \"diffuse\"\nreflectance = 0.5\n[[shapes]]\nname = \"unused\"\nkind = \"cube\"\n\
         material = \"unused\"\ntransform = [{ scale = [0.1, 0.1, 0.1] }, { translate = [0.0, 1.0, 40.0] }]\n",
    ),
    (
        "a metal ball behind the camera",
        "[materials.unused]\nkind = \"conductor\"\nmetal = \"Cu\"\nalpha = 0.2\n[[shapes]]\nname = \"unused\"\nkind = \"sphere\"\n\
         material = \"unused\"\ncenter = [0.0, 1.0, 40.0]\nradius = 0.1\n",
    ),
];

/// A scene in one file.
struct Text(String);

impl FileSource for Text {
    fn read(&self, path: &str) -> io::Result<Arc<[u8]>> {
        if path == SCENE { Ok(self.0.as_bytes().into()) } else { Err(io::ErrorKind::NotFound.into()) }
    }
}

fn scene(feature: &str) -> Result<Scene, String> {
    let (_, added) = FEATURES.iter().find(|(name, _)| *name == feature).ok_or_else(|| format!("no {feature:?}"))?;
    let text = std::fs::read_to_string(render::path(SCENE)).map_err(|e| format!("{SCENE}: {e}"))?;
    let source = Text(format!("{text}\n{added}"));
    Scene::load(&source, SCENE).map(|(scene, _)| scene).map_err(|e| e.to_string())
}

/// One render for the count; `what` is `FEATURE/INTEGRATOR`.
pub fn counted(what: &str, count: u32) -> Result<(), String> {
    let (feature, integrator) = what.split_once('/').ok_or("no integrator")?;
    let scene = scene(feature)?;
    if count > 0 {
        render::plain(&scene, integrator.parse()?, count)?;
    }
    Ok(())
}

/// What each feature costs each integrator.
pub fn rows() -> Result<Vec<Unused>, String> {
    let mut rows = Vec::new();
    for integrator in INTEGRATORS.map(IntegratorKind::name) {
        let mut base = None;
        for (feature, _) in FEATURES {
            let cost = count::cost(&format!("{NAME}:{feature}/{integrator}"), COUNT)?;
            let instructions = cost / *base.get_or_insert(cost);
            rows.push(Unused { name: feature, scene: SCENE, integrator, instructions });
        }
    }
    Ok(rows)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Else their cost would be that of nothing. Lights that are black are not even kept.
    #[test]
    fn scenes_have_the_features() {
        let of = |feature| {
            let scene = scene(feature).unwrap();
            let sizes = [scene.textures.len(), scene.materials.len(), scene.media.len(), scene.lights.len()];
            sizes.iter().sum::<usize>() + scene.objects.len()
        };
        for (feature, added) in FEATURES {
            let dropped = added.is_empty() || feature.contains("black");
            assert_eq!(of(feature) == of("nothing"), dropped, "{feature}");
        }
    }
}
