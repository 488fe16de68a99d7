//! Rays per second on one thread: camera rays, diffuse bounces, occlusion, in procedural rooms and in scenes; beside Embree where
//! its peer has been built (see `README.md`).

mod embree;
mod growth;
mod sets;

use crate::load;
use crate::meshes::room;
use embree::Embree;
use renderer::accel::Accel;
use renderer::camera::Camera;
use renderer::geometry::{Geometry, MeshId, Object, Shape};
use renderer::math::{Ray, Transform, Vec2, Vec3};
use sets::Set;
use std::path::PathBuf;
use std::time::Instant;

pub use growth::Growth;

/// Times the acceleration structure.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// Triangles of the rooms.
    #[arg(long, value_delimiter = ',', default_values_t = [50_000, 500_000, 5_000_000])]
    triangles: Vec<usize>,
    /// Scenes to measure in place of rooms; beside Embree only where all their objects are meshes of their own.
    #[arg(long, value_delimiter = ',', conflicts_with = "triangles")]
    scene: Vec<PathBuf>,
    /// Counted passes over each set of rays; the median counts.
    #[arg(long, default_value_t = 9)]
    runs: usize,
    /// Embree's peer, built from `bench/embree/rays.c`: traces the same rays in turn.
    #[arg(long)]
    embree: Option<PathBuf>,
    /// Settings of Embree's device, such as `threads=1` or `isa=avx2`.
    #[arg(long, default_value = "", requires = "embree")]
    embree_config: String,
    /// Times rooms of a thousand triangles to ten million and fits the growth.
    #[arg(long, conflicts_with_all = ["triangles", "scene", "embree"])]
    growth: bool,
}

/// The rates of one set of rays, million rays a second; medians.
#[derive(Debug, serde::Serialize)]
pub struct Rate {
    set: &'static str,
    rays: usize,
    ours: f64,
    embree: Option<f64>,
    /// Ours over Embree's: the median over the runs.
    ratio: Option<f64>,
}

/// How the nearest hits differ from Embree's, over all sets.
#[derive(Debug, Default, serde::Serialize)]
pub struct Differences {
    rays: usize,
    /// Another triangle at the same distance to 1e-5: a tie, or an edge between the two.
    ties: usize,
    /// Hits that only we have.
    only_ours: usize,
    /// Hits that only Embree has.
    only_embree: usize,
    /// Another triangle at another distance.
    other: usize,
    /// The largest relative difference of distances to the same triangle.
    distance: f64,
}

/// One mesh.
#[derive(Debug, serde::Serialize)]
pub struct Row {
    mesh: String,
    triangles: usize,
    build_s: f64,
    embree_build_s: Option<f64>,
    bytes_per_triangle: f64,
    embree_bytes_per_triangle: Option<f64>,
    rates: Vec<Rate>,
    differences: Option<Differences>,
}

/// What was measured.
#[derive(Debug, serde::Serialize)]
#[serde(untagged)]
pub enum Report {
    /// Rates of meshes.
    Rates(Vec<Row>),
    /// Time against the number of triangles.
    Growth(Growth),
}

/// What rays are traced in.
struct Subject {
    name: String,
    geometry: Geometry,
    camera: Vec<Ray>,
}

/// Side of the square of camera rays.
const SIDE: usize = 256;

/// Runs the benchmark.
pub fn run(args: &Args) -> Result<Report, String> {
    let runs = args.runs.max(1);
    if args.growth {
        return growth::measure(runs).map(Report::Growth);
    }
    let mut embree = args.embree.as_ref().map(|p| Embree::start(p, &args.embree_config)).transpose()?;
    let mut rows = Vec::new();
    if args.scene.is_empty() {
        for &n in &args.triangles {
            rows.push(measure(room_subject(n), runs, embree.as_mut())?);
        }
    }
    for path in &args.scene {
        rows.push(measure(scene_subject(path)?, runs, embree.as_mut())?);
    }
    Ok(Report::Rates(rows))
}

/// A procedural room and camera rays in it.
fn room_subject(triangles: usize) -> Subject {
    let object = Object { shape: Shape::Mesh(MeshId(0)), to_world: Transform::IDENTITY, flip_normals: false };
    let geometry = Geometry::new(vec![room(triangles.max(1000))], vec![object]);
    let camera = sets::pinhole(Vec3::new(0.9, 0.5, 0.9), Vec3::new(0.0, -0.2, 0.0), 1.6, SIDE);
    Subject { name: "room".into(), geometry, camera }
}

