use super::*;
use crate::math::{DAffine3, DVec3, cos64, sin64, tan64};
use crate::scene::desc::{FovAxis, LightDesc, SpotFalloff};
use crate::spectrum::Rgb;

#[test]
fn the_first_perspective_camera_is_taken() {
    let mut file = File::triangle();
    file.add(
        "cameras",
        json!({ "type": "orthographic", "orthographic": { "xmag": 1, "ymag": 1, "znear": 0, "zfar": 9 } }),
    );
    let perspective =
        |yfov: f64| json!({ "type": "perspective", "perspective": { "yfov": yfov, "znear": 0.1, "aspectRatio": 1.5 } });
    file.add("cameras", perspective(0.5));
    file.add("cameras", perspective(0.7));
    file.root(json!({ "camera": 0 }));
    file.root(json!({ "camera": 1, "translation": [1, 2, 3] }));
    file.root(json!({ "camera": 2 }));
    let (scene, warnings) = file.load();
    assert!((scene.camera.fov - 0.5f64.to_degrees()).abs() < 1e-5);
    assert_eq!((scene.camera.fov_axis, scene.camera.aperture_radius), (FovAxis::Y, 0.0));
    assert_eq!(scene.camera.to_world, DAffine3::from_translation(DVec3::new(1.0, 2.0, 3.0)));
    assert_eq!(scene.defaults.size, Some((1080, 720)));
    assert!(says(&warnings, &["cameras[0]", "only perspective"]) && says(&warnings, &["cameras[2]", "the first"]));
    assert!(!says(&warnings, &["stands in"]));
    for yfov in [0.0, -1.0, 3.2] {
        file.json["cameras"][1]["perspective"]["yfov"] = json!(yfov);
        assert!(says(&file.errors(), &["cameras[1].perspective.yfov", "out of range"]));
    }
    file.json["nodes"][2]["scale"] = json!([0, 0, 0]);
    file.json["cameras"][1]["perspective"]["yfov"] = json!(1);
    assert!(says(&file.errors(), &["nodes[2].camera", "scaled to nothing"]));
}

#[test]
fn the_stand_in_camera_sees_everything() {
    for scale in [[1.0, 1.0, 1.0], [1e-3, 2e-3, 1e-4], [1.0, 100.0, 3e5]] {
        let mut file = File::triangle();
        file.json["nodes"][0]["scale"] = json!(scale);
        file.root(json!({ "mesh": 0, "scale": scale, "translation": [5, 5, 5], "rotation": [1, 2, 3, 4] }));
        let (scene, warnings) = file.load();
        assert!(says(&warnings, &["no perspective camera"]) && says(&warnings, &["no light"]), "{warnings:?}");
        let slope = tan64(scene.camera.fov.to_radians() * 0.5);
        let to_camera = scene.camera.to_world.inverse();
        assert_eq!(scene.camera.fov_axis, FovAxis::X);
        let mut widest = 0.0f64;
        for shape in &scene.shapes {
            for p in &scene.meshes[0].positions {
                let p = to_camera.transform_point3(shape.to_world.transform_point3(p.as_dvec3()));
                assert!(p.z < 0.0, "behind the camera: {p}");
                widest = widest.max(p.x.abs().max(p.y.abs() * 16.0 / 9.0) / (-p.z * slope));
            }
        }
        assert!(widest <= 1.0 && widest > 0.2, "{scale:?}: {widest}");
    }
}

#[test]
fn the_stand_in_light_has_a_bright_side() {
    let (scene, _) = File::triangle().load();
    let [LightDesc::Environment { image, .. }] = &scene.lights[..] else { panic!() };
    let at = |x: u32, y: u32| image.texel(x, y).r;
    // Zenith and nadir away from the key light.
    assert!((at(64, 0) - 0.8).abs() < 0.05 && (at(64, 63) - 0.2).abs() < 0.01);
    let (brightest, _) = image.texels.iter().enumerate().max_by(|(_, a), (_, b)| a.r.total_cmp(&b.r)).unwrap();
    let (x, y) = (brightest as u32 % image.width, brightest as u32 / image.width);
    // (-0.5, 0.8, 0.6): u = 0.5 + atan2(-0.5, -0.6) / 2 pi, elevation 46 degrees.
    let (u, v) = ((x as f32 + 0.5) / image.width as f32, (y as f32 + 0.5) / image.height as f32);
    assert!((u - 0.110_6).abs() < 0.01 && (v - 0.243).abs() < 0.02, "{u} {v}");
    // Irradiance on a surface that faces it, over pi: what white paper sends back.
    let key = DVec3::new(-0.5, 0.8, 0.6).normalize();
    let mut sum = 0.0;
    for (i, t) in image.texels.iter().enumerate() {
        let (x, y) = ((i % 128) as f64, (i / 128) as f64);
        let (phi, theta) = (((x + 0.5) / 128.0 - 0.5) * std::f64::consts::TAU, (y + 0.5) / 64.0 * std::f64::consts::PI);
        let d = DVec3::new(sin64(theta) * sin64(phi), cos64(theta), -sin64(theta) * cos64(phi));
        let solid_angle = std::f64::consts::TAU / 128.0 * std::f64::consts::PI / 64.0 * sin64(theta);
        sum += f64::from(t.r) * d.dot(key).max(0.0) * solid_angle;
    }
    assert!((sum / std::f64::consts::PI - 1.1).abs() < 0.05, "{}", sum / std::f64::consts::PI);
}

