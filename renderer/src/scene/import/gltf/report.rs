//! Faults and warnings of one file, each said once.

use crate::diagnostics::Diagnostics;
use std::collections::{BTreeMap, BTreeSet};

/// Faults (and, apart, warnings) of one file beyond this number are only counted: a hostile file could hold millions.
const MOST: usize = 100;
/// Characters that are kept of a text from the file (a name, say), and of a message: a hostile file could hold a name of megabytes.
const LONGEST_NAME: usize = 80;
const LONGEST_MESSAGE: usize = 1000;
/// Places listed in a summary before "and more".
const MOST_PLACES: usize = 8;

/// What is wrong in one place of the file; it stops the part that holds it from loading.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(super) struct Fault {
    /// `materials[3].normalTexture`.
    pub place: String,
    /// What is wrong and what was expected.
    pub message: String,
    /// What to do about it.
    pub help: String,
}

impl Fault {
    /// A fault whose message says it all.
    pub(super) fn new(place: impl Into<String>, message: impl Into<String>) -> Self {
        Self { place: place.into(), message: cut(&message.into(), LONGEST_MESSAGE), help: String::new() }
    }

    /// With advice.
    pub(super) fn help(mut self, help: impl Into<String>) -> Self {
        self.help = help.into();
        self
    }
}

/// A text from the file, cut to a length that is fit for a name.
pub(super) fn shorten(text: &str) -> String {
    cut(text, LONGEST_NAME)
}

fn cut(text: &str, most: usize) -> String {
    match text.char_indices().nth(most) {
        Some((end, _)) => format!("{}...", &text[..end]),
        None => text.to_string(),
    }
}

/// The result of reading one part of a file.
pub(super) type Checked<T> = Result<T, Fault>;

/// Collects faults, warnings, and warnings that are summed up over all the places where they arise.
pub(super) struct Report<'a> {
    file: &'a str,
    diagnostics: &'a mut Diagnostics,
    seen: BTreeSet<Fault>,
    faults: usize,
    warnings: usize,
    sums: BTreeMap<(String, String), BTreeSet<String>>,
}

impl<'a> Report<'a> {
    /// An empty report about `file`.
    pub(super) fn new(file: &'a str, diagnostics: &'a mut Diagnostics) -> Self {
        Self { file, diagnostics, seen: BTreeSet::new(), faults: 0, warnings: 0, sums: BTreeMap::new() }
    }

    /// Whether anything stops the file from loading.
    pub(super) fn failed(&self) -> bool {
        self.faults > 0
    }

    /// Records an error.
    pub(super) fn fault(&mut self, fault: Fault) {
        if !self.seen.contains(&fault) {
            self.faults += 1;
            if self.faults <= MOST {
                self.diagnostics.error(self.file, fault.place.clone(), fault.message.clone(), fault.help.clone());
                self.seen.insert(fault);
            }
        }
    }

    /// Records a warning.
    pub(super) fn warn(&mut self, warning: Fault) {
        if !self.seen.contains(&warning) {
            self.warnings += 1;
            if self.warnings <= MOST {
                self.diagnostics.warn(self.file, warning.place.clone(), warning.message.clone(), warning.help.clone());
                self.seen.insert(warning);
            }
        }
    }

    /// Notes one more place for a warning that is given once, for all of its places.
    pub(super) fn sum(&mut self, message: impl Into<String>, help: impl Into<String>, place: impl Into<String>) {
        self.sums.entry((message.into(), help.into())).or_default().insert(place.into());
    }

    /// The value, or `None` with the fault recorded.
    pub(super) fn check<T>(&mut self, result: Checked<T>) -> Option<T> {
        result.map_err(|fault| self.fault(fault)).ok()
    }

    /// Gives the summed-up warnings and the number of what was left out.
    pub(super) fn finish(mut self) {
        for ((message, help), places) in std::mem::take(&mut self.sums) {
            let mut place = places.iter().take(MOST_PLACES).cloned().collect::<Vec<_>>().join(", ");
            if places.len() > MOST_PLACES {
                place += &format!(" and {} more", places.len() - MOST_PLACES);
            }
            self.warn(Fault::new(place, message).help(help));
        }
        let left_out = |n: usize, what: &str| format!("{} more {what} are not listed", n.saturating_sub(MOST));
        if self.faults > MOST {
            self.diagnostics.error(self.file, "", left_out(self.faults, "errors"), "mend those listed first");
        }
        if self.warnings > MOST {
            self.diagnostics.warn(self.file, "", left_out(self.warnings, "warnings"), "");
        }
    }
}
