//! Values of Mitsuba's parameters.

use super::xml::{Attributes, number, numbers};
use crate::math::{DAffine3, DVec3, pow64};
use crate::scene::import::importer::Importer;

/// The value of a parameter.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum Value {
    Boolean(bool),
    Integer(i64),
    Float(f64),
    String(String),
    /// A point or a vector.
    Vector(DVec3),
    /// Linear Rec.709.
    Rgb(DVec3),
    Transform(DAffine3),
}

impl Value {
    /// The element that writes it.
    pub fn element(&self) -> &'static str {
        match self {
            Self::Boolean(_) => "<boolean>",
            Self::Integer(_) => "<integer>",
            Self::Float(_) => "<float>",
            Self::String(_) => "<string>",
            Self::Vector(_) => "<point> or <vector>",
            Self::Rgb(_) => "<rgb>",
            Self::Transform(_) => "<transform>",
        }
    }
}

/// A parameter's name as Mitsuba 3 spells it: `toWorld` becomes `to_world`, `intIOR` becomes `int_ior`.
pub(super) fn modern_name(name: &str, legacy: bool) -> String {
    if !legacy {
        return name.to_string();
    }
    let mut out = String::with_capacity(name.len() + 4);
    let mut before = ' ';
    for c in name.chars() {
        if c.is_ascii_uppercase() && before.is_ascii_lowercase() {
            out.push('_');
        }
        // `IOR` after the underscore is one word.
        out.push(if c.is_ascii_uppercase() && out.contains('_') { c.to_ascii_lowercase() } else { c });
        before = c;
    }
    match out.as_str() {
        "diffuse_reflectance" => "reflectance".into(),
        _ => out,
    }
}

/// The value of the element `attributes.tag`; `None` after an error.
pub(super) fn parse(importer: &mut Importer, tag: &str, attributes: &Attributes, legacy: bool) -> Option<Value> {
    let at = attributes.at;
    if matches!(tag, "point" | "vector") {
        attributes.check(importer, &["name", "value", "x", "y", "z"]);
        return vector(importer, attributes, 0.0).map(Value::Vector);
    }
    attributes
        .check(importer, if tag == "rgb" { &["name", "value", "intent"] } else { &["name", "value", "filename"] });
    if tag == "spectrum" && attributes.get("filename").is_some() {
        importer.error(at, "spectra from files are not supported", "write the colour as <rgb>");
        return None;
    }
    let text = attributes.require(importer, "value")?;
    match tag {
        "boolean" if text.eq_ignore_ascii_case("true") => Some(Value::Boolean(true)),
        "boolean" if text.eq_ignore_ascii_case("false") => Some(Value::Boolean(false)),
        "boolean" => wrong(importer, attributes, "true or false"),
        "integer" => match text.trim().parse() {
            Ok(v) => Some(Value::Integer(v)),
            Err(_) => wrong(importer, attributes, "a whole number"),
        },
        "float" => number(importer, at, text).map(Value::Float),
        "string" => Some(Value::String(text.to_string())),
        "rgb" => colour(importer, attributes, text),
        "srgb" => match colour(importer, attributes, text)? {
            Value::Rgb(c) => Some(Value::Rgb(c.map(linear))),
            grey => Some(grey),
        },
        "spectrum" => spectrum(importer, attributes, text, legacy),
        _ => {
            importer.error(
                at,
                format!("<{tag}> is not supported"),
                if tag == "blackbody" { "write the colour as <rgb>" } else { "" },
            );
            None
        }
    }
}

fn wrong(importer: &mut Importer, attributes: &Attributes, expected: &str) -> Option<Value> {
    let shown: String = attributes.get("value").unwrap_or("").chars().take(40).collect();
    importer.error(attributes.at, format!("the value of <{}> is {shown:?}, expected {expected}", attributes.tag), "");
    None
}

/// One number, three, or `#rrggbb`.
fn colour(importer: &mut Importer, attributes: &Attributes, text: &str) -> Option<Value> {
    if let Some(hex) = text.trim().strip_prefix('#') {
        let digits = (hex.len() == 6).then(|| u32::from_str_radix(hex, 16).ok()).flatten();
        let Some(v) = digits else { return wrong(importer, attributes, "#rrggbb") };
        return Some(Value::Rgb(DVec3::new(f64::from(v >> 16), f64::from(v >> 8 & 255), f64::from(v & 255)) / 255.0));
    }
    match numbers(importer, attributes.at, text)?.as_slice() {
        [v] => Some(Value::Rgb(DVec3::splat(*v))),
        [r, g, b] => Some(Value::Rgb(DVec3::new(*r, *g, *b))),
        _ => wrong(importer, attributes, "one or three numbers"),
    }
}

/// A constant spectrum is a grey; version 0.6 also takes three numbers.
fn spectrum(importer: &mut Importer, attributes: &Attributes, text: &str, legacy: bool) -> Option<Value> {
    if text.contains(':') {
        importer.error(attributes.at, "spectra by wavelength are not supported", "write the colour as <rgb>");
        return None;
    }
    match colour(importer, attributes, text)? {
        Value::Rgb(c) if !legacy && (c.x != c.y || c.y != c.z) => wrong(importer, attributes, "one number"),
        value => Some(value),
    }
}

/// sRGB's transfer curve undone (IEC 61966-2-1).
fn linear(v: f64) -> f64 {
    if v <= 0.04045 { v / 12.92 } else { pow64((v + 0.055) / 1.055, 2.4) }
}

/// `value="a"`, `value="x y z"`, or single attributes x, y, z with a default for those left out.
pub(super) fn vector(importer: &mut Importer, attributes: &Attributes, default: f64) -> Option<DVec3> {
    if let Some(text) = attributes.get("value") {
        return match numbers(importer, attributes.at, text)?.as_slice() {
            [v] => Some(DVec3::splat(*v)),
            [x, y, z] => Some(DVec3::new(*x, *y, *z)),
            list => {
                importer.error(attributes.at, format!("expected one or three numbers, found {}", list.len()), "");
                None
            }
        };
    }
    let mut out = DVec3::splat(default);
    for (axis, name) in ["x", "y", "z"].into_iter().enumerate() {
        if let Some(text) = attributes.get(name) {
            out[axis] = number(importer, attributes.at, text)?;
        }
    }
    Some(out)
}
