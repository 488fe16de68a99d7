//! A table of a TOML file: keys asked for by name, checked, and what nobody asked for reported.

use crate::diagnostics::nearest;
use crate::math::DVec3;
use crate::scene::import::importer::{Importer, Place};
use crate::scene::import::number::Bound;
use crate::spectrum::Rgb;
use toml::Spanned;
use toml::de::{DeString, DeTable, DeValue};

/// A value and where it stands.
#[derive(Clone, Copy)]
pub(super) struct Item<'t> {
    pub value: &'t DeValue<'t>,
    pub at: Place,
}

impl<'t> Item<'t> {
    fn new(file: usize, spanned: &'t Spanned<DeValue<'t>>) -> Self {
        Self { value: spanned.get_ref(), at: Place { file, offset: spanned.span().start } }
    }

    /// Reports that it is not what was expected.
    pub fn wrong(&self, importer: &mut Importer, name: &str, expected: &str) {
        let found = match self.value {
            DeValue::String(text) => format!("the string {:?}", text.chars().take(40).collect::<String>()),
            DeValue::Integer(_) | DeValue::Float(_) => "a number".into(),
            DeValue::Boolean(v) => v.to_string(),
            DeValue::Datetime(_) => "a date".into(),
            DeValue::Array(list) => format!("a list of {}", list.len()),
            DeValue::Table(_) => "a table".into(),
        };
        importer.error(self.at, format!("`{name}` is {found}, expected {expected}"), "");
    }

    /// A number, not yet checked.
    fn as_number(&self) -> Option<f64> {
        match self.value {
            DeValue::Float(v) => v.as_str().parse().ok(),
            DeValue::Integer(v) => i64::from_str_radix(v.as_str(), v.radix()).ok().map(|v| v as f64),
            _ => None,
        }
    }

    /// A number within `bound`.
    pub fn number(&self, importer: &mut Importer, name: &str, bound: Bound) -> Option<f64> {
        let Some(value) = self.as_number() else {
            self.wrong(importer, name, &bound.expected());
            return None;
        };
        if bound.allows(value) {
            return Some(value);
        }
        importer.error(self.at, format!("`{name}` is {value}, expected {}", bound.expected()), "");
        None
    }

    /// A whole number from `low` to `high`.
    pub fn integer(&self, importer: &mut Importer, name: &str, low: i64, high: i64) -> Option<i64> {
        let value = match self.value {
            DeValue::Integer(v) => i64::from_str_radix(v.as_str(), v.radix()).ok(),
            _ => None,
        };
        if let Some(v) = value.filter(|v| (low..=high).contains(v)) {
            return Some(v);
        }
        let expected = format!("a whole number from {low} to {high}");
        match self.as_number() {
            Some(v) => importer.error(self.at, format!("`{name}` is {v}, expected {expected}"), ""),
            None => self.wrong(importer, name, &expected),
        }
        None
    }

