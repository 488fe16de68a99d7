//! Renders scenes by every integrator and prints a digest of each picture file: the same from any build and with any number of threads.
//!
//! usage: digests THREADS SCENE...

use renderer::film::exr;
use renderer::integrator::IntegratorKind;
use renderer::job::{LocalOptions, RenderOptions, RenderSettings, Stop, render_local};
use renderer::scene::Scene;
use renderer::scene::bundle::{Digest, DiskSource};
use std::path::Path;
use std::process::ExitCode;

/// Enough for every part of the code, little enough for all scenes.
const SIZE: (u32, u32) = (64, 48);
const SPP: u32 = 3;

fn main() -> ExitCode {
    let mut arguments = std::env::args().skip(1);
    let Some(Ok(threads @ 1..)) = arguments.next().map(|n| n.parse::<usize>()) else {
        eprintln!("usage: digests THREADS SCENE...");
        return ExitCode::from(2);
    };
    for scene in arguments {
        if let Err(message) = print(&scene, threads) {
            eprintln!("{scene}: {message}");
            return ExitCode::FAILURE;
        }
    }
    ExitCode::SUCCESS
}

/// A line for each integrator.
fn print(file: &str, threads: usize) -> Result<(), String> {
    let (source, root) = DiskSource::for_scene(Path::new(file)).map_err(|e| e.to_string())?;
    let (scene, _) = Scene::load(&source, &root).map_err(|e| e.to_string())?;
    for (name, integrator) in IntegratorKind::ALL {
        let options = RenderOptions { size: Some(SIZE), seed: Some(5), ..RenderOptions::counting(*integrator, SPP) };
        let settings = RenderSettings::resolve(&options, &scene.defaults).map_err(|e| e.to_string())?;
        let outcome = render_local(&scene, &settings, &LocalOptions { threads }, &Stop::new(), &mut |_| {})
            .map_err(|e| e.to_string())?;
        let picture = exr::encode(&outcome.image, &settings.provenance(Digest::of(file.as_bytes()), None))?;
        println!("{} {name} {file}", Digest::of(&picture));
    }
    Ok(())
}
