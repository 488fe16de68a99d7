//! What encloses a point, and what a straight flight passes.

use crate::scenes::{BLACK, GLASS, NULL, ball, body, desc, grey, scene};
use renderer::geometry::ObjectId;
use renderer::light::LightDesc;
use renderer::math::{Anchor, DVec3, Ray, Vec3, exp, exp_m1};
use renderer::medium::{Channels, passing_probability};
use renderer::sampling::{IndependentSampler, Sampler, warp};
use renderer::scene::desc::{ShapeDesc, ShapeKind};
use renderer::scene::{Enclosures, Event, Scene, Target};
use renderer::spectrum::Rgb;

fn objects(e: &Enclosures) -> Vec<u32> {
    e.iter().map(|o| o.0).collect()
}

fn at(scene: &Scene, x: f32, y: f32, z: f32) -> Vec<u32> {
    objects(&scene.enclosures_at(Vec3::new(x, y, z)))
}

fn transmission(scene: &Scene, from: Vec3, to: Vec3) -> Option<Rgb> {
    let around = scene.enclosures_at(from);
    let mut rays = 0;
    let target = Target::Point(Anchor::free(to));
    scene.transmission(&Anchor::free(from), &target, around, &mut rays).map(|t| t.transmittance)
}

fn assert_near(a: Option<Rgb>, depth: f32) {
    let (a, b) = (a.unwrap().r, exp(-depth));
    assert!((a / b - 1.0).abs() < 1e-5, "{a} {b}");
}

#[test]
fn points_know_what_they_are_inside_of() {
    // A glass ball in a fog cube, beside an opaque ball and a glass pane, which has no inside.
    let shapes = vec![
        body(ShapeKind::Cube, DVec3::ZERO, DVec3::splat(2.0), NULL, Some(0)),
        ball(DVec3::new(0.5, 0.0, 0.0), 0.5, GLASS, None),
        ball(DVec3::new(-1.0, 0.0, 0.0), 0.5, BLACK, None),
        body(ShapeKind::Rectangle, DVec3::Y, DVec3::ONE, GLASS, None),
    ];
    let s = scene(shapes, vec![grey(1.0, 0.5, 0.0)], vec![]);
    assert_eq!(at(&s, 0.0, 3.0, 0.0), [0u32; 0]);
    assert_eq!(at(&s, 0.0, 1.5, 0.3), [0]);
    assert_eq!(at(&s, 0.5, 0.1, 0.0), [0, 1]);
    assert_eq!(at(&s, 0.3, 0.2, -1.0), [0]);
    assert_eq!(objects(&s.camera_enclosures), [0u32; 0]);
    assert!(s.medium_in(&s.enclosures_at(Vec3::new(0.5, 0.1, 0.0))).is_none(), "empty space inside the glass");
    assert!(s.medium_in(&s.enclosures_at(Vec3::new(0.5, 0.6, 0.0))).is_some());
    assert_eq!((s.features.media, s.features.null_surfaces, s.features.chromatic_media), (1, 1, false));
}

#[test]
fn lights_know_what_they_are_inside_of() {
    let mut lamp = body(ShapeKind::Rectangle, DVec3::Y, DVec3::splat(0.1), BLACK, None);
    lamp.emission = crate::common::emission(1.0);
    // One that reaches from inside the fog to outside of it.
    let mut long = body(ShapeKind::Rectangle, DVec3::Z * 0.5, DVec3::new(5.0, 0.1, 1.0), BLACK, None);
    long.emission = crate::common::emission(1.0);
    let fog = body(ShapeKind::Cube, DVec3::ZERO, DVec3::splat(2.0), NULL, Some(0));
    let point = |p| LightDesc::Point { position: p, intensity: Rgb::ONE };
    let sun = LightDesc::Directional { direction: DVec3::NEG_Y, irradiance: Rgb::ONE };
    let lights = vec![point(DVec3::X), point(DVec3::X * 3.0), sun];
    let s = scene(vec![lamp, long, fog], vec![grey(1.0, 0.5, 0.0)], lights);
    let leaving = |i, p: Vec3| {
        let start = Anchor { p, p_error: Vec3::ZERO, ng: if i < 2 { Vec3::Z } else { Vec3::ZERO } };
        objects(&s.enclosures_of_light(i, &start, Vec3::Z))
    };
    assert_eq!(leaving(0, Vec3::Y), [2]);
    assert_eq!(leaving(1, Vec3::new(0.3, 0.0, 0.5)), [2]);
    assert_eq!(leaving(1, Vec3::new(4.0, 0.0, 0.5)), [0u32; 0]);
    assert_eq!(leaving(2, Vec3::X), [2]);
    assert_eq!(leaving(3, Vec3::X * 3.0), [0u32; 0]);
    assert_eq!(leaving(4, Vec3::Y * 9.0), [0u32; 0]);
}

