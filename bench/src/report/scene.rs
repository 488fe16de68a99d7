//! The scenes of the benchmark, and how much of each is rendered.

use std::path::{Path, PathBuf};

/// A scene with what is measured on it.
#[derive(Clone, Debug)]
pub struct BenchScene {
    /// What tables call it.
    pub name: String,
    /// The scene file.
    pub file: PathBuf,
    /// Width and height in pixels.
    pub size: (u32, u32),
    /// Edges of the longest path; -1 = unbounded.
    pub max_depth: i32,
    /// What of lightfarm is measured.
    pub variants: Vec<String>,
    /// The integrator that makes the reference.
    pub reference: String,
    /// A picture by another renderer of the same depth: the reference, where it is quiet enough; else what the reference is compared with.
    pub published: Option<PathBuf>,
}

/// How much is measured.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
pub enum Budget {
    /// Seconds: whether all of it works.
    Smoke,
    /// Minutes.
    Quick,
    /// Hours.
    Full,
}

impl Budget {
    /// Renders of each checkpoint.
    pub fn rounds(self) -> usize {
        match self {
            Self::Smoke => 2,
            Self::Quick => 3,
            Self::Full => 8,
        }
    }

    /// Seconds of the longest render.
    pub fn longest_s(self) -> f64 {
        match self {
            Self::Smoke => 0.08,
            Self::Quick => 1.5,
            Self::Full => 16.0,
        }
    }

    /// Seconds that a reference may take.
    pub fn reference_s(self) -> f64 {
        match self {
            Self::Smoke => 3.0,
            Self::Quick => 60.0,
            Self::Full => 1800.0,
        }
    }

    /// Its name.
    pub fn name(self) -> &'static str {
        match self {
            Self::Smoke => "smoke",
            Self::Quick => "quick",
            Self::Full => "full",
        }
    }

    /// The scenes where none are named.
    fn scenes(self) -> &'static [&'static str] {
        match self {
            Self::Smoke => &["cornell-diffuse", "fog-room"],
            Self::Quick | Self::Full => {
                &["cornell-box", "veach-mis", "veach-ajar", "water-caustic", "fog-room", "glossy-cornell"]
            }
        }
    }
}

/// One line of the list.
struct Known {
    name: &'static str,
    file: &'static str,
    size: (u32, u32),
    max_depth: i32,
    variants: &'static [&'static str],
    reference: &'static str,
    published: Option<&'static str>,
}

/// What there is. The reference is made by another integrator than the one that does best, where that can be paid for.
const KNOWN: &[Known] = &[
    Known {
        name: "cornell-box",
        file: "../shared/data/scenes/cornell-box/scene.xml",
        size: (256, 256),
        max_depth: 65,
        variants: &["path", "bdpt", "mmlt"],
        reference: "bdpt",
        published: Some("../shared/data/scenes/cornell-box/mitsuba-3.9-256x256.exr"),
    },
    Known {
        name: "veach-mis",
        file: "../shared/data/scenes/veach-mis/scene.xml",
        size: (320, 180),
        max_depth: 2,
        variants: &["path", "bdpt", "mmlt"],
        reference: "bdpt",
        published: Some("../shared/data/scenes/veach-mis/mitsuba-3.9-320x180.exr"),
    },
    Known {
        name: "veach-ajar",
        file: "../shared/data/scenes/veach-ajar/scene.xml",
        size: (320, 180),
        max_depth: 13,
        variants: &["path", "bdpt", "mmlt"],
        reference: "mmlt",
        published: Some("../shared/data/scenes/veach-ajar/mitsuba-3.9-320x180.exr"),
    },
    // No path tracer converges here, nor does anything but bdpt and mmlt.
    Known {
        name: "water-caustic",
        file: "../shared/data/scenes/water-caustic/scene.xml",
        size: (256, 256),
        max_depth: 9,
        variants: &["path", "bdpt", "mmlt"],
        reference: "bdpt",
        published: None,
    },
    Known {
        name: "fog-room",
        file: "bench/scenes/fog-room.xml",
        size: (256, 256),
        max_depth: 17,
        variants: &["path", "bdpt", "mmlt"],
        reference: "bdpt",
        published: None,
    },
    Known {
        name: "glossy-cornell",
        file: "scenes/stress/glossy-cornell.toml",
        size: (256, 256),
        max_depth: 9,
        variants: &["path", "bdpt", "mmlt"],
        reference: "bdpt",
        published: None,
    },
    Known {
        name: "cornell-diffuse",
        file: "scenes/cornell-diffuse.toml",
        size: (256, 256),
        max_depth: 9,
        variants: &["path", "bdpt", "mmlt"],
        reference: "bdpt",
        published: None,
    },
];

impl BenchScene {
    /// A scene file that is not in the list.
    pub fn of_file(file: &Path) -> Self {
        Self {
            name: file.file_stem().map_or(String::new(), |s| s.to_string_lossy().into_owned()),
            file: file.into(),
            size: (256, 256),
            max_depth: 9,
            variants: ["path", "bdpt", "mmlt"].map(String::from).to_vec(),
            reference: "bdpt".into(),
            published: None,
        }
    }
}

/// The scenes of these names or files, or those of the budget. What is in the list but not on this machine comes back as a note.
pub fn choose(names: &[String], budget: Budget) -> Result<(Vec<BenchScene>, Vec<String>), String> {
    let (mut scenes, mut notes) = (Vec::new(), Vec::new());
    let wanted: Vec<&str> =
        if names.is_empty() { budget.scenes().to_vec() } else { names.iter().map(String::as_str).collect() };
    for name in wanted {
        let mut scene = match KNOWN.iter().find(|k| k.name == name) {
            Some(known) => known.scene(),
            None if Path::new(name).is_file() => BenchScene::of_file(Path::new(name)),
            None => {
                let known: Vec<&str> = KNOWN.iter().map(|k| k.name).collect();
                return Err(format!("there is no scene {name:?}: give a scene file, or one of {}", known.join(", ")));
            }
        };
        if !scene.file.is_file() {
            notes.push(format!("{name} is left out: {} is not here", scene.file.display()));
            continue;
        }
        if budget == Budget::Smoke {
            scene.size = (scene.size.0 / 8, scene.size.1 / 8);
            scene.published = None;
        }
        scene.published = scene.published.filter(|p| p.is_file());
        scenes.push(scene);
    }
    Ok((scenes, notes))
}

impl Known {
    fn scene(&self) -> BenchScene {
        BenchScene {
            name: self.name.into(),
            file: self.file.into(),
            size: self.size,
            max_depth: self.max_depth,
            variants: self.variants.iter().map(|v| (*v).to_string()).collect(),
            reference: self.reference.into(),
            published: self.published.map(PathBuf::from),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_files_and_faults() {
        let (scenes, _) = choose(&["fog-room".into()], Budget::Smoke).unwrap_or_default();
        // Tests run in the crate's folder, the benchmark in the workspace's.
        assert!(scenes.is_empty());
        let (scenes, _) = choose(&["scenes/fog-room.xml".into()], Budget::Quick).unwrap();
        assert_eq!((scenes[0].name.as_str(), scenes[0].size), ("fog-room", (256, 256)));
        let message = choose(&["no-such".into()], Budget::Quick).unwrap_err();
        assert!(message.contains("no-such") && message.contains("veach-ajar"), "{message}");
        for budget in [Budget::Smoke, Budget::Quick, Budget::Full] {
            assert!(choose(&[], budget).is_ok());
        }
    }
}
