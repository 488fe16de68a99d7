use super::{faults, import, import_with_warnings, with_files};
use crate::bsdf::Material;
use crate::medium::{MediumId, Phase};
use crate::scene::import::tests::scene;
use crate::spectrum::Rgb;

#[test]
fn media_are_inside_of_shapes() {
    let scene = import(
        "<medium type='homogeneous' id='fog'><rgb name='sigma_t' value='1 2 3'/><float name='albedo' value='0.5'/>
           <float name='scale' value='2'/><phase type='hg'><float name='g' value='-0.25'/></phase></medium>
         <shape type='cube'><bsdf type='null'/><ref name='interior' id='fog'/></shape>
         <shape type='sphere'><bsdf type='dielectric'/><ref name='exterior' id='fog'/>
           <medium name='interior' type='homogeneous'/></shape>",
    );
    let [fog, plain] = scene.media[..] else { panic!("{:?}", scene.media) };
    let phase = Phase::HenyeyGreenstein { g: -0.25 };
    assert_eq!((fog.sigma_t, fog.albedo, fog.phase), (Rgb::new(2.0, 4.0, 6.0), Rgb::splat(0.5), phase));
    assert_eq!((plain.sigma_t, plain.albedo, plain.phase), (Rgb::ONE, Rgb::splat(0.75), Phase::Isotropic));
    assert_eq!([0, 1].map(|i| scene.shapes[i].interior), [Some(MediumId(0)), Some(MediumId(1))]);
    assert_eq!(scene.global_medium, None, "the fog is inside the cube");
    assert_eq!(scene.materials[scene.shapes[0].material.0 as usize], Material::Null);
}

#[test]
fn what_is_inside_of_nothing_fills_the_scene() {
    let fog = |id: &str| format!("<medium type='homogeneous' id='{id}'><float name='sigma_a' value='1'/></medium>");
    let scene = import(&format!("{}<shape type='cube'><ref name='exterior' id='a'/></shape>", fog("a")));
    assert_eq!(scene.global_medium, Some(MediumId(0)));
    assert!(!scene.media[0].scatters());
    let two = format!(
        "{}{}<shape type='cube'><ref name='exterior' id='a'/></shape>
        <emitter type='point'><ref id='b'/></emitter>",
        fog("a"),
        fog("b")
    );
    let (scene, warnings) = import_with_warnings(&two);
    assert!(scene.global_medium.is_some());
    assert!(warnings.len() == 1 && warnings[0].contains("only the first fills the scene"), "{warnings:?}");
    // The sensor's medium.
    let text = "<scene version='3.0.0'><sensor type='perspective'><medium type='homogeneous'/></sensor></scene>";
    with_files(text, |files| assert_eq!(self::scene(files).0.global_medium, Some(MediumId(0))));
}

#[test]
fn old_files_leave_the_border_of_a_medium_out() {
    let text = "<scene version='0.6.0'><sensor type='perspective'/><shape type='sphere'>
        <medium name='interior' type='homogeneous'><spectrum name='sigmaS' value='2'/>
        <spectrum name='sigmaA' value='0.5, 1, 2'/></medium></shape></scene>";
    with_files(text, |files| {
        let (scene, warnings) = scene(files);
        assert!(warnings.is_empty(), "{warnings:?}");
        assert_eq!(scene.media[0].sigma_t, Rgb::new(2.5, 3.0, 4.0));
        assert_eq!(scene.materials[scene.shapes[0].material.0 as usize], Material::Null);
    });
}

#[test]
fn malformed_and_extreme_media_are_refused() {
    for (inner, part) in [
        ("<float name='sigma_t' value='-1'/>", "`sigma_t` is -1"),
        ("<float name='sigma_t' value='nan'/>", "\"nan\""),
        ("<rgb name='albedo' value='1 1 1.5'/>", "`albedo` is 1.5"),
        ("<float name='sigma_t' value='1e20'/><float name='scale' value='1e20'/>", "above 1e12"),
        ("<float name='sigma_t' value='1'/><float name='sigma_s' value='1'/>", "either `sigma_a`"),
        ("<string name='material' value='Skimmilk'/>", "by the name of a material"),
        ("<phase type='rayleigh'/>", "the phase `rayleigh` is not supported"),
        ("<phase type='hg'><float name='g' value='1'/></phase>", "`g` is 1"),
        ("<volume name='albedo' type='constvolume'/>", "a volume for `albedo`"),
    ] {
        let errors = faults(&format!("<medium type='homogeneous'>{inner}</medium>"));
        assert!(errors.len() == 1 && errors[0].contains(part), "{inner}: {errors:#?}");
    }
    let errors = faults("<shape type='cube'><medium type='homogeneous'/></shape>");
    assert!(errors.len() == 1 && errors[0].contains("`interior` or `exterior`"), "{errors:?}");
}
