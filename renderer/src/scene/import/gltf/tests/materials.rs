use super::*;
use crate::bsdf::{Material, MaterialId};
use crate::medium::MediumId;
use crate::scene::desc::Emission;
use crate::spectrum::Rgb;
use crate::texture::{Filter, FloatParam, RgbParam, Texture, TextureId, Wrap};

fn texel(scene: &SceneDesc, id: TextureId) -> Rgb {
    let Texture::Image { image, .. } = &scene.textures[id.0 as usize] else { panic!("not an image") };
    image.texel(0, 0)
}

fn close(a: Rgb, b: [f32; 3]) -> bool {
    a.to_array().iter().zip(b).all(|(a, b)| (a - b).abs() < 1e-6)
}

#[test]
fn the_default_material() {
    let (scene, _) = File::triangle().load();
    let white = Material::Gltf {
        base_color: RgbParam::Const(Rgb::ONE),
        metallic: FloatParam::Const(1.0),
        roughness: FloatParam::Const(1.0),
        ior: 1.5,
        transmission: FloatParam::Const(0.0),
        thin: true,
    };
    assert_eq!(scene.materials, [white]);
    assert_eq!(scene.shapes[0].emission, None);
    // Nothing wants texture coordinates.
    assert!(scene.meshes[0].uvs.is_empty());
}

#[test]
fn every_texture_lands_in_its_channel_and_colour_space() {
    let file = File::with_material(json!({
        "name": "all",
        "doubleSided": true,
        "pbrMetallicRoughness": {
            "baseColorFactor": [0.5, 1.0, 1.0, 0.3], "baseColorTexture": { "index": 0 },
            "metallicFactor": 0.25, "roughnessFactor": 0.75, "metallicRoughnessTexture": { "index": 0 },
        },
        "normalTexture": { "index": 0, "scale": 0.5 },
        "emissiveFactor": [0.0, 1.0, 0.5], "emissiveTexture": { "index": 0 },
        "extensions": {
            "KHR_materials_emissive_strength": { "emissiveStrength": 8.0 },
            "KHR_materials_ior": { "ior": 1.33 },
            "KHR_materials_transmission": { "transmissionFactor": 0.9, "transmissionTexture": { "index": 0 } },
            "KHR_materials_volume": { "thicknessFactor": 0.1 },
        },
    }));
    let (scene, _) = file.load();
    let (MaterialId(top), emission) = (scene.shapes[0].material, scene.shapes[0].emission);
    let Material::NormalMap { inner, texture: normal, scale: 0.5, mirrors_with_uv: true } =
        scene.materials[top as usize]
    else {
        panic!()
    };
    let Material::Gltf { base_color, metallic, roughness, ior, transmission, thin } = scene.materials[inner.0 as usize]
    else {
        panic!()
    };
    let RgbParam::Texture(colour, factor) = base_color else { panic!() };
    assert_eq!(factor, Rgb::new(0.5, 1.0, 1.0));
    assert!(close(texel(&scene, colour), [0.502_886_5, 0.215_860_5, 0.0]));
    let raw = normal;
    assert!(close(texel(&scene, raw), [188.0 / 255.0, 128.0 / 255.0, 0.0]));
    assert_eq!(metallic, FloatParam::Texture(raw, 2, 0.25));
    assert_eq!(roughness, FloatParam::Texture(raw, 1, 0.75));
    assert_eq!(transmission, FloatParam::Texture(raw, 0, 0.9));
    assert_eq!((ior, thin), (1.33, false));
    let radiance = RgbParam::Texture(colour, Rgb::new(0.0, 8.0, 4.0));
    assert_eq!(emission, Some(Emission { radiance, two_sided: true }));
    // Two decodings of one picture, shared by all uses.
    assert_eq!(scene.textures.len(), 2);
    assert!(scene.lights.is_empty(), "the emission is light enough");
}

