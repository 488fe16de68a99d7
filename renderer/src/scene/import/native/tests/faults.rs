use super::document;
use crate::scene::import::load;
use crate::scene::import::tests::{assert_error, damage, errors, files};

/// Asserts that the scene around `content` has one error, at `line` and `column` of its file, that contains `parts`.
#[track_caller]
fn fault(content: &str, line: usize, column: usize, parts: &[&str]) {
    let text = document(content);
    let place = format!("error: scene.toml, line {line}, column {column}: ");
    let mut all = vec![place.as_str()];
    all.extend(parts);
    assert_error(&[("scene.toml", text.as_bytes())], &all);
}

#[test]
fn wrong_keys_are_named_with_the_nearest() {
    fault(
        "[materials.a]\nkind = 'diffuse'\nreflectence = 1",
        4,
        1,
        &["no key `reflectence`", "did you mean `reflectance`?"],
    );
    fault("[[shape]]\nkind = 'cube'", 2, 3, &["no key `shape`", "did you mean `shapes`?"]);
    fault("[materials.a]\nkind = 'diffuze'", 3, 8, &["\"diffuze\"", "did you mean \"diffuse\"?"]);
    fault("[materials.a]\nreflectance = 1", 2, 1, &["the material \"a\" has no `kind`"]);
    fault("[render]\nxyzzy = 1", 3, 1, &["known are: filter, integrator, max_depth"]);
    fault("[render]\nintegrator = 'paht'", 3, 14, &["did you mean \"path\"?"]);
    fault(
        "[render]\nintegrator = 'sppm'",
        3,
        14,
        &["`integrator` is \"sppm\", expected one of: path, light, bdpt, mmlt, auto"],
    );
    let scene = "[[shapes]]\nkind = 'cube'\nmaterial = 'wod'\n[materials.wood]\nkind = 'diffuse'";
    fault(scene, 4, 12, &["no material is called \"wod\"", "did you mean \"wood\"?"]);
    let scene = "[[shapes]]\nkind = 'cube'\ntransform = [{ translat = [1, 2, 3] }]";
    fault(scene, 4, 16, &["did you mean `translate`?"]);
}

#[test]
fn wrong_values_name_their_place() {
    let sphere = |line: &str| format!("[[shapes]]\nkind = 'sphere'\n{line}");
    fault(&sphere("radius = -1"), 4, 10, &["`radius` is -1", "greater than 0"]);
    fault(&sphere("radius = nan"), 4, 10, &["`radius` is NaN"]);
    fault(&sphere("radius = 1e300"), 4, 10, &["finite number"]);
    fault(&sphere("radius = '1'"), 4, 10, &["`radius` is the string \"1\""]);
    fault(&sphere("center = [1, 2]"), 4, 10, &["`center` is a list of 2", "3 numbers"]);
    fault(&sphere("center = [1, inf, 2]"), 4, 14, &["`center` is inf"]);
    fault(&sphere("flip_normals = 1"), 4, 16, &["true or false"]);
    fault(&sphere("transform = [{ scale = [1, 2, 1] }]"), 2, 1, &["same along all axes"]);
    fault(&sphere("transform = [{ scale = 0 }]"), 4, 13, &["singular"]);
    fault(&sphere("transform = [{ rotate = 5, axis = [0, 0, 0] }]"), 4, 25, &["no length"]);
    fault(&sphere("transform = [{}]"), 4, 14, &["found 0"]);
    fault(&sphere("transform = [{ rotate_x = 5, scale = 2 }]"), 4, 14, &["found 2"]);
    fault("[materials.a]\nkind = 'diffuse'\nreflectance = 2", 4, 15, &["from 0 to 1"]);
    fault("[materials.a]\nkind = 'diffuse'\nreflectance = '#12'", 4, 15, &["#rrggbb"]);
    fault("[materials.a]\nkind = 'conductor'\nmetal = 'Gold'", 4, 9, &["no metal is called \"Gold\""]);
    fault("[render]\nspp = 0", 3, 7, &["from 1 to"]);
    fault("[render]\nfilter = { kind = 'tent', radius = 9 }", 3, 36, &["from 0.01 to 8"]);
    fault("[render]\nfilter = { kind = 'gaussian', stddev = 3 }", 3, 40, &["from 0.01 to 2"]);
    fault("[render]\nsize = [1.5, 2]", 3, 9, &["`size` is 1.5", "whole number"]);
    fault("[render]\nseed = 99999999999999999999", 3, 8, &["`seed`"]);
    fault("[textures.t]\nkind = 'image'\nfile = 'no.png'", 4, 8, &["\"no.png\"", "no such file"]);
    fault("[textures.t]\nkind = 'image'\nsize = [2, 2]\npixels = [1]", 5, 10, &["1 colours, but 2 x 2"]);
    fault("[textures.t]\nkind = 'image'", 2, 1, &["either `file`, or `size` and `pixels`"]);
    fault("[[lights]]\nkind = 'spot'\nposition = [0, 0, 0]\nto = [0, 0, 0]", 2, 1, &["no length"]);
}

