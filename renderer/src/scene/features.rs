use super::ObjectInfo;
use crate::bsdf::Material;
use crate::geometry::{Geometry, Shape};
use crate::light::Light;
use crate::medium::{Medium, MediumId};
use crate::texture::Texture;
use serde::Serialize;

/// What a scene contains; found once at load. What it lacks is not computed.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct SceneFeatures {
    /// Triangles over all meshes, each mesh once.
    pub triangles: u64,
    /// Triangles over all objects: instances count as often as they appear.
    pub instanced_triangles: u64,
    /// Placed meshes, spheres and disks.
    pub objects: usize,
    /// Objects that share their mesh with another.
    pub instances: usize,
    /// Spheres and disks.
    pub curved: usize,
    /// Lights that rays can hit or that surround the scene.
    pub lights: usize,
    /// Point, spot and directional lights: nothing can hit them.
    pub delta_lights: usize,
    /// Environment and constant lights.
    pub infinite_lights: usize,
    /// Image and procedural textures.
    pub textures: usize,
    /// Normal maps among the materials.
    pub normal_maps: usize,
    /// Participating media that fill something.
    pub media: usize,
    /// Shapes whose surface is not there: they only bound a medium.
    pub null_surfaces: usize,
    /// Whether a medium scatters the colours at different distances.
    pub chromatic_media: bool,
    /// Names of what is not there and therefore skipped.
    pub skipped: Vec<&'static str>,
}

impl SceneFeatures {
    /// Looks through a scene.
    pub fn find(
        geometry: &Geometry,
        materials: &[Material],
        textures: &[Texture],
        lights: &[Light],
        objects: &[ObjectInfo],
        media: (&[Medium], Option<MediumId>),
    ) -> Self {
        let mut uses = vec![0u64; geometry.meshes.len()];
        let mut curved = 0;
        for o in &geometry.objects {
            match o.shape {
                Shape::Mesh(id) => uses[id.0 as usize] += 1,
                Shape::Sphere | Shape::Disk => curved += 1,
            }
        }
        let size = |i: usize| geometry.meshes[i].triangles.len() as u64;
        let used = || (0..uses.len()).filter(|i| uses[*i] > 0);
        let mut f = Self {
            triangles: used().map(size).sum(),
            instanced_triangles: used().map(|i| size(i) * uses[i]).sum(),
            objects: objects.len(),
            instances: uses.iter().filter(|n| **n > 1).map(|n| *n as usize).sum(),
            curved,
            lights: lights.iter().filter(|l| !l.flags().is_delta()).count(),
            delta_lights: lights.iter().filter(|l| l.flags().is_delta()).count(),
            infinite_lights: lights.iter().filter(|l| l.flags().infinite).count(),
            textures: textures.len(),
            normal_maps: materials.iter().filter(|m| matches!(m, Material::NormalMap { .. })).count(),
            media: used_media(media, objects).count(),
            null_surfaces: objects.iter().filter(|o| o.boundary.is_some_and(|b| b.null)).count(),
            chromatic_media: used_media(media, objects).any(Medium::is_chromatic),
            skipped: Vec::new(),
        };
        let absent = [
            (f.infinite_lights == 0, "environment lookups of rays that leave the scene"),
            (lights.len() < 2, "the choice between lights"),
            (f.lights == 0, "the search for lights by scattered rays"),
            (f.textures == 0, "texture lookups"),
            (f.normal_maps == 0, "normal maps"),
            (f.instances == 0, "transformed instances"),
            (f.curved == 0, "spheres and disks"),
            (!f.has_media(), "participating media"),
        ];
        f.skipped = absent.iter().filter(|a| a.0).map(|a| a.1).collect();
        f
    }

    /// Whether rays must be followed through media, or through surfaces that are not there.
    #[inline]
    pub fn has_media(&self) -> bool {
        self.media > 0 || self.null_surfaces > 0
    }
}

/// The media that are somewhere.
fn used_media<'a>(
    (media, global): (&'a [Medium], Option<MediumId>),
    objects: &'a [ObjectInfo],
) -> impl Iterator<Item = &'a Medium> {
    let used = move |id: MediumId| {
        global == Some(id) || objects.iter().any(|o| o.boundary.is_some_and(|b| b.interior == Some(id)))
    };
    media.iter().enumerate().filter(move |(i, _)| used(MediumId(*i as u32))).map(|(_, m)| m)
}
