//! Mitsuba's sensors, films, filters and samplers.

use super::Builder;
use super::document::NodeId;
use super::reader::Reader;
use super::value::Value;
use crate::math::atan64;
use crate::scene::desc::{CameraDesc, FilterDesc, FovAxis};
use crate::scene::import::number::Bound;
use crate::scene::import::transform::{half_turn, without_scale};

/// The sensors that can be rendered.
const SENSORS: [&str; 2] = ["perspective", "thinlens"];
/// Films are all alike here: what is written is decided on the command line.
const FILMS: [&str; 2] = ["hdrfilm", "ldrfilm"];
/// The reconstruction filters that can be rendered.
const FILTERS: [&str; 3] = ["box", "tent", "gaussian"];
/// Parameters of a film that change nothing of the picture's content.
const FILM_HARMLESS: [&str; 13] = [
    "file_format",
    "pixel_format",
    "component_format",
    "gamma",
    "banner",
    "high_quality_edges",
    "sample_border",
    "compensate",
    "attach_log",
    "exposure",
    "key",
    "burn",
    "tonemap_method",
];
/// Parameters of a sampler that only steer its random numbers.
const SAMPLER_HARMLESS: [&str; 5] = ["scramble", "jitter", "dimension", "strength", "seed_value"];
/// Focus of a thin lens without `focus_distance`: Mitsuba's far clipping plane.
const FAR: f64 = 1e4;
/// Diagonal of 35 mm film, in mm.
const FILM_DIAGONAL: f64 = 43.266_615_305_567_87;
/// Most pixels along a side.
const MAX_SIDE: i64 = 1 << 16;

