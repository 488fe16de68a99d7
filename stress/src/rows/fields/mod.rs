//! NaN and infinity in every number of a scene file: refused with the file and the place, never a panic.

mod gltf;
mod text;

use crate::probe::Probe;
use renderer::diagnostics::Severity;
use renderer::scene::Scene;
use renderer::scene::bundle::MemorySource;
use std::ops::Range;
use std::panic::{AssertUnwindSafe, catch_unwind};

/// A scene file in which one number is replaced at a time.
struct Document<'a> {
    /// Its name.
    name: &'a str,
    text: &'a str,
    /// Its numbers.
    numbers: Vec<Range<usize>>,
    /// What they are replaced by.
    bad: &'a [&'a str],
}

/// All formats.
pub fn fields(probe: &mut Probe) {
    let toml = Document {
        name: "scene.toml",
        text: text::TOML,
        numbers: text::outside_of_strings(text::TOML, Some('#')),
        bad: &["nan", "inf", "-inf", "1e39", "-1e39", "1e400"],
    };
    let xml = Document {
        name: "scene.xml",
        text: text::XML,
        numbers: text::attributes(text::XML),
        bad: &["NaN", "inf", "-inf", "Infinity", "1e39", "-1e39", "1e400"],
    };
    for document in [toml, xml] {
        replaced(probe, &document, true);
    }
    gltf::fields(probe);
    meshes(probe);
}

/// Each number of a document replaced by each of the bad ones.
fn replaced(probe: &mut Probe, document: &Document<'_>, has_lines: bool) {
    let Document { name, text, numbers, bad } = document;
    let sound = load(name, vec![(name, text.as_bytes().to_vec())]);
    if !probe.holds(sound.is_ok(), || {
        format!("{name}: the sound scene is refused: {}", sound.clone().err().unwrap_or_default())
    }) {
        return;
    }
    probe.figure(format!("{} numbers in {name}", numbers.len()));
    for number in numbers {
        let line = text[..number.start].matches('\n').count() + 1;
        let source = text.lines().nth(line - 1).unwrap_or_default().trim();
        for bad in *bad {
            let changed = format!("{}{bad}{}", &text[..number.start], &text[number.end..]);
            // Numbers that f64 holds may be told of where they are put together, such as a shape's transform; or do no harm.
            let far = bad.contains("1e39") && name.ends_with(".xml");
            let place = has_lines.then(|| if far { "line ".into() } else { format!("line {line},") });
            if far && load(name, vec![(name, changed.clone().into_bytes())]).is_ok() {
                continue;
            }
            refused(
                probe,
                name,
                &format!("{bad} for {} in line {line}, `{source}`", &text[number.clone()]),
                place,
                vec![(name, changed.into_bytes())],
            );
        }
    }
}

/// The scene must be refused, and the message must tell where.
fn refused(probe: &mut Probe, root: &str, what: &str, place: Option<String>, files: Vec<(&str, Vec<u8>)>) {
    match load(root, files) {
        Ok(warnings) => {
            // What is replaced is said, with its place.
            let told = place.as_ref().is_some_and(|p| warnings.contains(p.as_str()));
            probe.holds(told, || format!("{root}: {what} is taken, and said is: {warnings:?}"));
        }
        Err(message) => {
            let told = place.as_ref().is_none_or(|p| message.contains(p.as_str()));
            probe.holds(told, || format!("{root}: {what}: no place {place:?} in: {message}"));
        }
    }
}

/// Loads a scene; the warnings, or what is wrong with it, in one text.
fn load(root: &str, files: Vec<(&str, Vec<u8>)>) -> Result<String, String> {
    let files = MemorySource { files: files.into_iter().map(|(n, b)| (n.to_string(), b.into())).collect() };
    let loaded = catch_unwind(AssertUnwindSafe(|| Scene::load(&files, root)));
    match loaded {
        Ok(Ok((_, said))) => Ok(said.list.iter().map(ToString::to_string).collect::<Vec<_>>().join("; ")),
        Ok(Err(e)) => {
            let errors = e.0.iter().filter(|d| d.severity == Severity::Error);
            let text: Vec<String> = errors.map(|d| format!("{}, {}: {}", d.file, d.place, d.message)).collect();
            // An error that names no file would be of no use.
            if e.0.iter().all(|d| d.severity != Severity::Error || d.file.is_empty()) {
                return Err("(no file is named)".into());
            }
            Err(text.join("; "))
        }
        Err(_) => Err("it panics".into()),
    }
}

/// Coordinates in mesh files.
fn meshes(probe: &mut Probe) {
    let scene = "[camera]\nfrom = [0, 0, 3]\nto = [0, 0, 0]\n[[shapes]]\nkind = 'mesh'\nfile = 'MESH'\n";
    let obj = "v 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\nvt 1 0\nvt 0 1\nvn 0 0 1\nf 1/1/1 2/2/1 3/3/1\n";
    let ply = "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float z\nproperty float nx\nproperty float ny\nproperty float nz\nproperty float u\nproperty float v\nelement face 1\nproperty list uchar int vertex_indices\nend_header\n0 0 0 0 0 1 0 0\n1 0 0 0 0 1 1 0\n0 1 0 0 0 1 0 1\n3 0 1 2\n";
    for (name, text, start) in [("m.obj", obj, 0), ("m.ply", ply, ply.find("end_header").unwrap_or(0))] {
        let root = scene.replace("MESH", name).into_bytes();
        let files = |text: String| vec![("scene.toml", root.clone()), (name, text.into_bytes())];
        let sound = load("scene.toml", files(text.into()));
        probe.holds(sound.is_ok(), || format!("{name}: the sound mesh is refused: {sound:?}"));
        for number in text::outside_of_strings(text, None) {
            // Not the indices of faces.
            let line = text[..number.start].rsplit('\n').next().unwrap_or_default();
            let face = line.starts_with("f ") || text[number.start..].lines().count() == 1 && name == "m.ply";
            if number.start < start || face {
                continue;
            }
            for bad in ["nan", "inf", "-inf", "1e39", "1e400"] {
                let changed = format!("{}{bad}{}", &text[..number.start], &text[number.end..]);
                refused(
                    probe,
                    "scene.toml",
                    &format!("{name}: {bad} for the number at byte {}", number.start),
                    Some(name.into()),
                    files(changed),
                );
            }
        }
    }
}
