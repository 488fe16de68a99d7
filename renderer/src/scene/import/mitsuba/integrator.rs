//! Mitsuba's integrators: what they say of path lengths, and which of lightfarm's comes nearest.

use super::Builder;
use super::document::NodeId;

/// Integrators whose picture is that of `path` on the scenes that can be imported.
const PATHS: [&str; 4] = ["path", "volpath", "volpathmis", "volpath_simple"];
/// Integrators that estimate the same picture by other means.
const OTHERS: [&str; 12] = [
    "bdpt",
    "pssmlt",
    "mlt",
    "erpt",
    "photonmapper",
    "ppm",
    "sppm",
    "vpl",
    "irrcache",
    "prb",
    "prb_basic",
    "prbvolpath",
];
/// Integrators of passes that belong to another one.
const WRAPPERS: [&str; 3] = ["aov", "moment", "adaptive"];
/// What is to be said of those that are none of these.
const KNOWN: [&str; 4] = ["path", "volpath", "direct", "ptracer"];

impl Builder<'_, '_, '_> {
    /// Takes over what the integrator says; lightfarm's own choice is made on the command line.
    pub(super) fn integrator(&mut self, id: NodeId) {
        let node = &self.document.nodes[id];
        let mut reader = self.reader(id);
        let plugin = node.plugin.as_str();
        if WRAPPERS.contains(&plugin) {
            let message = format!("the integrator `{plugin}` is left out, the one inside it is taken");
            self.importer.warn(node.at, message, "");
            match reader.children(self.document, "integrator").first() {
                // Nesting of elements is limited, but a reference could lead back here.
                Some((_, inner)) if *inner > id => self.integrator(*inner),
                _ => self.importer.error(node.at, format!("`{plugin}` has no integrator inside"), ""),
            }
            return;
        }
        let (name, depth) = match plugin {
            "direct" => ("path", Some(2)),
            "ptracer" => ("light", None),
            _ if PATHS.contains(&plugin) => ("path", None),
            _ if OTHERS.contains(&plugin) => {
                let message = format!("the integrator `{plugin}` is replaced by `path`");
                self.importer.warn(node.at, message, "its own parameters are ignored; choose with --integrator");
                ("path", None)
            }
            _ => return self.unsupported(node.at, id, &KNOWN),
        };
        let importer = &mut *self.importer;
        let max_depth = reader.integer(importer, "max_depth", -1, i64::from(i32::MAX)).unwrap_or(-1);
        let rr_depth = reader.integer(importer, "rr_depth", 1, i64::from(u32::MAX));
        for name in ["hide_emitters", "strict_normals"] {
            if reader.boolean(importer, name) == Some(true) {
                importer.error(node.at, format!("`{name}` is not supported"), "set it to false, or remove it");
            }
        }
        // Parameters of an integrator that is replaced mean nothing here.
        if !OTHERS.contains(&plugin) {
            reader.finish(
                importer,
                self.document,
                &["samples_per_pass", "emitter_samples", "bsdf_samples", "shading_samples"],
            );
        }
        let defaults = &mut importer.scene.defaults;
        defaults.integrator = Some(name.into());
        defaults.max_depth = Some(depth.unwrap_or(max_depth as i32));
        defaults.rr_depth = rr_depth.map(|d| d as u32);
    }
}
