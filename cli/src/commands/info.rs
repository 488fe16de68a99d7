//! `lightfarm info`: what a scene contains and what rendering it will skip.

use crate::exit::{Failure, Outcome};
use crate::output::Console;
use crate::scene_file;
use renderer::job::{RenderOptions, RenderSettings};
use renderer::scene::desc::{Medium, Phase};
use renderer::scene::{Scene, SceneFeatures, bundle::Digest};
use renderer::texture::Texture;
use serde::Serialize;
use std::collections::BTreeMap;
use std::fmt;
use std::path::PathBuf;
use std::time::Instant;

/// The scene to look at.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// The scene: .gltf, .glb, .toml or .xml
    scene: PathBuf,
}

/// How many there are of each kind.
type Count = BTreeMap<&'static str, usize>;

/// What is shown, as text or JSON.
#[derive(Serialize)]
struct Info {
    event: &'static str,
    scene: Digest,
    files: usize,
    file_bytes: u64,
    load_seconds: f64,
    features: SceneFeatures,
    meshes: usize,
    materials: Count,
    lights: Count,
    media: Count,
    fills_scene: Option<&'static str>,
    textures: Count,
    texels: u64,
    camera: Camera,
    settings: RenderSettings,
    memory: Memory,
}

#[derive(Serialize)]
struct Camera {
    position: [f64; 3],
    direction: [f64; 3],
    fov_degrees: f64,
    fov_axis: String,
    aperture_radius: f64,
    focus_distance: f64,
}

#[derive(Serialize)]
struct Memory {
    /// Of the whole process with the scene loaded; `None` where the system does not tell.
    resident_bytes: Option<u64>,
    /// Of the film while the job renders with its default settings, at most.
    film_bytes: u64,
}

/// Runs it.
pub fn run(args: Args, console: &Console) -> Outcome {
    let started = Instant::now();
    let loaded = scene_file::load(&args.scene, console)?;
    let load_seconds = started.elapsed().as_secs_f64();
    let settings = RenderSettings::resolve(&RenderOptions::default(), &loaded.scene.defaults)
        .map_err(|e| Failure::Input(format!("error: {}: {e}", args.scene.display())))?;
    let resident_bytes = resident();
    let (manifest, _) = loaded.files.into_bundle(loaded.root);
    let scene = &loaded.scene;
    let info = Info {
        event: "info",
        scene: manifest.digest(),
        files: manifest.files.len(),
        file_bytes: manifest.files.iter().map(|f| f.len).sum(),
        load_seconds,
        features: scene.features.clone(),
        meshes: scene.geometry.meshes.len(),
        materials: count(scene.materials.iter().map(|m| m.kind())),
        lights: count(scene.lights.iter().map(|l| l.kind())),
        media: count(scene.media.iter().map(medium_kind)),
        fills_scene: scene.global_medium.map(|id| medium_kind(&scene.media[id.0 as usize])),
        textures: count(scene.textures.iter().map(texture_kind)),
        texels: texels(scene),
        camera: camera(scene),
        memory: Memory { resident_bytes, film_bytes: film_bytes(&settings) },
        settings,
    };
    console.result(&info, &info);
    Ok(())
}

fn count(kinds: impl Iterator<Item = &'static str>) -> Count {
    let mut count = Count::new();
    kinds.for_each(|k| *count.entry(k).or_default() += 1);
    count
}

fn texture_kind(t: &Texture) -> &'static str {
    match t {
        Texture::Image { .. } => "Image",
        Texture::Checkerboard { .. } => "Checkerboard",
    }
}

fn medium_kind(m: &Medium) -> &'static str {
    match m.phase {
        _ if !m.scatters() => "absorbing",
        Phase::Isotropic => "isotropic",
        Phase::HenyeyGreenstein { .. } => "Henyey-Greenstein",
    }
}

/// Texels of all pictures, each picture once.
fn texels(scene: &Scene) -> u64 {
    let images = scene.textures.iter().filter_map(|t| match t {
        Texture::Image { image, .. } => Some((std::sync::Arc::as_ptr(image), image.texels.len() as u64)),
        Texture::Checkerboard { .. } => None,
    });
    images.collect::<BTreeMap<_, _>>().values().sum()
}

