//! The scenes on which integrators must agree.

use std::path::{Path, PathBuf};

/// A scene and how it is rendered here.
#[derive(Clone, Debug)]
pub struct Case {
    /// Short name.
    pub name: String,
    /// The file, from the root of the checkout.
    pub file: PathBuf,
    /// Size of the picture.
    pub size: (u32, u32),
    /// Whether light tracing sees everything: nothing behind glass, nothing in mirrors, and the camera not in fog, whose points close
    /// to the lens it connects with no finite variance.
    pub light: bool,
    /// Whether only the full budget does it justice.
    pub full_only: bool,
    /// The radiance of every pixel under a depth limit (`None` = unbounded), where it is known.
    pub exact: Option<fn(Option<u32>) -> f64>,
}

/// Shipped scenes: name, and whether light tracing sees everything.
const STRESS: [(&str, bool); 20] = [
    ("glossy-cornell", true),
    ("mirror-box", false),
    ("glass-caustic", false),
    ("environment", true),
    ("directional", true),
    ("closed-sphere", true),
    ("coarse-normals", true),
    ("light-behind-glass", false),
    ("camera-in-glass", false),
    ("many-lights", true),
    ("hidden-lights", true),
    ("media-fog-spot", true),
    ("media-door", true),
    ("media-glass-caustic", false),
    ("media-lamp-in-cloud", true),
    ("media-camera-in-fog", false),
    ("media-coloured", true),
    ("media-rough-glass", true),
    ("media-overlap", true),
    ("media-nested", false),
];

/// Published scenes, used where they are at hand: name, size, and whether light tracing sees everything.
const PUBLISHED: [(&str, (u32, u32), bool); 3] =
    [("cornell-box", (48, 48), true), ("veach-mis", (64, 36), true), ("veach-ajar", (64, 36), false)];

/// Size of the shipped scenes: twelve blocks of 16 x 16 pixels.
const SIZE: (u32, u32) = (64, 48);

/// All scenes.
pub fn all() -> Vec<Case> {
    let stress = STRESS.iter().map(|&(name, light)| Case {
        name: name.into(),
        file: Path::new("scenes/stress").join(format!("{name}.toml")),
        size: SIZE,
        light,
        full_only: false,
        exact: (name == "closed-sphere").then_some(closed_sphere),
    });
    let published = PUBLISHED.iter().map(|&(name, size, light)| Case {
        name: name.into(),
        file: Path::new("../shared/data/scenes").join(name).join("scene.xml"),
        size,
        light,
        full_only: true,
        exact: None,
    });
    stress.chain(published).collect()
}

/// The scenes of these names; what is no name is a file.
pub fn chosen(names: &[String]) -> Result<Vec<Case>, String> {
    let find = |name: &String| {
        if let Some(case) = all().into_iter().find(|c| c.name == *name) {
            return Ok(case);
        }
        let file = PathBuf::from(name);
        if !file.exists() {
            let known: Vec<String> = all().into_iter().map(|c| c.name).collect();
            return Err(format!("{name} is neither a file nor one of {}", known.join(", ")));
        }
        Ok(Case { name: name.clone(), file, size: SIZE, light: true, full_only: false, exact: None })
    };
    names.iter().map(find).collect()
}

/// A light of intensity pi in a sphere of radius 1 and albedo 1/2: 1/2 + 1/4 + ..., one term for each edge beyond the first.
fn closed_sphere(max_depth: Option<u32>) -> f64 {
    let terms = max_depth.map_or(63, |depth| depth.saturating_sub(1).min(63));
    1.0 - 1.0 / (1u64 << terms) as f64
}
