//! The parameters of one object: asked for by name, checked, and what nobody asked for reported.

use super::document::{Child, Document, Node, NodeId, Prop};
use super::value::Value;
use crate::diagnostics::nearest;
use crate::math::{DAffine3, DVec3};
use crate::scene::import::importer::{Importer, Place};
use crate::scene::import::number::Bound;
use crate::spectrum::Rgb;

/// Reads one object.
pub(super) struct Reader<'d> {
    /// The object.
    pub node: &'d Node,
    /// Nested and referenced objects not taken yet.
    children: Vec<(&'d Child, NodeId)>,
    asked: Vec<&'static str>,
}

impl<'d> Reader<'d> {
    /// For the object `id`; references to nothing are reported.
    pub fn new(importer: &mut Importer, document: &'d Document, id: NodeId) -> Self {
        let node = &document.nodes[id];
        let mut children = Vec::new();
        for child in &node.children {
            if let Some(target) = document.target(child) {
                children.push((child, target));
            } else if let super::document::Target::Reference(id) = &child.target {
                let help = nearest(id, document.known_ids()).map_or(String::new(), |n| format!("did you mean {n:?}?"));
                importer.error(child.at, format!("no object has the id {id:?}"), help);
            }
        }
        Self { node, children, asked: Vec::new() }
    }