#[test]
fn thin_and_refracting_transmission() {
    let transmission = json!({ "KHR_materials_transmission": { "transmissionFactor": 1.0 } });
    let material = |extensions: Value| File::with_material(json!({ "extensions": extensions })).load();
    let thin = |scene: &SceneDesc| matches!(scene.materials[0], Material::Gltf { thin: true, .. });
    assert!(thin(&material(transmission.clone()).0));
    let mut volume = transmission;
    volume["KHR_materials_volume"] =
        json!({ "thicknessFactor": 0.0, "attenuationDistance": 2.0, "attenuationColor": [1, 0, 0] });
    let (scene, warnings) = material(volume.clone());
    assert!(thin(&scene));
    assert!(scene.media.is_empty() && !says(&warnings, &["ttenuation"]), "a thin sheet has no inside: {warnings:?}");
    volume["KHR_materials_volume"]["thicknessFactor"] = json!(2.0);
    let (scene, warnings) = material(volume.clone());
    assert!(!thin(&scene) && !says(&warnings, &["ttenuation"]), "{warnings:?}");
    // Black would be reached nowhere; what comes nearest to it is as good as opaque over the distance.
    let [medium] = scene.media[..] else { panic!("{:?}", scene.media) };
    assert_eq!(scene.shapes[0].interior, Some(MediumId(0)));
    assert!(medium.sigma_t.r == 0.0 && (40.0..50.0).contains(&medium.sigma_t.g) && !medium.scatters(), "{medium:?}");
    volume["KHR_materials_volume"]["attenuationColor"] = json!([1.0, 0.5, 0.25]);
    let medium = material(volume.clone()).0.media[0];
    let expected = Rgb::new(0.0, 0.5 * std::f32::consts::LN_2, std::f32::consts::LN_2);
    assert!((medium.sigma_t - expected).map(f32::abs).max_component() < 1e-7, "{medium:?}");
    volume["KHR_materials_volume"]["attenuationDistance"] = json!(-1.0);
    let (scene, warnings) = material(volume.clone());
    assert!(scene.media.is_empty() && says(&warnings, &["attenuationDistance", "-1", "above 0"]), "{warnings:?}");
    volume["KHR_materials_volume"] = json!({ "thicknessFactor": 2.0 });
    let (scene, _) = material(volume);
    assert!(!thin(&scene) && scene.media.is_empty());
}

#[test]
fn unlit_surfaces_emit_their_base_colour() {
    let file = File::with_material(json!({
        "pbrMetallicRoughness": { "baseColorFactor": [0.2, 0.4, 0.6, 1.0] },
        "extensions": { "KHR_materials_unlit": {} },
    }));
    let (scene, _) = file.load();
    assert_eq!(scene.materials, [Material::Lambert { reflectance: RgbParam::Const(Rgb::ZERO) }]);
    let radiance = RgbParam::Const(Rgb::new(0.2, 0.4, 0.6));
    assert_eq!(scene.shapes[0].emission, Some(Emission { radiance, two_sided: false }));
}

#[test]
fn a_black_emissive_texture_is_no_light() {
    let mut file = File::with_material(json!({ "emissiveFactor": [1, 1, 1], "emissiveTexture": { "index": 0 } }));
    assert!(file.load().0.shapes[0].emission.is_some());
    let view = file.view(&png(&[0; 6]));
    file.json["images"][0] = json!({ "bufferView": view });
    let (scene, warnings) = file.load();
    assert_eq!(scene.shapes[0].emission, None);
    assert!(says(&warnings, &["there is no light"]));
}

