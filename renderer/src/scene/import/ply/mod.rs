//! PLY, ascii and binary. Written here, not taken from a crate: every count is checked against the bytes that are there before
//! anything is allocated, every fault names its line or byte, and no list is allocated for a face.

mod body;
mod header;

use super::mesh_file::MeshFileError;
use crate::geometry::Mesh;
use crate::math::{Vec2, Vec3};
use body::{Ascii, Big, Body, Little};
use header::{Element, Encoding, Kind, Property};

/// The mesh of a file: elements `vertex` (x y z, and if there nx ny nz and u v, s t or texture_u texture_v) and `face`
/// (a list vertex_index or vertex_indices; polygons become fans). Other elements and properties are skipped.
pub(super) fn parse(bytes: &[u8]) -> Result<Mesh, MeshFileError> {
    let header = header::parse(bytes)?;
    match header.encoding {
        Encoding::Ascii => read(&header.elements, Ascii::new(bytes, header.end, header.lines)),
        Encoding::Little => read(&header.elements, Little::new(bytes, header.end)),
        Encoding::Big => read(&header.elements, Big::new(bytes, header.end)),
    }
}

fn read(elements: &[Element], mut body: impl Body) -> Result<Mesh, MeshFileError> {
    let mut mesh = Mesh::default();
    let mut seen = [false; 2];
    for element in elements {
        check_count(element, &body)?;
        match element.name.as_str() {
            "vertex" if !seen[0] => {
                seen[0] = true;
                read_vertices(element, &mut body, &mut mesh)?;
            }
            "face" if !seen[1] => {
                seen[1] = true;
                let known = if seen[0] { mesh.positions.len() } else { usize::MAX };
                read_faces(element, known, &mut body, &mut mesh)?;
            }
            _ if element.properties.is_empty() => {}
            _ => (0..element.count).try_for_each(|_| element.properties.iter().try_for_each(|p| skip(&mut body, p)))?,
        }
    }
    if mesh.triangles.is_empty() {
        return Err(body.error("the file has no triangles: it needs an element `vertex` and an element `face`"));
    }
    // Where the vertices come after the faces, indices can be checked only here.
    let count = mesh.positions.len();
    if let Some(t) = mesh.triangles.iter().flatten().find(|&&i| i as usize >= count) {
        return Err(body.error(&format!("a face names the vertex {t}, but there are only {count}")));
    }
    Ok(mesh)
}

/// Every value takes at least a byte (two of text: a digit and a space), so that a count beyond that is a lie.
fn check_count(element: &Element, body: &impl Body) -> Result<(), MeshFileError> {
    let least: usize = element.properties.iter().map(|p| body.least_size(p)).sum();
    let possible = body.remaining().checked_div(least).unwrap_or(usize::MAX);
    if element.count > possible {
        let Element { name, count, .. } = element;
        return Err(body.error(&format!(
            "the header promises {count} of element `{name}`, but the rest of the file has room for {possible} at most"
        )));
    }
    Ok(())
}

/// What a property of a vertex is for.
#[derive(Clone, Copy)]
enum Role {
    Position(usize),
    Normal(usize),
    Uv(usize),
    Other,
}

fn roles(element: &Element) -> Vec<Role> {
    let has = |names: &[&str]| names.iter().all(|n| element.properties.iter().any(|p| p.is_scalar(n)));
    let normals = has(&["nx", "ny", "nz"]);
    let uv_names = [["u", "v"], ["s", "t"], ["texture_u", "texture_v"], ["texture_s", "texture_t"]];
    let uvs = uv_names.iter().find(|names| has(*names));
    let role = |p: &Property| {
        let name = p.name.as_str();
        if p.list.is_some() {
            return Role::Other;
        }
        match name {
            "x" => Role::Position(0),
            "y" => Role::Position(1),
            "z" => Role::Position(2),
            "nx" if normals => Role::Normal(0),
            "ny" if normals => Role::Normal(1),
            "nz" if normals => Role::Normal(2),
            _ => uvs.and_then(|u| u.iter().position(|&n| n == name)).map_or(Role::Other, Role::Uv),
        }
    };
    element.properties.iter().map(role).collect()
}

