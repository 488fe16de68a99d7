//! An element's attributes, with the checks that all elements share.

use crate::diagnostics::nearest;
use crate::scene::import::importer::{Importer, Place};

/// The attributes of one element, `$parameters` substituted.
#[derive(Debug)]
pub(super) struct Attributes<'x> {
    /// The element's name.
    pub tag: &'x str,
    /// Where it stands.
    pub at: Place,
    list: Vec<(&'x str, String)>,
}

impl<'x> Attributes<'x> {
    /// None yet.
    pub fn new(tag: &'x str, at: Place) -> Self {
        Self { tag, at, list: Vec::new() }
    }

    /// Adds one.
    pub fn push(&mut self, name: &'x str, value: String) {
        self.list.push((name, value));
    }

    /// The value of `name`.
    pub fn get(&self, name: &str) -> Option<&str> {
        self.list.iter().find(|(n, _)| *n == name).map(|(_, v)| v.as_str())
    }

    /// The value of `name`, or an error that it is missing.
    pub fn require(&self, importer: &mut Importer, name: &str) -> Option<&str> {
        let value = self.get(name);
        if value.is_none() {
            let near = nearest(name, self.list.iter().map(|(n, _)| *n).filter(|n| !["name", "type", "id"].contains(n)));
            let help = near.map_or(String::new(), |n| format!("it has `{n}`: a slip of the pen?"));
            importer.error(self.at, format!("<{}> has no attribute `{name}`", self.tag), help);
        }
        value
    }

    /// Warns of attributes that are not `known`.
    pub fn check(&self, importer: &mut Importer, known: &[&str]) {
        for (name, _) in self.list.iter().filter(|(n, _)| !known.contains(n)) {
            let help = nearest(name, known.iter().copied()).map_or(String::new(), |n| format!("did you mean `{n}`?"));
            importer.warn(self.at, format!("<{}> knows no attribute `{name}`: it is ignored", self.tag), help);
        }
    }
}

/// The numbers in `text`, separated by spaces or commas; an error names the first that is none.
pub(super) fn numbers(importer: &mut Importer, at: Place, text: &str) -> Option<Vec<f64>> {
    let words = text.split(|c: char| c == ',' || c.is_ascii_whitespace()).filter(|w| !w.is_empty());
    let mut out = Vec::new();
    for word in words {
        match word.parse::<f64>() {
            Ok(v) if v.is_finite() => out.push(v),
            _ => {
                let shown: String = word.chars().take(40).collect();
                importer.error(at, format!("{shown:?} is not a finite number"), "");
                return None;
            }
        }
    }
    Some(out)
}

/// A single number.
pub(super) fn number(importer: &mut Importer, at: Place, text: &str) -> Option<f64> {
    match numbers(importer, at, text)?.as_slice() {
        [v] => Some(*v),
        list => {
            importer.error(at, format!("expected one number, found {}", list.len()), "");
            None
        }
    }
}
