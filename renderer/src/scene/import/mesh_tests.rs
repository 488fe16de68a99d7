//! PLY and OBJ: every form that is read, and what is said of each fault.

use super::mesh_file::{MeshFileError, MeshOptions, Normals, parse, smooth_normals};
use super::tests::damage;
use crate::geometry::Mesh;
use crate::math::{DMat3, DVec3, Vec2, Vec3};

const PLAIN: MeshOptions = MeshOptions { flip_v: false, normals: Normals::File };

fn read(path: &str, bytes: &[u8]) -> Mesh {
    let mesh = parse(bytes, path, &PLAIN).unwrap().mesh;
    mesh.validate().unwrap();
    mesh
}

#[track_caller]
fn refused(path: &str, bytes: &[u8], place: &str, part: &str) {
    let MeshFileError { place: found, message } = parse(bytes, path, &PLAIN).unwrap_err();
    assert!(found == place && message.contains(part), "{found}: {message}");
}

fn square() -> Mesh {
    Mesh {
        positions: vec![Vec3::ZERO, Vec3::X, Vec3::new(1.0, 1.0, 0.0), Vec3::Y],
        normals: vec![Vec3::Z; 4],
        uvs: vec![Vec2::ZERO, Vec2::X, Vec2::ONE, Vec2::Y],
        triangles: vec![[0, 1, 2], [0, 2, 3]],
    }
}

/// A square as binary PLY, with a property, an element and a list that nobody asked for.
fn binary_square(big: bool) -> Vec<u8> {
    let name = if big { "big" } else { "little" };
    let mut out = format!(
        "ply\nformat binary_{name}_endian 1.0\ncomment made here\nelement camera 1\nproperty list uchar short what\nproperty int k\n\
         element vertex 4\nproperty double x\nproperty float y\nproperty float z\nproperty uchar red\nproperty float nx\n\
         property float ny\nproperty float nz\nproperty float s\nproperty float t\nelement face 1\n\
         property list uchar ushort vertex_index\nproperty float quality\nend_header\n"
    )
    .into_bytes();
    let mut put = |le: &[u8]| {
        let mut b = le.to_vec();
        if big {
            b.reverse();
        }
        out.extend(b);
    };
    put(&[2]);
    [7i16, 8].iter().for_each(|v| put(&v.to_le_bytes()));
    put(&5i32.to_le_bytes());
    let square = square();
    for (p, uv) in square.positions.iter().zip(&square.uvs) {
        put(&f64::from(p.x).to_le_bytes());
        [p.y, p.z].iter().for_each(|v| put(&v.to_le_bytes()));
        put(&[200]);
        [0.0f32, 0.0, 2.0, uv.x, uv.y].iter().for_each(|v| put(&v.to_le_bytes()));
    }
    put(&[4]);
    [0u16, 1, 2, 3].iter().for_each(|v| put(&v.to_le_bytes()));
    put(&0.5f32.to_le_bytes());
    out
}

const ASCII: &str = "ply\nformat ascii 1.0\nelement vertex 4\nproperty float x\nproperty float y\nproperty float z\nproperty float nx
property float ny\nproperty float nz\nproperty float u\nproperty float v\nelement face 2\nproperty list uchar int vertex_indices\nend_header
0 0 0 0 0 1 0 0\n1 0 0 0 0 1 1 0\n1 1 0 0 0 1 1 1\n0 1 0 0 0 1 0 1\n3 0 1 2\n3 0 2 3\n";

#[test]
fn ply_in_all_encodings() {
    assert_eq!(read("a.ply", ASCII.as_bytes()), square());
    assert_eq!(read("a.ply", ASCII.replace('\n', "\r\n").as_bytes()), square());
    assert_eq!(read("a.ply", &binary_square(false)), square());
    assert_eq!(read("a.ply", &binary_square(true)), square());
}

#[test]
fn ply_without_normals_and_uv_is_plain() {
    let text = "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float z\nproperty float nx
element face 1\nproperty list uchar uint vertex_index\nend_header\n0 0 0 1 1 0 0 1 0 1 0 1 3 0 1 2";
    let mesh = read("a.ply", text.as_bytes());
    assert!(mesh.normals.is_empty() && mesh.uvs.is_empty(), "nx alone is no normal");
    assert_eq!(mesh.triangles, [[0, 1, 2]]);
}

