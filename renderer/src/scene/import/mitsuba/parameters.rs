//! `$parameters` of a Mitsuba scene.

use crate::diagnostics::nearest;
use std::collections::BTreeMap;

/// A parameter may not make a value longer than this many bytes.
const MAX_SUBSTITUTED: usize = 1 << 16;

/// More parameters are refused.
const MAX_PARAMETERS: usize = 1000;

/// What `<default>` elements have set.
#[derive(Debug, Default)]
pub(super) struct Parameters(BTreeMap<String, String>);

impl Parameters {
    /// Sets `name` unless it has a value already.
    pub fn set_default(&mut self, name: &str, value: &str) -> Result<(), String> {
        if self.0.len() >= MAX_PARAMETERS {
            return Err(format!("there are more than {MAX_PARAMETERS} parameters"));
        }
        self.0.entry(name.to_string()).or_insert_with(|| value.to_string());
        Ok(())
    }

    /// Replaces `$name` by the parameter's value; the longest known name wins, `\$` stays a dollar sign.
    pub fn substitute(&self, text: &str) -> Result<String, String> {
        let mut out = String::new();
        let mut rest = text;
        while let Some(dollar) = rest.find('$') {
            if let Some(before) = rest[..dollar].strip_suffix('\\') {
                out.push_str(before);
                out.push('$');
                rest = &rest[dollar + 1..];
                continue;
            }
            out.push_str(&rest[..dollar]);
            rest = &rest[dollar + 1..];
            let known = self.0.iter().filter(|(name, _)| rest.starts_with(name.as_str()));
            let Some((name, value)) = known.max_by_key(|(name, _)| name.len()) else {
                return Err(self.unknown(rest));
            };
            out.push_str(value);
            rest = &rest[name.len()..];
            if out.len() > MAX_SUBSTITUTED {
                return Err(format!("parameters make a value longer than {MAX_SUBSTITUTED} bytes"));
            }
        }
        out.push_str(rest);
        Ok(out)
    }

    fn unknown(&self, rest: &str) -> String {
        let end = rest.find(|c: char| !c.is_alphanumeric() && c != '_').unwrap_or(rest.len());
        let name = &rest[..end];
        let near = nearest(name, self.0.keys().map(String::as_str));
        let hint = near.map_or("set it by <default name=... value=...>".into(), |n| format!("did you mean ${n}?"));
        format!("the parameter ${name} has no value; {hint}")
    }
}
