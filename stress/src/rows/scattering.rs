//! Surfaces: roughness towards none, cosines towards zero, and single precision against double.

use crate::oracle::{self, Facets};
use crate::probe::{Probe, Shot};
use crate::scene::{at, camera, colour, diffuse, facing, glass, lamp, metal, rough, shape};
use renderer::bsdf::{Bsdf, Conductor, Dielectric, Distribution, Material, Microfacet, Transport, fresnel, roster};
use renderer::film::MergedImage;
use renderer::integrator::IntegratorKind::{Bdpt, Mmlt, Path};
use renderer::math::{DVec3, ONE_MINUS_EPSILON, Vec2, Vec3, sin_cos};
use renderer::medium::Phase;
use renderer::sampling::{IndependentSampler, Sampler, warp};
use renderer::scene::desc::{SceneDesc, ShapeKind};
use renderer::spectrum::Rgb;
use renderer::texture::FloatParam;

/// A ball of the material under a large lamp, on a grey floor.
fn stage(material: Material) -> SceneDesc {
    SceneDesc {
        shapes: vec![
            shape(ShapeKind::Rectangle, facing(-DVec3::Y, DVec3::Y, DVec3::splat(4.0)), 0),
            shape(ShapeKind::Sphere, at(DVec3::ZERO, 1.0), 1),
            lamp(ShapeKind::Rectangle, facing(DVec3::Y * 4.0, -DVec3::Y, DVec3::splat(3.0)), 2, 1.0),
        ],
        materials: vec![diffuse(0.5), material, diffuse(0.0)],
        camera: camera(DVec3::new(0.0, 1.5, 5.0), DVec3::ZERO, 28.0),
        ..SceneDesc::default()
    }
}

/// Rough surfaces become smooth ones.
pub fn roughness(probe: &mut Probe) {
    let plastic = |alpha: f32| Material::Gltf {
        base_color: colour(0.8, 0.5, 0.2),
        metallic: FloatParam::Const(0.5),
        roughness: FloatParam::Const(alpha.sqrt()),
        ior: 1.5,
        transmission: FloatParam::Const(0.0),
        thin: true,
    };
    let kinds: [(&str, &dyn Fn(f32) -> Material); 4] = [
        ("GGX metal", &|a| metal(if a > 0.0 { rough(Distribution::Ggx, a) } else { None })),
        ("Beckmann metal", &|a| metal(if a > 0.0 { rough(Distribution::Beckmann, a) } else { None })),
        ("GGX glass", &|a| glass(if a > 0.0 { rough(Distribution::Ggx, a) } else { None })),
        ("glTF", &plastic),
    ];
    let count = probe.pick(128, 1024);
    for (name, material) in kinds {
        let picture = |probe: &mut Probe, alpha: f32, kind, seed| {
            let what = format!("{name}, alpha {alpha:e}");
            let scene = probe.build(&what, stage(material(alpha)))?;
            probe.shoot(&what, &scene, &Shot { size: (24, 24), ..Shot::new(kind, count, 6, seed) })
        };
        let Some(smooth) = picture(probe, 0.0, Path, 1) else { continue };
        let mut distances = Vec::new();
        for alpha in [1.0f32, 0.3, 0.1, 0.03, 0.01, 3e-3, 1e-3, 1e-4, 1e-6] {
            let Some(image) = picture(probe, alpha, Path, 1) else { continue };
            let what = format!("{name}, alpha {alpha:e}");
            if alpha < 1e-3 {
                // f32 directions can't resolve such lobes: they are smooth.
                probe.same_bits(&format!("{what} against smooth"), &image, &smooth);
            } else if alpha <= 3e-3 {
                probe.agree(&format!("{what} against smooth"), &image, &smooth, 0.05);
            }
            distances.push(difference(&image, &smooth));
            for kind in [Bdpt, Mmlt].into_iter().take(if alpha <= 1e-3 || alpha == 0.03 { 2 } else { 0 }) {
                if let Some(other) = picture(probe, alpha, kind, 2) {
                    let share = if kind == Mmlt { 0.15 } else { 0.05 };
                    probe.agree(&format!("{what}, {} against path", kind.name()), &other, &image, share);
                }
            }
        }
        // They come nearer and nearer, down to the noise of so few samples; there the tests above tell.
        let near = distances.windows(2).all(|w| w[1] <= w[0] || w[1] < 0.02);
        probe.holds(near, || format!("{name}: not ever nearer to smooth: {distances:?}"));
    }
}

