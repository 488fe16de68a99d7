//! What a job does not compute, in words.

use super::settings::RenderSettings;
use crate::integrator::IntegratorKind;
use crate::scene::SceneFeatures;

/// What a render of these settings skips: what the scene lacks, and what contributes nothing or too little for its cost. For `auto` give
/// the settings that it chose, see [`RenderSettings::rendered_by`].
pub fn skipped(features: &SceneFeatures, settings: &RenderSettings) -> Vec<String> {
    let mut list: Vec<String> = features.skipped.iter().map(|s| (*s).into()).collect();
    if settings.adapts() {
        list.push("most samples of tiles that have little noise".into());
    }
    let lamps = features.lights + features.delta_lights;
    match settings.integrator {
        IntegratorKind::Path if lamps > 1 => {
            list.push("most shadow rays to lights that reach little of the picture".into());
        }
        IntegratorKind::Bdpt => list.push("most shadow rays of connections that carry little".into()),
        IntegratorKind::Light if lamps > 1 => {
            list.push("most light paths from lights that reach little of the picture".into())
        }
        IntegratorKind::Mmlt => {
            let direct = settings.mmlt.direct_edges;
            if direct > 0 {
                list.push(format!("chains for paths of up to {direct} edges, which ordinary samples make"));
            }
            if settings.mmlt.learn {
                list.push("most proposals by techniques and of path lengths that carry little".into());
            }
        }
        _ => {}
    }
    list
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::job::RenderOptions;
    use crate::scene::desc::RenderDefaults;

    #[test]
    fn each_integrator_says_what_it_leaves_out() {
        let features = SceneFeatures { lights: 2, skipped: vec!["normal maps"], ..SceneFeatures::default() };
        let of = |integrator, adaptive| {
            let options = RenderOptions { adaptive, ..RenderOptions::counting(integrator, 16) };
            skipped(&features, &RenderSettings::resolve(&options, &RenderDefaults::default()).unwrap())
        };
        assert_eq!(of(IntegratorKind::Path, Some(true)).len(), of(IntegratorKind::Path, None).len() + 1);
        for kind in [IntegratorKind::Path, IntegratorKind::Light, IntegratorKind::Bdpt, IntegratorKind::Mmlt] {
            assert!(of(kind, None).len() > 1, "{kind:?}");
        }
    }
}
