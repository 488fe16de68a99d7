//! Cameras and punctual lights, and what stands in for them where a file has none.

use super::Importer;
use super::buffers::lookup;
use super::report::{Checked, Fault};
use crate::math::{DAffine3, DMat3, DVec3, cos64, pow64, sin64, tan64};
use crate::scene::desc::{CameraDesc, FovAxis, LightDesc, SpotFalloff};
use crate::spectrum::Rgb;
use crate::texture::Image;
use gltf::json::extensions::scene::khr_lights_punctual::{Light, Type};
use gltf::json::validation::Checked as Valid;
use std::f64::consts::{FRAC_PI_2, PI, TAU};
use std::sync::Arc;

/// Height in pixels of a picture whose camera says its aspect ratio.
const HEIGHT: f32 = 720.0;
/// Full angle of the stand-in camera over the picture's width, degrees.
const STAND_IN_FOV: f64 = 56.0;
/// Height over width of the widest picture in which it still sees everything.
const STAND_IN_ASPECT: f64 = 9.0 / 16.0;
/// Intensities beyond this could not be summed over a scene in f32.
const MOST_INTENSITY: f32 = 1e20;

impl Importer<'_> {
    /// Takes the first perspective camera that is met.
    pub(super) fn camera(&mut self, index: usize, to_world: DAffine3, place: &str) -> Checked<()> {
        let json = lookup(&self.root.cameras, index, place, "cameras")?;
        let own = format!("cameras[{index}]");
        let Some(perspective) = &json.perspective else {
            let message = "only perspective cameras are supported; this one is ignored";
            self.report.warn(Fault::new(own, message));
            return Ok(());
        };
        if self.has_camera {
            self.report.sum("a picture has one camera, the first; the others are ignored", "", own);
            return Ok(());
        }
        let yfov = f64::from(perspective.yfov);
        if !(yfov > 0.0 && yfov < PI) {
            return Err(Fault::new(
                format!("{own}.perspective.yfov"),
                format!("{yfov} is out of range; expected radians in (0, pi)"),
            ));
        }
        if !(to_world.matrix3.determinant().abs() > 0.0) {
            return Err(Fault::new(place, "the camera's transform is scaled to nothing"));
        }
        let fov = yfov.to_degrees();
        self.scene.camera =
            CameraDesc { to_world, fov, fov_axis: FovAxis::Y, aperture_radius: 0.0, focus_distance: 1.0 };
        self.has_camera = true;
        if let Some(aspect) = perspective.aspect_ratio {
            if aspect > 0.05 && aspect < 20.0 {
                self.scene.defaults.size = Some(((HEIGHT * aspect).round() as u32, HEIGHT as u32));
            } else {
                let message = format!("{aspect} is not a sensible ratio of width to height; it is ignored");
                self.report.warn(Fault::new(format!("{own}.perspective.aspectRatio"), message));
            }
        }
        Ok(())
    }

    /// KHR_lights_punctual. Candela and lux are taken as W/sr and W/m^2: the extension's photometric units with an efficacy of 1.
    pub(super) fn light(&mut self, index: usize, to_world: DAffine3, place: &str) -> Checked<()> {
        let lights = self.root.extensions.as_ref().and_then(|e| e.khr_lights_punctual.as_ref());
        let name = "extensions.KHR_lights_punctual.lights";
        let light = lookup(lights.map_or(&[][..], |l| &l.lights), index, place, name)?;
        let own = format!("{name}[{index}]");
        let intensity = Rgb::from(light.color) * light.intensity;
        if !(intensity.is_valid() && intensity.max_component() <= MOST_INTENSITY) {
            let message = format!("colour times intensity must be from 0 to {MOST_INTENSITY:e}");
            return Err(Fault::new(own, message));
        }
        if light.range.is_some() {
            self.report.sum("the range of a light is ignored: light never ends", "", &own);
        }
        let direction = to_world.transform_vector3(DVec3::NEG_Z).normalize_or_zero();
        let position = to_world.translation;
        let Valid::Valid(kind) = light.type_ else {
            return Err(Fault::new(format!("{own}.type"), "expected point, spot or directional"));
        };
        if kind != Type::Point && direction == DVec3::ZERO {
            return Err(Fault::new(place, "the light's transform is scaled to nothing, so it has no direction"));
        }
        self.scene.lights.push(match kind {
            Type::Point => LightDesc::Point { position, intensity },
            Type::Directional => LightDesc::Directional { direction, irradiance: intensity },
            Type::Spot => {
                let (beam, cutoff) = cone(light, &own)?;
                LightDesc::Spot { position, direction, intensity, beam, cutoff, falloff: SpotFalloff::SquaredCosine }
            }
        });
        Ok(())
    }

    /// Adds a camera that sees everything and light from everywhere, where the file has none.
    pub(super) fn stand_ins(&mut self) {
        if !self.has_camera {
            self.scene.camera = framing(self.bounds.0, self.bounds.1);
            let message = "there is no perspective camera; one that sees everything from the front and above is used";
            self.report.warn(Fault::new("cameras", message));
        }
        if self.scene.lights.is_empty() && self.scene.shapes.iter().all(|s| s.emission.is_none()) {
            let image = Arc::new(studio());
            self.scene.lights.push(LightDesc::Environment { image, scale: Rgb::ONE, to_world: DAffine3::IDENTITY });
            let message = "there is no light; soft light from all around, mostly from the upper left, is used";
            self.report.warn(Fault::new("", message));
        }
    }
}