#[test]
fn sets_of_objects_have_room_for_six() {
    let mut e = Enclosures::default();
    for i in [5, 3, 9, 1, 7, 2, 8] {
        e = e.set(ObjectId(i), true).set(ObjectId(i), true);
    }
    assert_eq!(objects(&e), [1, 2, 3, 5, 7, 9]);
    e = e.set(ObjectId(4), false).set(ObjectId(3), false);
    assert_eq!(objects(&e), [1, 2, 5, 7, 9]);
    assert!(!e.contains(ObjectId(3)) && e.contains(ObjectId(9)));
    assert_eq!(e.set(ObjectId(9), false).set(ObjectId(9), true), e);
}

#[test]
fn beams_are_attenuated_by_each_medium_on_their_way() {
    // Overlapping balls on a line, radius 1 around 0 and 1.5: of priority 0 and `priority`.
    let overlapping = |priority| {
        let second = ShapeDesc { priority, ..ball(DVec3::X * 1.5, 1.0, NULL, Some(1)) };
        let shapes = vec![ball(DVec3::ZERO, 1.0, NULL, Some(0)), second];
        scene(shapes, vec![grey(0.3, 0.5, 0.0), grey(0.7, 0.0, 0.0)], vec![])
    };
    let (left, right) = (Vec3::X * -3.0, Vec3::X * 4.0);
    for (priority, depth) in [(1, 1.5 * 0.3 + 2.0 * 0.7), (-1, 2.0 * 0.3 + 1.5 * 0.7)] {
        let s = overlapping(priority);
        assert_near(transmission(&s, left, right), depth);
        assert_near(transmission(&s, right, left), depth);
        // From within the overlap.
        let own = if priority > 0 { 0.7 } else { 0.3 };
        assert_near(transmission(&s, Vec3::X * 0.75, right), own * 0.25 + 0.7 * 1.5);
    }
    // Without priorities, the smaller one is there, in both directions.
    let shapes = vec![ball(DVec3::X * 0.25, 0.5, NULL, None), ball(DVec3::ZERO, 1.0, NULL, Some(0))];
    let s = scene(shapes, vec![grey(0.3, 0.5, 0.0)], vec![]);
    assert_near(transmission(&s, left, right), 0.3);
    assert_near(transmission(&s, right, left), 0.3);
}

#[test]
fn surfaces_inside_an_object_of_higher_priority_are_not_there() {
    // A glass ball half inside a denser medium that has no surface itself.
    let shapes = vec![
        ball(DVec3::ZERO, 1.0, GLASS, None),
        ShapeDesc { priority: 3, ..body(ShapeKind::Cube, DVec3::X * 5.0, DVec3::splat(5.0), NULL, Some(0)) },
    ];
    let s = scene(shapes, vec![grey(0.1, 0.5, 0.0)], vec![]);
    assert_near(transmission(&s, Vec3::X * 0.5, Vec3::X * 3.0), 0.25);
    assert_near(transmission(&s, Vec3::X * 3.0, Vec3::X * 0.5), 0.25);
    // The other half is glass, which lets no shadow ray through.
    assert_eq!(transmission(&s, Vec3::X * -0.5, Vec3::X * -3.0), None);
    // Leaving the cube inside of the ball a ray is in the glass.
    let around = s.enclosures_at(Vec3::X * 0.5);
    let mut rays = 0;
    let flight = s.fly(&Channels::ALIKE, &Ray::new(Vec3::X * 0.5, Vec3::NEG_X), around, 0.9999, &mut rays);
    let Event::Surface(hit) = flight.event else { panic!("{flight:?}") };
    assert!(hit.object == ObjectId(0) && (hit.p + Vec3::X).length() < 1e-5, "{hit:?}");
    assert_eq!(objects(&flight.around), [0]);
    assert_eq!(objects(&s.beside(Some(hit.object), &hit.anchor(), hit.ng, &flight.around)), [0u32; 0]);
    assert!((passing_probability(flight.tau) - exp(-0.05)).abs() < 1e-6);
    assert_eq!((flight.weight, rays), (Rgb::ONE, 2));
}

