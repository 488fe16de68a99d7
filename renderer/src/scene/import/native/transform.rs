//! Transforms: a list of steps, each applied after those before it.

use super::table::{Item, Table};
use crate::math::{DAffine3, DMat3, DVec3};
use crate::scene::import::importer::Importer;
use crate::scene::import::number::Bound;
use crate::scene::import::transform::{look_along_z, rotate};
use toml::de::DeValue;

/// The transform `item`; the identity after an error.
pub(super) fn read(importer: &mut Importer, name: &str, item: Item) -> DAffine3 {
    let Some(steps) = item.list(importer, name, "a list of steps like { translate = [0, 1, 0] }") else {
        return DAffine3::IDENTITY;
    };
    let mut all = DAffine3::IDENTITY;
    for step_item in steps {
        let Some(mut table) = step_item.table(importer, "a step of a transform") else { continue };
        if let Some(map) = step(importer, &mut table) {
            all = map * all;
        }
        table.finish(importer);
    }
    if importer.check_placement(item.at, all) { all } else { DAffine3::IDENTITY }
}

/// The transform in `table`, or the identity.
pub(super) fn of(importer: &mut Importer, table: &mut Table) -> DAffine3 {
    table.get("transform").map_or(DAffine3::IDENTITY, |item| read(importer, "transform", item))
}

/// Every action of a step, of which there must be one.
fn step(importer: &mut Importer, table: &mut Table) -> Option<DAffine3> {
    let mut actions = 0;
    let mut result = None;
    let mut act = |map: Option<DAffine3>| {
        actions += 1;
        result = map;
    };
    if table.has("translate") {
        act(table.vector(importer, "translate").map(DAffine3::from_translation));
    }
    if let Some(item) = table.get("scale") {
        act(scale(importer, item).map(DAffine3::from_scale));
    }
    for (key, axis) in [("rotate_x", DVec3::X), ("rotate_y", DVec3::Y), ("rotate_z", DVec3::Z)] {
        if table.has(key) {
            act(table.number(importer, key, Bound::Any).and_then(|degrees| rotate(axis, degrees)));
        }
    }
    if let Some(item) = table.get("rotate") {
        act(rotation(importer, table, item));
    }
    if let Some(item) = table.get("matrix") {
        act(matrix(importer, item));
    }
    if let Some(item) = table.get("look_at") {
        act(item.table(importer, "look_at").and_then(|mut look| {
            let map = look_at(importer, &mut look);
            look.finish(importer);
            map
        }));
    }
    // Names for did-you-mean, also of what this step does not use.
    for key in ["translate", "rotate_x", "rotate_y", "rotate_z", "axis"] {
        table.get(key);
    }
    // A step with nothing but unknown keys is reported for these.
    if actions > 1 || actions == 0 && (table.is_empty() || table.has("axis")) {
        let help = "one of translate, scale, rotate_x, rotate_y, rotate_z, rotate with axis, matrix, look_at";
        importer.error(table.at, format!("a step of a transform needs one action, found {actions}"), help);
    }
    result
}

/// A number, or three.
fn scale(importer: &mut Importer, item: Item) -> Option<DVec3> {
    match item.value {
        DeValue::Array(_) => item.numbers(importer, "scale", Bound::Any).map(DVec3::from_array),
        _ => item.number(importer, "scale", Bound::Any).map(DVec3::splat),
    }
}

fn rotation(importer: &mut Importer, table: &mut Table, item: Item) -> Option<DAffine3> {
    let degrees = item.number(importer, "rotate", Bound::Any);
    let axis = table.required_vector(importer, "axis");
    let map = rotate(axis?, degrees?);
    if map.is_none() {
        importer.error(item.at, "the axis of the rotation has no length", "");
    }
    map
}

/// Three rows of four numbers.
fn matrix(importer: &mut Importer, item: Item) -> Option<DAffine3> {
    let rows: [Item; 3] = item.exactly(importer, "matrix", "three rows of four numbers")?;
    let mut m = [[0.0; 4]; 3];
    for (row, item) in m.iter_mut().zip(rows) {
        *row = item.numbers(importer, "a row of the matrix", Bound::Any)?;
    }
    let column = |c: usize| DVec3::new(m[0][c], m[1][c], m[2][c]);
    Some(DAffine3::from_mat3_translation(DMat3::from_cols(column(0), column(1), column(2)), column(3)))
}

/// From the keys `from`, `to` and `up` (+Y by default): +Z points from `from` to `to`, +Y is near `up`.
pub(super) fn look_at(importer: &mut Importer, table: &mut Table) -> Option<DAffine3> {
    let (from, to) = (table.required_vector(importer, "from"), table.required_vector(importer, "to"));
    let up = table.vector(importer, "up").unwrap_or(DVec3::Y);
    let map = look_along_z(from?, to?, up);
    if map.is_none() {
        importer.error(table.at, "`from` and `to` are the same point, or `up` points along the view", "");
    }
    map
}
