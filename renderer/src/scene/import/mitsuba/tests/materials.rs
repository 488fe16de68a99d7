use super::{import, import_with_warnings};
use crate::bsdf::{Distribution, Material, MaterialId, Roughness};
use crate::spectrum::Rgb;
use crate::texture::{Filter, FloatParam, RgbParam, Texture, TextureId, UvTransform, Wrap};

fn material(xml: &str) -> Material {
    *import(xml).materials.last().unwrap()
}

fn white() -> RgbParam {
    RgbParam::Const(Rgb::ONE)
}

#[test]
fn diffuse_takes_rgb_spectrum_and_float() {
    let lambert = |r, g, b| Material::Lambert { reflectance: RgbParam::Const(Rgb::new(r, g, b)) };
    assert_eq!(material("<bsdf type='diffuse'/>"), lambert(0.5, 0.5, 0.5));
    for (xml, expected) in [
        ("<rgb name='reflectance' value='0.1, 0.2 0.3'/>", lambert(0.1, 0.2, 0.3)),
        ("<rgb name='reflectance' value='0.25'/>", lambert(0.25, 0.25, 0.25)),
        ("<rgb name='reflectance' value='#ff0000'/>", lambert(1.0, 0.0, 0.0)),
        ("<spectrum name='reflectance' value='0.25'/>", lambert(0.25, 0.25, 0.25)),
        ("<float name='reflectance' value='.25'/>", lambert(0.25, 0.25, 0.25)),
    ] {
        assert_eq!(material(&format!("<bsdf type='diffuse'>{xml}</bsdf>")), expected, "{xml}");
    }
}

#[test]
fn two_sided_takes_one_or_two_and_each_shows_its_front() {
    let scene = import("<bsdf type='twosided'><bsdf type='diffuse'/></bsdf>");
    assert_eq!(scene.materials[1], Material::TwoSided { front: MaterialId(0), back: MaterialId(0) });
    let scene = import("<bsdf type='twosided'><bsdf type='diffuse'/><bsdf type='conductor'/></bsdf>");
    assert_eq!(scene.materials[2], Material::TwoSided { front: MaterialId(0), back: MaterialId(1) });
    // The back of an inner two-sided material is never seen.
    let inner = "<bsdf type='twosided'><bsdf type='diffuse'/><bsdf type='conductor'/></bsdf>";
    let scene = import(&format!("<bsdf type='twosided'><bsdf type='diffuse'/>{inner}</bsdf>"));
    assert_eq!(*scene.materials.last().unwrap(), Material::TwoSided { front: MaterialId(0), back: MaterialId(1) });
}

#[test]
fn conductors_take_indices_and_names() {
    let mirror = Material::Conductor { eta: Rgb::ZERO, k: Rgb::ONE, reflectance: white(), roughness: None };
    assert_eq!(material("<bsdf type='conductor'/>"), mirror);
    assert_eq!(material("<bsdf type='conductor'><string name='material' value='none'/></bsdf>"), mirror);
    let xml = "<bsdf type='conductor'><string name='material' value='Al'/></bsdf>";
    let Material::Conductor { eta, k, .. } = material(xml) else { panic!() };
    assert_eq!((eta, k), (Rgb::new(1.6575, 0.880405, 0.521244), Rgb::new(9.22381, 6.2695, 4.837)));
    let xml = "<bsdf type='roughconductor'><rgb name='eta' value='1 2 3'/><rgb name='k' value='4'/>
        <float name='alpha' value='0.2'/><rgb name='specular_reflectance' value='0.9'/></bsdf>";
    let alpha = FloatParam::Const(0.2);
    let roughness = Roughness { distribution: Distribution::Beckmann, alpha_u: alpha, alpha_v: alpha };
    let expected = Material::Conductor {
        eta: Rgb::new(1.0, 2.0, 3.0),
        k: Rgb::splat(4.0),
        reflectance: RgbParam::Const(Rgb::splat(0.9)),
        roughness: Some(roughness),
    };
    assert_eq!(material(xml), expected);
    let xml = "<bsdf type='roughconductor'><string name='distribution' value='GGX'/>
        <float name='alpha_u' value='0.3'/><float name='alpha_v' value='0'/></bsdf>";
    let Material::Conductor { roughness: Some(r), .. } = material(xml) else { panic!() };
    let expected = (Distribution::Ggx, FloatParam::Const(0.3), FloatParam::Const(1e-4));
    assert_eq!((r.distribution, r.alpha_u, r.alpha_v), expected, "alpha is at least Mitsuba's 1e-4");
}