#[test]
fn samplers() {
    let mut file = File::with_material(json!({ "normalTexture": { "index": 0 } }));
    let mut check = |sampler: Value, wrap: [Wrap; 2], filter: Filter| {
        file.json["samplers"] = json!([sampler]);
        file.json["textures"][0]["sampler"] = json!(0);
        let (scene, _) = file.load();
        let Texture::Image { wrap: w, filter: f, .. } = &scene.textures[0] else { panic!() };
        assert_eq!((*w, *f), (wrap, filter), "{sampler}");
    };
    check(json!({}), [Wrap::Repeat; 2], Filter::Linear);
    check(json!({ "wrapS": 33071, "wrapT": 33648 }), [Wrap::Clamp, Wrap::Mirror], Filter::Linear);
    check(json!({ "magFilter": 9728, "minFilter": 9987, "wrapS": 10497 }), [Wrap::Repeat; 2], Filter::Nearest);
    check(json!({ "minFilter": 9984 }), [Wrap::Repeat; 2], Filter::Nearest);
    check(json!({ "magFilter": 9729, "minFilter": 9728 }), [Wrap::Repeat; 2], Filter::Linear);
}

/// The quads of Khronos' TextureTransformTest: where the "correct" markers lie, the transformed coordinates must lie on the arrow,
/// which runs along the diagonal of the picture.
#[test]
fn texture_transforms_turn_the_right_way() {
    let transformed = |transform: Value, uv: [f32; 2], normal: bool| {
        let info = json!({ "index": 0, "extensions": { "KHR_texture_transform": transform } });
        let material = match normal {
            true => json!({ "normalTexture": info }),
            false => json!({ "pbrMetallicRoughness": { "baseColorTexture": info } }),
        };
        let (scene, _) = File::with_material(material).load();
        let Texture::Image { uv: m, .. } = &scene.textures[0] else { panic!() };
        m.apply(uv.into())
    };
    for normal in [false, true] {
        // Marker at (-0.079, -0.516) of a quad whose coordinates run from (0, 0) at (-0.5, 0.5) to (1, 1) at (0.5, -0.5).
        let p = transformed(json!({ "rotation": std::f32::consts::FRAC_PI_8 }), [0.420_952, 1.016_267_5], normal);
        assert!((p.x - p.y).abs() < 1e-5 && p.x > 0.5, "{p}");
        let p = transformed(json!({ "scale": [1.5, 1.5] }), [0.518_545, 0.518_545], normal);
        assert!((p.x - 0.777_817_5).abs() < 1e-5 && (p.x - p.y).abs() < 1e-6, "{p}");
        let p = transformed(
            json!({ "offset": [0.5, 0.25], "rotation": std::f32::consts::FRAC_PI_2, "scale": [2, 3] }),
            [0.1, 0.2],
            normal,
        );
        // Scale to (0.2, 0.6), turn u to -v and v to u, then move.
        assert!((p.x - 1.1).abs() < 1e-6 && (p.y - 0.05).abs() < 1e-6, "{p}");
    }
}

#[test]
fn sets_of_texture_coordinates() {
    let mut file = File::with_material(json!({
        "pbrMetallicRoughness": { "baseColorTexture": { "index": 0, "texCoord": 1 } },
        "normalTexture": { "index": 0, "texCoord": 0 },
    }));
    let uvs = file.floats("VEC2", &[0.5; 6]);
    file.json["meshes"][0]["primitives"][0]["attributes"]["TEXCOORD_1"] = json!(uvs);
    let (scene, warnings) = file.load();
    assert_eq!(scene.meshes[0].uvs[0].x, 0.5);
    assert!(
        says(&warnings, &["materials[0].normalTexture", "TEXCOORD_0 is wanted", "TEXCOORD_1 is used"]),
        "{warnings:?}"
    );
    // The set named in KHR_texture_transform wins.
    let info = json!({ "index": 0, "texCoord": 0, "extensions": { "KHR_texture_transform": { "texCoord": 1 } } });
    file.json["materials"][0] = json!({ "pbrMetallicRoughness": { "baseColorTexture": info } });
    let (scene, warnings) = file.load();
    assert_eq!(scene.meshes[0].uvs[0].x, 0.5);
    assert!(!says(&warnings, &["is wanted"]));
}