impl Builder<'_, '_, '_> {
    /// The first sensor is the camera.
    pub(super) fn sensors(&mut self, scene: &mut Reader) {
        let sensors = scene.children(self.document, "sensor");
        match sensors.first() {
            Some((_, id)) => self.sensor(*id),
            None => self.importer.error(scene.node.at, "the scene has no sensor", "add <sensor type=\"perspective\">"),
        }
        for (child, _) in sensors.iter().skip(1) {
            self.importer.warn(child.at, "a second sensor: it is ignored", "");
        }
    }

    fn sensor(&mut self, id: NodeId) {
        let node = &self.document.nodes[id];
        if !SENSORS.contains(&node.plugin.as_str()) {
            return self.unsupported(node.at, id, &SENSORS);
        }
        let mut reader = self.reader(id);
        let to_world = reader.transform(self.importer, "to_world");
        // Mitsuba's camera looks along +Z with +X to the left.
        let to_world = without_scale(to_world).map_or(to_world, |m| m * half_turn());
        let (fov, fov_axis) = self.fov(&mut reader);
        let mut camera = CameraDesc { to_world, fov, fov_axis, ..CameraDesc::default() };
        if node.plugin == "thinlens" {
            camera.aperture_radius = reader.float_or(self.importer, "aperture_radius", Bound::NotNegative, 0.0);
            if !reader.has("aperture_radius") {
                self.importer.error(node.at, "a `thinlens` needs an `aperture_radius`", "0 is a pinhole");
            }
            camera.focus_distance = reader.float_or(self.importer, "focus_distance", Bound::Positive, FAR);
        }
        for name in ["principal_point_offset_x", "principal_point_offset_y"] {
            if reader.float(self.importer, name, Bound::Any).is_some_and(|v| v != 0.0) {
                self.importer.error(node.at, format!("`{name}` is not supported"), "");
            }
        }
        self.importer.scene.camera = camera;
        self.film(&mut reader);
        self.sampler(&mut reader);
        self.place_in_medium(&mut reader);
        let harmless = ["near_clip", "far_clip", "shutter_open", "shutter_close", "focus_distance"];
        reader.finish(self.importer, self.document, &harmless);
    }

    /// `fov` along `fov_axis`, or the diagonal angle of a focal length for 35 mm film (50 mm by default).
    fn fov(&mut self, reader: &mut Reader) -> (f64, FovAxis) {
        let axes = [
            ("x", FovAxis::X),
            ("y", FovAxis::Y),
            ("diagonal", FovAxis::Diagonal),
            ("smaller", FovAxis::Smaller),
            ("larger", FovAxis::Larger),
        ];
        let axis = reader.choice(self.importer, "fov_axis", &axes);
        let fov = reader.float(self.importer, "fov", Bound::Inside(0.0, 180.0));
        let focal = self.focal_length(reader);
        if reader.has("fov") {
            if reader.has("focal_length") {
                self.importer.error(reader.node.at, "both `fov` and `focal_length` are given", "leave one of them out");
            }
            return (fov.unwrap_or(CameraDesc::default().fov), axis);
        }
        ((2.0 * atan64(FILM_DIAGONAL / (2.0 * focal))).to_degrees(), FovAxis::Diagonal)
    }

    /// In mm; written with or without the unit.
    fn focal_length(&mut self, reader: &mut Reader) -> f64 {
        let Some(prop) = reader.get("focal_length") else { return 50.0 };
        let value = match &prop.value {
            Value::String(text) => text.trim().trim_end_matches("mm").trim().parse::<f64>().ok(),
            Value::Float(v) => Some(*v),
            Value::Integer(v) => Some(*v as f64),
            _ => None,
        };
        // The angle of view would round to 0 or 180 degrees beyond these.
        value.filter(|v| Bound::Between(1e-3, 1e6).allows(*v)).unwrap_or_else(|| {
            self.importer.error(prop.at, "`focal_length` is not a length like \"50mm\"", "");
            50.0
        })
    }

    fn film(&mut self, sensor: &mut Reader) {
        let films = sensor.children(self.document, "film");
        let mut size = (768, 576);
        let mut filter = FilterDesc::Gaussian { stddev: 0.5 };
        if let Some((_, id)) = films.first() {
            let node = &self.document.nodes[*id];
            if !FILMS.contains(&node.plugin.as_str()) {
                return self.unsupported(node.at, *id, &FILMS);
            }
            let mut reader = self.reader(*id);
            size.0 = reader.integer(self.importer, "width", 1, MAX_SIDE).unwrap_or(size.0);
            size.1 = reader.integer(self.importer, "height", 1, MAX_SIDE).unwrap_or(size.1);
            for name in ["crop_offset_x", "crop_offset_y", "crop_width", "crop_height"] {
                if let Some(prop) = reader.get(name) {
                    self.importer.error(prop.at, "a crop window is not supported", "remove it");
                }
            }
            for (_, id) in reader.children(self.document, "rfilter") {
                filter = self.filter(id).unwrap_or(filter);
            }
            reader.finish(self.importer, self.document, &FILM_HARMLESS);
        }
        let defaults = &mut self.importer.scene.defaults;
        defaults.size = Some((size.0 as u32, size.1 as u32));
        defaults.filter = Some(filter);
    }

    fn filter(&mut self, id: NodeId) -> Option<FilterDesc> {
        let node = &self.document.nodes[id];
        if !FILTERS.contains(&node.plugin.as_str()) {
            self.unsupported(node.at, id, &FILTERS);
            return None;
        }
        let mut reader = self.reader(id);
        let importer = &mut *self.importer;
        let mut number =
            |key, most, default| reader.float_or(importer, key, Bound::Between(1e-3, f64::from(most)), default) as f32;
        let mut radius = |default| number("radius", FilterDesc::MAX_RADIUS, default);
        let filter = match node.plugin.as_str() {
            "box" => FilterDesc::Box { radius: radius(0.5) },
            "tent" => FilterDesc::Tent { radius: radius(1.0) },
            _ => FilterDesc::Gaussian { stddev: number("stddev", FilterDesc::MAX_STDDEV, 0.5) },
        };
        reader.finish(importer, self.document, &[]);
        Some(filter)
    }

    /// Any sampler: only the number of samples and the seed matter.
    fn sampler(&mut self, sensor: &mut Reader) {
        for (_, id) in sensor.children(self.document, "sampler") {
            let mut reader = self.reader(id);
            let count = reader.integer(self.importer, "sample_count", 1, 1 << 24);
            let seed = reader.integer(self.importer, "seed", 0, i64::MAX);
            reader.finish(self.importer, self.document, &SAMPLER_HARMLESS);
            let defaults = &mut self.importer.scene.defaults;
            defaults.spp = count.map(|c| c as u32);
            defaults.seed = seed.map(|s| s as u64);
        }
    }
}
