//! A scene: its description (what importers make), its files (what the farm ships), and the immutable renderable form.

pub mod bundle;
pub mod desc;
mod enclosures;
mod features;
mod flight;
pub mod import;
mod lamps;
mod recentre;
mod shapes;

pub use enclosures::{Boundary, Enclosures};
pub use features::SceneFeatures;
pub use flight::{Event, Flight, Target, Transmission};

use crate::accel::Accel;
use crate::bsdf::{Material, MaterialId, first_bad_nesting};
use crate::diagnostics::{Diagnostics, SceneError};
use crate::geometry::{BoundingSphere, Geometry, Interaction, Object};
use crate::light::{Light, LightContext, LightSelector};
use crate::math::{DVec3, Transform};
use crate::medium::Medium;
use crate::texture::Texture;
use bundle::FileSource;
use desc::{SceneDesc, ShapeDesc};

/// An immutable scene, ready to render; shared by all threads.
#[derive(Debug)]
pub struct Scene {
    /// Meshes and objects.
    pub geometry: Geometry,
    /// Finds hits.
    pub accel: Accel,
    /// By [`MaterialId`].
    pub materials: Vec<Material>,
    /// By `TextureId`.
    pub textures: Vec<Texture>,
    /// Every light: emitting objects first.
    pub lights: Vec<Light>,
    /// The lights that rays which leave the scene see; indices into `lights`.
    pub infinite_lights: Vec<u32>,
    /// Chooses lights by power.
    pub selector: LightSelector,
    /// What the objects are.
    pub objects: Vec<ObjectInfo>,
    /// By `MediumId`.
    pub media: Vec<Medium>,
    /// The medium wherever no object's inside is.
    pub global_medium: Option<desc::MediumId>,
    /// The objects around the camera.
    pub camera_enclosures: Enclosures,
    /// The camera.
    pub camera: desc::CameraDesc,
    /// What was subtracted from all coordinates of a scene that is far from the origin.
    pub origin: DVec3,
    /// What the scene file says of rendering.
    pub defaults: desc::RenderDefaults,
    /// What the scene contains, and so what is skipped.
    pub features: SceneFeatures,
    bounds: BoundingSphere,
    /// The objects around each light; `None` where they are not the same all over it.
    light_enclosures: Vec<Option<Enclosures>>,
}

/// What belongs to an object beside its shape.
#[derive(Clone, Copy, Debug)]
pub struct ObjectInfo {
    /// What it is made of.
    pub material: MaterialId,
    /// Index into `Scene::lights` when it emits.
    pub light: Option<u32>,
    /// What its inside is, where light can come there.
    pub boundary: Option<Boundary>,
}

impl Scene {
    /// Loads a scene file and builds it; warnings come back beside the scene.
    pub fn load(files: &dyn FileSource, root: &str) -> Result<(Self, Diagnostics), SceneError> {
        let (desc, mut diagnostics) = import::load(files, root)?;
        match Self::build(desc, root, &mut diagnostics) {
            Some(scene) => Ok((scene, diagnostics)),
            None => Err(SceneError(diagnostics.list)),
        }
    }

    /// Builds the acceleration structure, lights and features of a description; `None` when `diagnostics` got an error.
    pub fn build(mut desc: SceneDesc, file: &str, diagnostics: &mut Diagnostics) -> Option<Self> {
        let origin = recentre::recentre(&mut desc);
        let SceneDesc { meshes, shapes, textures, materials, media, global_medium, lights, camera, defaults } = desc;
        let light_descs = lights;
        check_references(&materials, &meshes, &shapes, file, diagnostics);
        check_media(&media, global_medium, &materials, &shapes, file, diagnostics);
        if diagnostics.has_errors() {
            return None;
        }
        check_insides(&meshes, &shapes, file, diagnostics);

        // Place the shapes.
        let mut builder = shapes::ObjectBuilder::new(meshes);
        let mut objects = Vec::with_capacity(shapes.len());
        for shape in &shapes {
            match builder.object(shape) {
                Ok(object) => objects.push(object),
                Err(message) => diagnostics.error(file, shape.name.clone(), message, ""),
            }
        }
        let mut geometry = Geometry::new(builder.meshes, objects);
        let described: Vec<Option<f64>> = shapes
            .iter()
            .zip(&geometry.objects)
            .map(|(shape, object)| lamps::described_area(shape, object, &geometry))
            .collect();
        geometry.bake();
        let bounds = geometry.bounds();
        if let Err(e) = crate::camera::Camera::new(&camera, 16, 16) {
            diagnostics.error(file, "camera", format!("the camera can't be used: {e}"), "");
        }
        if diagnostics.has_errors() {
            return None;
        }

        // Collect the lights: emitting objects, then the rest.
        let mut lights = Vec::new();
        let mut info = Vec::with_capacity(shapes.len());
        for (i, shape) in shapes.iter().enumerate() {
            let light = emission(&geometry, i, shape).map(|light| {
                lights.push(light);
                lights.len() as u32 - 1
            });
            if let (Some(area), Some(_)) = (described.get(i).copied().flatten(), light) {
                let id = crate::geometry::ObjectId(i as u32);
                lamps::warn_of_rounded_area(area, id, &geometry, shape, (file, &mut *diagnostics));
            }
            info.push(ObjectInfo { material: shape.material, light, boundary: None });
        }
        enclosures::mark_boundaries(&mut info, &shapes, &materials, &geometry, !media.is_empty());
        for (i, d) in light_descs.iter().enumerate() {
            match Light::from_desc(d) {
                Ok(light) => lights.extend(light),
                Err(e) => diagnostics.error(file, format!("light {i}"), format!("the light can't be used: {e}"), ""),
            }
        }
        let accel = Accel::build(&geometry)
            .map_err(|e| diagnostics.error(file, "", format!("the geometry can't be used: {e}"), ""))
            .ok();
        if diagnostics.has_errors() {
            return None;
        }

        // Find what is there.
        let infinite_lights = (0..lights.len() as u32).filter(|i| lights[*i as usize].flags().infinite).collect();
        let context = LightContext { geometry: &geometry, textures: &textures, bounds };
        let places: Vec<_> = lights.iter().map(|l| l.bounds(&context)).collect();
        let powers: Vec<f32> = lights.iter().map(|l| l.power(&context).luminance()).collect();
        let features = SceneFeatures::find(&geometry, &materials, &textures, &lights, &info, (&media, global_medium));
        let mut scene = Self {
            accel: accel?,
            selector: LightSelector::placed(&powers, &places, bounds.radius),
            geometry,
            materials,
            textures,
            lights,
            infinite_lights,
            objects: info,
            media,
            global_medium,
            camera_enclosures: Enclosures::default(),
            camera,
            origin,
            defaults,
            features,
            bounds,
            light_enclosures: Vec::new(),
        };
        if scene.features.has_media() {
            scene.enclose(file, diagnostics);
        }
        scene.warn_of_covered_lamps(&shapes, file, diagnostics);
        Some(scene)
    }

