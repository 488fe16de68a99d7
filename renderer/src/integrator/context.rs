use super::gauge::{Choice, Lesson};
use crate::camera::Camera;
use crate::film::{Counters, Filter};
use crate::light::{LightLessons, LightSelector};
use crate::math::{Ray, Vec2};
use crate::path::Tracer;
use crate::path::mis::Heuristic;
use crate::sampling::Sampler;
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

/// The path lengths that ordinary samples carry: short ones, and those longer than what chains carry.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Carried {
    /// Edges of the longest of the short ones.
    pub up_to: u32,
    /// Longer than this again.
    pub beyond: u32,
}

impl Carried {
    /// All lengths.
    pub const ALL: Self = Self { up_to: u32::MAX, beyond: u32::MAX };

    /// Whether paths of so many edges are carried.
    #[inline]
    pub fn has(self, edges: u32) -> bool {
        edges <= self.up_to || edges > self.beyond
    }
}

impl<'a> UnitContext<'a> {
    /// For all paths of up to `max_depth` edges, without what makes rendering faster: roulette, connections left to chance, shared paths.
    pub fn of_all_paths(scene: &'a Scene, view: &'a View, max_depth: u32) -> Self {
        Self {
            scene,
            view,
            seed: 0,
            replicate: 0,
            max_depth,
            carried: Carried::ALL,
            rr_depth: u32::MAX,
            threshold: 0.0,
            share: false,
            begin: None,
            selector: &scene.selector,
            stopped: &|| false,
        }
    }

    /// Traces and connects walks for the unit; Russian roulette may end them from `rr_depth` edges on, if at all.
    pub fn tracer(&self, rr_depth: Option<u32>) -> Tracer<'a> {
        self.tracer_weighing(rr_depth, Heuristic::Power)
    }

    /// The same with another heuristic.
    pub fn tracer_weighing(&self, rr_depth: Option<u32>, heuristic: Heuristic) -> Tracer<'a> {
        Tracer {
            scene: self.scene,
            camera: &self.view.camera,
            selector: self.selector,
            rr_depth,
            heuristic,
            counters: Counters::default(),
        }
    }

    /// The camera ray through a raster position, by the sampler's next numbers.
    #[inline]
    pub fn camera_ray(&self, sampler: &mut impl Sampler, raster: Vec2) -> Ray {
        let lens = if self.view.camera.is_pinhole() { Vec2::ZERO } else { sampler.next_2d() };
        self.view.camera.generate_ray(raster, lens)
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
    /// The path lengths that count.
    pub carried: Carried,
    /// Edges from which Russian roulette may end a path.
    pub rr_depth: u32,
    /// Contributions of connections below this are tested for visibility by chance only; 0 = never.
    pub threshold: f32,
    /// Whether paths of pixels may share their second vertices.
    pub share: bool,
    /// How pixels begin to share, as other samples have taught.
    pub begin: Option<Choice>,
    /// Chooses lights: by power, or as the plan says.
    pub selector: &'a LightSelector,
    /// Whether the unit should end without a result.
    pub stopped: &'a dyn Fn() -> bool,
}

/// What the samples of a unit teach those of later passes.
#[derive(Debug)]
pub struct Lessons {
    /// Which lights are worth selecting.
    pub lights: LightLessons,
    /// What pixels gain by sharing, if they may.
    pub sharing: Option<Lesson>,
}