#[test]
fn ply_faults() {
    refused("a.ply", b"plx\n", "line 1", "first line");
    refused("a.ply", b"ply\nformat ascii 1.0\n", "line 3", "end_header");
    refused("a.ply", b"ply\nformat utf8 1.0\nend_header\n", "line 2", "unknown format");
    refused("a.ply", b"ply\nend_header\n", "line 2", "no line `format`");
    refused("a.ply", b"ply\nformat ascii 1.0\nproperty float x\n", "line 3", "before the first element");
    refused("a.ply", b"ply\nformat ascii 1.0\nelement vertex many\n", "line 3", "\"many\"");
    refused("a.ply", b"ply\nformat ascii 1.0\nelement vertex 3\nproperty real x\n", "line 4", "unknown type \"real\"");
    refused("a.ply", b"ply\nformat ascii 1.0\nend_header\n", "line 4", "no triangles");
    let late = b"ply\nformat ascii 1.0\nelement face 1\nproperty list uchar int vertex_index\nelement vertex 3\nproperty float x
property float y\nproperty float z\nend_header\n3 0 1 3\n0 0 0\n0 0 1\n0 1 0\n";
    refused("a.ply", late, "line 13", "vertex 3, but there are only 3");
    let with = |from: &str, to: &str| ASCII.replacen(from, to, 1).into_bytes();
    refused("a.ply", &with("3 0 2 3", "3 0 2 4"), "line 20", "vertex 4, but there are only 4");
    refused("a.ply", &with("3 0 2 3", "3 0 -2 3"), "line 20", "-2 is not an index");
    refused("a.ply", &with("3 0 2 3", "2 0 2"), "line 20", "2 corners");
    refused("a.ply", &with("3 0 2 3", "3 0 2"), "line 21", "ends before");
    refused("a.ply", &with("1 1 0 0 0 1", "1 nan 0 0 0 1"), "line 17", "\"nan\"");
    refused("a.ply", &with("1 1 0 0 0 1", "1 1e39 0 0 0 1"), "line 17", "vertex 2 has a number that is not finite");
    refused("a.ply", &with("vertex 4", "vertex 4000000000000000000"), "line 15", "room for");
    refused("a.ply", &with("face 2", "face 99999999999999"), "line 18", "room for");
    refused("a.ply", &with("property float z\n", ""), "line 14", "needs the properties x, y and z");
    refused("a.ply", &with("vertex_indices", "corners"), "line 18", "vertex_indices");
    let binary = binary_square(false);
    let start = binary.windows(11).position(|w| w == b"end_header\n").unwrap() + 11;
    refused("a.ply", &binary[..binary.len() - 1], &format!("byte {}", binary.len() - 4), "ends before");
    let mut list = binary.clone();
    list[start] = 200;
    refused("a.ply", &list, &format!("byte {}", start + 1), "a list of 200 values does not fit");
}

#[test]
fn obj_forms() {
    let text = "# made here\nmtllib no.mtl\no thing\nv 0 0 0\nv 1 0 0 1.0\nv 1 1 0\nv 0 1 0\nvn 0 0 3\nvt 0 0\nvt 1 0 0\nvt 1 1\nvt 0 1
usemtl none\ns off\nf 1/1/1 2/2/1 \\\n 3/3/1 -1/-1/-1 # a square\nl 1 2\n";
    assert_eq!(read("a.obj", text.as_bytes()), square());
    let bare = read("a.obj", b"v 0 0 0\r\nv 1 0 0\r\nv 0 1 0\r\nf 1 2 3\r\nf 3 2 1\r\n");
    assert_eq!((bare.positions.len(), bare.triangles.len()), (3, 2));
    assert!(bare.normals.is_empty() && bare.uvs.is_empty());
    // A position with two texture coordinates becomes two vertices; a corner without one gets (0, 0).
    let seam = read("a.obj", b"v 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0.5 0.5\nf 1/1 2/1 3/1\nf 1 2/1 3/1\n");
    assert_eq!(seam.triangles, [[0, 1, 2], [3, 1, 2]]);
    assert_eq!((seam.uvs[0], seam.uvs[3]), (Vec2::splat(0.5), Vec2::ZERO));
    let normals = read("a.obj", b"v 0 0 0\nv 1 0 0\nv 0 1 0\nvn 0 0 1\nf 1//1 2//1 3\n").normals;
    assert_eq!(normals, [Vec3::Z, Vec3::Z, Vec3::ZERO], "a missing normal is zero: the face's is taken");
}