#[test]
fn wrong_meshes_name_their_place() {
    let mesh = |lines: &str| format!("[meshes.m]\npositions = [[0, 0, 0], [1, 0, 0], [0, 1, 0]]\n{lines}");
    fault(&mesh("triangles = [[0, 1, 3]]"), 4, 21, &["from 0 to 2"]);
    fault(&mesh("triangles = [[0, 1, 4294967296]]"), 4, 21, &["from 0 to 2"]);
    fault(&mesh("triangles = [[0, 1]]"), 4, 14, &["three vertex indices"]);
    fault(&mesh("triangles = []"), 4, 13, &["no triangles"]);
    fault(&mesh("triangles = [[0, 1, 2]]\nuvs = [[0, 0]]"), 2, 1, &["3 positions, but 1 texture coordinates"]);
    fault("[meshes.m]\nfile = 'no.ply'", 3, 8, &["\"no.ply\""]);
}

#[test]
fn all_faults_are_found_at_once() {
    let text = "[camera]\nform = [0, 0, 1]\nto = [0, 0, 0]\n[render]\nspp = 'many'\n[materials.a]\nkind = 'two-sided'\nfront = 'b'
[materials.b]\nkind = 'two-sided'\nfront = 'a'\n[[lights]]\nkind = 'sun'\n";
    let errors = errors(&[("s.toml", text.as_bytes())]);
    let expected = ["line 1, column 1", "line 2, column 1", "line 5, column 7", "contains itself", "line 13, column 8"];
    assert_eq!(errors.len(), expected.len(), "{errors:#?}");
    for (error, part) in errors.iter().zip(expected) {
        assert!(error.contains(part), "{part}: {error}");
    }
}

#[test]
fn broken_files() {
    assert_error(&[("s.toml", b"[camera]\nfrom = [0, 0, 1\nto = 1")], &["s.toml, line ", "not TOML"]);
    assert_error(&[("s.toml", b"")], &["s.toml, line 1, column 1", "no camera"]);
    assert_error(&[("s.toml", b"a = \"\xff\"")], &["s.toml, byte 5", "UTF-8"]);
    let deep = format!("a = {}", "[".repeat(100_000));
    assert!(!errors(&[("s.toml", deep.as_bytes())]).is_empty());
}

#[test]
fn hostile_files_end() {
    let junk = "= ".repeat(500_000);
    assert!(!errors(&[("s.toml", junk.as_bytes())]).is_empty());
    let lines = "=\n".repeat(300_000);
    assert!(errors(&[("s.toml", lines.as_bytes())]).len() <= 50);
    let large = format!("#{}", " ".repeat(9 << 20));
    assert_error(&[("s.toml", large.as_bytes())], &["larger than 8 MiB"]);
    let unknown: String = (0..50_000).map(|i| format!("k{i} = 1\n")).collect();
    assert!(errors(&[("s.toml", unknown.as_bytes())]).len() <= 201);
}

#[test]
fn damaged_scenes_never_panic() {
    let valid = "medium = 'haze'\n[camera]\nfrom = [0, 1, 5]\nto = [0, 0, 0]\nfov = 40\n[render]\nspp = 4\nfilter = { kind = 'tent' }
[textures.t]\nkind = 'image'\nsize = [2, 1]\npixels = [1, '#00ff00']\nuv = { scale = 2 }
[materials.m]\nkind = 'conductor'\nmetal = 'Cu'\nalpha = { texture = 't', scale = 0.2 }\ntwo_sided = true
[materials.n]\nkind = 'two-sided'\nfront = 'm'
[meshes.q]\npositions = [[0, 0, 0], [1, 0, 0], [0, 1, 0]]\ntriangles = [[0, 1, 2]]\nshading = 'smooth'
[[shapes]]\nkind = 'mesh'\nmesh = 'q'\nmaterial = 'n'\ninstances = [[{ rotate = 10, axis = [0, 1, 0] }], [{ scale = 2 }]]
[media.haze]\nsigma_t = [0.1, 0.2, 0.3]\nalbedo = 0.9\nscale = 2\ng = 0.5\n[media.tea]\nsigma_a = 1
[[shapes]]\nkind = 'cube'\ninterior = 'tea'\npriority = 1
[[lights]]\nkind = 'environment'\nsize = [1, 1]\npixels = [2.5]\ntransform = [{ rotate_y = 1e1 }]\n";
    let mut loaded = 0;
    damage(valid.as_bytes(), 4000, |bytes| {
        loaded += u32::from(load(&files(&[("s.toml", bytes)]), "s.toml").is_ok());
    });
    assert!((1..3000).contains(&loaded), "{loaded}");
}
