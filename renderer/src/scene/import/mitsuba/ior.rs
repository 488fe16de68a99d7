//! Indices of refraction by name, as Mitsuba has them (Hecht, "Optics", 4th edition; at 589 nm).

use super::reader::Reader;
use super::value::Value;
use crate::diagnostics::nearest;
use crate::scene::import::importer::Importer;
use crate::scene::import::number::Bound;

const INDICES: [(&str, f64); 23] = [
    ("vacuum", 1.0),
    ("helium", 1.000_036),
    ("hydrogen", 1.000_132),
    ("air", 1.000_277),
    ("carbon dioxide", 1.000_45),
    ("water", 1.333),
    ("acetone", 1.36),
    ("ethanol", 1.361),
    ("carbon tetrachloride", 1.461),
    ("glycerol", 1.4729),
    ("benzene", 1.501),
    ("silicone oil", 1.520_45),
    ("bromine", 1.661),
    ("water ice", 1.31),
    ("fused quartz", 1.458),
    ("pyrex", 1.47),
    ("acrylic glass", 1.49),
    ("polypropylene", 1.49),
    ("bk7", 1.5046),
    ("sodium chloride", 1.544),
    ("amber", 1.55),
    ("pet", 1.575),
    ("diamond", 2.419),
];

/// The parameter `name`: a number or a material.
pub(super) fn index(importer: &mut Importer, reader: &mut Reader, name: &'static str, default: f64) -> f64 {
    let Some(prop) = reader.get(name) else { return default };
    let Value::String(material) = &prop.value else {
        return reader.float_or(importer, name, Bound::Positive, default);
    };
    if let Some((_, index)) = INDICES.iter().find(|(known, _)| known.eq_ignore_ascii_case(material)) {
        return *index;
    }
    let known = INDICES.iter().map(|(known, _)| *known);
    let list = known.clone().collect::<Vec<_>>().join(", ");
    let near = nearest(material, known).map_or(String::new(), |n| format!("did you mean {n:?}? "));
    importer.error(
        prop.at,
        format!("no index of refraction is known of {material:?}"),
        format!("{near}known are: {list}"),
    );
    default
}
