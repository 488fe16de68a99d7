use super::mis::{Heuristic, Step};
use super::scattering::Scattering;
use crate::bsdf::Transport;
use crate::geometry::ObjectId;
use crate::light::LightFlags;
use crate::math::{Anchor, Vec3};
use crate::medium::{Medium, passing_probability};
use crate::scene::{Enclosures, Scene};
use crate::spectrum::Rgb;

/// What is at a vertex.
#[derive(Clone, Copy, Debug)]
pub enum VertexKind {
    /// The camera's lens.
    Lens,
    /// A point (or, infinitely far away, a direction) of a light.
    Light,
    /// A surface, or a point of a medium.
    Inner(Scattering),
}

/// A vertex of a walk.
#[derive(Clone, Copy, Debug)]
pub struct Vertex {
    /// What is there.
    pub kind: VertexKind,
    /// Where it is.
    pub anchor: Anchor,
    /// The walk's throughput when it arrives here: emission (or importance) over density, and `f cos / pdf` of the vertices before.
    pub beta: Rgb,
    /// Density with which its own walk made it (see [`super::mis`] for the measure).
    pub pdf_fwd: f64,
    /// The way back to the vertex before.
    pub edge: Edge,
    /// Whether the walk went on through a delta lobe.
    pub delta: bool,
    /// Relative densities of the strategies that connect at or beyond this vertex, for a walk that went at least two vertices on.
    pub tail: f64,
    /// What encloses it, on the side from which the walk came.
    pub around: Enclosures,
    /// The object whose surface it is on, which may have a medium inside.
    pub object: Option<ObjectId>,
    /// What the surface emits towards the vertex before: index of the light and radiance.
    pub emitted: Option<(u32, Rgb)>,
}

impl Vertex {
    /// The first vertex of a walk.
    pub(super) fn first(kind: VertexKind, anchor: Anchor, pdf_fwd: f64) -> Self {
        Self {
            kind,
            anchor,
            beta: Rgb::ONE,
            pdf_fwd,
            edge: Edge::NONE,
            delta: false,
            tail: 0.0,
            around: Enclosures::default(),
            object: None,
            emitted: None,
        }
    }

    /// The medium whose point it is.
    #[inline]
    pub fn medium(&self) -> Option<&Medium> {
        match &self.kind {
            VertexKind::Inner(Scattering::Medium(point)) => Some(&point.medium),
            _ => None,
        }
    }

    /// What scatters here, if it can be connected to.
    #[inline]
    pub(super) fn connectible(&self) -> Option<&Scattering> {
        match &self.kind {
            VertexKind::Inner(at) if !at.is_delta_only() => Some(at),
            _ => None,
        }
    }

    /// Density with which a walk from the other end makes the vertex before, when it comes here from `w`; `mode` is that of this
    /// vertex's own walk.
    #[inline]
    pub(super) fn pdf_back(&self, at: &Scattering, w: Vec3, mode: Transport) -> f64 {
        f64::from(at.pdf_reverse(w, mode.reversed())) * self.edge.backward
    }

    /// What encloses a ray that leaves in direction `w`.
    #[inline]
    pub fn around_towards(&self, scene: &Scene, w: Vec3) -> Enclosures {
        scene.beside(self.object, &self.anchor, w, &self.around)
    }
}

/// Turns densities of directions into densities of vertices, those of distances in media included.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Edge {
    /// Density of the far vertex over that of the direction towards it.
    pub forward: f64,
    /// Density of the near vertex over that of the direction back to it.
    pub backward: f64,
    /// Probability that a flight comes this far through the media on the way; part of the density of a vertex on a surface.
    pub passes: f64,
}

impl Edge {
    /// No edge: the first vertex of a walk has none behind it.
    pub const NONE: Self = Self { forward: 0.0, backward: 0.0, passes: 1.0 };

    /// Between two points, with `w` the unit direction from the first to the second.
    #[inline]
    pub fn between(from: &Anchor, to: &Anchor, w: Vec3) -> Self {
        // Points of a dense medium may fall together: far too near for coordinates is as good as any distance, but not 0 / 0.
        let d2 = f64::from((to.p - from.p).length_squared()).max(f64::from(f32::MIN_POSITIVE));
        Self { forward: abs_cos(to, w) / d2, backward: abs_cos(from, w) / d2, passes: 1.0 }
    }

