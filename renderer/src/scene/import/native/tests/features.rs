use super::document;
use crate::bsdf::{Distribution, Material, MaterialId, Roughness};
use crate::geometry::MeshId;
use crate::math::{DAffine3, DMat3, DVec3, Vec2, Vec3};
use crate::scene::desc::{
    CameraDesc, Emission, FilterDesc, FovAxis, LightDesc, RenderDefaults, SceneDesc, ShapeKind, SpotFalloff,
};
use crate::scene::import::tests::{assert_error, scene};
use crate::spectrum::Rgb;
use crate::texture::{Filter, FloatParam, RgbParam, Texture, TextureId, UvTransform, Wrap};

fn read(text: &str) -> SceneDesc {
    let quad: &[u8] = b"v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nvt 0 0.25\nf 1/1 2/1 3/1 4/1\n";
    let (scene, warnings) = scene(&[("scene.toml", text.as_bytes()), ("quad.obj", quad)]);
    assert!(warnings.is_empty(), "{warnings:#?}");
    scene
}

fn import(content: &str) -> SceneDesc {
    read(&document(content))
}

fn material(toml: &str) -> Material {
    *import(&format!("[materials.m]\n{toml}")).materials.last().unwrap()
}

fn white() -> RgbParam {
    RgbParam::Const(Rgb::ONE)
}

#[test]
fn cameras() {
    let camera = |toml: &str| read(&format!("[camera]\n{toml}")).camera;
    let near = |a: DAffine3, b: DAffine3| a.abs_diff_eq(b, 1e-12);
    let c = camera("from = [1, 2, 3]\nto = [1, 2, -1]");
    assert!(near(c.to_world, DAffine3::from_translation(DVec3::new(1.0, 2.0, 3.0))), "from +Z to -Z nothing turns");
    let CameraDesc { fov, fov_axis, aperture_radius, focus_distance, .. } = c;
    assert_eq!((fov, fov_axis, aperture_radius, focus_distance), (45.0, FovAxis::Y, 0.0, 4.0));
    let c =
        camera("from = [0, 0, 0]\nto = [5, 0, 0]\nfov = 30\nfov_axis = 'x'\naperture_radius = 0.1\nfocus_distance = 2");
    // Looking along +X, right is +Z.
    assert!(near(c.to_world, DAffine3::from_mat3(DMat3::from_cols(DVec3::Z, DVec3::Y, -DVec3::X))));
    assert_eq!((c.fov, c.fov_axis, c.aperture_radius, c.focus_distance), (30.0, FovAxis::X, 0.1, 2.0));
    let c = camera("transform = [{ scale = 3 }, { translate = [0, 1, 0] }]");
    assert!(near(c.to_world, DAffine3::from_translation(DVec3::Y)), "scale is ignored");
}

#[test]
fn render_settings() {
    let text = "[render]\nintegrator = 'light'\nspp = 16\nsize = [320, 0xb4]\nmax_depth = -1\nrr_depth = 3\nseed = 7
        filter = { kind = 'blackman-harris', radius = 2 }";
    let expected = RenderDefaults {
        integrator: Some("light".into()),
        spp: Some(16),
        size: Some((320, 180)),
        max_depth: Some(-1),
        rr_depth: Some(3),
        seed: Some(7),
        filter: Some(FilterDesc::BlackmanHarris { radius: 2.0 }),
    };
    assert_eq!(import(text).defaults, expected);
    assert_eq!(import("").defaults, RenderDefaults::default());
    for (toml, filter) in [
        ("{}", FilterDesc::Gaussian { stddev: 0.5 }),
        ("{ kind = 'box' }", FilterDesc::Box { radius: 0.5 }),
        ("{ kind = 'tent', radius = 1.5 }", FilterDesc::Tent { radius: 1.5 }),
    ] {
        assert_eq!(import(&format!("[render]\nfilter = {toml}")).defaults.filter, Some(filter));
    }
}

