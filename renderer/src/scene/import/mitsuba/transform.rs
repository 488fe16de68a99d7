//! `<transform>`: each step is applied after those before it.

use super::value::vector;
use super::xml::{Attributes, number, numbers};
use crate::diagnostics::nearest;
use crate::math::{DAffine3, DMat3, DVec3};
use crate::scene::import::importer::Importer;
use crate::scene::import::transform::{look_along_z, rotate};

/// The steps a transform may have.
const STEPS: [&str; 5] = ["translate", "rotate", "scale", "matrix", "lookat"];

/// The composed map; `None` after an error.
pub(super) fn compose(importer: &mut Importer, steps: &[Attributes]) -> Option<DAffine3> {
    let mut all = Some(DAffine3::IDENTITY);
    for attributes in steps {
        let step = step(importer, attributes);
        all = all.zip(step).map(|(before, step)| step * before);
    }
    all
}

fn step(importer: &mut Importer, attributes: &Attributes) -> Option<DAffine3> {
    let at = attributes.at;
    match attributes.tag {
        "translate" => {
            attributes.check(importer, &["value", "x", "y", "z"]);
            vector(importer, attributes, 0.0).map(DAffine3::from_translation)
        }
        "scale" => {
            attributes.check(importer, &["value", "x", "y", "z"]);
            vector(importer, attributes, 1.0).map(DAffine3::from_scale)
        }
        "rotate" => {
            attributes.check(importer, &["value", "x", "y", "z", "angle"]);
            let axis = vector(importer, attributes, 0.0);
            let text = attributes.require(importer, "angle")?;
            let map = rotate(axis?, number(importer, at, text)?);
            if map.is_none() {
                importer.error(at, "the axis of the rotation has no length", "give x, y or z");
            }
            map
        }
        "matrix" => {
            attributes.check(importer, &["value"]);
            matrix(importer, attributes)
        }
        "lookat" | "lookAt" => {
            attributes.check(importer, &["origin", "target", "up"]);
            look_at(importer, attributes)
        }
        tag => {
            let help = nearest(tag, STEPS).map_or(String::new(), |n| format!("did you mean <{n}>?"));
            importer.error(at, format!("<{tag}> is not a step of a transform"), help);
            None
        }
    }
}

/// 16 numbers by rows, or 9 for a linear map.
fn matrix(importer: &mut Importer, attributes: &Attributes) -> Option<DAffine3> {
    let text = attributes.require(importer, "value")?;
    let v = numbers(importer, attributes.at, text)?;
    let side = match v.len() {
        16 => 4,
        9 => 3,
        n => {
            importer.error(attributes.at, format!("a matrix has 16 numbers (or 9), found {n}"), "");
            return None;
        }
    };
    if side == 4 && v[12..] != [0.0, 0.0, 0.0, 1.0] {
        importer.error(attributes.at, "the last row of the matrix must be 0 0 0 1: projections are not supported", "");
        return None;
    }
    let column = |c: usize| DVec3::new(v[c], v[side + c], v[2 * side + c]);
    let translation = if side == 4 { column(3) } else { DVec3::ZERO };
    Some(DAffine3::from_mat3_translation(DMat3::from_cols(column(0), column(1), column(2)), translation))
}

fn look_at(importer: &mut Importer, attributes: &Attributes) -> Option<DAffine3> {
    let mut point = |name: &str, default: Option<DVec3>| {
        let text = match (attributes.get(name), default) {
            (None, Some(default)) => return Some(default),
            _ => attributes.require(importer, name)?,
        };
        match numbers(importer, attributes.at, text)?.as_slice() {
            [x, y, z] => Some(DVec3::new(*x, *y, *z)),
            list => {
                importer.error(attributes.at, format!("`{name}` needs three numbers, found {}", list.len()), "");
                None
            }
        }
    };
    let (origin, target, up) = (point("origin", None), point("target", None), point("up", Some(DVec3::ZERO)));
    let (origin, target, up) = (origin?, target?, up?);
    // Without an up vector any will do.
    let up = if up == DVec3::ZERO { (target - origin).any_orthogonal_vector() } else { up };
    let map = look_along_z(origin, target, up);
    if map.is_none() {
        importer.error(attributes.at, "origin and target are the same point, or `up` points along the view", "");
    }
    map
}
