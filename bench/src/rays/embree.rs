//! Embree as a peer: a process of its own that traces the very same rays, handed over in files. Its source is `bench/embree/rays.c`.

use super::Differences;
use super::sets::Set;
use renderer::accel::Accel;
use renderer::geometry::{Geometry, ObjectId, Shape};
use std::io::{BufRead, BufReader, Write};
use std::path::Path;
use std::process::{Child, ChildStdin, ChildStdout, Command, Stdio};

/// The running peer; it ends with this value.
pub struct Embree {
    process: Child,
    ask: ChildStdin,
    answers: BufReader<ChildStdout>,
    folder: tempfile::TempDir,
}

/// What the peer says of its tree.
pub struct Built {
    pub seconds: f64,
    pub bytes: f64,
}

/// Whether the peer can have the same triangles: all objects are meshes in world space.
pub fn can_take(geometry: &Geometry) -> bool {
    geometry.objects.iter().all(|o| matches!(o.shape, Shape::Mesh(_)) && o.to_world.is_identity())
}

/// First triangle of each object in the one mesh that the peer gets.
fn starts(geometry: &Geometry) -> Vec<u32> {
    let mut starts = vec![0];
    for o in 0..geometry.objects.len() {
        starts.push(starts[o] + geometry.primitive_count(ObjectId(o as u32)));
    }
    starts
}

impl Embree {
    /// Starts the peer.
    pub fn start(program: &Path, config: &str) -> Result<Self, String> {
        let folder = tempfile::tempdir().map_err(|e| format!("no temporary folder: {e}"))?;
        let mut process = Command::new(program)
            .arg(config)
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .spawn()
            .map_err(|e| format!("{}: {e}; bench/README.md tells how to build it", program.display()))?;
        match (process.stdin.take(), process.stdout.take()) {
            (Some(ask), Some(answers)) => Ok(Self { process, ask, answers: BufReader::new(answers), folder }),
            _ => Err("no pipes to the peer".into()),
        }
    }

    /// Hands over a geometry and the sets of rays.
    pub fn load(&mut self, geometry: &Geometry, sets: &[Set]) -> Result<Built, String> {
        let name = self.write("mesh", &mesh_bytes(geometry))?;
        let answer = self.command(&format!("mesh {name}"), "built")?;
        let numbers: Vec<f64> = answer.split(' ').filter_map(|x| x.parse().ok()).collect();
        let [seconds, bytes] = numbers[..] else { return Err(format!("the peer answered: built {answer}")) };
        for (i, set) in sets.iter().enumerate() {
            let mut bytes = (set.rays.len() as u32).to_le_bytes().to_vec();
            for r in &set.rays {
                let numbers = r.o.to_array().into_iter().chain(r.d.to_array()).chain([r.t_max]);
                bytes.extend(numbers.flat_map(f32::to_le_bytes));
            }
            let name = self.write(&format!("rays-{i}"), &bytes)?;
            self.command(&format!("rays {name}"), "rays")?;
        }
        Ok(Built { seconds, bytes })
    }

    /// Seconds for all rays of a set.
    pub fn time(&mut self, set: usize, occlusion: bool) -> Result<f64, String> {
        let what = if occlusion { "occluded" } else { "closest" };
        let answer = self.command(&format!("{what} {set}"), "time")?;
        answer.parse().map_err(|_| format!("the peer answered: time {answer}"))
    }

    /// Compares the nearest hits of all sets that ask for them.
    pub fn compare(&mut self, sets: &[Set], geometry: &Geometry, accel: &Accel) -> Result<Differences, String> {
        let starts = starts(geometry);
        let mut d = Differences::default();
        for (i, set) in sets.iter().enumerate().filter(|(_, s)| !s.occlusion) {
            let file = self.folder.path().join("hits");
            self.command(&format!("hits {i} {}", file.display()), "written")?;
            let bytes = std::fs::read(&file).map_err(|e| format!("{}: {e}", file.display()))?;
            let (theirs, _) = bytes.as_chunks::<8>();
            for (ray, [a, b, c, e, t @ ..]) in set.rays.iter().zip(theirs) {
                let their_id = u32::from_le_bytes([*a, *b, *c, *e]);
                let their_t = f64::from(f32::from_le_bytes(*t));
                d.rays += 1;
                let ours = accel.intersect(ray);
                let Some(hit) = ours else {
                    d.only_embree += usize::from(their_id != u32::MAX);
                    continue;
                };
                if their_id == u32::MAX {
                    d.only_ours += 1;
                    continue;
                }
                let apart = (f64::from(hit.t) - their_t).abs() / their_t.max(1e-30);
                if starts[hit.object.0 as usize] + hit.primitive == their_id {
                    d.distance = d.distance.max(apart);
                } else if apart <= 1e-5 {
                    d.ties += 1;
                } else {
                    d.other += 1;
                }
            }
        }
        Ok(d)
    }

    fn write(&self, name: &str, bytes: &[u8]) -> Result<String, String> {
        let path = self.folder.path().join(name);
        std::fs::write(&path, bytes).map_err(|e| format!("{}: {e}", path.display()))?;
        Ok(path.display().to_string())
    }

    /// Sends a line; the rest of the answer, which must begin with `expected`.
    fn command(&mut self, line: &str, expected: &str) -> Result<String, String> {
        writeln!(self.ask, "{line}").map_err(|e| format!("the Embree peer has ended: {e}"))?;
        let mut answer = String::new();
        self.answers.read_line(&mut answer).map_err(|e| format!("the Embree peer: {e}"))?;
        let rest = answer.trim_end().strip_prefix(expected);
        rest.map(|r| r.trim().into()).ok_or_else(|| format!("the Embree peer answered {answer:?} to {line:?}"))
    }
}

impl Drop for Embree {
    fn drop(&mut self) {
        // It may have ended by itself.
        let _ = self.process.kill();
        let _ = self.process.wait();
    }
}

/// All meshes as one, in the order of the objects.
fn mesh_bytes(geometry: &Geometry) -> Vec<u8> {
    let (mut vertices, mut triangles) = (Vec::new(), Vec::new());
    for o in &geometry.objects {
        let Shape::Mesh(id) = o.shape else { continue };
        let mesh = &geometry.meshes[id.0 as usize];
        let first = vertices.len() as u32;
        vertices.extend_from_slice(&mesh.positions);
        triangles.extend(mesh.triangles.iter().map(|t| t.map(|v| v + first)));
    }
    let mut bytes = Vec::with_capacity(8 + 12 * (vertices.len() + triangles.len()));
    bytes.extend((vertices.len() as u32).to_le_bytes());
    bytes.extend((triangles.len() as u32).to_le_bytes());
    bytes.extend(vertices.iter().flat_map(|v| v.to_array()).flat_map(f32::to_le_bytes));
    bytes.extend(triangles.as_flattened().iter().flat_map(|i| i.to_le_bytes()));
    bytes
}
