//! The skips, each with the way to do without it.

use renderer::integrator::IntegratorKind;
use renderer::integrator::IntegratorKind::{Bdpt, Light, Mmlt, Path};
use renderer::job::{PassPlan, RenderSettings};
use renderer::scene::Scene;

/// Something that is not computed where it would contribute nothing, or little for its cost.
#[derive(Debug)]
pub struct Skip {
    /// Short name.
    pub name: &'static str,
    /// What is not computed.
    pub what: &'static str,
    /// The scene on which it is measured, from the root of the checkout.
    pub scene: &'static str,
    /// The integrator.
    pub integrator: IntegratorKind,
    /// What the settings of both renders are.
    pub settings: fn(&mut RenderSettings),
    /// How to do without.
    pub without: Without,
}

/// Where a skip is decided, and what decides against it.
#[derive(Debug)]
pub enum Without {
    /// When the scene is loaded.
    Scene(fn(&mut Scene)),
    /// In the job's settings.
    Settings(fn(&mut RenderSettings)),
    /// In the plan of each pass.
    Plan(fn(&mut PassPlan)),
}

const AS_THEY_ARE: fn(&mut RenderSettings) = |_| {};

/// Rays are followed as if there were media somewhere.
const MEDIA: Without = Without::Scene(|scene| scene.features.media = 1);

/// All of them.
pub const SKIPS: &[Skip] = &[
    Skip {
        name: "media-path",
        what: "following rays through media, in a scene without any",
        scene: "scenes/cornell.toml",
        integrator: Path,
        settings: AS_THEY_ARE,
        without: MEDIA,
    },
    Skip {
        name: "media-bdpt",
        what: "the same",
        scene: "scenes/cornell.toml",
        integrator: Bdpt,
        settings: AS_THEY_ARE,
        without: MEDIA,
    },
    Skip {
        name: "media-mmlt",
        what: "the same",
        scene: "scenes/cornell.toml",
        integrator: Mmlt,
        settings: AS_THEY_ARE,
        without: MEDIA,
    },
    Skip {
        name: "dim-paths",
        what: "long paths that carry little: ended by chance",
        scene: "scenes/cornell.toml",
        integrator: Path,
        settings: |s| s.max_depth = Some(64),
        without: Without::Settings(|s| s.rr_depth = u32::MAX),
    },
    Skip {
        name: "clean-tiles",
        what: "samples of tiles that have little noise",
        scene: "scenes/glass-and-mirrors.toml",
        integrator: Path,
        settings: |s| s.adaptive = true,
        without: Without::Settings(|s| s.adaptive = false),
    },
    Skip {
        name: "shared-paths",
        what: "paths of pixels whose neighbours' paths show as much",
        scene: "scenes/cornell-diffuse.toml",
        integrator: Path,
        settings: AS_THEY_ARE,
        without: Without::Settings(|s| s.share = false),
    },
    Skip {
        name: "known-sharing",
        what: "finding out anew in each unit what its pixels gain by sharing",
        scene: "scenes/cornell-diffuse.toml",
        integrator: Path,
        settings: AS_THEY_ARE,
        without: Without::Plan(|p| p.sharing.clear()),
    },
    Skip {
        name: "more-paths",
        what: "whole paths where a second sample of the lights shows as much",
        scene: "scenes/plates.toml",
        integrator: Path,
        settings: |s| s.max_depth = Some(2),
        without: Without::Settings(|s| s.share = false),
    },
    Skip {
        name: "dim-connections",
        what: "shadow rays of connections that carry little: cast by chance",
        scene: "scenes/cornell.toml",
        integrator: Bdpt,
        settings: AS_THEY_ARE,
        without: Without::Plan(|p| p.threshold = 0.0),
    },
    Skip {
        name: "far-lights",
        what: "most shadow rays to lights that are far from what they would light, or behind it",
        scene: "scenes/stress/many-lights.toml",
        integrator: Path,
        settings: AS_THEY_ARE,
        without: Without::Scene(|scene| scene.selector.forget_places()),
    },
    Skip {
        name: "unseen-lights",
        what: "most shadow rays to lights that reach little of what is seen",
        scene: "scenes/stress/hidden-lights.toml",
        integrator: Path,
        settings: AS_THEY_ARE,
        without: Without::Plan(|p| p.light_weights.clear()),
    },
    Skip {
        name: "unseen-bdpt",
        what: "the same, and most light paths from such lights",
        scene: "scenes/stress/hidden-lights.toml",
        integrator: Bdpt,
        settings: AS_THEY_ARE,
        without: Without::Plan(|p| p.light_weights.clear()),
    },
    Skip {
        name: "unseen-mmlt",
        what: "the same",
        scene: "scenes/stress/hidden-lights.toml",
        integrator: Mmlt,
        settings: AS_THEY_ARE,
        without: Without::Plan(|p| p.light_weights.clear()),
    },
    Skip {
        name: "unseen-light",
        what: "most light paths from such lights",
        scene: "scenes/stress/hidden-lights.toml",
        integrator: Light,
        settings: AS_THEY_ARE,
        without: Without::Plan(|p| p.light_weights.clear()),
    },
    Skip {
        name: "poor-techniques",
        what: "chains' proposals by techniques that carry little",
        scene: "scenes/glass-and-mirrors.toml",
        integrator: Mmlt,
        settings: AS_THEY_ARE,
        without: Without::Plan(|p| {
            let techniques = p.chains.iter_mut().flat_map(|c| &mut c.depths).flat_map(|d| &mut d.techniques);
            techniques.for_each(|weight| *weight = 1.0);
        }),
    },
    Skip {
        name: "dim-pool-rays",
        what: "shadow rays of the pools' paths that carry little",
        scene: "scenes/cornell.toml",
        integrator: Mmlt,
        settings: AS_THEY_ARE,
        without: Without::Plan(|p| p.chains.iter_mut().for_each(|c| c.threshold = 0.0)),
    },
    Skip {
        name: "direct-chains",
        what: "chains for light that is seen directly or after one bounce",
        scene: "scenes/glass-and-mirrors.toml",
        integrator: Mmlt,
        settings: AS_THEY_ARE,
        without: Without::Settings(|s| s.mmlt.direct_edges = 0),
    },
    Skip {
        name: "neighbours",
        what: "mutations for each pixel where those of the pixels around tell as much",
        scene: "scenes/cornell-diffuse.toml",
        integrator: Mmlt,
        settings: AS_THEY_ARE,
        without: Without::Settings(|s| s.mmlt.neighbours = 0),
    },
];

/// The skip of a name.
pub fn find(name: &str) -> Result<&'static Skip, String> {
    SKIPS.iter().find(|s| s.name == name).ok_or_else(|| {
        let known: Vec<&str> = SKIPS.iter().map(|s| s.name).collect();
        format!("there is no skip {name:?} (known: {})", known.join(", "))
    })
}

#[cfg(test)]
mod tests {
    use super::super::render::{Arm, render, scene};
    use super::*;

    /// A switch that switches nothing would show that a skip saves nothing.
    #[test]
    fn every_skip_can_be_done_without() {
        for skip in SKIPS {
            let picture = |arm| {
                let scene = scene(skip, skip.scene, arm).unwrap();
                render(skip, &scene, arm, 16, 1).unwrap().picture
            };
            assert_ne!(picture(Arm::With), picture(Arm::Without), "{}", skip.name);
        }
    }
}
