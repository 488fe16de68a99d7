use crate::scene::Scene;
use crate::scene::desc::FilterDesc;

/// The camera and the filter for a film of a given size.
#[derive(Clone, Debug)]
pub struct View {
    /// Width in pixels.
    pub width: u32,
    /// Height in pixels.
    pub height: u32,
}

impl View {
    /// The scene's camera, for a film of this size.
    pub fn new(_scene: &Scene, width: u32, height: u32, _filter: FilterDesc) -> Self {
        Self { width, height }
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
    /// Selection weights of the lights; empty = by power.
    pub light_weights: &'a [f32],
    /// Whether the unit should end without a result.
    pub stopped: &'a dyn Fn() -> bool,
}
