use super::document;
use crate::bsdf::Material;
use crate::medium::{MediumId, Phase};
use crate::scene::desc::SceneDesc;
use crate::scene::import::tests::{assert_error, scene};
use crate::spectrum::Rgb;

fn import(content: &str) -> SceneDesc {
    let (scene, warnings) = scene(&[("scene.toml", document(content).as_bytes())]);
    assert!(warnings.is_empty(), "{warnings:#?}");
    scene
}

/// Asserts that a medium with these keys has one error, at `line` below its head and `column`, that contains `part`.
#[track_caller]
fn fault(keys: &str, line: usize, column: usize, part: &str) {
    let text = document(&format!("[media.fog]\n{keys}"));
    let place = format!("error: scene.toml, line {}, column {column}: ", line + 2);
    assert_error(&[("scene.toml", text.as_bytes())], &[&place, part]);
}

#[test]
fn media_fill_shapes_and_the_scene() {
    let scene = import(
        "medium = 'haze'
        [media.haze]\nsigma_t = [0.1, 0.2, 0.3]\nalbedo = 0.5\nscale = 2
        [media.milk]\nsigma_a = 1\nsigma_s = 3\ng = 0.75
        [media.tea]\nsigma_t = '#ffffff'
        [materials.border]\nkind = 'null'
        [[shapes]]\nkind = 'cube'\nmaterial = 'border'\ninterior = 'milk'\npriority = -7
        [[shapes]]\nkind = 'sphere'",
    );
    let [haze, milk, tea] = scene.media[..] else { panic!("{:?}", scene.media) };
    assert_eq!((haze.sigma_t, haze.albedo, haze.phase), (Rgb::new(0.2, 0.4, 0.6), Rgb::splat(0.5), Phase::Isotropic));
    let phase = Phase::HenyeyGreenstein { g: 0.75 };
    assert_eq!((milk.sigma_t, milk.albedo, milk.phase), (Rgb::splat(4.0), Rgb::splat(0.75), phase));
    assert_eq!((tea.sigma_t, tea.scatters()), (Rgb::ONE, false));
    assert_eq!(scene.global_medium, Some(MediumId(0)));
    assert_eq!((scene.shapes[0].interior, scene.shapes[0].priority), (Some(MediumId(1)), -7));
    assert_eq!((scene.shapes[1].interior, scene.shapes[1].priority), (None, 0));
    assert_eq!(scene.materials[scene.shapes[0].material.0 as usize], Material::Null);
}

#[test]
fn malformed_and_extreme_media_are_refused() {
    fault("sigma_t = -1", 1, 11, "`sigma_t` is -1, expected a finite number that is not negative");
    fault("sigma_t = nan", 1, 11, "`sigma_t` is NaN");
    fault("sigma_t = [1, inf, 1]", 1, 15, "`sigma_t` is inf");
    fault("sigma_t = 1e39", 1, 11, "`sigma_t` is 1");
    fault("albedo = 1.01", 1, 10, "`albedo` is 1.01, expected a number from 0 to 1");
    fault("sigma_t = 1\nscale = 2e12", 0, 1, "its extinction is negative, not finite or above 1e12");
    fault("sigma_a = 1\nsigma_t = 1", 0, 1, "either `sigma_a` and `sigma_s`, or `sigma_t` and `albedo`");
    fault("g = 1", 1, 5, "`g` is 1, expected a number between -1 and 1, both excluded");
    fault("g = nan", 1, 5, "`g` is NaN");
    // In single precision that is 1.
    fault("g = -0.99999999999", 0, 1, "g is not between -1 and 1");
    fault("phase = 'hg'", 0, 1, "needs `g`");
    fault("phase = 'isotropic'\ng = 0.5", 0, 1, "`g` is given, but the phase function is isotropic");
    fault("phase = 'rayleigh'", 1, 9, "expected one of: isotropic, hg");
    fault("sigmat = 1", 1, 1, "knows no key `sigmat`");
    fault("[[shapes]]\nkind = 'cube'\ninterior = 'fgo'", 3, 12, "no medium is called \"fgo\"");
    fault("[[shapes]]\nkind = 'cube'\npriority = 0.5", 3, 12, "`priority` is 0.5, expected a whole number");
    fault("[materials.a]\nkind = 'null'\n[materials.b]\nkind = 'two-sided'\nfront = 'a'", 5, 9, "not there (null)");
}

#[test]
fn what_makes_no_sense_together_is_refused_when_the_scene_is_built() {
    let errors = |content: &str| {
        let mut diagnostics = crate::diagnostics::Diagnostics::default();
        let built = crate::scene::Scene::build(import(content), "scene.toml", &mut diagnostics);
        assert!(built.is_none());
        diagnostics.list.iter().map(ToString::to_string).collect::<Vec<_>>().join("\n")
    };
    let flat = errors("[media.fog]\n[[shapes]]\nkind = 'disk'\ninterior = 'fog'");
    assert!(flat.contains("a flat shape has no inside"), "{flat}");
    let lamp = errors("[materials.a]\nkind = 'null'\n[[shapes]]\nkind = 'cube'\nmaterial = 'a'\nemission = 1");
    assert!(lamp.contains("(null) can't emit"), "{lamp}");
}

#[test]
fn an_interior_in_an_open_mesh_is_warned_of() {
    let text = document(
        "[media.fog]\n[materials.border]\nkind = 'null'
        [[shapes]]\nkind = 'mesh'\nfile = 'pyramid.obj'\nmaterial = 'border'\ninterior = 'fog'
        [[shapes]]\nkind = 'mesh'\nfile = 'pyramid.obj'\nmaterial = 'border'\ninterior = 'fog'
        [[shapes]]\nkind = 'cube'\nmaterial = 'border'\ninterior = 'fog'",
    );
    let warnings = |obj: &str| {
        let (scene, _) = scene(&[("scene.toml", text.as_bytes()), ("pyramid.obj", obj.as_bytes())]);
        let mut diagnostics = crate::diagnostics::Diagnostics::default();
        assert!(crate::scene::Scene::build(scene, "scene.toml", &mut diagnostics).is_some());
        diagnostics.list.iter().map(ToString::to_string).collect::<Vec<_>>()
    };
    let closed = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\n";
    assert_eq!(warnings(closed), [""; 0]);
    let open = closed.replace("f 2 3 4\n", "");
    let warned = warnings(&open);
    assert!(warned.len() == 1 && warned[0].contains("not closed"), "{warned:?}");
}
