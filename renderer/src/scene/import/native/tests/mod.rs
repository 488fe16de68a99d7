//! Scenes in TOML: what comes out of each key, and what is said of each fault.

mod faults;
mod features;
mod media;
mod shipped;

/// A complete scene around `content`.
fn document(content: &str) -> String {
    format!("camera = {{ from = [0, 0, 5], to = [0, 0, 0] }}\n{content}")
}