#[test]
fn punctual_lights() {
    let mut file = File::triangle();
    file.json["extensions"] = json!({ "KHR_lights_punctual": { "lights": [
        { "type": "point", "color": [1.0, 0.5, 0.25], "intensity": 8.0, "range": 3.0 },
        { "type": "directional" },
        { "type": "spot", "intensity": 2.0, "spot": { "innerConeAngle": 0.25, "outerConeAngle": 0.5 } },
        { "type": "spot", "spot": {} },
    ] } });
    let light = |i: usize| json!({ "KHR_lights_punctual": { "light": i } });
    let half = std::f32::consts::FRAC_1_SQRT_2;
    for i in 0..4 {
        // A quarter turn about x: -z becomes -y ... +y for the negative angle.
        let node = json!({ "translation": [0, i, 0], "rotation": [-half, 0, 0, half], "scale": [2, 2, 2], "extensions": light(i) });
        file.root(node);
    }
    let (scene, warnings) = file.load();
    assert!(says(&warnings, &["lights[0]", "range"]) && !says(&warnings, &["no light"]), "{warnings:?}");
    assert_eq!(scene.lights.len(), 4);
    let LightDesc::Point { position: DVec3::ZERO, intensity } = scene.lights[0] else { panic!() };
    assert_eq!(intensity, Rgb::new(8.0, 4.0, 2.0));
    let LightDesc::Directional { direction, irradiance } = scene.lights[1] else { panic!() };
    assert!((direction - DVec3::NEG_Y).length() < 1e-7, "{direction}");
    assert_eq!(irradiance, Rgb::ONE);
    let LightDesc::Spot { position, direction, intensity, beam, cutoff, falloff } = scene.lights[2] else { panic!() };
    assert_eq!(
        (position, intensity, falloff),
        (DVec3::new(0.0, 2.0, 0.0), Rgb::splat(2.0), SpotFalloff::SquaredCosine)
    );
    assert!((direction - DVec3::NEG_Y).length() < 1e-7);
    assert!((beam - 0.25f64.to_degrees()).abs() < 1e-9 && (cutoff - 0.5f64.to_degrees()).abs() < 1e-9);
    let LightDesc::Spot { beam, cutoff, .. } = scene.lights[3] else { panic!() };
    assert!(beam == 0.0 && (cutoff - 45.0).abs() < 1e-5);
}

#[test]
fn faulty_lights_are_refused() {
    for (light, words) in [
        (json!({ "type": "spot" }), "needs its cone"),
        (json!({ "type": "area" }), "expected point, spot or directional"),
        (json!({ "type": "point", "intensity": -1 }), "from 0"),
        (json!({ "type": "spot", "spot": { "innerConeAngle": 0.5, "outerConeAngle": 0.4 } }), "out of range"),
        (json!({ "type": "spot", "spot": { "outerConeAngle": 1.6 } }), "out of range"),
    ] {
        let mut file = File::triangle();
        file.json["extensions"] = json!({ "KHR_lights_punctual": { "lights": [light] } });
        file.root(json!({ "extensions": { "KHR_lights_punctual": { "light": 0 } } }));
        let errors = file.errors();
        assert!(says(&errors, &["extensions.KHR_lights_punctual.lights[0]", words]), "{errors:?}");
        file.json["nodes"][1]["extensions"]["KHR_lights_punctual"]["light"] = json!(1);
        assert!(says(&file.errors(), &["nodes[1].extensions.KHR_lights_punctual", "only 1"]));
    }
    // pi / 2 as f32 is above pi / 2.
    let mut file = File::triangle();
    let spot = json!({ "type": "spot", "spot": { "outerConeAngle": std::f32::consts::FRAC_PI_2 } });
    file.json["extensions"] = json!({ "KHR_lights_punctual": { "lights": [spot] } });
    file.root(json!({ "extensions": { "KHR_lights_punctual": { "light": 0 } } }));
    let LightDesc::Spot { cutoff, .. } = file.load().0.lights[0] else { panic!() };
    assert_eq!(cutoff, 90.0);
}
