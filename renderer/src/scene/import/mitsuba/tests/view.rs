use super::{document, import};
use crate::math::{DAffine3, DVec3};
use crate::scene::desc::{FilterDesc, FovAxis, LightDesc, RenderDefaults, SceneDesc, SpotFalloff};
use crate::scene::import::tests::scene;
use crate::spectrum::Rgb;

fn read(text: &str) -> (SceneDesc, Vec<String>) {
    scene(&[("scene.xml", text.as_bytes())])
}

/// The scene of a file that has nothing but a sensor.
fn sensor(xml: &str) -> SceneDesc {
    let (scene, warnings) = read(&format!("<scene version='3.0.0'>{xml}</scene>"));
    assert!(warnings.is_empty(), "{warnings:#?}");
    scene
}

#[test]
fn the_camera_looks_where_mitsubas_does() {
    let look =
        "<transform name='to_world'><scale value='3'/><lookat origin='1 2 3' target='1 2 -9' up='0 1 0'/></transform>";
    let camera = sensor(&format!("<sensor type='perspective'><float name='fov' value='40'/>{look}</sensor>")).camera;
    // Mitsuba: along +Z of its space, here along -Z. Seen from 3 towards -9, right is +X.
    assert!(camera.to_world.abs_diff_eq(DAffine3::from_translation(DVec3::new(1.0, 2.0, 3.0)), 1e-12));
    assert_eq!((camera.fov, camera.fov_axis, camera.aperture_radius), (40.0, FovAxis::X, 0.0));
}

#[test]
fn angles_of_view() {
    let fov = |xml: &str| {
        let camera = sensor(&format!("<sensor type='perspective'>{xml}</sensor>")).camera;
        (camera.fov, camera.fov_axis)
    };
    let axis = |name: &str| fov(&format!("<float name='fov' value='30'/><string name='fov_axis' value='{name}'/>")).1;
    let axes = ["x", "y", "smaller", "larger", "diagonal"].map(axis);
    assert_eq!(axes, [FovAxis::X, FovAxis::Y, FovAxis::Smaller, FovAxis::Larger, FovAxis::Diagonal]);
    // The diagonal of 35 mm film, 43.27 mm, seen from 50 mm and from 24 mm (values of lens tables).
    for (xml, degrees) in [("", 46.79), ("<string name='focal_length' value='24mm'/>", 84.06)] {
        let (fov, axis) = fov(xml);
        assert!((fov - degrees).abs() < 0.01, "{fov}");
        assert_eq!(axis, FovAxis::Diagonal);
    }
}

#[test]
fn thin_lenses() {
    let lens = "<float name='aperture_radius' value='0.1'/>";
    let camera =
        sensor(&format!("<sensor type='thinlens'>{lens}<float name='focus_distance' value='4'/></sensor>")).camera;
    assert_eq!((camera.aperture_radius, camera.focus_distance), (0.1, 4.0));
    assert_eq!(sensor(&format!("<sensor type='thinlens'>{lens}</sensor>")).camera.focus_distance, 1e4);
}

#[test]
fn film_filter_sampler_and_integrator() {
    let film = |filter: &str| {
        sensor(&format!(
            "<integrator type='path'><integer name='max_depth' value='7'/><integer name='rr_depth' value='3'/></integrator>
             <sensor type='perspective'><film type='hdrfilm'><integer name='width' value='320'/><integer name='height' value='180'/>
             {filter}</film><sampler type='independent'><integer name='sample_count' value='16'/><integer name='seed' value='5'/>
             </sampler></sensor>"
        ))
        .defaults
    };
    let expected = RenderDefaults {
        integrator: Some("path".into()),
        spp: Some(16),
        size: Some((320, 180)),
        max_depth: Some(7),
        rr_depth: Some(3),
        seed: Some(5),
        filter: Some(FilterDesc::Gaussian { stddev: 0.5 }),
    };
    assert_eq!(film(""), expected);
    for (xml, filter) in [
        ("<rfilter type='box'/>", FilterDesc::Box { radius: 0.5 }),
        ("<rfilter type='tent'/>", FilterDesc::Tent { radius: 1.0 }),
        ("<rfilter type='gaussian'><float name='stddev' value='0.7'/></rfilter>", FilterDesc::Gaussian { stddev: 0.7 }),
    ] {
        assert_eq!(film(xml).filter, Some(filter));
    }
    let defaults = sensor(super::SENSOR).defaults;
    assert_eq!((defaults.size, defaults.filter), (Some((768, 576)), Some(FilterDesc::Gaussian { stddev: 0.5 })));
}

