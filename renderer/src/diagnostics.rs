//! What is wrong with an input: file, place, what was expected, what to do. All faults of a scene are collected, then shown at once.

use std::fmt;

/// Whether a diagnostic stops the scene from loading.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Severity {
    /// The scene can't be rendered.
    Error,
    /// The scene renders, but something is ignored or replaced.
    Warning,
}

/// One fault in one place.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Diagnostic {
    /// Error or warning.
    pub severity: Severity,
    /// The file's path as the user or the scene wrote it.
    pub file: String,
    /// The place in it: `line 12, column 5`, `materials[3].pbrMetallicRoughness`, `byte 120`; empty for the whole file.
    pub place: String,
    /// What is wrong and what was expected.
    pub message: String,
    /// What to do about it; empty when the message says it all.
    pub help: String,
}

impl fmt::Display for Diagnostic {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let kind = match self.severity {
            Severity::Error => "error",
            Severity::Warning => "warning",
        };
        write!(f, "{kind}: {}", self.file)?;
        if !self.place.is_empty() {
            write!(f, ", {}", self.place)?;
        }
        write!(f, ": {}", self.message)?;
        if !self.help.is_empty() {
            write!(f, "\n  help: {}", self.help)?;
        }
        Ok(())
    }
}

/// A growing list of diagnostics.
#[derive(Clone, Debug, Default)]
pub struct Diagnostics {
    /// In the order found.
    pub list: Vec<Diagnostic>,
}

impl Diagnostics {
    /// Adds an error.
    pub fn error(&mut self, file: &str, place: impl Into<String>, message: impl Into<String>, help: impl Into<String>) {
        self.push(Severity::Error, file, place.into(), message.into(), help.into());
    }

    /// Adds a warning.
    pub fn warn(&mut self, file: &str, place: impl Into<String>, message: impl Into<String>, help: impl Into<String>) {
        self.push(Severity::Warning, file, place.into(), message.into(), help.into());
    }

    /// Whether an error is among them.
    pub fn has_errors(&self) -> bool {
        self.list.iter().any(|d| d.severity == Severity::Error)
    }

    fn push(&mut self, severity: Severity, file: &str, place: String, message: String, help: String) {
        self.list.push(Diagnostic { severity, file: file.into(), place, message, help });
    }
}

/// The faults that stopped a scene from loading (and the warnings met on the way).
#[derive(Clone, Debug, thiserror::Error)]
pub struct SceneError(pub Vec<Diagnostic>);

impl fmt::Display for SceneError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        for (i, d) in self.0.iter().enumerate() {
            if i > 0 {
                writeln!(f)?;
            }
            write!(f, "{d}")?;
        }
        Ok(())
    }
}

/// Longer names are no slip of the pen, and the distance of two names takes time and memory of their lengths' product.
const MAX_NAME: usize = 64;
/// No more names than this are compared.
const MAX_KNOWN: usize = 1000;

/// The nearest of `known` to `name`, when it is near enough to be a likely slip of the pen.
pub fn nearest<'a>(name: &str, known: impl IntoIterator<Item = &'a str>) -> Option<&'a str> {
    if name.len() > MAX_NAME {
        return None;
    }
    known
        .into_iter()
        .take(MAX_KNOWN)
        .filter(|k| k.len() <= MAX_NAME)
        .map(|k| (strsim::damerau_levenshtein(&name.to_lowercase(), &k.to_lowercase()), k))
        .filter(|(d, k)| *d <= 1 + k.len().max(name.len()) / 3)
        .min()
        .map(|(_, k)| k)
}
