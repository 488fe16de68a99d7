//! The same scene at another scale, place or orientation.

use crate::probe::{Probe, Shot};
use crate::scene::{foggy_room, moved, room};
use renderer::film::MergedImage;
use renderer::integrator::IntegratorKind::{self, Bdpt, Light, Mmlt, Path};
use renderer::math::{DQuat, DVec3};
use renderer::scene::desc::SceneDesc;

const KINDS: [IntegratorKind; 4] = [Path, Light, Bdpt, Mmlt];

/// How well the image mean must be known: chains start from few samples.
fn share(kind: IntegratorKind) -> f64 {
    if kind == Mmlt { 0.2 } else { 0.06 }
}

fn shot(probe: &Probe, kind: IntegratorKind, seed: u64) -> Shot {
    let count = probe.pick(1, 16) * if kind == Light { 256 } else { 64 };
    Shot { size: (24, 24), ..Shot::new(kind, count, 6, seed) }
}

fn picture(probe: &mut Probe, what: &str, desc: SceneDesc, kind: IntegratorKind, seed: u64) -> Option<MergedImage> {
    let scene = probe.build(what, desc)?;
    let shot = shot(probe, kind, seed);
    probe.shoot(what, &scene, &shot)
}

/// Compares `change` of both rooms with the rooms as they are, by all integrators with other random numbers.
fn compare(probe: &mut Probe, what: &str, references: &References, change: impl Fn(SceneDesc) -> SceneDesc) {
    for kind in KINDS {
        for (name, desc, reference) in [("room", room(), &references.room), ("fog", foggy_room(3.0), &references.fog)] {
            let what = format!("{name} {what}");
            let (Some(image), Some(reference)) = (picture(probe, &what, change(desc), kind, 7), reference) else {
                continue;
            };
            probe.agree(&format!("{what}, {}", kind.name()), &image, reference, share(kind));
        }
    }
}

/// The rooms as they are.
struct References {
    room: Option<MergedImage>,
    fog: Option<MergedImage>,
}

impl References {
    fn new(probe: &mut Probe) -> Self {
        Self { room: picture(probe, "room", room(), Path, 1), fog: picture(probe, "fog", foggy_room(3.0), Path, 1) }
    }
}

pub fn scale(probe: &mut Probe) {
    for kind in KINDS {
        for (name, desc) in [("room", room()), ("fog", foggy_room(3.0))] {
            let reference = picture(probe, name, desc.clone(), kind, 2);
            for power in [-20, 20] {
                let what = format!("{name} times 2^{power}");
                let desc = moved(desc.clone(), f64::powi(2.0, power), DQuat::IDENTITY, DVec3::ZERO);
                if let (Some(a), Some(b)) = (picture(probe, &what, desc, kind, 2), &reference) {
                    probe.same_bits(&format!("{what}, {}", kind.name()), &a, b);
                }
            }
        }
    }
    let references = References::new(probe);
    for size in probe.pick(&[1e-6, 1e6][..], &[1e-6, 1e-3, 0.1, 1e3, 1e6]) {
        compare(probe, &format!("times {size:e}"), &references, |d| moved(d, *size, DQuat::IDENTITY, DVec3::ZERO));
    }
}

pub fn offset(probe: &mut Probe) {
    let references = References::new(probe);
    let places = [DVec3::new(2e4, -2e4, 2e4), DVec3::X * 2e4, DVec3::new(0.0, 0.3, -2e4)];
    for place in &places[..probe.pick(1, 3)] {
        compare(probe, &format!("at {place}"), &references, |d| moved(d, 1.0, DQuat::IDENTITY, *place));
    }
    // Both at once.
    for size in probe.pick(&[1e-6][..], &[1e-6, 1e6]) {
        let place = places[0] * *size;
        compare(probe, &format!("times {size:e} at {place}"), &references, |d| moved(d, *size, DQuat::IDENTITY, place));
    }
}

pub fn rotation(probe: &mut Probe) {
    let references = References::new(probe);
    let quarter = std::f64::consts::FRAC_PI_2;
    let turns = [
        DQuat::from_axis_angle(DVec3::new(0.36, 0.48, 0.8), 1.1),
        DQuat::from_rotation_y(quarter) * DQuat::from_rotation_x(quarter),
        DQuat::from_rotation_z(std::f64::consts::PI),
        DQuat::from_axis_angle(DVec3::X, 1e-7),
    ];
    for turn in &turns[..probe.pick(2, 4)] {
        compare(probe, &format!("turned {turn}"), &references, |d| moved(d, 1.0, *turn, DVec3::ZERO));
    }
}
