//! The rows.

mod fields;
mod lights;
mod media;
mod paths;
mod place;
mod rays;
mod scattering;
mod shapes;
mod sums;
mod textures;

use crate::probe::Probe;

/// A family of cases.
#[derive(Debug)]
pub struct Row {
    /// Its name on the command line.
    pub name: &'static str,
    /// What it is about and what must hold.
    pub what: &'static str,
    pub(crate) run: fn(&mut Probe),
}

macro_rules! rows {
    ($($name:literal, $run:path: $what:literal;)*) => {
        /// All of them.
        pub const ROWS: &[Row] = &[$(Row { name: $name, what: $what, run: $run }),*];
    };
}

rows! {
    "scale", place::scale: "scenes of 1e-6 to 1e6: powers of two give the same bits, others the same picture";
    "offset", place::offset: "1e4 times the scene's size away from the origin: the same picture";
    "rotation", place::rotation: "turned by any angle: the same picture";
    "roughness", scattering::roughness: "alpha from 1 to 1e-6 comes to the smooth surface; integrators agree";
    "cosines", scattering::cosines: "every BSDF down to cosines of 1e-7 and 0: finite, weights bounded";
    "precision", scattering::precision: "phase functions, Fresnel terms and facets against double precision";
    "tiny-lights", lights::tiny: "lights of 1e-12 sr: the irradiance known";
    "huge-lights", lights::huge: "lights of 1e6 times the scene: the irradiance known";
    "radiance", lights::radiance: "1e-20 to 1e20: powers of two give the same bits, others the same picture";
    "many-lights", lights::many: "1e5 lights: the picture of one, and sums known";
    "depth", paths::depth: "paths of 1024 edges, white boxes: the geometric series";
    "dark", paths::dark: "no light, no surface, nothing: exactly black, exactly the sky";
    "thickness", media::thickness: "optical thickness 1e-6 to 1e6: Beer's law, furnaces, integrators agree";
    "asymmetry", media::asymmetry: "|g| to 0.999999: furnaces, integrators agree";
    "triangles", shapes::triangles: "without area: the same bits; needles: the same picture";
    "coincident", shapes::coincident: "surfaces twice: the same bits; 1e-6 apart: the same picture; one plane: a warning";
    "instances", shapes::instances: "1e6 placements of a mesh: integrators agree";
    "textures", textures::textures: "1 x 1 to 16384 x 16384 texels: the colour known, memory bounded";
    "fields", fields::fields: "NaN and infinity in every number of TOML, Mitsuba XML, glTF, OBJ, PLY: refused with the place";
    "splats", sums::splats: "1e6 splats over twelve decades against exact sums";
    "drift", sums::drift: "1e9 samples of a pixel, and a job of 2^24: no drift";
    "sobol", sums::sobol: "samples numbered near 2^24, 2^31 and 2^32: nets as the first";
    "ray-offsets", rays::offsets: "rays do not meet the surface they leave, and meet the next; coordinates over twelve decades";
    "directions", rays::directions: "zeros of both signs, rays along axes, edges and faces, and back";
    "watertight", rays::watertight: "no ray slips out of a closed mesh of size 1e-6 to 1e6";
}