#[test]
fn materials() {
    let grey = RgbParam::Const(Rgb::splat(0.5));
    assert_eq!(material("kind = 'diffuse'"), Material::Lambert { reflectance: grey });
    let red = RgbParam::Const(Rgb::new(1.0, 0.0, 0.0));
    assert_eq!(material("kind = 'diffuse'\nreflectance = '#ff0000'"), Material::Lambert { reflectance: red });
    let mirror = Material::Conductor { eta: Rgb::ZERO, k: Rgb::ONE, reflectance: white(), roughness: None };
    assert_eq!(material("kind = 'conductor'"), mirror);
    let alpha = |u, v| Roughness {
        distribution: Distribution::Beckmann,
        alpha_u: FloatParam::Const(u),
        alpha_v: FloatParam::Const(v),
    };
    let expected = Material::Conductor {
        eta: Rgb::new(0.143036, 0.375307, 1.44205),
        k: Rgb::new(3.983, 2.38556, 1.60336),
        reflectance: white(),
        roughness: Some(alpha(0.1, 0.3)),
    };
    assert_eq!(material("kind = 'conductor'\nmetal = 'Au'\nalpha = [0.1, 0.3]\ndistribution = 'beckmann'"), expected);
    let expected = Material::Dielectric {
        eta: 1.25,
        reflectance: white(),
        transmittance: RgbParam::Const(Rgb::splat(0.9)),
        roughness: Some(Roughness { distribution: Distribution::Ggx, ..alpha(0.2, 0.2) }),
    };
    assert_eq!(
        material("kind = 'dielectric'\nior = 1.5\nexterior_ior = 1.2\ntransmittance = 0.9\nalpha = 0.2"),
        expected
    );
    let expected = Material::Gltf {
        base_color: RgbParam::Const(Rgb::new(0.1, 0.2, 0.3)),
        metallic: FloatParam::Const(0.0),
        roughness: FloatParam::Const(0.25),
        ior: 1.4,
        transmission: FloatParam::Const(1.0),
        thin: false,
    };
    let toml = "kind = 'gltf'\nbase_color = [0.1, 0.2, 0.3]\nmetallic = 0\nroughness = 0.25\nior = 1.4\ntransmission = 1\nthin = false";
    assert_eq!(material(toml), expected);
}

#[test]
fn materials_of_materials() {
    let two_sided = |front, back| Material::TwoSided { front: MaterialId(front), back: MaterialId(back) };
    assert_eq!(material("kind = 'diffuse'\ntwo_sided = true"), two_sided(0, 0));
    // Names are read in alphabetical order, whatever they refer to.
    let scene = import(
        "materials.a = { kind = 'two-sided', front = 'z', back = 'b' }
         materials.b = { kind = 'diffuse' }
         materials.c = { kind = 'normal-map', material = 'b', texture = 't', scale = 0.5 }
         materials.z = { kind = 'conductor' }
         textures.t = { kind = 'image', size = [1, 1], pixels = [[0.5, 0.5, 1]] }",
    );
    assert_eq!(scene.materials[2], two_sided(0, 1));
    let expected =
        Material::NormalMap { inner: MaterialId(1), texture: TextureId(0), scale: 0.5, mirrors_with_uv: true };
    assert_eq!(scene.materials[3], expected);
}

#[test]
fn textures() {
    let scene = import(
        "[textures.a]\nkind = 'checkerboard'\na = 1\nb = [0, 0.5, 0]\nuv = { scale = 4 }
         [textures.b]\nkind = 'image'\nsize = [2, 1]\npixels = ['#ffffff', 0.25]\nwrap = ['clamp', 'mirror']\nfilter = 'nearest'\nscale = 2
         uv = { flip_v = true, scale = [2, 3], rotate = 90, translate = [0.5, 0] }
         [materials.m]\nkind = 'diffuse'\nreflectance = { texture = 'a', scale = [1, 0.5, 0.5] }
         [materials.n]\nkind = 'conductor'\nalpha = { texture = 'b', channel = 'green', scale = 0.1 }\nreflectance = 'b'",
    );
    let uv = UvTransform([4.0, 0.0, 0.0, 0.0, 4.0, 0.0]);
    assert_eq!(scene.textures[0], Texture::Checkerboard { a: Rgb::ONE, b: Rgb::new(0.0, 0.5, 0.0), uv });
    let Texture::Image { image, wrap, filter, uv, scale } = &scene.textures[1] else { panic!() };
    assert_eq!((image.width, image.height, &image.texels), (2, 1, &vec![Rgb::ONE, Rgb::splat(0.25)].into()));
    assert_eq!((*wrap, *filter, *scale), ([Wrap::Clamp, Wrap::Mirror], Filter::Nearest, Rgb::splat(2.0)));
    // (u, v) -> (u, 1 - v) -> (2 u, 3 - 3 v) -> a quarter turn (-3 + 3 v, 2 u) -> u + 0.5.
    assert!(uv.apply(Vec2::new(0.5, 0.25)).abs_diff_eq(Vec2::new(-1.75, 1.0), 1e-6), "{uv:?}");
    let reflectance = RgbParam::Texture(TextureId(0), Rgb::new(1.0, 0.5, 0.5));
    assert_eq!(scene.materials[0], Material::Lambert { reflectance });
    let Material::Conductor { reflectance, roughness: Some(r), .. } = scene.materials[1] else { panic!() };
    assert_eq!(reflectance, RgbParam::Texture(TextureId(1), Rgb::ONE));
    assert_eq!(
        (r.alpha_u, r.alpha_v),
        (FloatParam::Texture(TextureId(1), 1, 0.1), FloatParam::Texture(TextureId(1), 1, 0.1))
    );
}