#[test]
fn integrators_are_replaced_by_the_nearest() {
    let of = |xml: &str| {
        let (scene, warnings) = read(&document(xml));
        (scene.defaults.integrator.unwrap(), scene.defaults.max_depth.unwrap(), warnings.len())
    };
    assert_eq!(of("<integrator type='path'/>"), ("path".into(), -1, 0));
    assert_eq!(of("<integrator type='direct'/>"), ("path".into(), 2, 0));
    assert_eq!(of("<integrator type='ptracer'/>"), ("light".into(), -1, 0));
    let sppm = "<integrator type='sppm'><integer name='max_depth' value='9'/><integer name='photonCount' value='5'/></integrator>";
    assert_eq!(of(sppm), ("path".into(), 9, 1));
    assert_eq!(of("<integrator type='moment'><integrator type='volpath'/></integrator>"), ("path".into(), -1, 1));
}

#[test]
fn lights_of_the_scene() {
    let lights = import(
        "<emitter type='point'><point name='position' value='1 2 3'/><rgb name='intensity' value='4'/></emitter>
         <emitter type='spot'><transform name='to_world'><lookat origin='0 5 0' target='0 0 0' up='0 0 1'/></transform>
           <float name='cutoff_angle' value='40'/></emitter>
         <emitter type='directional'><vector name='direction' value='0 -1 0'/></emitter>
         <emitter type='constant'><rgb name='radiance' value='0.5'/></emitter>
         <emitter type='envmap'><string name='filename' value='grey.png'/><float name='scale' value='2'/></emitter>",
    )
    .lights;
    let LightDesc::Point { position, intensity } = lights[0] else { panic!() };
    assert_eq!((position, intensity), (DVec3::new(1.0, 2.0, 3.0), Rgb::splat(4.0)));
    let LightDesc::Spot { position, direction, intensity, beam, cutoff, falloff } = lights[1] else { panic!() };
    assert_eq!((position, intensity, falloff), (DVec3::new(0.0, 5.0, 0.0), Rgb::ONE, SpotFalloff::LinearAngle));
    assert!(direction.abs_diff_eq(-DVec3::Y, 1e-12) && beam == 30.0 && cutoff == 40.0);
    let LightDesc::Directional { direction, .. } = lights[2] else { panic!() };
    assert_eq!(direction, -DVec3::Y);
    assert!(matches!(lights[3], LightDesc::Constant { radiance } if radiance == Rgb::splat(0.5)));
    let LightDesc::Environment { scale, to_world, .. } = &lights[4] else { panic!() };
    assert_eq!(*scale, Rgb::splat(2.0));
    // Mitsuba's u = atan2(x, -z) / 2 pi puts -Z at u = 0, which here is the direction +Z of the light's space.
    assert!(to_world.transform_vector3(DVec3::Z).abs_diff_eq(-DVec3::Z, 1e-12));
    assert!(to_world.transform_vector3(DVec3::X).abs_diff_eq(-DVec3::X, 1e-12));
}

