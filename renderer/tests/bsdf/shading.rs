//! Shading points: sides, normal maps, and the rules that keep them reciprocal.

use crate::chi2::test_density;
use crate::{SIGNIFICANCE, direction};
use renderer::bsdf::{Material, MaterialId, ShadingPoint, Transport, first_bad_nesting};
use renderer::geometry::{Interaction, ObjectId};
use renderer::math::{Frame, Vec2, Vec3};
use renderer::sampling::{IndependentSampler, Sampler, warp};
use renderer::spectrum::Rgb;
use renderer::texture::{Filter, FloatParam, Image, RgbParam, Texture, TextureId, UvTransform, Wrap};
use statcheck::sidak;
use std::f64::consts::FRAC_PI_2;
use std::sync::Arc;

/// A hit whose shading normal differs from the geometric one by `tilt` degrees.
fn hit(tilt: f32) -> Interaction {
    let dpdu = Vec3::new(2.0, 0.5, 0.0);
    Interaction {
        p: Vec3::ZERO,
        p_error: Vec3::ZERO,
        ng: Vec3::Z,
        frame: Frame::from_normal_tangent(direction(tilt, 0.3), dpdu),
        uv: Vec2::splat(0.5),
        dpdu,
        dpdv: Vec3::new(-0.3, 1.0, 0.1),
        object: ObjectId(0),
        primitive: 0,
    }
}

/// A texture of one texel.
fn flat(colour: Rgb) -> Texture {
    Texture::Image {
        image: Arc::new(Image { width: 1, height: 1, texels: vec![colour].into() }),
        wrap: [Wrap::Repeat; 2],
        filter: Filter::Linear,
        uv: UvTransform::IDENTITY,
        scale: Rgb::ONE,
    }
}

const RED: MaterialId = MaterialId(0);
const BLUE: MaterialId = MaterialId(1);
const GLTF: MaterialId = MaterialId(2);
const TWO_SIDED: MaterialId = MaterialId(3);
const BENT_GLTF: MaterialId = MaterialId(4);
const BENT_TWO_SIDED: MaterialId = MaterialId(5);
const BENT_GLASS: MaterialId = MaterialId(6);
const GLASS: MaterialId = MaterialId(7);
const LOOP: MaterialId = MaterialId(8);

fn materials() -> Vec<Material> {
    let lambert = |c| Material::Lambert { reflectance: RgbParam::Const(c) };
    let gltf = |transmission| Material::Gltf {
        base_color: RgbParam::Const(Rgb::new(0.7, 0.6, 0.5)),
        metallic: FloatParam::Const(0.2),
        roughness: FloatParam::Const(0.6),
        ior: 1.5,
        transmission: FloatParam::Const(transmission),
        thin: false,
    };
    let bend = |inner| Material::NormalMap { inner, texture: TextureId(0), scale: 1.0, mirrors_with_uv: false };
    vec![
        lambert(Rgb::new(0.8, 0.0, 0.0)),
        lambert(Rgb::new(0.0, 0.0, 0.8)),
        gltf(0.0),
        Material::TwoSided { front: RED, back: BLUE },
        bend(GLTF),
        bend(TWO_SIDED),
        bend(GLASS),
        gltf(0.9),
        Material::TwoSided { front: LOOP, back: LOOP },
    ]
}

fn textures() -> Vec<Texture> {
    // A normal some 40 degrees off.
    vec![flat(Rgb::new(0.75, 0.35, 0.8))]
}

fn point(material: MaterialId, hit: &Interaction, wo: Vec3) -> ShadingPoint {
    ShadingPoint::new(&materials(), &textures(), material, hit, wo)
}

#[test]
fn two_sided_materials_show_each_side_its_own() {
    for tilt in [0.0, 20.0] {
        let hit = hit(tilt);
        let above = point(TWO_SIDED, &hit, direction(30.0, 1.0));
        let below = point(TWO_SIDED, &hit, direction(150.0, 1.0));
        let up = above.eval(direction(10.0, 2.0), Transport::Radiance);
        let down = below.eval(direction(170.0, 2.0), Transport::Radiance);
        assert!(up.r > 0.25 && up.b == 0.0, "{up:?}");
        assert!(down.b > 0.25 && down.r == 0.0, "{down:?}");
        // Opaque: nothing passes.
        assert!(above.eval(direction(170.0, 2.0), Transport::Radiance).is_black());
        assert!(below.eval(direction(10.0, 2.0), Transport::Radiance).is_black());
        // One-sided: black from behind.
        assert!(point(RED, &hit, direction(150.0, 1.0)).eval(direction(170.0, 2.0), Transport::Radiance).is_black());
    }
}

/// Whatever the normals do, light and importance see one BSDF, and no light leaks through what is opaque.
#[test]
fn shading_is_reciprocal_and_does_not_leak() {
    let mut sampler = IndependentSampler::new([8]);
    for material in [RED, GLTF, TWO_SIDED, BENT_GLTF, BENT_TWO_SIDED, BENT_GLASS, GLASS] {
        for tilt in [0.0, 25.0] {
            let hit = hit(tilt);
            let mut lit = 0;
            for _ in 0..5000 {
                let (a, b) = (warp::uniform_sphere(sampler.next_2d()), warp::uniform_sphere(sampler.next_2d()));
                let there = point(material, &hit, a).eval(b, Transport::Radiance);
                let back = point(material, &hit, b).eval(a, Transport::Importance);
                for c in 0..3 {
                    let difference = (there[c] - back[c]).abs();
                    assert!(
                        difference <= 1e-3 * there[c].max(back[c]) + 1e-7,
                        "{material:?} {a} {b}: {there:?} {back:?}"
                    );
                }
                let opaque = !matches!(material, GLASS | BENT_GLASS);
                let crosses = a.dot(hit.ng) * b.dot(hit.ng) <= 0.0;
                assert!(!(opaque && crosses) || there.is_black(), "{material:?} {a} {b}: a leak");
                lit += usize::from(!there.is_black());
            }
            assert!(lit > 300, "{material:?}, tilt {tilt}: only {lit} pairs lit");
        }
    }
}

