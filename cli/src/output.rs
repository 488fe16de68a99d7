//! Standard output (results only), standard error (everything else) and the log.

use crate::exit::Failure;
use serde::Serialize;
use std::fmt::Display;
use std::io::{self, IsTerminal, Write};
use tracing_subscriber::filter::{LevelFilter, Targets};
use tracing_subscriber::layer::SubscriberExt;
use tracing_subscriber::util::SubscriberInitExt;

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

/// Logs to standard error; `RUST_LOG` overrides `level` (`info`, or `warn,coordinator=debug`).
pub fn start_log(level: &str) {
    let wanted = std::env::var("RUST_LOG").ok().filter(|v| !v.is_empty());
    let parsed: Option<Result<Targets, _>> = wanted.as_ref().map(|v| v.parse());
    let filter = match &parsed {
        Some(Ok(targets)) => targets.clone(),
        _ => Targets::new().with_default(level.parse::<LevelFilter>().unwrap_or(LevelFilter::WARN)),
    };
    let lines = tracing_subscriber::fmt::layer().with_writer(io::stderr).with_ansi(io::stderr().is_terminal());
    tracing_subscriber::registry().with(lines).with(filter).init();
    if let (Some(text), Some(Err(e))) = (wanted, parsed) {
        tracing::warn!("RUST_LOG={text:?} is not understood: {e}");
    }
}