#[test]
fn obj_faults() {
    refused("a.obj", b"v 0 0\n", "line 1", "needs 3 numbers, found 2");
    refused("a.obj", b"\nv 0 0 1e99\n", "line 2", "\"1e99\"");
    refused("a.obj", b"v 0 0 x\n", "line 1", "\"x\"");
    refused("a.obj", b"vt nan\n", "line 1", "\"nan\"");
    let face = |f: &str| format!("v 0 0 0\nv 1 0 0\nv 0 1 0\n{f}\n").into_bytes();
    refused("a.obj", &face("f 1 2"), "line 4", "3 corners or more, found 2");
    refused("a.obj", &face("f 1 2 4"), "line 4", "names a vertex that is not there: 3 so far");
    refused("a.obj", &face("f 1 2 -4"), "line 4", "names a vertex that is not there");
    refused("a.obj", &face("f 1 2 0"), "line 4", "other than 0");
    refused("a.obj", &face("f 1 2 99999999999999999999"), "line 4", "\"99999999999999999999\"");
    refused("a.obj", &face("f 1/1 2/1 3/1"), "line 4", "names a texture coordinate");
    refused("a.obj", &face("f 1///4 2 3"), "line 4", "more than three indices");
    refused("a.obj", b"hello\n", "line 2", "no faces");
    refused("a.obj", b"", "line 1", "no faces");
}

#[test]
fn smooth_normals_weigh_angles() {
    // A roof: at the ridge two faces meet with equal angles, whatever their areas.
    let mesh = Mesh {
        positions: [[0.0, 0.0, 0.0], [0.0, 0.0, 1.0], [1.0, -1.0, 0.0], [-3.0, -3.0, 0.0]].map(Vec3::from).to_vec(),
        triangles: vec![[1, 2, 0], [0, 3, 1]],
        ..Mesh::default()
    };
    let normals = smooth_normals(&mesh, DMat3::IDENTITY);
    assert!(normals[0].abs_diff_eq(Vec3::Y, 1e-6), "{normals:?}");
    assert!(normals[2].abs_diff_eq(Vec3::new(1.0, 1.0, 0.0).normalize(), 1e-6));
    // Seen through a map, the normal in the world is the mean of the normals in the world.
    let map = DMat3::from_diagonal(DVec3::new(2.0, 1.0, 1.0));
    let n = smooth_normals(&mesh, map)[0].as_dvec3();
    let world = (map.inverse().transpose() * n).normalize();
    assert!(world.abs_diff_eq(DVec3::Y, 1e-6), "{world}");
    let mirrored = smooth_normals(&mesh, DMat3::from_diagonal(DVec3::new(-1.0, 1.0, 1.0)));
    assert!(mirrored[0].abs_diff_eq(-Vec3::Y, 1e-6));
    // A face without area has no say, a vertex without faces no normal.
    let flat = Mesh { positions: vec![Vec3::ZERO; 4], triangles: vec![[0, 1, 2]], ..Mesh::default() };
    assert_eq!(smooth_normals(&flat, DMat3::IDENTITY), [Vec3::ZERO; 4]);
}

#[test]
fn damaged_meshes_never_panic() {
    let obj = b"v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nvn 0 0 3\nvt 0 0\nf 1/1/1 2/1/1 3/1/1 -1/-1/-1\nf 1//1 2//1 3//1\n";
    for (path, bytes) in [("a.ply", ASCII.as_bytes()), ("a.ply", &binary_square(false)), ("a.obj", obj)] {
        let mut loaded = 0;
        damage(bytes, 4000, |bytes| {
            if let Ok(found) = parse(bytes, path, &PLAIN) {
                found.mesh.validate().unwrap();
                loaded += 1;
            }
        });
        assert!((1..3000).contains(&loaded), "{path}: {loaded}");
    }
}
