//! Mitsuba's emitters.

use super::Builder;
use super::document::NodeId;
use super::reader::Reader;
use crate::math::{DAffine3, DVec3};
use crate::scene::desc::{Emission, LightDesc, SpotFalloff};
use crate::scene::import::image::ImageKind;
use crate::scene::import::number::Bound;
use crate::scene::import::transform::half_turn;
use crate::spectrum::Rgb;

/// The emitters that can stand for themselves.
const EMITTERS: [&str; 6] = ["area", "point", "spot", "directional", "constant", "envmap"];
/// Parameters that change nothing here.
const HARMLESS: [&str; 3] = ["sampling_weight", "mis_compensation", "cache"];

impl Builder<'_, '_, '_> {
    /// An emitter of the scene (not of a shape).
    pub(super) fn emitter(&mut self, id: NodeId) {
        let node = &self.document.nodes[id];
        if !EMITTERS.contains(&node.plugin.as_str()) {
            return self.unsupported(node.at, id, &EMITTERS);
        }
        let mut reader = self.reader(id);
        let light = match node.plugin.as_str() {
            "point" => Some(self.point(&mut reader)),
            "spot" => Some(self.spot(&mut reader)),
            "directional" => self.directional(&mut reader),
            "constant" => Some(LightDesc::Constant { radiance: self.power(&mut reader, "radiance") }),
            "envmap" => self.envmap(&mut reader),
            _ => {
                self.importer.error(
                    node.at,
                    "an `area` emitter lights a shape",
                    "move it into the shape that shall shine",
                );
                return;
            }
        };
        self.place_in_medium(&mut reader);
        reader.finish(self.importer, self.document, &HARMLESS);
        self.importer.scene.lights.extend(light);
    }

    /// The colour of an emitter, 1 by default.
    fn power(&mut self, reader: &mut Reader, name: &'static str) -> Rgb {
        if let Some((child, _)) = reader.named_child(name) {
            self.importer.error(child.at, format!("a texture for `{name}` is not supported here"), "give it an <rgb>");
        }
        reader.rgb(self.importer, name, Bound::NotNegative).unwrap_or(Rgb::ONE)
    }

    fn point(&mut self, reader: &mut Reader) -> LightDesc {
        let to_world = reader.transform(self.importer, "to_world");
        let position = reader.vector(self.importer, "position");
        if position.is_some() && reader.has("to_world") {
            self.importer.error(reader.node.at, "both `position` and `to_world` are given", "leave one of them out");
        }
        LightDesc::Point {
            position: position.unwrap_or(to_world.translation),
            intensity: self.power(reader, "intensity"),
        }
    }

    /// At the origin of its space, along +Z; the falloff is linear in the angle.
    fn spot(&mut self, reader: &mut Reader) -> LightDesc {
        let to_world = reader.transform(self.importer, "to_world");
        if let Some((child, _)) = reader.named_child("texture") {
            self.importer.error(child.at, "a spot light with a texture is not supported", "");
        }
        let cutoff = reader.float_or(self.importer, "cutoff_angle", Bound::Inside(0.0, 180.0), 20.0);
        let beam = reader.float_or(self.importer, "beam_width", Bound::Between(0.0, 180.0), 0.75 * cutoff);
        LightDesc::Spot {
            position: to_world.translation,
            direction: to_world.transform_vector3(DVec3::Z),
            intensity: self.power(reader, "intensity"),
            beam: beam.min(cutoff),
            cutoff,
            falloff: SpotFalloff::LinearAngle,
        }
    }

    fn directional(&mut self, reader: &mut Reader) -> Option<LightDesc> {
        let to_world = reader.transform(self.importer, "to_world");
        let given = reader.vector(self.importer, "direction");
        if given.is_some() && reader.has("to_world") {
            self.importer.error(reader.node.at, "both `direction` and `to_world` are given", "leave one of them out");
        }
        let direction = given.unwrap_or(to_world.transform_vector3(DVec3::Z));
        let irradiance = self.power(reader, "irradiance");
        if direction.try_normalize().is_none() {
            self.importer.error(reader.node.at, "the direction has no length", "");
            return None;
        }
        Some(LightDesc::Directional { direction, irradiance })
    }

    /// Mitsuba's column 0 lies at -Z, lightfarm's centre column does: half a turn about Y between them.
    fn envmap(&mut self, reader: &mut Reader) -> Option<LightDesc> {
        let to_world = reader.transform(self.importer, "to_world");
        let scale = reader.float_or(self.importer, "scale", Bound::NotNegative, 1.0) as f32;
        let Some((name, at)) = reader.string(self.importer, "filename") else {
            self.importer.error(reader.node.at, "an environment map needs a `filename`", "");
            return None;
        };
        let image = self.importer.image(at, name, ImageKind::Srgb, false)?;
        Some(LightDesc::Environment { image, scale: Rgb::splat(scale), to_world: rotation(to_world) * half_turn() })
    }

    /// The light of a shape, if it has an emitter.
    pub(super) fn emission(&mut self, reader: &mut Reader) -> Option<Emission> {
        let emitters = reader.children(self.document, "emitter");
        if let Some((child, _)) = emitters.get(1) {
            self.importer.error(child.at, "a shape can have one emitter only", "");
        }
        let (_, id) = *emitters.first()?;
        let node = &self.document.nodes[id];
        if node.plugin != "area" {
            self.unsupported(node.at, id, &["area"]);
            return None;
        }
        let mut reader = self.reader(id);
        let radiance = self.rgb_param(&mut reader, "radiance", Bound::NotNegative, 1.0);
        reader.finish(self.importer, self.document, &HARMLESS);
        Some(Emission { radiance, two_sided: false })
    }
}

/// An environment is infinitely far away: its place means nothing.
fn rotation(m: DAffine3) -> DAffine3 {
    DAffine3::from_mat3(m.matrix3)
}