    /// The parameter `name`.
    pub fn get(&mut self, name: &'static str) -> Option<&'d Prop> {
        self.asked.push(name);
        self.node.props.iter().find(|p| p.name == name)
    }

    /// Whether the parameter or child `name` is given.
    pub fn has(&self, name: &str) -> bool {
        self.node.props.iter().any(|p| p.name == name) || self.children.iter().any(|(c, _)| c.name == name)
    }

    fn wrong_type(importer: &mut Importer, prop: &Prop, expected: &str) {
        let message = format!("`{}` is a {}, expected {expected}", prop.name, prop.value.element());
        importer.error(prop.at, message, "");
    }

    /// A number within `bound`.
    pub fn float(&mut self, importer: &mut Importer, name: &'static str, bound: Bound) -> Option<f64> {
        let prop = self.get(name)?;
        let value = match prop.value {
            Value::Float(v) => v,
            Value::Integer(v) => v as f64,
            Value::Rgb(c) if c.x == c.y && c.y == c.z => c.x,
            _ => {
                Self::wrong_type(importer, prop, "<float>");
                return None;
            }
        };
        checked(importer, prop.at, name, value, bound)
    }

    /// A number within `bound`, or the default.
    pub fn float_or(&mut self, importer: &mut Importer, name: &'static str, bound: Bound, default: f64) -> f64 {
        self.float(importer, name, bound).unwrap_or(default)
    }

    /// A whole number from `low` to `high`.
    pub fn integer(&mut self, importer: &mut Importer, name: &'static str, low: i64, high: i64) -> Option<i64> {
        let prop = self.get(name)?;
        let value = match prop.value {
            Value::Integer(v) => v,
            Value::Float(v) if v.fract() == 0.0 && v.abs() < 1e15 => v as i64,
            _ => {
                Self::wrong_type(importer, prop, "<integer>");
                return None;
            }
        };
        if value < low || value > high {
            importer.error(prop.at, format!("`{name}` is {value}, expected a whole number from {low} to {high}"), "");
            return None;
        }
        Some(value)
    }

    /// A truth value.
    pub fn boolean(&mut self, importer: &mut Importer, name: &'static str) -> Option<bool> {
        let prop = self.get(name)?;
        if let Value::Boolean(v) = prop.value {
            return Some(v);
        }
        Self::wrong_type(importer, prop, "<boolean>");
        None
    }

    /// A text and its place.
    pub fn string(&mut self, importer: &mut Importer, name: &'static str) -> Option<(&'d str, Place)> {
        let prop = self.get(name)?;
        if let Value::String(v) = &prop.value {
            return Some((v, prop.at));
        }
        Self::wrong_type(importer, prop, "<string>");
        None
    }

    /// One of `choices` (case does not matter); the first is the default.
    pub fn choice<T: Copy>(&mut self, importer: &mut Importer, name: &'static str, choices: &[(&str, T)]) -> T {
        let default = choices[0].1;
        let Some((text, at)) = self.string(importer, name) else { return default };
        if let Some((_, value)) = choices.iter().find(|(c, _)| c.eq_ignore_ascii_case(text)) {
            return *value;
        }
        let known: Vec<&str> = choices.iter().map(|(c, _)| *c).collect();
        let near = nearest(text, known.iter().copied()).map_or(String::new(), |n| format!("did you mean {n:?}?"));
        importer.error(at, format!("`{name}` is {text:?}, expected one of: {}", known.join(", ")), near);
        default
    }

    /// A point or vector.
    pub fn vector(&mut self, importer: &mut Importer, name: &'static str) -> Option<DVec3> {
        let prop = self.get(name)?;
        match prop.value {
            Value::Vector(v) if v.as_vec3().is_finite() => return Some(v),
            Value::Vector(_) => importer.error(prop.at, format!("`{name}` is too large"), ""),
            _ => Self::wrong_type(importer, prop, "<point> or <vector>"),
        }
        None
    }

    /// A transform, or the identity.
    pub fn transform(&mut self, importer: &mut Importer, name: &'static str) -> DAffine3 {
        let Some(prop) = self.get(name) else { return DAffine3::IDENTITY };
        match prop.value {
            Value::Transform(m) if importer.check_placement(prop.at, m) => m,
            Value::Transform(_) => DAffine3::IDENTITY,
            _ => {
                Self::wrong_type(importer, prop, "<transform>");
                DAffine3::IDENTITY
            }
        }
    }

    /// A colour, each component within `bound`, or a grey.
    pub fn rgb(&mut self, importer: &mut Importer, name: &'static str, bound: Bound) -> Option<Rgb> {
        let prop = self.get(name)?;
        let c = match prop.value {
            Value::Rgb(c) => c,
            Value::Float(v) => DVec3::splat(v),
            Value::Integer(v) => DVec3::splat(v as f64),
            _ => {
                Self::wrong_type(importer, prop, "<rgb>");
                return None;
            }
        };
        for v in c.to_array() {
            checked(importer, prop.at, name, v, bound)?;
        }
        Some(Rgb::from(c.as_vec3().to_array()))
    }

    /// The child called `name`.
    pub fn named_child(&mut self, name: &'static str) -> Option<(&'d Child, NodeId)> {
        self.asked.push(name);
        let index = self.children.iter().position(|(c, _)| c.name == name)?;
        Some(self.children.remove(index))
    }

    /// All children whose object is a `tag`, in their order.
    pub fn children(&mut self, document: &Document, tag: &str) -> Vec<(&'d Child, NodeId)> {
        let (taken, left) = self.children.drain(..).partition(|(_, id)| document.nodes[*id].tag == tag);
        self.children = left;
        taken
    }

    /// Warns of parameters that nobody asked for, unless they are `harmless`, and refuses objects that nobody asked for.
    pub fn finish(self, importer: &mut Importer, document: &Document, harmless: &[&str]) {
        let Node { tag, plugin, .. } = self.node;
        for prop in &self.node.props {
            let name = prop.name.as_str();
            if !self.asked.contains(&name) && !harmless.contains(&name) {
                let near = nearest(name, self.asked.iter().copied());
                let help = near.map_or(String::new(), |n| format!("did you mean `{n}`?"));
                importer.warn(
                    prop.at,
                    format!("the {tag} `{plugin}` knows no parameter `{name}`: it is ignored"),
                    help,
                );
            }
        }
        for (child, id) in self.children {
            let other = &document.nodes[id];
            let message = format!("the {} `{}` has no place in the {tag} `{plugin}`", other.tag, other.plugin);
            let near = nearest(&child.name, self.asked.iter().copied()).filter(|_| !child.name.is_empty());
            importer.error(child.at, message, near.map_or(String::new(), |n| format!("did you mean the name `{n}`?")));
        }
    }
}

/// The value, or an error when it is out of bounds.
fn checked(importer: &mut Importer, at: Place, name: &str, value: f64, bound: Bound) -> Option<f64> {
    if bound.allows(value) {
        return Some(value);
    }
    importer.error(at, format!("`{name}` is {value}, expected {}", bound.expected()), "");
    None
}
