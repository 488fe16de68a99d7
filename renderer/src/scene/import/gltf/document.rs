//! A .gltf or .glb file to its JSON and its binary chunk, and what is said of the file as a whole.

use super::report::{Checked, Fault, Report};
use gltf::json;
use serde::de::{self, Deserialize, Deserializer, IgnoredAny, MapAccess, SeqAccess, Visitor};
use serde_json::Value;
use std::borrow::Cow;
use std::fmt;
use std::sync::Arc;

/// Extensions that are honoured, or that change nothing here.
const SUPPORTED: [&str; 11] = [
    "KHR_lights_punctual",
    "KHR_materials_emissive_strength",
    "KHR_materials_ior",
    "KHR_materials_transmission",
    "KHR_materials_unlit",
    "KHR_materials_volume",
    "KHR_mesh_quantization",
    "KHR_node_visibility",
    "KHR_texture_transform",
    "EXT_mesh_gpu_instancing",
    "KHR_xmp_json_ld",
];

/// The parts of a file.
pub(super) struct Document {
    /// The JSON, well-typed but otherwise not to be trusted: indices, counts and offsets are as the file has them.
    pub root: json::Root,
    /// The binary chunk of a .glb.
    pub bin: Option<Arc<[u8]>>,
}

/// Splits and parses; the kind is told by the first bytes.
pub(super) fn parse(bytes: &[u8]) -> Checked<Document> {
    let in_glb = bytes.starts_with(b"glTF");
    let (text, bin) = if in_glb { split_glb(bytes)? } else { (bytes, None) };
    if text.starts_with(b"\xef\xbb\xbf") {
        return Err(Fault::new("byte 0", "the JSON begins with a byte-order mark").help("save it as UTF-8 without one"));
    }
    let root = typed(text, in_glb)?;
    Ok(Document { root, bin: bin.map(Arc::from) })
}

/// JSON text to the crate's types.
fn typed(text: &[u8], in_glb: bool) -> Checked<json::Root> {
    let mut numbers = serde_json::Deserializer::from_slice(text);
    if let Err(e) = serde_path_to_error::deserialize::<_, SinglePrecision>(&mut numbers)
        && e.inner().is_data()
    {
        return Err(json_fault(e.inner(), &e.path().to_string(), in_glb));
    }
    let mut source = serde_json::Deserializer::from_slice(text);
    let error = match serde_path_to_error::deserialize(&mut source) {
        Ok(root) => return source.end().map(|()| root).map_err(|e| json_fault(&e, "", in_glb)),
        Err(e) => e,
    };
    // The crate is stricter than glTF, and asks for what is not used here: once more without that.
    if let Ok(mut value) = serde_json::from_slice::<Value>(text) {
        relax(&mut value);
        if let Ok(root) = json::Root::deserialize(value) {
            return Ok(root);
        }
    }
    let path = error.path().to_string();
    Err(json_fault(error.inner(), if path == "." { "" } else { &path }, in_glb))
}

/// JSON of which nothing is kept: all its numbers, but for those of applications (`extras`), must be finite in single precision, in
/// which the crate reads them.
struct SinglePrecision;

impl<'de> Deserialize<'de> for SinglePrecision {
    fn deserialize<D: Deserializer<'de>>(source: D) -> Result<Self, D::Error> {
        source.deserialize_any(Numbers)
    }
}

struct Numbers;

impl<'de> Visitor<'de> for Numbers {
    type Value = SinglePrecision;

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("JSON")
    }

    fn visit_f64<E: de::Error>(self, v: f64) -> Result<SinglePrecision, E> {
        let message = || E::custom(format_args!("{v:e} is beyond single precision; expected a finite number"));
        (v as f32).is_finite().then_some(SinglePrecision).ok_or_else(message)
    }

    fn visit_seq<A: SeqAccess<'de>>(self, mut list: A) -> Result<SinglePrecision, A::Error> {
        while list.next_element::<SinglePrecision>()?.is_some() {}
        Ok(SinglePrecision)
    }

    fn visit_map<A: MapAccess<'de>>(self, mut map: A) -> Result<SinglePrecision, A::Error> {
        while let Some(key) = map.next_key::<Cow<'de, str>>()? {
            if key == "extras" {
                map.next_value::<IgnoredAny>()?;
            } else {
                map.next_value::<SinglePrecision>()?;
            }
        }
        Ok(SinglePrecision)
    }

    fn visit_bool<E>(self, _: bool) -> Result<SinglePrecision, E> {
        Ok(SinglePrecision)
    }

    fn visit_i64<E>(self, _: i64) -> Result<SinglePrecision, E> {
        Ok(SinglePrecision)
    }

    fn visit_u64<E>(self, _: u64) -> Result<SinglePrecision, E> {
        Ok(SinglePrecision)
    }

    fn visit_str<E>(self, _: &str) -> Result<SinglePrecision, E> {
        Ok(SinglePrecision)
    }

    fn visit_unit<E>(self) -> Result<SinglePrecision, E> {
        Ok(SinglePrecision)
    }
}