#[test]
fn shapes_and_instances() {
    let scene = import(
        "[[shapes]]\nkind = 'sphere'\ncenter = [1, 0, 0]\nradius = 2\nname = 'ball'\nmaterial = 'm'\nemission = 3\nemission_two_sided = true
         transform = [{ scale = 2 }, { rotate_z = 90 }]
         [[shapes]]\nkind = 'disk'\nflip_normals = true\ninstances = [[{ translate = [1, 2, 3] }], []]
         [[shapes]]\nkind = 'cube'\ntransform = [{ matrix = [[1, 2, 0, 5], [0, 1, 0, 6], [0, 0, 1, 7]] }]
         [[shapes]]\nkind = 'rectangle'\ntransform = [{ look_at = { from = [0, 3, 0], to = [0, 0, 0], up = [0, 0, 1] } }]
         [materials.m]\nkind = 'diffuse'",
    );
    let names: Vec<&str> = scene.shapes.iter().map(|s| s.name.as_str()).collect();
    assert_eq!(names, ["ball", "shape 2, instance 1", "shape 2, instance 2", "shape 3", "shape 4"]);
    let kinds: Vec<ShapeKind> = scene.shapes.iter().map(|s| s.kind).collect();
    let expected = [ShapeKind::Sphere, ShapeKind::Disk, ShapeKind::Disk, ShapeKind::Cube, ShapeKind::Rectangle];
    assert_eq!(kinds, expected);
    let ball = &scene.shapes[0];
    assert!(ball.to_world.transform_point3(DVec3::ZERO).abs_diff_eq(DVec3::new(0.0, 2.0, 0.0), 1e-12));
    assert!(ball.to_world.transform_vector3(DVec3::X).abs_diff_eq(DVec3::new(0.0, 4.0, 0.0), 1e-12));
    let emission = Emission { radiance: RgbParam::Const(Rgb::splat(3.0)), two_sided: true };
    assert_eq!((ball.material, ball.emission), (MaterialId(0), Some(emission)));
    assert!(scene.shapes[1].flip_normals && scene.shapes[1].emission.is_none());
    assert_eq!(scene.shapes[1].to_world.translation, DVec3::new(1.0, 2.0, 3.0));
    let p = scene.shapes[3].to_world.transform_point3(DVec3::new(1.0, 1.0, 0.0));
    assert_eq!(p, DVec3::new(8.0, 7.0, 7.0));
    let normal = scene.shapes[4].to_world.transform_vector3(DVec3::Z);
    assert!(normal.abs_diff_eq(-DVec3::Y, 1e-12), "+Z points at `to`");
    let front = scene.shapes[1].material.0 - 1;
    assert_eq!(
        scene.materials[front as usize + 1],
        Material::TwoSided { front: MaterialId(front), back: MaterialId(front) }
    );
}

#[test]
fn meshes() {
    let scene = import(
        "[meshes.a]\nfile = 'quad.obj'\n[meshes.b]\nfile = 'quad.obj'\nshading = 'smooth'
         [meshes.c]\npositions = [[0, 0, 0], [1, 0, 0], [0, 1, 0]]\ntriangles = [[0, 1, 2]]\nnormals = [[0, 0, 2], [0, 0, 2], [0, 0, 2]]
         uvs = [[0, 0], [1, 0], [0, 1]]
         [[shapes]]\nkind = 'mesh'\nmesh = 'c'\n[[shapes]]\nkind = 'mesh'\nfile = 'quad.obj'",
    );
    assert_eq!(scene.meshes.len(), 3);
    assert!(scene.meshes[0].normals.is_empty() && scene.meshes[0].triangles == [[0, 1, 2], [0, 2, 3]]);
    assert_eq!(scene.meshes[0].uvs[0], Vec2::new(0.0, 0.75), "v of OBJ counts from the bottom");
    assert_eq!((&scene.meshes[1].normals, &scene.meshes[2].normals), (&vec![Vec3::Z; 4], &vec![Vec3::Z; 3]));
    let kinds: Vec<ShapeKind> = scene.shapes.iter().map(|s| s.kind).collect();
    assert_eq!(kinds, [ShapeKind::Mesh(MeshId(2)), ShapeKind::Mesh(MeshId(0))], "a file is read once");
}