/// Half angles of full and of no intensity, degrees.
fn cone(light: &Light, own: &str) -> Checked<(f64, f64)> {
    let place = format!("{own}.spot");
    let spot = light.spot.as_ref().ok_or_else(|| Fault::new(&place, "a spot light needs its cone"))?;
    let (inner, outer) = (f64::from(spot.inner_cone_angle), f64::from(spot.outer_cone_angle));
    // pi / 2 as f32 is a little more than pi / 2.
    let outer = if outer as f32 == FRAC_PI_2 as f32 { FRAC_PI_2 } else { outer };
    if !(inner >= 0.0 && inner <= outer && outer > 0.0 && outer <= FRAC_PI_2) {
        let message =
            format!("angles {inner} and {outer} are out of range; expected 0 <= inner <= outer <= pi / 2 radians");
        return Err(Fault::new(place, message));
    }
    Ok((inner.to_degrees(), outer.to_degrees()))
}

/// The light for files without any. Not a constant, in which white things would have no shape: radiance 0.2 at the nadir to 0.8 at the
/// zenith, and a key light of 8 cos^32 around a direction to the upper left, in front. White paper that faces it sends back 1.1.
fn studio() -> Image {
    let (width, height) = (128, 64);
    let key = DVec3::new(-0.5, 0.8, 0.6).normalize();
    let texel = |i: u32| {
        let u = (f64::from(i % width) + 0.5) / f64::from(width);
        let v = (f64::from(i / width) + 0.5) / f64::from(height);
        let (phi, theta) = (TAU * (u - 0.5), PI * v);
        let d = DVec3::new(sin64(theta) * sin64(phi), cos64(theta), -sin64(theta) * cos64(phi));
        Rgb::splat((0.5 + 0.3 * d.y + 8.0 * pow64(d.dot(key).max(0.0), 32.0)) as f32)
    };
    Image { width, height, texels: (0..width * height).map(texel).collect::<Vec<_>>().into() }
}

/// A camera in front of the box (towards +Z) and above it that has all of it in the picture, be it 16:9 or narrower.
fn framing(low: DVec3, high: DVec3) -> CameraDesc {
    let centre = (low + high) * 0.5;
    let back = DVec3::new(0.25, 0.45, 1.0).normalize();
    let right = DVec3::Y.cross(back).normalize();
    let up = back.cross(right);
    let slope = tan64(STAND_IN_FOV.to_radians() * 0.5);
    let steep = slope * STAND_IN_ASPECT;
    let half = (high - low) * 0.5;
    // The farthest that any corner asks for: in view when |x| and |y| stay below (distance - z) times their slope.
    let corners =
        (0..8).map(|i| half * DVec3::from_array([0, 1, 2].map(|bit| if i >> bit & 1 == 1 { 1.0 } else { -1.0 })));
    let wanted = corners.map(|c| c.dot(back) + (c.dot(right).abs() / slope).max(c.dot(up).abs() / steep));
    let distance = 1.05 * wanted.fold(0.0, f64::max);
    let distance = if distance > 0.0 { distance } else { 1.0 };
    CameraDesc {
        to_world: DAffine3 { matrix3: DMat3::from_cols(right, up, back), translation: centre + back * distance },
        fov: STAND_IN_FOV,
        fov_axis: FovAxis::X,
        aperture_radius: 0.0,
        focus_distance: distance,
    }
}
