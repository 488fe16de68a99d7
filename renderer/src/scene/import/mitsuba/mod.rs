//! Mitsuba XML, versions 0.6 and 3: the part of it that published scenes use. Everything unsupported is reported with its place.
//!
//! The pictures should be Mitsuba's. Its conventions, as read in the source of Mitsuba 3.9.1, stand beside the code that needs
//! them.

mod bsdf;
mod document;
mod emitter;
mod guard;
mod integrator;
mod ior;
mod medium;
mod parameters;
mod reader;
mod sensor;
mod shape;
mod texture;
mod transform;
mod value;
mod xml;

#[cfg(test)]
mod tests;

use super::importer::{Importer, Place};
use crate::bsdf::MaterialId;
use crate::diagnostics::nearest;
use crate::medium::MediumId;
use crate::texture::TextureId;
use document::{Document, NodeId};
use reader::Reader;
use std::collections::BTreeMap;

/// Imports the scene file `root`.
pub(super) fn import(importer: &mut Importer, root: &str) {
    let document = document::read(importer, root);
    if document.nodes.is_empty() {
        return;
    }
    let mut builder = Builder {
        importer,
        document: &document,
        textures: BTreeMap::new(),
        materials: BTreeMap::new(),
        media: BTreeMap::new(),
        exteriors: Vec::new(),
        open: Vec::new(),
        defaults: [None; 2],
        groups: BTreeMap::new(),
        shape_names: BTreeMap::new(),
    };
    builder.scene();
}

/// Turns objects into the scene; each is built once, however often it is referred to.
struct Builder<'d, 'i, 'a> {
    importer: &'i mut Importer<'a>,
    document: &'d Document,
    /// By object and whether only its luminance is wanted.
    textures: BTreeMap<(NodeId, bool), Option<TextureId>>,
    materials: BTreeMap<NodeId, Option<MaterialId>>,
    media: BTreeMap<NodeId, Option<MediumId>>,
    /// What is said to be outside of shapes, or around sensors and emitters.
    exteriors: Vec<(Place, MediumId)>,
    /// Materials being built, outermost first.
    open: Vec<NodeId>,
    /// The materials of shapes without one: that of an emitter, that of others.
    defaults: [Option<MaterialId>; 2],
    groups: BTreeMap<NodeId, Option<shape::Group>>,
    /// How many shapes of a kind have no id.
    shape_names: BTreeMap<String, usize>,
}

impl<'d> Builder<'d, '_, '_> {
    fn reader(&mut self, id: NodeId) -> Reader<'d> {
        Reader::new(self.importer, self.document, id)
    }

    fn scene(&mut self) {
        let mut reader = self.reader(0);
        let document = self.document;
        for (child, id) in reader.children(document, "integrator").into_iter().skip(1) {
            let plugin = &document.nodes[id].plugin;
            self.importer.warn(child.at, format!("a second integrator, `{plugin}`: it is ignored"), "");
        }
        let mut reader = self.reader(0);
        if let Some((_, id)) = reader.children(document, "integrator").first() {
            self.integrator(*id);
        }
        self.sensors(&mut reader);
        for (_, id) in reader.children(document, "texture") {
            self.texture(id, false);
        }
        for (_, id) in reader.children(document, "bsdf") {
            self.material(id);
        }
        for (_, id) in reader.children(document, "emitter") {
            self.emitter(id);
        }
        for (_, id) in reader.children(document, "shape") {
            self.shape(id);
        }
        for (_, id) in reader.children(document, "medium") {
            self.medium(id);
        }
        self.outside();
        for tag in ["phase", "volume", "subsurface"] {
            for (child, id) in reader.children(document, tag) {
                self.unsupported(child.at, id, &[]);
            }
        }
        for tag in ["sampler", "film", "rfilter"] {
            for (child, id) in reader.children(document, tag) {
                let plugin = &document.nodes[id].plugin;
                self.importer.warn(
                    child.at,
                    format!("the {tag} `{plugin}` belongs into the sensor: it is ignored here"),
                    "",
                );
            }
        }
        reader.finish(self.importer, document, &[]);
    }

    /// Reports that the object `id`, met at `at`, can't be rendered; `known` are the plugins of its kind that can.
    fn unsupported(&mut self, at: Place, id: NodeId, known: &[&str]) {
        let node = &self.document.nodes[id];
        let message = format!("the {} `{}` is not supported", node.tag, node.plugin);
        let help = match (nearest(&node.plugin, known.iter().copied()), known) {
            (Some(near), _) => format!("did you mean `{near}`? supported are: {}", known.join(", ")),
            (None, []) => String::new(),
            (None, _) => format!("supported are: {}", known.join(", ")),
        };
        self.importer.error(at, message, help);
    }
}
