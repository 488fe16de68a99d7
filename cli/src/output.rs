//! Standard output (results only), standard error (everything else) and the log.

use crate::exit::Failure;
use serde::Serialize;
use std::fmt::Display;
use std::io::{self, Write};
use tracing_subscriber::EnvFilter;

/// Where results go, and in which form.
#[derive(Clone, Copy, Debug)]
pub struct Console {
    /// JSON lines instead of text.
    pub json: bool,
}

impl Console {
    /// `json` = the `--json` flag.
    pub fn new(json: bool) -> Self {
        Self { json }
    }

    /// A result: `text` for people or one line of JSON for scripts, on standard output.
    pub fn result(&self, text: impl Display, json: &impl Serialize) {
        if self.json {
            self.event(json);
        } else {
            put(io::stdout(), &text.to_string());
        }
    }

    /// A line for scripts only: shown with `--json`.
    pub fn event(&self, json: &impl Serialize) {
        if self.json {
            match serde_json::to_string(json) {
                Ok(line) => put(io::stdout(), &line),
                Err(e) => tracing::error!("a result can't be written as JSON: {e}"),
            }
        }
    }

    /// A remark for people, on standard error in both forms.
    pub fn note(&self, text: impl Display) {
        put(io::stderr(), &text.to_string());
    }

    /// Says why the command failed: on standard error, and as a last line of JSON.
    pub fn failure(&self, failure: &Failure) {
        if *failure != Failure::Interrupted {
            self.note(failure);
        }
        self.event(&serde_json::json!({"event": "error", "status": failure.status(), "message": failure.to_string()}));
    }
}

/// A line; a reader that went away is no error.
fn put(mut to: impl Write, text: &str) {
    let _ = writeln!(to, "{text}").and_then(|()| to.flush());
}

/// Logs to standard error; `RUST_LOG` overrides `level`.
pub fn start_log(level: &str) {
    let filter = EnvFilter::try_from_default_env().unwrap_or_else(|_| EnvFilter::new(level));
    tracing_subscriber::fmt().with_env_filter(filter).with_writer(io::stderr).init();
}