#[test]
fn images_come_from_files_views_and_uris() {
    let mut file = File::with_material(json!({ "normalTexture": { "index": 0 } }));
    let bytes = png(&[255, 0, 0]);
    let view = file.view(&bytes);
    file.json["images"][0] = json!({ "bufferView": view, "mimeType": "image/png" });
    let (scene, _) = file.load();
    assert_eq!(texel(&scene, TextureId(0)), Rgb::new(1.0, 0.0, 0.0));
    let mut source = MemorySource::default();
    source.files.insert("dir/te x.png".into(), png(&[0, 255, 0]).into());
    source.files.insert("up 100%25.png".into(), png(&[0, 0, 255]).into());
    for (uri, expected) in
        [("te%20x.png", [0.0, 1.0, 0.0]), ("./te x.png", [0.0, 1.0, 0.0]), ("../up 100%25.png", [0.0, 0.0, 1.0])]
    {
        file.json["images"][0] = json!({ "uri": uri });
        assert_eq!(texel(&file.load_with(source.clone()).0, TextureId(0)), Rgb::from(expected), "{uri}");
    }
    for (uri, words) in [
        ("http://example.com/a.png", "another place"),
        ("file:///a.png", "another place"),
        ("/a.png", "absolute"),
        ("", "empty"),
        ("%ff.png", "UTF-8"),
        ("a%00.png", "zero byte"),
        ("none.png", "can't read \"none.png\""),
        ("data:image/png", "no comma"),
        ("data:image/png;base64,!!", "data URI"),
        ("data:image/png,abc", "not a PNG"),
    ] {
        file.json["images"][0] = json!({ "uri": uri });
        let errors = file.errors();
        assert!(says(&errors, &["images[0]", words]), "{uri}: {errors:?}");
    }
    file.json["images"][0] = json!({});
    assert!(says(&file.errors(), &["images[0]", "neither uri nor bufferView"]));
    file.json["textures"][0] = json!({ "extensions": { "KHR_texture_basisu": { "source": 0 } } });
    assert!(says(&file.errors(), &["textures[0]", "only KHR_texture_basisu"]));
}

#[test]
fn what_is_not_supported_is_said_once_with_the_materials() {
    let mut file = File::with_material(json!({
        "name": "paint", "alphaMode": "MASK",
        "extensions": { "KHR_materials_clearcoat": {}, "KHR_materials_specular": {} },
    }));
    file.add("materials", json!({ "extensions": { "KHR_materials_clearcoat": {} }, "alphaMode": "BLEND" }));
    let second = json!({ "attributes": { "POSITION": 0 }, "material": 1 });
    file.json["meshes"][0]["primitives"].as_array_mut().unwrap().push(second);
    let (_, warnings) = file.load();
    let places = "materials[0] (\"paint\"), materials[1]: ";
    assert!(says(&warnings, &[places, "KHR_materials_clearcoat is not supported"]), "{warnings:?}");
    assert!(says(&warnings, &[places, "rendered opaque"]), "{warnings:?}");
    assert!(says(&warnings, &["materials[0] (\"paint\"): KHR_materials_specular"]), "{warnings:?}");
}

#[test]
fn numbers_out_of_range_are_pulled_in_with_a_warning() {
    let file = File::with_material(json!({
        "pbrMetallicRoughness": { "baseColorFactor": [2, -1, 0.5, 1], "roughnessFactor": 1e38, "metallicFactor": -3 },
        "extensions": { "KHR_materials_ior": { "ior": 0.5 } },
    }));
    let (scene, warnings) = file.load();
    let Material::Gltf { base_color, metallic, roughness, ior, .. } = scene.materials[0] else { panic!() };
    assert_eq!(base_color, RgbParam::Const(Rgb::new(1.0, 0.0, 0.5)));
    assert_eq!((metallic, roughness, ior), (FloatParam::Const(0.0), FloatParam::Const(1.0), 1.0));
    for place in ["baseColorFactor", "metallicFactor", "roughnessFactor", "KHR_materials_ior.ior"] {
        assert!(says(&warnings, &[place, "out of range"]), "{place}: {warnings:?}");
    }
}