fn camera(scene: &Scene) -> Camera {
    let c = &scene.camera;
    Camera {
        position: (c.to_world.translation + scene.origin).to_array(),
        direction: (-c.to_world.matrix3.z_axis).normalize_or_zero().to_array(),
        fov_degrees: c.fov,
        fov_axis: format!("{:?}", c.fov_axis).to_lowercase(),
        aperture_radius: c.aperture_radius,
        focus_distance: c.focus_distance,
    }
}

/// Sums of one group (two for a splatting job), the means of all groups, first hits, and the merged image.
fn film_bytes(s: &RenderSettings) -> u64 {
    let pixels = u64::from(s.width) * u64::from(s.height);
    pixels * (2 * 28 + 12 * u64::from(s.replicates) + 64 + 60)
}

/// Bytes that the process holds in memory.
fn resident() -> Option<u64> {
    let text = std::fs::read_to_string("/proc/self/status").ok()?;
    let line = text.lines().find_map(|l| l.strip_prefix("VmRSS:"))?;
    line.trim().strip_suffix("kB")?.trim().parse::<u64>().ok().map(|kib| kib << 10)
}

impl fmt::Display for Info {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let features = &self.features;
        let list = |count: &Count| match count.len() {
            0 => "none".to_string(),
            _ => count.iter().map(|(kind, n)| format!("{n} {kind}")).collect::<Vec<_>>().join(", "),
        };
        let mib = |bytes: u64| format!("{:.1} MiB", bytes as f64 / f64::from(1 << 20));
        let mut line = |name: &str, value: String| writeln!(f, "{name:<10} {value}");
        line("scene", self.scene.to_string())?;
        line("files", format!("{}, {}, loaded in {:.2} s", self.files, mib(self.file_bytes), self.load_seconds))?;
        line(
            "geometry",
            format!(
                "{} meshes of {} triangles; {} objects ({} instances, {} spheres and disks) of {} triangles",
                self.meshes,
                features.triangles,
                features.objects,
                features.instances,
                features.curved,
                features.instanced_triangles
            ),
        )?;
        line("materials", list(&self.materials))?;
        line("textures", format!("{} ({} texels)", list(&self.textures), self.texels))?;
        line("lights", list(&self.lights))?;
        if features.has_media() {
            let outside = self.fills_scene.map_or(String::new(), |kind| format!("; {kind} fills the scene"));
            line("media", format!("{}; {} null surfaces{outside}", list(&self.media), features.null_surfaces))?;
        }
        let c = &self.camera;
        let lens = if c.aperture_radius > 0.0 {
            format!("lens of radius {} focused at {}", c.aperture_radius, c.focus_distance)
        } else {
            "pinhole".into()
        };
        let triple = |v: [f64; 3]| format!("({:.4}, {:.4}, {:.4})", v[0], v[1], v[2]);
        line(
            "camera",
            format!(
                "at {} towards {}, {:.3} degrees along {}, {lens}",
                triple(c.position),
                triple(c.direction),
                c.fov_degrees,
                c.fov_axis
            ),
        )?;
        let s = &self.settings;
        let budget = match (s.budget.spp, s.budget.mpp) {
            (Some(n), _) => format!("{n} samples per pixel"),
            (_, Some(n)) => format!("{n} mutations per pixel"),
            _ => "-".into(),
        };
        let depth = s.max_depth.map_or("unbounded".into(), |d| format!("at most {d}"));
        let integrator = s.integrator.name();
        line("film", format!("{} x {} pixels, {:?}", s.width, s.height, s.filter))?;
        line(
            "settings",
            format!("{integrator}, {budget} in {} replicates, depth {depth}, seed {}", s.replicates, s.seed),
        )?;
        let scene = self.memory.resident_bytes.map_or("unknown".into(), mib);
        line("memory", format!("{scene} with the scene loaded; film {}", mib(self.memory.film_bytes)))?;
        write!(f, "{:<10} {}", "skipped", features.skipped.join("; "))
    }
}
