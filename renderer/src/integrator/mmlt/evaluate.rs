use super::constants::{ChainConstants, MmltOptions};
use super::neighbours::Tail;
use crate::integrator::UnitContext;
use crate::math::{Vec2, Vec3};
use crate::path::{Always, Connection, Subpath, Tracer};
use crate::sampling::{Discrete, PrimarySpace, Sampler, StepSizes, Stream};
use crate::spectrum::Rgb;

/// The path that a point of primary sample space makes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Proposal {
    /// Its weighted contribution to the picture over the probability of its technique.
    pub value: Rgb,
    /// What the chain's density is proportional to; 0 where there is no path.
    pub target: f32,
    /// Where it falls.
    pub raster: Vec2,
    /// Vertices from the light.
    pub technique: u32,
}

/// Makes paths of one length from points of primary sample space.
pub struct Evaluator<'a> {
    /// Traces and counts.
    pub tracer: Tracer<'a>,
    constants: &'a ChainConstants,
    size: Vec2,
    pub(super) edges: usize,
    techniques: Discrete,
    sizes: StepSizes,
    pub(super) camera: Subpath,
    pub(super) light: Subpath,
    /// Of the path that was made last: where it goes through the lens, and along what its two walks were joined.
    lens_u: Vec2,
    connection: Option<Vec3>,
}

impl<'a> Evaluator<'a> {
    /// For paths of `edges` edges; `None` when no technique makes any.
    pub fn new(c: &UnitContext<'a>, constants: &'a ChainConstants, options: &MmltOptions, edges: u32) -> Option<Self> {
        let techniques = constants.depth(edges)?.table(c.scene)?;
        Some(Self {
            tracer: c.tracer(None),
            constants,
            size: Vec2::new(c.view.width as f32, c.view.height as f32),
            edges: edges as usize,
            techniques,
            sizes: options.step_sizes(),
            camera: Subpath::default(),
            light: Subpath::default(),
            lens_u: Vec2::ZERO,
            connection: None,
        })
    }

    /// Proposes the path that a pool's sample found with s vertices from the light.
    pub fn replay(&mut self, space: &mut PrimarySpace, key: u64, s: u32) -> Proposal {
        space.propose_large(key);
        if s as usize <= self.edges {
            let rest = space.stream(Stream::Technique, &self.sizes).next_1d();
            space.set_technique(self.techniques.locate(s as usize, rest));
        }
        self.evaluate(space)
    }

    /// The path of the space's proposal.
    pub fn evaluate(&mut self, space: &mut PrimarySpace) -> Proposal {
        let choice = self.techniques.sample(space.stream(Stream::Technique, &self.sizes).next_1d());
        let s = choice.index;
        let mut proposal = Proposal { value: Rgb::ZERO, target: 0.0, raster: Vec2::ZERO, technique: s as u32 };
        let Some((value, raster)) = self.path(space, s) else { return proposal };
        let value = value / choice.pmf;
        if self.tracer.counters.admit(value) {
            proposal.target = self.constants.target_of(value, raster, self.size);
        }
        if proposal.target > 0.0 {
            (proposal.value, proposal.raster) = (value, raster);
        }
        proposal
    }

    /// What the path that was made last has in common with its neighbours, if it makes a set with them.
    pub(super) fn tail(&self, path: &Proposal) -> Option<Tail> {
        if !(path.target > 0.0) {
            return None;
        }
        let ray = self.tracer.camera.generate_ray(path.raster, self.lens_u);
        Tail::of(self, path, self.lens_u, &ray, self.connection)
    }

    /// Weighted contribution to the whole picture of the path with s vertices from the light, and where it falls.
    fn path(&mut self, space: &mut PrimarySpace, s: usize) -> Option<(Rgb, Vec2)> {
        let t = self.edges + 1 - s;
        let mut lens = space.stream(Stream::Lens, &self.sizes);
        let raster = lens.next_2d() * self.size;
        let lens_u = self.tracer.lens_numbers(&mut lens);
        (self.lens_u, self.connection) = (lens_u, None);
        if t == 1 {
            self.walk_light(space, s)?;
            let path = self.tracer.to_lens(&self.light, s, lens_u)?;
            return self.visible(&path).map(|value| (value, path.raster.unwrap_or_default()));
        }
        let ray = self.tracer.camera.generate_ray(raster, lens_u);
        self.tracer.camera_walk(&mut self.camera, &mut space.stream(Stream::Camera, &self.sizes), ray, t);
        // A raster position uniform over the picture stands for all of its pixels.
        let pixels = self.size.x * self.size.y;
        let made = self.camera.vertices.len();
        let value = match s {
            0 if made == t => self.tracer.hit(&self.camera, t).map(|path| path.weighted()),
            0 if made + 1 == t => {
                Some(self.tracer.escaped(&self.camera).fold(Rgb::ZERO, |sum, path| sum + path.weighted()))
            }
            _ if made < t => None,
            1 => {
                let mut numbers = space.stream(Stream::Connection, &self.sizes);
                let (uc, u) = (numbers.next_1d(), numbers.next_2d());
                self.tracer.next_event(&self.camera, t, uc, u, &mut Always).and_then(|path| self.visible(&path))
            }
            _ => {
                self.walk_light(space, s)?;
                self.tracer.join(&self.light, s, &self.camera, t, &mut Always).and_then(|path| self.visible(&path))
            }
        };
        value.map(|value| (value * pixels, raster))
    }

    /// Walks from the light; `None` when it ends before there are s vertices.
    fn walk_light(&mut self, space: &mut PrimarySpace, s: usize) -> Option<()> {
        self.tracer.light_walk(&mut self.light, &mut space.stream(Stream::Light, &self.sizes), s);
        (self.light.vertices.len() == s).then_some(())
    }

    fn visible(&mut self, path: &Connection) -> Option<Rgb> {
        let value = path.weighted();
        self.connection = path.shadow.map(|ray| ray.d);
        (!value.is_black() && self.tracer.is_free(path)).then_some(value)
    }
}
