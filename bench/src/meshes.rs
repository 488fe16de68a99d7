//! Procedural meshes, the same on every machine: benchmarks need no downloads.

use renderer::geometry::Mesh;
use renderer::math::{Vec3, cos, sin};
use std::f32::consts::PI;

/// SplitMix64 (Steele, Lea, Flood 2014).
pub struct Random(pub u64);

impl Random {
    /// Uniform in [0, 1).
    pub fn next(&mut self) -> f32 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ z >> 30).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ z >> 27).wrapping_mul(0x94d0_49bb_1331_11eb);
        ((z ^ z >> 31) >> 40) as f32 / (1u64 << 24) as f32
    }
}

/// A closed room, the cube [-1, 1]^3: hilly ground and many rough blobs of all sizes, in `triangles` triangles or a few more.
pub fn room(triangles: usize) -> Mesh {
    let mut mesh = Mesh::default();
    let mut random = Random(1);
    // Walls and ceiling.
    for (o, u, v) in [
        (Vec3::new(-1.0, 1.0, -1.0), Vec3::X, Vec3::Z),
        (Vec3::new(-1.0, -1.0, -1.0), Vec3::X, Vec3::Y),
        (Vec3::new(-1.0, -1.0, 1.0), Vec3::Y, Vec3::X),
        (Vec3::new(-1.0, -1.0, -1.0), Vec3::Y, Vec3::Z),
        (Vec3::new(1.0, -1.0, -1.0), Vec3::Z, Vec3::Y),
    ] {
        grid(&mut mesh, 4, 4, |x, y| o + (u * x + v * y) * 2.0);
    }
    // Ground with a quarter of the triangles.
    let n = ((triangles / 8) as f32).sqrt() as usize;
    let waves: Vec<[f32; 4]> =
        (0..24).map(|i| [random.next() - 0.5, random.next() - 0.5, random.next() * 6.0, 1.0 + i as f32]).collect();
    let height =
        |x: f32, z: f32| waves.iter().map(|[a, b, c, f]| 0.08 / f * sin(6.0 * f * (a * x + b * z) + c)).sum::<f32>();
    grid(&mut mesh, n, n, |x, z| {
        let (x, z) = (2.0 * x - 1.0, 2.0 * z - 1.0);
        Vec3::new(x, -0.8 + height(x, z), -z)
    });
    // Blobs with the rest, of radii from 0.02 to 0.25.
    let blobs = 40;
    let per_blob = (triangles - mesh.triangles.len()) / blobs;
    let m = ((per_blob / 4) as f32).sqrt().ceil() as usize;
    for _ in 0..blobs {
        let centre = Vec3::new(random.next(), random.next(), random.next()) * 1.6 - Vec3::splat(0.8);
        let radius = 0.02 + 0.23 * random.next() * random.next();
        let bumps = [3.0 + 9.0 * random.next(), 3.0 + 9.0 * random.next(), 6.0 * random.next()];
        grid(&mut mesh, 2 * m, m, |u, v| {
            let (phi, theta) = (2.0 * PI * u, PI * v);
            let d = Vec3::new(sin(theta) * cos(phi), cos(theta), sin(theta) * sin(phi));
            let bump = sin(bumps[0] * d.x + bumps[2]) * sin(bumps[1] * d.y) * cos(bumps[0] * d.z);
            centre + d * radius * (1.0 + 0.2 * bump)
        });
    }
    mesh
}

/// A patch of `w` by `h` quads, two triangles each, over the unit square.
fn grid(mesh: &mut Mesh, w: usize, h: usize, at: impl Fn(f32, f32) -> Vec3) {
    let first = mesh.positions.len() as u32;
    for j in 0..=h {
        for i in 0..=w {
            mesh.positions.push(at(i as f32 / w as f32, j as f32 / h as f32));
        }
    }
    let row = w as u32 + 1;
    for j in 0..h as u32 {
        for i in 0..w as u32 {
            let a = first + j * row + i;
            mesh.triangles.extend([[a, a + 1, a + row + 1], [a, a + row + 1, a + row]]);
        }
    }
}