    /// The elements of a list.
    pub fn list(&self, importer: &mut Importer, name: &str, expected: &str) -> Option<Vec<Item<'t>>> {
        match self.value {
            DeValue::Array(list) => Some(list.iter().map(|v| Item::new(self.at.file, v)).collect()),
            _ => {
                self.wrong(importer, name, expected);
                None
            }
        }
    }

    /// The elements of a list of exactly `N`.
    pub fn exactly<const N: usize>(
        &self,
        importer: &mut Importer,
        name: &str,
        expected: &str,
    ) -> Option<[Item<'t>; N]> {
        let list = self.list(importer, name, expected)?;
        let found = list.try_into().ok();
        if found.is_none() {
            self.wrong(importer, name, expected);
        }
        found
    }

    /// A list of exactly `N` numbers within `bound`.
    pub fn numbers<const N: usize>(&self, importer: &mut Importer, name: &str, bound: Bound) -> Option<[f64; N]> {
        let list: [Item; N] = self.exactly(importer, name, &format!("a list of {N} numbers"))?;
        let mut out = [0.0; N];
        for (slot, item) in out.iter_mut().zip(list) {
            *slot = item.number(importer, name, bound)?;
        }
        Some(out)
    }

    /// A list of lists of `N` numbers.
    pub fn points<const N: usize>(&self, importer: &mut Importer, name: &str) -> Option<Vec<[f64; N]>> {
        let list = self.list(importer, name, &format!("a list of lists of {N} numbers"))?;
        let mut out = Vec::with_capacity(list.len());
        for item in list {
            out.push(item.numbers(importer, name, Bound::Any)?);
        }
        Some(out)
    }

    /// A grey, three numbers, or `"#rrggbb"` in sRGB.
    pub fn rgb(&self, importer: &mut Importer, name: &str, bound: Bound) -> Option<Rgb> {
        match self.value {
            DeValue::String(text) => {
                let digits = text.strip_prefix('#').filter(|hex| hex.len() == 6);
                let Some(v) = digits.and_then(|hex| u32::from_str_radix(hex, 16).ok()) else {
                    self.wrong(importer, name, "a number, [red, green, blue] or \"#rrggbb\"");
                    return None;
                };
                Some(Rgb::from([v >> 16, v >> 8 & 255, v & 255].map(|v| super::texture::srgb_to_linear(v as u8))))
            }
            DeValue::Array(_) => {
                let [r, g, b] = self.numbers(importer, name, bound)?;
                Some(Rgb::new(r as f32, g as f32, b as f32))
            }
            _ => self.number(importer, name, bound).map(|v| Rgb::splat(v as f32)),
        }
    }

    /// A string.
    pub fn string(&self, importer: &mut Importer, name: &str) -> Option<&'t str> {
        if let DeValue::String(text) = self.value {
            return Some(text);
        }
        self.wrong(importer, name, "a string");
        None
    }

    /// A table.
    pub fn table(&self, importer: &mut Importer, name: &str) -> Option<Table<'t>> {
        if let DeValue::Table(entries) = self.value {
            return Some(Table { at: self.at, name: name.to_string(), entries, asked: Vec::new() });
        }
        self.wrong(importer, name, "a table");
        None
    }
}

/// Reads one table.
pub(super) struct Table<'t> {
    /// Where it starts.
    pub at: Place,
    /// For messages.
    pub name: String,
    entries: &'t DeTable<'t>,
    asked: Vec<&'static str>,
}

impl<'t> Table<'t> {
    /// The table that is the whole file.
    pub fn root(file: usize, entries: &'t DeTable<'t>) -> Self {
        Self { at: Place { file, offset: 0 }, name: "the scene".into(), entries, asked: Vec::new() }
    }