/// Directions refused because the two normals disagree are missing from the density too.
#[test]
fn world_space_directions_follow_the_density() {
    let cases = [RED, GLASS, BENT_GLTF, BENT_TWO_SIDED, BENT_GLASS];
    let views = [direction(20.0, 1.0), direction(75.0, 3.5), direction(110.0, 5.0)];
    let level = sidak(SIGNIFICANCE, cases.len() * views.len());
    let hit = hit(25.0);
    for material in cases {
        for (v, &wo) in views.iter().enumerate() {
            let s = point(material, &hit, wo);
            let sample = |uc, u| {
                let d = s.sample(uc, u, Transport::Radiance)?;
                let (f, pdf) = s.eval_pdf(d.wi, Transport::Radiance);
                assert!((pdf / d.pdf - 1.0).abs() < 1e-2 && (f.g - d.f.g).abs() <= 1e-2 * f.g, "{d:?}: {f:?} {pdf}");
                assert!((d.cos_theta - s.abs_cos(d.wi)).abs() < 1e-5);
                let reverse = ShadingPoint::new(&materials(), &textures(), material, &hit, d.wi);
                assert!(
                    (reverse.pdf(wo, Transport::Radiance) / s.pdf_reverse(d.wi, Transport::Radiance) - 1.0).abs()
                        < 1e-2
                );
                Some(d.wi)
            };
            let jumps = [FRAC_PI_2];
            let seed = [9, u64::from(material.0), v as u64];
            if let Some(chi2) = test_density(seed, sample, |wi| s.pdf(wi, Transport::Radiance), &jumps) {
                assert!(chi2.p > level, "{material:?}, wo {wo}: {chi2:?}");
            }
        }
    }
}

/// The bent normal is the map's, in the frame of the surface; the map's y axis can follow mirrored texture coordinates.
#[test]
fn normal_maps_bend_the_frame() {
    let hit = hit(0.0);
    let surface = hit.frame;
    let texel = Vec3::new(0.5, -0.3, 0.6).normalize();
    let bent = point(BENT_GLTF, &hit, Vec3::Z).frame.n;
    assert!(bent.distance(surface.to_world(texel)) < 1e-5, "{bent}");

    let mut mirroring = materials();
    mirroring[BENT_GLTF.0 as usize] =
        Material::NormalMap { inner: GLTF, texture: TextureId(0), scale: 1.0, mirrors_with_uv: true };
    // v runs along the frame's y axis: for glTF, whose v runs down the image, that is mirrored.
    let n = ShadingPoint::new(&mirroring, &textures(), BENT_GLTF, &hit, Vec3::Z).frame.n;
    assert!(n.distance(surface.to_world(texel * Vec3::new(1.0, -1.0, 1.0))) < 1e-5, "{n}");
    let upright = Interaction { dpdv: -hit.dpdv, ..hit };
    let n = ShadingPoint::new(&mirroring, &textures(), BENT_GLTF, &upright, Vec3::Z).frame.n;
    assert!(n.distance(surface.to_world(texel)) < 1e-5, "{n}");
}

/// Texels that mean no direction of the upper side leave the surface as it is.
#[test]
fn senseless_normal_maps_are_ignored() {
    let hit = hit(10.0);
    for texel in [[0.5, 0.5, 0.5], [0.5, 0.5, 0.0], [1.0, 0.5, 0.5], [f32::NAN, 0.5, 1.0], [0.5, 0.5, f32::INFINITY]] {
        let textures = [flat(Rgb::from(texel))];
        let s = ShadingPoint::new(&materials(), &textures, BENT_GLTF, &hit, direction(30.0, 1.0));
        assert!(s.frame.n.distance(hit.frame.n) < 1e-6, "{texel:?}: {:?}", s.frame);
        assert!(s.eval(direction(40.0, 4.0), Transport::Radiance).is_valid());
    }
}

/// `|wo.ns| |wi.ng| / (|wo.ng| |wi.ns|)` written out.
#[test]
fn adjoint_correction_is_veachs() {
    let hit = hit(25.0);
    let (wo, wi) = (direction(40.0, 1.0), direction(65.0, 4.0));
    let expected = (wo.dot(hit.frame.n) * wi.dot(hit.ng) / (wo.dot(hit.ng) * wi.dot(hit.frame.n))).abs();
    assert!((point(RED, &hit, wo).adjoint_correction(wi) / expected - 1.0).abs() < 1e-5);
    assert!((point(RED, &self::hit(0.0), wo).adjoint_correction(wi) - 1.0).abs() < 1e-5);
    assert_eq!(point(RED, &hit, Vec3::X).adjoint_correction(wi), 0.0);
}

/// Materials that contain themselves are found, and even unchecked do no harm.
#[test]
fn endless_nesting_is_black() {
    assert_eq!(first_bad_nesting(&materials()), Some(LOOP));
    assert_eq!(first_bad_nesting(&materials()[..8]), None);
    assert_eq!(first_bad_nesting(&[Material::TwoSided { front: RED, back: MaterialId(7) }]), Some(RED));
    let s = point(LOOP, &hit(0.0), Vec3::Z);
    assert!(s.eval(Vec3::Z, Transport::Radiance).is_black());
}