#[test]
fn parameters_includes_and_aliases() {
    let text = "<scene version='3.0.0'><default name='w' value='32'/><default name='wide' value='64'/><default name='w' value='7'/>
        <default name='twice' value='$w$w'/><include filename='sub/part.xml'/>
        <sensor type='perspective'><film type='hdrfilm'><integer name='width' value='$wide'/><integer name='height' value='$twice'/>
        </film></sensor><alias id='m' as='n'/><shape type='cube'><ref id='n'/></shape></scene>";
    let part = "<scene version='3.0.0'><bsdf type='diffuse' id='m'><rgb name='reflectance' value='0.$w'/></bsdf>
        <shape type='obj' id='\\$w'><string name='filename' value='t.obj'/></shape></scene>";
    let files: [(&str, &[u8]); 3] =
        [("a/scene.xml", text.as_bytes()), ("a/sub/part.xml", part.as_bytes()), ("a/sub/t.obj", super::TRIANGLE)];
    let (scene, warnings) = scene(&files);
    assert!(warnings.is_empty(), "{warnings:#?}");
    assert_eq!(scene.defaults.size, Some((64, 3232)), "the longest name wins, the first default stays");
    assert_eq!(scene.shapes.iter().map(|s| s.name.as_str()).collect::<Vec<_>>(), ["$w", "cube 1"]);
}

#[test]
fn version_06_spelling() {
    let old = "<?xml version='1.0' encoding='utf-8'?><scene version='0.5.0'>
        <integrator type='path'><integer name='maxDepth' value='9'/><boolean name='strictNormals' value='false'/></integrator>
        <sensor type='thinlens'><float name='fov' value='30'/><string name='fovAxis' value='smaller'/>
          <float name='apertureRadius' value='0.5'/><float name='focusDistance' value='2'/>
          <transform name='toWorld'><lookAt origin='0,0,5' target='0,0,0' up='0,1,0'/></transform>
          <sampler type='ldsampler'><integer name='sampleCount' value='8'/></sampler>
          <film type='ldrfilm'><integer name='width' value='20'/><integer name='height' value='10'/>
            <string name='pixelFormat' value='rgb'/><float name='gamma' value='2.2'/><boolean name='banner' value='false'/></film>
        </sensor>
        <bsdf type='dielectric' id='d'><float name='intIOR' value='1.8'/><float name='extIOR' value='1'/></bsdf>
        <bsdf type='diffuse' id='e'><srgb name='diffuseReflectance' value='#808080'/></bsdf>
        <bsdf type='diffuse' id='f'><texture name='reflectance' type='checkerboard'><float name='uscale' value='4'/>
          <float name='voffset' value='0.5'/></texture></bsdf>
        <bsdf type='conductor' id='c'/>
        <shape type='sphere'><transform name='toWorld'><translate x='1'/></transform><boolean name='flipNormals' value='true'/>
          <ref id='d'/></shape></scene>";
    let new = "<scene version='3.0.0'>
        <integrator type='path'><integer name='max_depth' value='9'/><boolean name='strict_normals' value='false'/></integrator>
        <sensor type='thinlens'><float name='fov' value='30'/><string name='fov_axis' value='smaller'/>
          <float name='aperture_radius' value='0.5'/><float name='focus_distance' value='2'/>
          <transform name='to_world'><lookat origin='0,0,5' target='0,0,0' up='0,1,0'/></transform>
          <sampler type='independent'><integer name='sample_count' value='8'/></sampler>
          <film type='hdrfilm'><integer name='width' value='20'/><integer name='height' value='10'/></film>
        </sensor>
        <bsdf type='dielectric' id='d'><float name='int_ior' value='1.8'/><float name='ext_ior' value='1'/></bsdf>
        <bsdf type='diffuse' id='e'><rgb name='reflectance' value='0.21586050011389926'/></bsdf>
        <bsdf type='diffuse' id='f'><texture name='reflectance' type='checkerboard'><transform name='to_uv'>
          <scale x='4'/><translate y='0.5'/></transform></texture></bsdf>
        <bsdf type='conductor' id='c'><string name='material' value='Cu'/></bsdf>
        <shape type='sphere'><transform name='to_world'><translate x='1'/></transform><boolean name='flip_normals' value='true'/>
          <ref id='d'/></shape></scene>";
    let ((old, warnings), (new, _)) = (read(old), read(new));
    assert!(warnings.is_empty(), "{warnings:#?}");
    assert_eq!(format!("{old:?}"), format!("{new:?}"));
}