    /// The value of `key`.
    pub fn get(&mut self, key: &'static str) -> Option<Item<'t>> {
        self.asked.push(key);
        self.entries.get(key).map(|v| Item::new(self.at.file, v))
    }

    /// Whether `key` is given.
    pub fn has(&self, key: &str) -> bool {
        self.entries.contains_key(key)
    }

    /// Whether nothing is given.
    pub fn is_empty(&self) -> bool {
        self.entries.is_empty()
    }

    /// The value of `key`, or an error that it is missing.
    pub fn require(&mut self, importer: &mut Importer, key: &'static str, expected: &str) -> Option<Item<'t>> {
        let item = self.get(key);
        if item.is_none() {
            importer.error(self.at, format!("{} has no `{key}`, expected {expected}", self.name), "");
        }
        item
    }

    /// All entries: name, its place, value.
    pub fn all(&self) -> impl Iterator<Item = (&'t str, Place, Item<'t>)> + use<'t> {
        let file = self.at.file;
        let entry = move |(k, v): (&'t Spanned<DeString<'t>>, &'t Spanned<DeValue<'t>>)| {
            (k.get_ref().as_ref(), Place { file, offset: k.span().start }, Item::new(file, v))
        };
        self.entries.iter().map(entry)
    }

    /// A number within `bound`.
    pub fn number(&mut self, importer: &mut Importer, key: &'static str, bound: Bound) -> Option<f64> {
        self.get(key)?.number(importer, key, bound)
    }

    /// A number within `bound`, or the default.
    pub fn number_or(&mut self, importer: &mut Importer, key: &'static str, bound: Bound, default: f64) -> f64 {
        self.number(importer, key, bound).unwrap_or(default)
    }

    /// A whole number from `low` to `high`.
    pub fn integer(&mut self, importer: &mut Importer, key: &'static str, low: i64, high: i64) -> Option<i64> {
        self.get(key)?.integer(importer, key, low, high)
    }

    /// A truth value.
    pub fn boolean(&mut self, importer: &mut Importer, key: &'static str, default: bool) -> bool {
        match self.get(key) {
            None => default,
            Some(Item { value: DeValue::Boolean(v), .. }) => *v,
            Some(item) => {
                item.wrong(importer, key, "true or false");
                default
            }
        }
    }

    /// A string and its place.
    pub fn string(&mut self, importer: &mut Importer, key: &'static str) -> Option<(&'t str, Place)> {
        let item = self.get(key)?;
        item.string(importer, key).map(|text| (text, item.at))
    }

    /// One of `choices`; the first is the default.
    pub fn choice<T: Copy>(&mut self, importer: &mut Importer, key: &'static str, choices: &[(&str, T)]) -> T {
        match self.string(importer, key) {
            Some((text, at)) => choose(importer, at, key, text, choices).unwrap_or(choices[0].1),
            None => choices[0].1,
        }
    }

    /// The one of `choices` that `kind` names; it must be given.
    pub fn kind<T: Copy>(&mut self, importer: &mut Importer, choices: &[(&str, T)]) -> Option<T> {
        let names: Vec<&str> = choices.iter().map(|(name, _)| *name).collect();
        let item = self.require(importer, "kind", &format!("one of: {}", names.join(", ")))?;
        let text = item.string(importer, "kind")?;
        choose(importer, item.at, "kind", text, choices)
    }

    /// Three numbers.
    pub fn vector(&mut self, importer: &mut Importer, key: &'static str) -> Option<DVec3> {
        self.get(key)?.numbers(importer, key, Bound::Any).map(DVec3::from_array)
    }

    /// Three numbers that must be given.
    pub fn required_vector(&mut self, importer: &mut Importer, key: &'static str) -> Option<DVec3> {
        let item = self.require(importer, key, "[x, y, z]")?;
        item.numbers(importer, key, Bound::Any).map(DVec3::from_array)
    }

    /// A colour, or the default.
    pub fn rgb(&mut self, importer: &mut Importer, key: &'static str, bound: Bound, default: Rgb) -> Rgb {
        self.get(key).and_then(|item| item.rgb(importer, key, bound)).unwrap_or(default)
    }

    /// A table inside this one.
    pub fn table(&mut self, importer: &mut Importer, key: &'static str) -> Option<Table<'t>> {
        self.get(key)?.table(importer, key)
    }

    /// Reports keys that nobody asked for.
    pub fn finish(mut self, importer: &mut Importer) {
        self.asked.sort_unstable();
        self.asked.dedup();
        for (key, at, _) in self.all() {
            if !self.asked.contains(&key) {
                let near = nearest(key, self.asked.iter().copied()).map(|n| format!("did you mean `{n}`?"));
                let help = near.unwrap_or_else(|| format!("known are: {}", self.asked.join(", ")));
                importer.error(at, format!("{} knows no key `{key}`", self.name), help);
            }
        }
    }
}

/// The one of `choices` that `text` names, or an error.
pub(super) fn choose<T: Copy>(
    importer: &mut Importer,
    at: Place,
    name: &str,
    text: &str,
    choices: &[(&str, T)],
) -> Option<T> {
    let found = choices.iter().find(|(c, _)| *c == text).map(|(_, v)| *v);
    if found.is_none() {
        let known: Vec<&str> = choices.iter().map(|(c, _)| *c).collect();
        let near = nearest(text, known.iter().copied()).map_or(String::new(), |n| format!("did you mean {n:?}?"));
        importer.error(at, format!("`{name}` is {text:?}, expected one of: {}", known.join(", ")), near);
    }
    found
}
