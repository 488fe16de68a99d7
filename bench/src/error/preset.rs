//! The comparisons that the project states figures of.

/// A scene with what is compared on it.
#[derive(Clone, Copy, Debug)]
pub struct Preset {
    /// Its name on the command line.
    pub name: &'static str,
    /// The scene file.
    pub scene: &'static str,
    /// The reference picture; `None` = the other renders.
    pub reference: Option<&'static str>,
    /// Size; `None` = the reference's.
    pub size: Option<(u32, u32)>,
    /// Edges of the longest path.
    pub max_depth: i32,
    /// What is compared; the first is what the others are measured by.
    pub variants: &'static [&'static str],
}

/// All of them.
pub const PRESETS: &[Preset] = &[
    // Caustics of a tiny light below water: no path tracer converges, so the published picture is the truth.
    Preset {
        name: "water-caustic",
        scene: "../shared/data/scenes/water-caustic/scene.xml",
        reference: Some("../shared/data/scenes/water-caustic/TungstenRender.exr"),
        size: None,
        max_depth: 9,
        variants: &["path:spp=4", "bdpt:spp=2"],
    },
    // Light from behind a door that is ajar.
    Preset {
        name: "veach-ajar",
        scene: "../shared/data/scenes/veach-ajar/scene.xml",
        reference: Some("../shared/data/scenes/veach-ajar/mitsuba-3.9-320x180.exr"),
        size: None,
        max_depth: 13,
        variants: &["mmlt:mpp=64", "bdpt:spp=32", "mmlt:plain,mpp=64", "mmlt:pbrt,mpp=64", "path:spp=64"],
    },
    Preset {
        name: "cornell-box",
        scene: "../shared/data/scenes/cornell-box/scene.xml",
        reference: None,
        size: Some((256, 256)),
        max_depth: 9,
        variants: &["path:spp=64", "bdpt:spp=32", "mmlt:mpp=64"],
    },
    // The same room from this repository.
    Preset {
        name: "cornell-diffuse",
        scene: "scenes/cornell-diffuse.toml",
        reference: None,
        size: Some((256, 256)),
        max_depth: 9,
        variants: &["path:spp=64", "bdpt:spp=32", "mmlt:mpp=64"],
    },
];

/// The preset of a name.
pub fn find(name: &str) -> Result<Preset, String> {
    let known = || PRESETS.iter().map(|p| p.name).collect::<Vec<_>>().join(", ");
    let found = PRESETS.iter().find(|p| p.name == name);
    found.copied().ok_or_else(|| format!("there is no preset {name:?} (known: {})", known()))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::error::variant::Variant;

    #[test]
    fn presets_are_found_by_name_and_make_sense() {
        for p in PRESETS {
            assert_eq!(find(p.name).unwrap().scene, p.scene);
            assert!(p.reference.is_some() || p.size.is_some(), "{}", p.name);
            // What is compared may be more than this build has; path is always there.
            let known: Vec<Variant> = p.variants.iter().filter_map(|v| v.parse().ok()).collect();
            assert!(known.iter().any(|v| v.kind == renderer::integrator::IntegratorKind::Path), "{}", p.name);
        }
        assert!(find("cornell").is_err());
    }
}
