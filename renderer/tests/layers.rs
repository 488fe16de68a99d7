//! The layers of the renderer import only downward, in the order that its front page gives.

use std::fs;
use std::path::{Path, PathBuf};

/// Modules that every layer may use.
const SHARED: [&str; 1] = ["diagnostics"];

fn source() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("src")
}

fn read(path: &Path) -> String {
    fs::read_to_string(path).unwrap_or_default()
}

/// The layers from the lowest, as the line of `lib.rs` that starts with `math` lists them.
fn order(lib: &str) -> Vec<String> {
    let line = lib.lines().find_map(|l| l.strip_prefix("//! `math")).unwrap_or_default();
    let line = format!("math{}", line.split('`').next().unwrap_or_default());
    line.split("->").flat_map(|layer| layer.split(',')).map(|name| name.trim().to_owned()).collect()
}

/// Every module that a source text names as `crate::module` or in `crate::{...}`, comments left out.
fn imports(text: &str) -> Vec<String> {
    let code: String = text.lines().map(|l| l.split("//").next().unwrap_or_default()).collect::<Vec<_>>().join("\n");
    let mut names = Vec::new();
    for rest in code.split("crate::").skip(1) {
        if let Some(group) = rest.strip_prefix('{') {
            names.extend(heads(group));
        } else {
            names.push(identifier(rest));
        }
    }
    names.retain(|n| n.chars().next().is_some_and(|c| c.is_ascii_lowercase()));
    names
}

/// The first segment of each path of a `{a::b, c::{d, e}}` group, given what follows its brace.
fn heads(group: &str) -> Vec<String> {
    let (mut depth, mut at_head, mut names) = (1, true, Vec::new());
    for (i, c) in group.char_indices() {
        match c {
            '{' => depth += 1,
            '}' => depth -= 1,
            ',' if depth == 1 => at_head = true,
            c if at_head && !c.is_whitespace() => {
                names.push(identifier(&group[i..]));
                at_head = false;
            }
            _ => {}
        }
        if depth == 0 {
            break;
        }
    }
    names
}

fn identifier(text: &str) -> String {
    text.chars().take_while(|c| c.is_ascii_alphanumeric() || *c == '_').collect()
}

/// The Rust files below a folder.
fn files(folder: &Path) -> Vec<PathBuf> {
    let mut found = Vec::new();
    for entry in fs::read_dir(folder).into_iter().flatten().flatten() {
        let path = entry.path();
        if path.is_dir() {
            found.extend(files(&path));
        } else if path.extension().is_some_and(|e| e == "rs") {
            found.push(path);
        }
    }
    found
}

#[test]
fn layers_import_only_downward() {
    let lib = read(&source().join("lib.rs"));
    let order = order(&lib);
    assert!(order.len() > 10, "no list of layers in lib.rs: {order:?}");
    let rank = |name: &str| order.iter().position(|o| o == name);
    // Every module has its place.
    let modules: Vec<_> = lib.lines().filter_map(|l| l.strip_prefix("pub mod ")?.strip_suffix(';')).collect();
    for module in &modules {
        assert!(
            SHARED.contains(module) || rank(module).is_some(),
            "`{module}` has no place among the layers in lib.rs"
        );
    }
    // Every import goes down.
    let mut wrong = Vec::new();
    let mut seen = 0;
    for (place, layer) in order.iter().enumerate().filter(|(_, layer)| modules.contains(&layer.as_str())) {
        for file in files(&source().join(layer)) {
            for import in imports(&read(&file)) {
                seen += 1;
                let fine = import == *layer || SHARED.contains(&import.as_str());
                if !fine && rank(&import).is_none_or(|r| r >= place) {
                    wrong.push(format!("{}: `{layer}` imports `{import}`", file.display()));
                }
            }
        }
    }
    assert!(seen > 100, "only {seen} imports found");
    assert!(wrong.is_empty(), "imports that go up:\n{}", wrong.join("\n"));
}

#[test]
fn imports_are_found_in_every_form() {
    let text = "use crate::math::Vec3; // crate::job\nuse crate::{film::{self, tile}, light, path::mis::{a, b}};\n/// [`crate::scene`]\nlet x = crate::bsdf::roster(); crate::FINGERPRINT";
    assert_eq!(imports(text), ["math", "film", "light", "path", "bsdf"]);
}
