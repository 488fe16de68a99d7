//! A scene: its description (what importers make), its files (what the farm ships), and the immutable renderable form.

pub mod bundle;
pub mod desc;
pub mod import;