/// A scene file, seen by its camera.
fn scene_subject(path: &std::path::Path) -> Result<Subject, String> {
    let scene = load::scene(path)?;
    let camera = Camera::new(&scene.camera, SIDE as u32, SIDE as u32).map_err(|e| e.to_string())?;
    let raster = |i: usize| Vec2::new((i % SIDE) as f32 + 0.5, (i / SIDE) as f32 + 0.5);
    let camera = (0..SIDE * SIDE).map(|i| camera.generate_ray(raster(i), Vec2::splat(0.5))).collect();
    Ok(Subject { name: path.display().to_string(), geometry: scene.geometry, camera })
}

fn measure(subject: Subject, runs: usize, embree: Option<&mut Embree>) -> Result<Row, String> {
    let Subject { name, geometry, camera } = subject;
    let (accel, build_s) = timed(|| Accel::build(&geometry));
    let accel = accel.map_err(|e| e.to_string())?;
    let sets = sets::all(&geometry, &accel, camera);
    let triangles: usize = geometry.meshes.iter().map(|m| m.triangles.len()).sum();
    let mut row = Row {
        mesh: name,
        triangles,
        build_s,
        embree_build_s: None,
        bytes_per_triangle: accel.bytes() as f64 / triangles as f64,
        embree_bytes_per_triangle: None,
        rates: Vec::new(),
        differences: None,
    };
    let embree = embree.filter(|_| embree::can_take(&geometry));
    let Some(embree) = embree else {
        row.rates = sets.iter().map(|s| rate(s, runs, &accel, |_| Ok(None))).collect::<Result<_, _>>()?;
        return Ok(row);
    };
    let built = embree.load(&geometry, &sets)?;
    row.embree_build_s = Some(built.seconds);
    row.embree_bytes_per_triangle = Some(built.bytes / triangles as f64);
    for (i, set) in sets.iter().enumerate() {
        row.rates.push(rate(set, runs, &accel, |occlusion| embree.time(i, occlusion).map(Some))?);
    }
    row.differences = Some(embree.compare(&sets, &geometry, &accel)?);
    Ok(row)
}

/// Times a set, ours and the peer's in turn. One run of each does not count.
fn rate(
    set: &Set,
    runs: usize,
    accel: &Accel,
    mut peer: impl FnMut(bool) -> Result<Option<f64>, String>,
) -> Result<Rate, String> {
    let (mut ours, mut theirs) = (Vec::new(), Vec::new());
    for run in 0..=runs {
        let (a, b) = (set.time(accel), peer(set.occlusion)?);
        if run > 0 {
            ours.push(a);
            theirs.extend(b);
        }
    }
    let ratios = theirs.iter().zip(&ours).map(|(t, o)| t / o).collect::<Vec<f64>>();
    let mega = set.rays.len() as f64 / 1e6;
    Ok(Rate {
        set: set.name,
        rays: set.rays.len(),
        ours: mega / median(ours).unwrap_or(f64::NAN),
        embree: median(theirs).map(|s| mega / s),
        ratio: median(ratios),
    })
}

fn timed<T>(f: impl FnOnce() -> T) -> (T, f64) {
    let started = Instant::now();
    let result = f();
    (result, started.elapsed().as_secs_f64())
}

fn median(mut values: Vec<f64>) -> Option<f64> {
    values.sort_by(f64::total_cmp);
    values.get(values.len() / 2).copied()
}

/// The report as a table.
pub fn table(report: &Report) -> String {
    match report {
        Report::Rates(rows) => rows.iter().map(rates_table).collect::<Vec<_>>().join("\n"),
        Report::Growth(growth) => growth.to_string(),
    }
}

fn rates_table(row: &Row) -> String {
    let number = |x: Option<f64>, digits: usize| x.map_or("-".into(), |x| format!("{x:.digits$}"));
    let ratio = row.embree_build_s.map(|e| row.build_s / e);
    let mut text = format!(
        "{}: {} triangles                  lightfarm    Embree    ratio\n\
         build, s                        {:12.3}  {:>8}  {:>7}\n\
         bytes per triangle              {:12.1}  {:>8}\n",
        row.mesh,
        row.triangles,
        row.build_s,
        number(row.embree_build_s, 3),
        number(ratio, 2),
        row.bytes_per_triangle,
        number(row.embree_bytes_per_triangle, 1)
    );
    for r in &row.rates {
        text +=
            &format!("{:24} Mray/s {:12.2}  {:>8}  {:>7}\n", r.set, r.ours, number(r.embree, 2), number(r.ratio, 3));
    }
    if let Some(d) = &row.differences {
        text += &format!(
            "nearest hits of {} rays: {} ties, {} only ours, {} only Embree's, {} other; distances within {:.1e}\n",
            d.rays, d.ties, d.only_ours, d.only_embree, d.other, d.distance
        );
    }
    text
}
