//! The published scenes, when the shared data is there.

use crate::scene::desc::SceneDesc;
use crate::scene::import::tests::{load_file, shared};

fn load(path: &str) -> Option<(SceneDesc, Vec<String>)> {
    Some(load_file(&shared(&format!("scenes/{path}"))?).unwrap())
}

#[test]
fn published_scenes_load_without_a_warning() {
    // Shapes, materials, meshes, textures; counted by hand in the files.
    for (name, counts, triangles) in [
        ("cornell-box", [8, 16, 0, 0], 0),
        ("veach-mis", [9, 12, 0, 0], 0),
        ("veach-ajar", [22, 25, 17, 4], 0),
        ("water-caustic", [10, 17, 2, 0], 103_451),
    ] {
        let Some((scene, warnings)) = load(&format!("{name}/scene.xml")) else { return };
        assert!(warnings.is_empty(), "{name}: {warnings:#?}");
        let found = [scene.shapes.len(), scene.materials.len(), scene.meshes.len(), scene.textures.len()];
        assert_eq!(found, counts, "{name}");
        let sum: usize = scene.meshes.iter().map(|m| m.triangles.len()).sum();
        assert!(triangles == 0 || sum == triangles, "{name}: {sum}");
    }
}

#[test]
fn both_spellings_give_the_same_scene() {
    for (name, warned) in [("cornell-box", 0), ("water-caustic", 1)] {
        let (Some((new, _)), Some((old, warnings))) =
            (load(&format!("{name}/scene.xml")), load(&format!("{name}/scene_v0.6.xml")))
        else {
            return;
        };
        // The old water-caustic asks for photon mapping and has another number of samples.
        assert_eq!(warnings.len(), warned, "{warnings:#?}");
        assert_eq!(new.meshes, old.meshes);
        let parts = |s: &SceneDesc| {
            let d = &s.defaults;
            let defaults = (d.size, d.max_depth, d.filter, d.integrator.clone());
            format!("{:?}", (&s.shapes, &s.materials, &s.textures, &s.lights, &s.camera, defaults))
        };
        assert_eq!(parts(&new), parts(&old), "{name}");
    }
}