/// Mean difference of two pictures' blocks of 8 x 8 pixels, relative to their mean.
fn difference(a: &MergedImage, b: &MergedImage) -> f64 {
    let block = |m: &MergedImage, x: usize, y: usize| {
        (0..64).map(|i| f64::from(m.mean[(8 * y + i / 8) * m.width as usize + 8 * x + i % 8][1])).sum::<f64>() / 64.0
    };
    let (w, h) = (a.width as usize / 8, a.height as usize / 8);
    let cells = (0..w * h).map(|i| (block(a, i % w, i / w), block(b, i % w, i / w)));
    let (d, s) = cells.fold((0.0, 0.0), |(d, s), (x, y)| (d + (x - y).abs(), s + y));
    d / s
}

/// Cosines of both signs down to zero, around.
fn grazing() -> Vec<Vec3> {
    let mut all = vec![Vec3::Z, -Vec3::Z];
    for cos in [1.0f32, 0.5, 0.1, 1e-2, 1e-3, 1e-4, 1e-5, 1e-6, 1e-7, 1e-20, f32::MIN_POSITIVE, 0.0] {
        for phi in [0.0f32, 0.7, 2.0, std::f32::consts::PI, 4.0] {
            let (sin, c) = sin_cos(phi);
            let r = (1.0 - cos * cos).max(0.0).sqrt();
            all.extend([cos, -cos].map(|z| Vec3::new(r * c, r * sin, z).normalize()));
        }
    }
    all
}

/// Every BSDF at all cosines: finite, and weights bounded.
pub fn cosines(probe: &mut Probe) {
    let directions = grazing();
    let mut heaviest = 0.0f32;
    for example in roster() {
        let mut s = IndependentSampler::new([21]);
        for &wo in &directions {
            for mode in [Transport::Radiance, Transport::Importance] {
                for &wi in &directions {
                    let (f, pdf) = example.bsdf.eval_pdf(wo, wi, mode);
                    let weight = f.max_component() * wi.z.abs();
                    probe.holds(f.is_valid() && pdf.is_finite() && pdf >= 0.0 && weight.is_finite(), || {
                        format!("{}: wo {wo}, wi {wi}: f {f:?}, pdf {pdf}", example.name)
                    });
                }
                let edges = [0.0, 1e-7, 0.5, ONE_MINUS_EPSILON]
                    .map(|x| Vec2::new(x, 1.0 - x).min(Vec2::splat(ONE_MINUS_EPSILON)));
                let drawn: Vec<Vec2> = (0..probe.pick(20, 1000)).map(|_| s.next_2d()).collect();
                for u in edges.into_iter().chain(drawn) {
                    let Some(d) = example.bsdf.sample(wo, s.next_1d(), u, mode) else { continue };
                    let weight = d.f.max_component() * d.wi.z.abs() / d.pdf;
                    let ok = d.f.is_valid() && d.pdf > 0.0 && d.pdf.is_finite() && (d.wi.length() - 1.0).abs() < 1e-5;
                    probe.holds(ok && weight <= 12.0, || format!("{}: wo {wo}: {d:?}, weight {weight}", example.name));
                    heaviest = heaviest.max(weight);
                }
            }
        }
    }
    probe.figure(format!("largest weight f cos / pdf {heaviest:.2}"));
}

/// The largest relative error of values against their truths, and where.
#[derive(Default)]
struct Worst {
    error: f64,
    place: String,
}

impl Worst {
    fn see(&mut self, value: f32, truth: f64, place: impl FnOnce() -> String) {
        // Below what f32 resolves only the absolute error counts.
        let error = (f64::from(value) - truth).abs() / truth.abs().max(1e-30);
        if !(error <= self.error) {
            *self = Self { error, place: place() };
        }
    }

    fn judge(self, probe: &mut Probe, what: &str, allowed: f64) {
        probe.holds(self.error <= allowed, || format!("{what}: off by {:.1e} at {}", self.error, self.place));
        probe.figure(format!("{what} {:.0e}", self.error));
    }
}

/// Single precision against double.
pub fn precision(probe: &mut Probe) {
    phases(probe);
    boundaries(probe);
    facets(probe);
}

