//! Mitsuba's media.

use super::Builder;
use super::document::NodeId;
use super::reader::Reader;
use crate::medium::{MediumId, Phase};
use crate::scene::import::importer::{Importer, Place};
use crate::scene::import::medium::{Coefficients, Parameters};
use crate::scene::import::number::Bound;
use crate::spectrum::Rgb;

/// The media that can be rendered.
const MEDIA: [&str; 1] = ["homogeneous"];
/// The phase functions that can be rendered.
const PHASES: [&str; 2] = ["isotropic", "hg"];
/// Parameters that change nothing here.
const HARMLESS: [&str; 4] = ["sample_emitters", "has_spectral_extinction", "strategy", "medium_sampling_weight"];

/// The media on the two sides of a shape.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Sides {
    /// What fills it.
    pub interior: Option<MediumId>,
    /// Whether either side was given.
    pub any: bool,
}

impl Builder<'_, '_, '_> {
    /// The medium `id`; `None` after an error.
    pub(super) fn medium(&mut self, id: NodeId) -> Option<MediumId> {
        if let Some(known) = self.media.get(&id) {
            return *known;
        }
        let built = self.build_medium(id);
        self.media.insert(id, built);
        built
    }

    fn build_medium(&mut self, id: NodeId) -> Option<MediumId> {
        let node = &self.document.nodes[id];
        if !MEDIA.contains(&node.plugin.as_str()) {
            self.unsupported(node.at, id, &MEDIA);
            return None;
        }
        let mut reader = self.reader(id);
        let phases = reader.children(self.document, "phase");
        let phase = phases.first().map_or(Phase::Isotropic, |(_, id)| self.phase(*id));
        let importer = &mut *self.importer;
        for name in ["sigma_t", "albedo", "sigma_a", "sigma_s"] {
            if let Some((child, _)) = reader.named_child(name) {
                importer.error(child.at, format!("a volume for `{name}` is not supported"), "give it an <rgb>");
            }
        }
        if let Some(prop) = reader.get("material") {
            importer.error(prop.at, "media by the name of a material are not supported", "give `sigma_t` and `albedo`");
        }
        // Mitsuba's default albedo.
        let coefficients = Coefficients::read(importer, node.at, &mut reader, 0.75);
        let scale = reader.float_or(importer, "scale", Bound::NotNegative, 1.0);
        reader.finish(importer, self.document, &HARMLESS);
        importer.add_medium(node.at, coefficients, scale, phase)
    }

    fn phase(&mut self, id: NodeId) -> Phase {
        let node = &self.document.nodes[id];
        if !PHASES.contains(&node.plugin.as_str()) {
            self.unsupported(node.at, id, &PHASES);
            return Phase::Isotropic;
        }
        let mut reader = self.reader(id);
        let phase = match node.plugin.as_str() {
            "hg" => {
                let g = reader.float_or(self.importer, "g", Bound::Inside(-1.0, 1.0), 0.8);
                Phase::HenyeyGreenstein { g: g as f32 }
            }
            _ => Phase::Isotropic,
        };
        reader.finish(self.importer, self.document, &[]);
        phase
    }

    /// The media inside and outside of a shape. Which medium is where follows from the insides alone; what is outside is kept to
    /// see whether it agrees with them ([`Builder::outside`]).
    pub(super) fn sides(&mut self, reader: &mut Reader) -> Sides {
        let mut sides = Sides::default();
        for (child, id) in reader.children(self.document, "medium") {
            sides.any = true;
            let medium = self.medium(id);
            match child.name.as_str() {
                "interior" => sides.interior = medium,
                "exterior" => self.exteriors.extend(medium.map(|m| (child.at, m))),
                _ => {
                    let message = "a medium of a shape must be called `interior` or `exterior`";
                    self.importer.error(child.at, message, "set its attribute name");
                }
            }
        }
        for (child, id) in reader.children(self.document, "subsurface") {
            self.unsupported(child.at, id, &[]);
        }
        sides
    }

    /// The medium that a sensor or an emitter says it is in.
    pub(super) fn place_in_medium(&mut self, reader: &mut Reader) {
        for (child, id) in reader.children(self.document, "medium") {
            let medium = self.medium(id);
            self.exteriors.extend(medium.map(|m| (child.at, m)));
        }
    }

    /// A medium that is outside of something, but inside of nothing, fills the scene.
    pub(super) fn outside(&mut self) {
        let exteriors: Vec<(Place, MediumId)> = std::mem::take(&mut self.exteriors);
        for (at, medium) in exteriors {
            let scene = &mut self.importer.scene;
            if scene.shapes.iter().any(|s| s.interior == Some(medium)) {
                continue;
            }
            if *scene.global_medium.get_or_insert(medium) != medium {
                let message = "of several media that no shape has as its `interior` only the first fills the scene";
                self.importer.warn(at, message, "let a shape bound this one");
            }
        }
    }
}

impl Parameters for Reader<'_> {
    fn has(&self, name: &str) -> bool {
        self.has(name)
    }

    fn rgb(&mut self, importer: &mut Importer, name: &'static str, bound: Bound) -> Option<Rgb> {
        self.rgb(importer, name, bound)
    }
}