    /// Number of lights.
    pub fn light_count(&self) -> usize {
        self.lights.len()
    }

    /// What lights refer to.
    #[inline]
    pub fn light_context(&self) -> LightContext<'_> {
        LightContext { geometry: &self.geometry, textures: &self.textures, bounds: self.bounds }
    }

    /// The light that the surface at a hit is, with its index.
    #[inline]
    pub fn light_at(&self, hit: &Interaction) -> Option<(u32, &Light)> {
        let index = self.objects[hit.object.0 as usize].light?;
        Some((index, &self.lights[index as usize]))
    }
}

/// The light of a shape that emits; none of a black one.
fn emission(geometry: &Geometry, index: usize, shape: &ShapeDesc) -> Option<Light> {
    Light::area(geometry, crate::geometry::ObjectId(index as u32), shape.emission.as_ref()?)
}

/// Checks what importers should never get wrong, so that no index can panic later.
fn check_references(
    materials: &[Material],
    meshes: &[crate::geometry::Mesh],
    shapes: &[ShapeDesc],
    file: &str,
    diagnostics: &mut Diagnostics,
) {
    if let Some(id) = first_bad_nesting(materials) {
        let message = "the material wraps itself, another one too deep, or one that does not exist";
        diagnostics.error(file, format!("material {}", id.0), message, "");
    }
    for (i, mesh) in meshes.iter().enumerate() {
        if let Err(e) = mesh.validate() {
            diagnostics.error(file, format!("mesh {i}"), e.to_string(), "");
        }
    }
    for shape in shapes {
        let mesh_missing = matches!(shape.kind, desc::ShapeKind::Mesh(id) if id.0 as usize >= meshes.len());
        if shape.material.0 as usize >= materials.len() || mesh_missing {
            diagnostics.error(file, shape.name.clone(), "the shape names a mesh or material that does not exist", "");
        }
    }
}

/// Checks media and what has one.
fn check_media(
    media: &[Medium],
    global: Option<desc::MediumId>,
    materials: &[Material],
    shapes: &[ShapeDesc],
    file: &str,
    diagnostics: &mut Diagnostics,
) {
    for (i, m) in media.iter().enumerate() {
        if let Err(e) = Medium::new(m.sigma_t, m.albedo, m.phase) {
            diagnostics.error(file, format!("medium {i}"), format!("the medium can't be used: {e}"), "");
        }
    }
    let missing = |id: Option<desc::MediumId>| id.is_some_and(|id| id.0 as usize >= media.len());
    if missing(global) {
        diagnostics.error(file, "", "the scene names a medium that does not exist", "");
    }
    for shape in shapes {
        if missing(shape.interior) {
            diagnostics.error(file, shape.name.clone(), "the shape names a medium that does not exist", "");
        }
        let flat = matches!(shape.kind, desc::ShapeKind::Disk | desc::ShapeKind::Rectangle);
        if flat && shape.interior.is_some() {
            let help = "use a cube, a sphere or a closed mesh";
            diagnostics.error(file, shape.name.clone(), "a flat shape has no inside that a medium could fill", help);
        }
        if shape.emission.is_some() && matches!(materials.get(shape.material.0 as usize), Some(Material::Null)) {
            let help = "give it another material, or let a shape just inside or outside of it emit";
            diagnostics.error(file, shape.name.clone(), "a surface that is not there (null) can't emit", help);
        }
    }
}

/// Warns of meshes with an inside that they do not enclose, once for each.
fn check_insides(meshes: &[crate::geometry::Mesh], shapes: &[ShapeDesc], file: &str, diagnostics: &mut Diagnostics) {
    let mut known = std::collections::BTreeSet::new();
    for shape in shapes.iter().filter(|s| s.interior.is_some()) {
        if let desc::ShapeKind::Mesh(id) = shape.kind
            && known.insert(id.0)
            && !meshes[id.0 as usize].is_closed()
        {
            let message = "the mesh has an interior but is not closed: an edge of it belongs to one triangle only";
            let help = "close it; light that passes through the hole is taken to be inside or outside as it was before";
            diagnostics.warn(file, shape.name.clone(), message, help);
        }
    }
}

/// An object for a shape's transform.
fn placed(shape: crate::geometry::Shape, to_world: Transform, flip_normals: bool) -> Object {
    Object { shape, to_world, flip_normals }
}