fn read_vertices(element: &Element, body: &mut impl Body, mesh: &mut Mesh) -> Result<(), MeshFileError> {
    let roles = roles(element);
    if ["x", "y", "z"].iter().any(|n| !element.properties.iter().any(|p| p.is_scalar(n))) {
        return Err(body.error("the element `vertex` needs the properties x, y and z"));
    }
    if element.count > u32::MAX as usize {
        return Err(body.error("the mesh has more vertices than 32 bits can count"));
    }
    let normals = roles.iter().any(|r| matches!(r, Role::Normal(_)));
    let uvs = roles.iter().any(|r| matches!(r, Role::Uv(_)));
    mesh.positions.reserve_exact(element.count);
    mesh.normals.reserve_exact(if normals { element.count } else { 0 });
    mesh.uvs.reserve_exact(if uvs { element.count } else { 0 });
    for i in 0..element.count {
        let (mut p, mut n, mut uv) = (Vec3::ZERO, Vec3::ZERO, Vec2::ZERO);
        for (property, role) in element.properties.iter().zip(&roles) {
            match *role {
                Role::Position(axis) => p[axis] = body.number(property.kind)? as f32,
                Role::Normal(axis) => n[axis] = body.number(property.kind)? as f32,
                Role::Uv(axis) => uv[axis] = body.number(property.kind)? as f32,
                Role::Other => skip(body, property)?,
            }
        }
        if !(p.is_finite() && n.is_finite() && uv.is_finite()) {
            return Err(body.error(&format!("the vertex {i} has a number that is not finite")));
        }
        mesh.positions.push(p);
        if normals {
            mesh.normals.push(n);
        }
        if uvs {
            mesh.uvs.push(uv);
        }
    }
    Ok(())
}

/// `vertices`: how many there are, as far as known.
fn read_faces(element: &Element, vertices: usize, body: &mut impl Body, mesh: &mut Mesh) -> Result<(), MeshFileError> {
    let is_corners = |p: &Property| p.list.is_some() && (p.name == "vertex_indices" || p.name == "vertex_index");
    let Some(corners) = element.properties.iter().position(is_corners) else {
        return Err(body.error("the element `face` needs a list property vertex_indices or vertex_index"));
    };
    // A face that counts has three corners.
    let least = body.least_size(&element.properties[corners]) + 3 * body.least_value(element.properties[corners].kind);
    mesh.triangles.reserve_exact(element.count.min(body.remaining() / least));
    for i in 0..element.count {
        for (k, property) in element.properties.iter().enumerate() {
            match property.list {
                Some(counts) if k == corners => read_face(i, vertices, counts, property.kind, body, mesh)?,
                _ => skip(body, property)?,
            }
        }
    }
    Ok(())
}

fn read_face(
    i: usize,
    vertices: usize,
    counts: Kind,
    kind: Kind,
    body: &mut impl Body,
    mesh: &mut Mesh,
) -> Result<(), MeshFileError> {
    let count = list_length(body, counts, kind)?;
    if count < 3 {
        return Err(body.error(&format!("the face {i} has {count} corners, 3 or more are needed")));
    }
    let (first, mut last) = (corner(body, kind, vertices)?, corner(body, kind, vertices)?);
    for _ in 2..count {
        let next = corner(body, kind, vertices)?;
        mesh.triangles.push([first, last, next]);
        last = next;
    }
    Ok(())
}

fn corner(body: &mut impl Body, kind: Kind, vertices: usize) -> Result<u32, MeshFileError> {
    let value = body.number(kind)?;
    if !(value >= 0.0 && value <= f64::from(u32::MAX) && value.fract() == 0.0) {
        return Err(body.error(&format!("{value} is not an index of a vertex")));
    }
    if value >= vertices as f64 {
        return Err(body.error(&format!("a face names the vertex {value}, but there are only {vertices}")));
    }
    Ok(value as u32)
}

fn list_length(body: &mut impl Body, counts: Kind, kind: Kind) -> Result<usize, MeshFileError> {
    let value = body.number(counts)?;
    let possible = body.remaining() / body.least_value(kind);
    if value >= 0.0 && value.fract() == 0.0 && value <= possible as f64 {
        return Ok(value as usize);
    }
    Err(body.error(&format!("a list of {value} values does not fit into the rest of the file")))
}

fn skip(body: &mut impl Body, property: &Property) -> Result<(), MeshFileError> {
    let count = property.list.map_or(Ok(1), |counts| list_length(body, counts, property.kind))?;
    (0..count).try_for_each(|_| body.number(property.kind).map(drop))
}
