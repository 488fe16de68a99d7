//! What was loaded must hold together: everything later may index it blindly.

use crate::guard::Outcome;
use renderer::bsdf::Material;
use renderer::diagnostics::SceneError;
use renderer::job::{LocalOptions, RenderOptions, RenderSettings, Stop, render_local};
use renderer::math::Transform;
use renderer::scene::Scene;
use renderer::scene::bundle::FileSource;
use renderer::scene::desc::{SceneDesc, ShapeKind};
use renderer::scene::import::image::{ImageKind, decode_image};
use renderer::scene::import::load;
use renderer::texture::{FloatParam, RgbParam, Texture, TextureId};

/// Loads a scene, checks it, builds it and renders a few paths.
pub fn load_scene(files: &dyn FileSource, root: &str, name: &str) -> Outcome {
    let (description, mut diagnostics) = match load(files, root) {
        Ok(loaded) => loaded,
        Err(e) => return Outcome::Refused(e.to_string()),
    };
    check(&description, name);
    let Some(scene) = Scene::build(description, root, &mut diagnostics) else {
        return Outcome::Refused(SceneError(diagnostics.list).to_string());
    };
    let options = RenderOptions { spp: Some(1), size: Some((12, 8)), max_depth: Some(6), ..RenderOptions::default() };
    let settings = RenderSettings::resolve(&options, &scene.defaults).unwrap();
    let threads = LocalOptions { threads: 1 };
    let image = render_local(&scene, &settings, &threads, &Stop::new(), &mut |_| {}).unwrap().image;
    assert!(image.mean.iter().flatten().all(|v| v.is_finite() && *v >= 0.0), "{name}: what is not finite is dropped");
    Outcome::Loaded
}

/// Decodes a picture as colour and as data, which take different ways to the texels.
pub fn decode(bytes: &[u8], name: &str) -> Outcome {
    let raw = decode_image(bytes, name, ImageKind::Raw);
    let colour = decode_image(bytes, name, ImageKind::Srgb);
    match (raw, colour) {
        (Ok(raw), Ok(colour)) => {
            for image in [raw.image, colour.image] {
                assert_eq!(image.texels.len(), image.width as usize * image.height as usize, "{name}");
                assert!(image.texels.iter().all(|t| t.to_array().iter().all(|v| v.is_finite())), "{name}");
            }
            Outcome::Loaded
        }
        (Err(e), Err(_)) => Outcome::Refused(e),
        _ => panic!("{name}: loads as one kind and not as the other"),
    }
}

fn check(scene: &SceneDesc, name: &str) {
    for mesh in &scene.meshes {
        mesh.validate().unwrap_or_else(|e| panic!("{name}: {e}"));
        assert!(mesh.normals.iter().all(|n| n.is_finite()) && mesh.uvs.iter().all(|uv| uv.is_finite()), "{name}");
    }
    for texture in &scene.textures {
        if let Texture::Image { image, .. } = texture {
            assert_eq!(image.texels.len(), image.width as usize * image.height as usize, "{name}");
        }
    }
    scene.materials.iter().for_each(|m| check_material(scene, m, name));
    check_shapes(scene, name);
    let camera = &scene.camera;
    assert!(camera.to_world.is_finite() && camera.fov > 0.0 && camera.fov < 180.0, "{name}: {camera:?}");
}

fn check_shapes(scene: &SceneDesc, name: &str) {
    assert!(!scene.shapes.is_empty(), "{name}: nothing to show");
    for shape in &scene.shapes {
        assert!((shape.material.0 as usize) < scene.materials.len(), "{name}");
        shape.emission.iter().for_each(|e| check_colour(scene, &e.radiance, name));
        let ShapeKind::Mesh(id) = shape.kind else { panic!("{name}: the loader makes meshes only") };
        let mesh = &scene.meshes[id.0 as usize];
        assert!(!mesh.triangles.is_empty(), "{name}");
        assert!(Transform::new(shape.to_world).is_some(), "{name}: {}", shape.name);
        let far = mesh.positions.iter().map(|p| shape.to_world.transform_point3(p.as_dvec3()).abs().max_element());
        assert!(far.fold(0.0, f64::max) <= 1.001e18, "{name}: {}", shape.name);
    }
}

fn check_material(scene: &SceneDesc, material: &Material, name: &str) {
    match material {
        Material::Gltf { base_color, metallic, roughness, ior, transmission, .. } => {
            check_colour(scene, base_color, name);
            [metallic, roughness, transmission].into_iter().for_each(|p| check_number(scene, p, name));
            assert!(*ior >= 1.0 && ior.is_finite(), "{name}");
        }
        Material::NormalMap { inner, texture, scale, .. } => {
            check_texture(scene, *texture, name);
            assert!((inner.0 as usize) < scene.materials.len() && scale.is_finite(), "{name}");
        }
        Material::Lambert { reflectance } => check_colour(scene, reflectance, name),
        other => panic!("{name}: the loader makes no {other:?}"),
    }
}

fn check_texture(scene: &SceneDesc, id: TextureId, name: &str) {
    assert!((id.0 as usize) < scene.textures.len(), "{name}");
}

fn check_colour(scene: &SceneDesc, parameter: &RgbParam, name: &str) {
    let (RgbParam::Const(factor) | RgbParam::Texture(_, factor)) = parameter;
    assert!(factor.is_valid(), "{name}: {factor:?}");
    if let RgbParam::Texture(id, _) = parameter {
        check_texture(scene, *id, name);
    }
}

fn check_number(scene: &SceneDesc, parameter: &FloatParam, name: &str) {
    let (FloatParam::Const(factor) | FloatParam::Texture(_, _, factor)) = parameter;
    assert!((0.0..=1.0).contains(factor), "{name}: {factor}");
    if let FloatParam::Texture(id, channel, _) = parameter {
        check_texture(scene, *id, name);
        assert!(*channel < 3, "{name}");
    }
}