#[test]
fn glass_of_matching_index_is_passed_and_media_fill_what_is_left() {
    let mut d =
        desc(vec![ball(DVec3::ZERO, 1.0, GLASS, Some(0))], vec![grey(0.2, 0.9, 0.0), grey(0.0, 0.0, 0.0)], vec![]);
    let renderer::bsdf::Material::Dielectric { eta, .. } = &mut d.materials[GLASS as usize] else { panic!() };
    *eta = 1.0;
    let around = renderer::medium::MediumId(1);
    let absorbing =
        renderer::medium::Medium::new(Rgb::new(0.1, 0.0, 0.2), Rgb::ZERO, renderer::medium::Phase::Isotropic);
    d.media[1] = absorbing.unwrap();
    d.global_medium = Some(around);
    let s = crate::common::build(d);
    let t = transmission(&s, Vec3::X * -3.0, Vec3::X * 3.0).unwrap();
    for (c, sigma) in [0.1f32, 0.0, 0.2].into_iter().enumerate() {
        assert!((t[c] / exp(-0.4 - 4.0 * sigma) - 1.0).abs() < 1e-5, "{c}: {t:?}");
    }
    // To infinity, an absorbing medium lets only clear channels through, sampled or not.
    let mut rays = 0;
    let out = s.fly(&Channels::ALIKE, &Ray::new(Vec3::X * 3.0, Vec3::X), Enclosures::default(), 0.1, &mut rays);
    assert!(matches!(out.event, Event::Escaped));
    assert_eq!(out.weight, Rgb::new(0.0, 1.0, 0.0));
    assert_eq!(out.tau, Rgb::ZERO);
    let sky =
        s.transmission(&Anchor::free(Vec3::X * 3.0), &Target::Direction(Vec3::X), Enclosures::default(), &mut rays);
    assert_eq!(sky.unwrap().transmittance, Rgb::new(0.0, 1.0, 0.0));
}

#[test]
fn what_rounding_moves_out_of_an_object_does_not_stay_inside_of_it() {
    let s = scene(vec![ball(DVec3::ZERO, 1.0, NULL, Some(0))], vec![grey(100.0, 1.0, 0.0)], vec![]);
    let inside = Enclosures::default().set(ObjectId(0), true);
    let mut rays = 0;
    // Said to be inside, but beyond the surface on a ray that meets nothing.
    let flight = s.fly(&Channels::ALIKE, &Ray::new(Vec3::X * 1.9, Vec3::X), inside, 0.5, &mut rays);
    assert!(matches!(flight.event, Event::Escaped) && flight.around.is_empty());
    let sky = s.transmission(&Anchor::free(Vec3::X * 1.5), &Target::Direction(Vec3::X), inside, &mut rays).unwrap();
    assert_eq!(sky.transmittance, Rgb::ONE);
}

#[test]
fn scatterings_next_to_a_surface_stay_on_their_side_of_it() {
    let s = scene(vec![ball(DVec3::ZERO, 1.0, NULL, Some(0))], vec![grey(5.0, 1.0, 0.0)], vec![]);
    let inside = Enclosures::default().set(ObjectId(0), true);
    let mut sampler = IndependentSampler::new([3]);
    let (mut rays, mut near) = (0, 0);
    for _ in 0..4000 {
        let d = warp::uniform_sphere(sampler.next_2d());
        // Numbers whose flights end within some 1e-6 of the surface.
        for k in -4i32..=4 {
            let u = -exp_m1(-5.0) + k as f32 * (0.5 * f32::EPSILON);
            let flight = s.fly(&Channels::ALIKE, &Ray::new(Vec3::ZERO, d), inside, u, &mut rays);
            let Event::Scatter { p, .. } = flight.event else { continue };
            assert!(p.as_dvec3().length() < 1.0, "{p}");
            near += 1;
        }
    }
    assert!(near > 10_000, "{near}");
}