fn phases(probe: &mut Probe) {
    let mut worst = Worst::default();
    let mut s = IndependentSampler::new([22]);
    for g in [1e-7f32, -1e-4, 0.3, -0.9, 0.99, 0.999, -0.9999, 0.99999, 0.999_999, -0.999_999] {
        let phase = Phase::HenyeyGreenstein { g };
        for _ in 0..probe.pick(2000, 100_000) {
            let wo = warp::uniform_sphere(s.next_2d());
            let (drawn, pdf) = phase.sample(wo, s.next_2d());
            worst.see(pdf, oracle::henyey_greenstein(f64::from(g), wo, drawn), || format!("g {g}, drawn {drawn}"));
            let other = warp::uniform_sphere(s.next_2d());
            let pdf = phase.pdf(wo, other);
            worst.see(pdf, oracle::henyey_greenstein(f64::from(g), wo, other), || format!("g {g}, {wo}, {other}"));
        }
    }
    worst.judge(probe, "Henyey-Greenstein", 3e-6);
}

fn boundaries(probe: &mut Probe) {
    let mut reflectance = Worst::default();
    for eta in [1.0 / 2.4f32, 1.0 / 1.5, 0.99, 1.001, 1.33, 1.5, 2.4] {
        for k in 0..=probe.pick(400, 20_000) {
            let e = f64::from(k) / f64::from(probe.pick(400, 20_000));
            let cos = 10f64.powf(-7.0 * e) as f32;
            let b = fresnel::dielectric(cos, eta);
            let (r, cos_t) = oracle::dielectric(f64::from(cos), f64::from(eta));
            // Near total reflection the cosine beyond is the root of a difference; away from it all digits count.
            if cos_t.is_some_and(|c| c > 0.05) && r > 1e-3 {
                reflectance.see(b.reflectance, r, || format!("cos {cos:e}, index {eta}"));
            }
            let valid = (0.0..=1.0).contains(&b.reflectance) && (0.0..=1.0).contains(&b.cos_t);
            probe.holds(valid, || format!("cos {cos}, index {eta}: {b:?}"));
        }
    }
    reflectance.judge(probe, "Fresnel reflectance", 1e-4);
}

fn facets(probe: &mut Probe) {
    let directions: Vec<Vec3> = grazing().into_iter().filter(|w| w.z.abs() >= 0.9e-7).collect();
    let (mut mirror, mut pane) = (Worst::default(), Worst::default());
    for alpha in [[1.0f32, 1.0], [0.3, 0.3], [0.1, 0.4], [0.01, 0.01], [2e-3, 2e-3]] {
        let model = Microfacet::new(Distribution::Ggx, alpha[0], alpha[1]);
        let own = Facets { ggx: true, alpha: alpha.map(f64::from) };
        let metal = Bsdf::Conductor(Conductor { eta: Rgb::ZERO, k: Rgb::ONE, reflectance: Rgb::ONE, facets: model });
        let glass =
            Bsdf::Dielectric(Dielectric { eta: 1.5, reflectance: Rgb::ONE, transmittance: Rgb::ONE, facets: model });
        let mut s = IndependentSampler::new([23]);
        for &wo in &directions {
            let mut others = directions.clone();
            others.extend(
                (0..20).filter_map(|_| Some(metal.sample(wo, s.next_1d(), s.next_2d(), Transport::Radiance)?.wi)),
            );
            others.extend(
                (0..20).filter_map(|_| Some(glass.sample(wo, s.next_1d(), s.next_2d(), Transport::Radiance)?.wi)),
            );
            for wi in others {
                let place = || format!("alpha {alpha:?}, wo {wo}, wi {wi}");
                if wo.z > 0.0 && wi.z > 0.0 {
                    let (f, pdf) = metal.eval_pdf(wo, wi, Transport::Radiance);
                    let (f_true, pdf_true) = own.mirror(wo, wi);
                    mirror.see(f.r, f_true, place);
                    mirror.see(pdf, pdf_true, place);
                } else if wo.z * wi.z < 0.0 {
                    let (f, pdf) = glass.eval_pdf(wo, wi, Transport::Radiance);
                    let (f_true, pdf_true) = own.glass(wo, wi, 1.5);
                    pane.see(f.r, f_true, place);
                    pane.see(pdf, pdf_true, place);
                }
            }
        }
    }
    mirror.judge(probe, "GGX reflection", 1e-3);
    pane.judge(probe, "GGX refraction", 1e-3);
}