fn json_fault(e: &serde_json::Error, path: &str, in_glb: bool) -> Fault {
    let at = format!("{}line {}, column {}", if in_glb { "JSON chunk " } else { "" }, e.line(), e.column());
    let message = e.to_string();
    let message = message.strip_suffix(&format!(" at line {} column {}", e.line(), e.column())).unwrap_or(&message);
    let place = if path.is_empty() { at } else { format!("{at}, {path}") };
    Fault::new(place, format!("not a glTF 2.0 document: {message}"))
}

/// Empties animations (which may lack targets), gives every scene its nodes, and writes whole numbers without a decimal point.
fn relax(value: &mut Value) {
    for animation in value.get_mut("animations").and_then(Value::as_array_mut).into_iter().flatten() {
        *animation = serde_json::json!({ "channels": [], "samplers": [] });
    }
    for scene in value.get_mut("scenes").and_then(Value::as_array_mut).into_iter().flatten() {
        if let Some(scene) = scene.as_object_mut() {
            scene.entry("nodes").or_insert_with(|| Value::Array(Vec::new()));
        }
    }
    whole_numbers(value);
}

/// The nesting of `value` is bounded by the parser.
fn whole_numbers(value: &mut Value) {
    match value {
        Value::Array(list) => list.iter_mut().for_each(whole_numbers),
        Value::Object(map) => map.values_mut().for_each(whole_numbers),
        Value::Number(n) if n.is_f64() => {
            // Whole numbers below 2^53 are exact in f64.
            if let Some(v) = n.as_f64().filter(|v| v.fract() == 0.0 && *v >= 0.0 && *v < 9.007e15) {
                *value = Value::from(v as u64);
            }
        }
        _ => {}
    }
}

/// JSON and binary chunk of a .glb (glTF 2.0, 4.4); chunks of other types are skipped, as it demands.
fn split_glb(bytes: &[u8]) -> Checked<(&[u8], Option<&[u8]>)> {
    let word = |at: usize| {
        let word = bytes.get(at..at + 4).and_then(|w| <[u8; 4]>::try_from(w).ok());
        word.map(u32::from_le_bytes).ok_or_else(|| Fault::new(format!("byte {at}"), "the file ends in a header"))
    };
    let version = word(4)?;
    if version != 2 {
        return Err(Fault::new(
            "byte 4",
            format!("this is version {version} of the .glb container; expected version 2"),
        ));
    }
    let length = word(8)? as usize;
    if length > bytes.len() {
        return Err(Fault::new("byte 8", format!("the header promises {length} bytes, the file has {}", bytes.len())));
    }
    let (mut json, mut bin, mut at) = (None, None, 12);
    while at < length {
        let (size, kind) = (word(at)? as usize, word(at + 4)?.to_le_bytes());
        let data = (at + 8).checked_add(size).filter(|end| *end <= length).and_then(|end| bytes.get(at + 8..end));
        let data = data.ok_or_else(|| {
            Fault::new(
                format!("byte {at}"),
                format!("a chunk of {size} bytes reaches past the end of the file ({length})"),
            )
        })?;
        match &kind {
            b"JSON" if json.is_none() && at == 12 => json = Some(data),
            b"BIN\0" if bin.is_none() && json.is_some() => bin = Some(data),
            b"JSON" | b"BIN\0" => {
                return Err(Fault::new(
                    format!("byte {at}"),
                    "a chunk out of place; expected one JSON chunk, then at most one BIN",
                ));
            }
            _ => {}
        }
        at += 8 + size;
    }
    let json = json.ok_or_else(|| Fault::new("byte 12", "there is no JSON chunk"))?;
    Ok((json, bin))
}

/// Checks version and extensions.
pub(super) fn check_header(root: &json::Root, report: &mut Report<'_>) {
    let asset = &root.asset;
    let (wanted, place) = match &asset.min_version {
        Some(v) => (v, "asset.minVersion"),
        None => (&asset.version, "asset.version"),
    };
    let major = wanted.split('.').next().unwrap_or("");
    let newer = asset.min_version.as_deref().is_some_and(|v| v != "2.0");
    if major != "2" || newer {
        report.fault(Fault::new(place, format!("this is glTF {wanted:?}; expected 2.0")).help("export it as glTF 2.0"));
    }
    for (i, name) in root.extensions_required.iter().enumerate() {
        if !SUPPORTED.contains(&name.as_str()) {
            let fault = Fault::new(
                format!("extensionsRequired[{i}]"),
                format!("the file can't be shown without {name}, which is not supported"),
            );
            report.fault(fault.help("export the model without it"));
        }
    }
    for (i, name) in root.extensions_used.iter().enumerate() {
        // Those of materials are reported with the materials that have them.
        let elsewhere = name.starts_with("KHR_materials_") && name != "KHR_materials_variants";
        if !SUPPORTED.contains(&name.as_str()) && !elsewhere && !root.extensions_required.contains(name) {
            report.warn(Fault::new(format!("extensionsUsed[{i}]"), format!("{name} is not supported and is ignored")));
        }
    }
}

/// Whether a material's extension is honoured.
pub(super) fn is_supported(extension: &str) -> bool {
    SUPPORTED.contains(&extension)
}