    /// From a light infinitely far away, whose light travels along `w`: its direction is its vertex, and the point on the disk through
    /// which the ray came is the first surface's.
    #[inline]
    pub fn from_infinity(to: &Anchor, w: Vec3) -> Self {
        Self { forward: abs_cos(to, w), backward: 1.0, passes: 1.0 }
    }

    /// The edge through scattering media of optical depth `tau`; `from` and `to` are the media of its ends that are points of one.
    #[inline]
    pub fn through(self, tau: Rgb, from: Option<&Medium>, to: Option<&Medium>) -> Self {
        Self {
            forward: self.forward * distance_density(tau, to),
            backward: self.backward * distance_density(tau, from),
            passes: f64::from(passing_probability(tau)),
        }
    }
}

/// Density of the distance of a flight through scattering media of optical depth `tau`: per length where it ends in a medium, the
/// probability of coming so far where it ends at a surface.
#[inline]
pub fn distance_density(tau: Rgb, end: Option<&Medium>) -> f64 {
    f64::from(end.map_or_else(|| passing_probability(tau), |medium| medium.scatter_density(tau)))
}

/// `|cos|` of the angle between a direction and a surface's geometric normal; 1 for a point in free space.
#[inline]
pub(super) fn abs_cos(at: &Anchor, w: Vec3) -> f64 {
    if at.ng == Vec3::ZERO { 1.0 } else { f64::from(at.ng.dot(w).abs()) }
}

/// The light that a walk started from.
#[derive(Clone, Copy, Debug)]
pub struct LightStart {
    /// Index of the light.
    pub index: usize,
    /// What kind of light it is.
    pub flags: LightFlags,
    /// Density of the light's point when it is sampled from the first surface (s = 1), over that when the walk starts there.
    pub direct: f64,
}

/// A walk that left the scene.
#[derive(Clone, Copy, Debug)]
pub struct Escape {
    /// Its direction.
    pub w: Vec3,
    /// Its throughput.
    pub beta: Rgb,
    /// Density of the direction per solid angle.
    pub pdf: f64,
    /// Optical depth of the scattering media on the way out.
    pub tau: Rgb,
}

/// A walk from one end of a path; reused from path to path.
#[derive(Clone, Debug, Default)]
pub struct Subpath {
    /// The lens or the light, then surfaces.
    pub vertices: Vec<Vertex>,
    /// The light of a walk from the lights.
    pub light: Option<LightStart>,
    /// How a walk from the camera left the scene, if it did.
    pub escape: Option<Escape>,
}

impl Subpath {
    /// Forgets everything.
    pub fn clear(&mut self) {
        self.vertices.clear();
        self.light = None;
        self.escape = None;
    }

    /// Whether a strategy may connect vertex `i` to its predecessor, counted from this walk's end: neither has a delta lobe there.
    #[inline]
    fn connects(&self, i: usize) -> bool {
        i > 0 && !self.vertices[i].delta && !self.vertices[i - 1].delta
    }

    /// The step outwards past vertex `i`, which the other end's walk makes with density `pdf_rev`. `end` says whether `i` is the vertex
    /// that is connected, and so not delta whatever the walk did there later.
    #[inline]
    pub fn step(&self, heuristic: Heuristic, i: usize, pdf_rev: f64, end: bool) -> Step {
        let ratio = pdf_rev / self.vertices[i].pdf_fwd;
        let exists = match (&self.light, i) {
            (Some(_), 0 | 1) if !heuristic.has_path() => false,
            // The camera walk that hits the light.
            (Some(light), 0) => !light.flags.is_delta(),
            // Nothing hits a lens.
            (None, 0) => false,
            _ if end => !self.vertices[i - 1].delta,
            _ => self.connects(i),
        };
        let own = match &self.light {
            Some(light) if i == 1 => light.direct,
            _ => 1.0,
        };
        Step { ratio, reach: if exists { own } else { 0.0 } }
    }

    /// Sum over the strategies beyond a connection at the vertex `end`, which the other walk makes with density `pdf_rev`, and the vertex
    /// before it with `pdf_rev_before`.
    #[inline]
    pub fn beyond(&self, heuristic: Heuristic, end: usize, pdf_rev: f64, pdf_rev_before: f64) -> f64 {
        let mut sum = 0.0;
        if end >= 2 {
            sum = self.vertices[end - 2].tail;
        }
        if end >= 1 {
            sum = heuristic.fold(sum, self.step(heuristic, end - 1, pdf_rev_before, false));
        }
        heuristic.fold(sum, self.step(heuristic, end, pdf_rev, true))
    }
}
