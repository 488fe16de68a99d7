use crate::camera::Camera;
use crate::film::Filter;
use crate::light::LightSelector;
use crate::scene::Scene;
use crate::scene::desc::FilterDesc;

/// The camera and the filter for a film of a given size.
#[derive(Clone, Debug)]
pub struct View {
    /// Width in pixels.
    pub width: u32,
    /// Height in pixels.
    pub height: u32,
    /// The scene's camera for this film.
    pub camera: Camera,
    /// The film's filter.
    pub filter: Filter,
}

impl View {
    /// The scene's camera, for a film of this size. `None` when the film is empty (the camera was checked with the scene).
    pub fn new(scene: &Scene, width: u32, height: u32, filter: FilterDesc) -> Option<Self> {
        let camera = Camera::new(&scene.camera, width, height).ok()?;
        Some(Self { width, height, camera, filter: Filter::new(&filter, width, height) })
    }
}

/// What every unit of an integrator needs.
pub struct UnitContext<'a> {
    /// The scene.
    pub scene: &'a Scene,
    /// Camera and filter.
    pub view: &'a View,
    /// The job's seed.
    pub seed: u64,
    /// The unit's replicate group.
    pub replicate: u32,
    /// Edges of the longest path.
    pub max_depth: u32,
    /// Edges from which Russian roulette may end a path.
    pub rr_depth: u32,
    /// Chooses lights: by power, or as the plan says.
    pub selector: &'a LightSelector,
    /// Whether the unit should end without a result.
    pub stopped: &'a dyn Fn() -> bool,
}