#[test]
fn lights() {
    let lights = import(
        "[[lights]]\nkind = 'point'\nposition = [1, 2, 3]\nintensity = [4, 5, 6]
         [[lights]]\nkind = 'spot'\nposition = [0, 5, 0]\nto = [0, 1, 0]\ncutoff = 40\nfalloff = 'squared-cosine'
         [[lights]]\nkind = 'directional'\ndirection = [0, -1, 0]\nirradiance = 2
         [[lights]]\nkind = 'constant'\nradiance = 0.5
         [[lights]]\nkind = 'environment'\nsize = [1, 2]\npixels = [1, 0]\nscale = 3\ntransform = [{ rotate_y = 90 }]",
    )
    .lights;
    let LightDesc::Point { position, intensity } = lights[0] else { panic!() };
    assert_eq!((position, intensity), (DVec3::new(1.0, 2.0, 3.0), Rgb::new(4.0, 5.0, 6.0)));
    let LightDesc::Spot { direction, intensity, beam, cutoff, falloff, .. } = lights[1] else { panic!() };
    assert_eq!((direction, intensity), (DVec3::new(0.0, -4.0, 0.0), Rgb::ONE));
    assert_eq!((beam, cutoff, falloff), (30.0, 40.0, SpotFalloff::SquaredCosine));
    let LightDesc::Directional { direction, irradiance } = lights[2] else { panic!() };
    assert_eq!((direction, irradiance), (-DVec3::Y, Rgb::splat(2.0)));
    assert!(matches!(lights[3], LightDesc::Constant { radiance } if radiance == Rgb::splat(0.5)));
    let LightDesc::Environment { image, scale, to_world } = &lights[4] else { panic!() };
    assert_eq!((&image.texels, *scale), (&vec![Rgb::ONE, Rgb::ZERO].into(), Rgb::splat(3.0)));
    assert!(to_world.transform_vector3(DVec3::Z).abs_diff_eq(DVec3::X, 1e-12));
}

/// Two triangles with a red and a blue material, and a camera.
fn gltf(camera: bool) -> String {
    let scene_camera = if camera { r#"{"camera":0,"translation":[0,0,9]},"# } else { "" };
    let nodes = if camera { "[0,1]" } else { "[0]" };
    let cameras =
        if camera { r#""cameras":[{"type":"perspective","perspective":{"yfov":0.5,"znear":0.1}}],"# } else { "" };
    format!(
        r#"{{"asset":{{"version":"2.0"}},"scene":0,"scenes":[{{"nodes":{nodes}}}],"nodes":[{scene_camera}{{"mesh":0}}],{cameras}
        "materials":[{{"name":"red","emissiveFactor":[1,0,0]}},{{"name":"blue"}}],
        "meshes":[{{"primitives":[{{"attributes":{{"POSITION":0}},"material":0}},{{"attributes":{{"POSITION":0}},"material":1}}]}}],
        "accessors":[{{"bufferView":0,"componentType":5126,"count":3,"type":"VEC3","min":[0,0,0],"max":[1,1,0]}}],
        "bufferViews":[{{"buffer":0,"byteLength":36}}],
        "buffers":[{{"byteLength":36,"uri":"data:application/octet-stream;base64,AAAAAAAAAAAAAAAAAACAPwAAAAAAAAAAAAAAAAAAgD8AAAAA"}}]}}"#
    )
}

#[test]
fn gltf_files_are_opened_and_their_materials_replaced() {
    let text = "gltf = 'sub/a.gltf'\n[materials.red]\nkind = 'conductor'\nmetal = 'Cu'
        [[shapes]]\nkind = 'cube'\nmaterial = 'blue'";
    let (scene, _) = scene(&[("s.toml", text.as_bytes()), ("sub/a.gltf", gltf(true).as_bytes())]);
    assert_eq!(scene.shapes.len(), 3);
    let of = |i: usize| scene.materials[scene.shapes[i].material.0 as usize];
    assert!(matches!(of(0), Material::Conductor { .. }), "{:?}", of(0));
    assert!(scene.shapes[0].emission.is_some(), "what it emits stays");
    assert!(matches!(of(1), Material::Gltf { .. }) && scene.shapes[1].material == scene.shapes[2].material);
    assert_eq!(scene.camera.to_world.translation, DVec3::new(0.0, 0.0, 9.0));
    assert!(scene.lights.is_empty(), "nothing stands in for lights");
}

#[test]
fn gltf_files_without_camera_need_one() {
    let file = gltf(false);
    let files: [(&str, &[u8]); 2] = [("s.toml", b"gltf = 'a.gltf'"), ("a.gltf", file.as_bytes())];
    assert_error(&files, &["s.toml, line 1, column 1", "no camera"]);
    assert_error(&[("s.toml", b"gltf = 'a.gltf'")], &["a.gltf"]);
    assert_error(&[("s.toml", b"gltf = 'a.gltf'"), ("a.gltf", b"{}")], &["a.gltf"]);
}