#[test]
fn dielectrics_take_indices_and_names() {
    for (xml, index) in [
        ("", 1.5046 / 1.000_277),
        ("<float name='int_ior' value='1.5'/><float name='ext_ior' value='1'/>", 1.5),
        ("<string name='int_ior' value='water'/><string name='ext_ior' value='vacuum'/>", 1.333),
        ("<float name='int_ior' value='1'/><string name='ext_ior' value='Diamond'/>", 1.0 / 2.419),
    ] {
        let expected =
            Material::Dielectric { eta: index as f32, reflectance: white(), transmittance: white(), roughness: None };
        assert_eq!(material(&format!("<bsdf type='dielectric'>{xml}</bsdf>")), expected);
    }
    let Material::Dielectric { roughness: Some(r), .. } = material("<bsdf type='roughdielectric'/>") else { panic!() };
    assert_eq!(r.alpha_u, FloatParam::Const(0.1));
}

#[test]
fn bitmaps_and_references() {
    let scene = import(
        "<bsdf type='diffuse'><ref name='reflectance' id='t'/></bsdf>
         <texture type='bitmap' id='t'><string name='filename' value='grey.png'/><string name='filter_type' value='nearest'/>
           <string name='wrap_mode' value='mirror'/><transform name='to_uv'><scale x='2' y='-1'/><translate x='3' y='4'/></transform>
         </texture>",
    );
    assert_eq!(scene.materials[0], Material::Lambert { reflectance: RgbParam::Texture(TextureId(0), Rgb::ONE) });
    assert_eq!(scene.textures.len(), 1, "built once");
    let Texture::Image { image, wrap, filter, uv, scale } = &scene.textures[0] else { panic!() };
    assert_eq!((image.width, image.height, *filter, *wrap), (1, 1, Filter::Nearest, [Wrap::Mirror; 2]));
    assert_eq!((*uv, *scale), (UvTransform([2.0, 0.0, 3.0, 0.0, -1.0, 4.0]), Rgb::ONE));
    assert!((image.texel(0, 0).g - 0.502_886).abs() < 1e-5, "sRGB 188 is 0.503");
}

#[test]
fn raw_bitmaps_and_luminance() {
    let xml =
        "<bsdf type='roughconductor'><texture name='alpha' type='bitmap'><string name='filename' value='grey.png'/>
        <boolean name='raw' value='true'/></texture></bsdf>";
    let scene = import(xml);
    let Material::Conductor { roughness: Some(r), .. } = scene.materials[0] else { panic!() };
    assert_eq!(
        (r.alpha_u, r.alpha_v),
        (FloatParam::Texture(TextureId(0), 0, 1.0), FloatParam::Texture(TextureId(0), 0, 1.0))
    );
    let Texture::Image { image, .. } = &scene.textures[0] else { panic!() };
    assert!((image.texel(0, 0).r - 188.0 / 255.0).abs() < 1e-5);
    let xml = "<bsdf type='roughconductor'><texture name='alpha' type='checkerboard'>
        <rgb name='color0' value='1 0 0'/><rgb name='color1' value='0 0 1'/></texture></bsdf>";
    let Texture::Checkerboard { a, b, uv } = &import(xml).textures[0] else { panic!() };
    let luminance = |r, g, b| Rgb::splat(Rgb::new(r, g, b).luminance());
    assert_eq!((*a, *b, *uv), (luminance(1.0, 0.0, 0.0), luminance(0.0, 0.0, 1.0), UvTransform::IDENTITY));
}

#[test]
fn normal_maps_wrap_one_material() {
    let scene = import(
        "<bsdf type='normalmap'><bsdf type='diffuse'/><texture name='normalmap' type='bitmap'>
           <string name='filename' value='grey.png'/><boolean name='raw' value='true'/></texture></bsdf>",
    );
    let expected =
        Material::NormalMap { inner: MaterialId(0), texture: TextureId(0), scale: 1.0, mirrors_with_uv: false };
    assert_eq!(scene.materials[1], expected);
}

#[test]
fn unknown_parameters_are_named() {
    let (_, warnings) = import_with_warnings("<bsdf type='diffuse'>\n  <rgb name='reflectence' value='1'/></bsdf>");
    assert_eq!(warnings.len(), 1, "{warnings:#?}");
    for part in ["scene.xml, line 3, column 3", "`reflectence`", "did you mean `reflectance`?"] {
        assert!(warnings[0].contains(part), "{part:?} is not in {:?}", warnings[0]);
    }
}
