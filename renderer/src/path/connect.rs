//! What each strategy makes of two walks: contribution, weight, and the ray that must be free.
//!
//! Strategy (s, t) takes s vertices from the light and t from the camera (Veach 1997, section 10.2). A contribution is the radiance that
//! the path carries over the density with which the strategy makes it, without its weight and without visibility.

use super::mis::Step;
use super::vertex::{Subpath, Vertex, abs_cos, distance_density};
use super::walk::Tracer;
use crate::bsdf::Transport;
use crate::math::{Anchor, Ray, Vec2, Vec3};
use crate::medium::{Medium, transmittance};
use crate::scene::{Enclosures, Target};
use crate::spectrum::Rgb;

/// A path made by one strategy.
#[derive(Clone, Copy, Debug)]
pub struct Connection {
    /// Contribution, unweighted.
    pub value: Rgb,
    /// Weight of the strategy for this path.
    pub weight: f64,
    /// The ray that must be free; `None` where there is nothing to test.
    pub shadow: Option<Ray>,
    /// Where it falls on the picture, for t = 1: elsewhere than the camera walk's own place.
    pub raster: Option<Vec2>,
    /// The light that was selected for it; none where the path ran into one.
    pub light: Option<usize>,
}

impl Connection {
    /// Contribution times weight.
    #[inline]
    pub fn weighted(&self) -> Rgb {
        self.value * self.weight as f32
    }
}

/// Factor from a density of directions at `from` to the density of the vertex `at`, which they meet along `w`.
#[inline]
fn per_area(at: &Anchor, w: Vec3, d2: f64) -> f64 {
    abs_cos(at, w) / d2
}

/// Decides by chance whether a connection is worth the rays that it takes.
pub trait Chance {
    /// The probability with which a connection was kept that contributes about `estimate`, in its largest channel; `None` drops it.
    fn keep(&mut self, estimate: impl FnOnce() -> f32) -> Option<f32>;
}

/// Keeps all connections.
#[derive(Clone, Copy, Debug)]
pub struct Always;

impl Chance for Always {
    #[inline]
    fn keep(&mut self, _: impl FnOnce() -> f32) -> Option<f32> {
        Some(1.0)
    }
}

/// A connection's contribution is not estimated at less than this share of what it were alone and without media: an estimate that is
/// too low would make it rare and large.
const LEAST_SHARE: f32 = 1e-3;

/// The straight way between the two ends of a connection.
struct Way {
    /// The ray that must be free, unless that is known already.
    shadow: Option<Ray>,
    /// What media let through, over the probability with which the way was followed.
    transmittance: Rgb,
    /// Optical depth of the media that scatter; `None` in a scene without media.
    tau: Option<Rgb>,
}

impl Way {
    /// Density of the distance of a flight along it ([`distance_density`]).
    #[inline]
    fn density(&self, end: Option<&Medium>) -> f64 {
        self.tau.map_or(1.0, |tau| distance_density(tau, end))
    }

    /// The path that connects its ends by it.
    #[inline(always)]
    fn connection(
        self,
        value: Rgb,
        weight: impl Fn(&Self) -> f64,
        raster: Option<Vec2>,
        light: Option<usize>,
    ) -> Connection {
        Connection { value: value * self.transmittance, weight: weight(&self), shadow: self.shadow, raster, light }
    }
}

impl Tracer<'_> {
    /// The way from a vertex to `target`, in direction `w`; `None` when it is known to be blocked. How much media let through takes part
    /// in the weights, so where there are any the way is followed at once, unless `chance` decides otherwise: the connection would
    /// contribute `value` times its weight if nothing were in the way.
    #[inline(always)]
    fn way(
        &mut self,
        from: &Vertex,
        w: Vec3,
        target: Target,
        value: Rgb,
        weight: impl Fn(&Way) -> f64,
        chance: &mut impl Chance,
    ) -> Option<Way> {
        if !self.scene.features.has_media() {
            let shadow = match &target {
                Target::Point(end) => from.anchor.segment_to(end),
                Target::Direction(d) => from.anchor.ray(*d),
            };
            return Some(Way { shadow: Some(shadow), transmittance: Rgb::ONE, tau: None });
        }
        let around = from.around_towards(self.scene, w);
        let q = chance.keep(|| {
            let guess = self.guess(from, &target, &around);
            let estimate = (value * guess.transmittance).max_component() * weight(&guess) as f32;
            estimate.max(LEAST_SHARE * value.max_component())
        })?;
        self.way_through_media(from, &target, around, q)
    }

    /// The way if there were nothing on it but what it starts in. Light from infinitely far is taken to be free of media.
    #[inline(never)]
    fn guess(&self, from: &Vertex, target: &Target, around: &Enclosures) -> Way {
        let mut way = Way { shadow: None, transmittance: Rgb::ONE, tau: Some(Rgb::ZERO) };
        if let (Some((_, medium)), Target::Point(end)) = (self.scene.medium_in(around), target) {
            let tau = medium.tau((end.p - from.anchor.p).length());
            way.transmittance = transmittance(tau);
            way.tau = Some(if medium.scatters() { tau } else { Rgb::ZERO });
        }
        way
    }

    /// The way where there are media, followed with probability `q`. Apart, so that it costs nothing where there are none.
    #[inline(never)]
    fn way_through_media(&mut self, from: &Vertex, target: &Target, around: Enclosures, q: f32) -> Option<Way> {
        let through = self.scene.transmission(&from.anchor, target, around, &mut self.counters.rays)?;
        Some(Way { shadow: None, transmittance: through.transmittance / q, tau: Some(through.tau) })
    }

    /// What comes through from a vertex to `target` in direction `w`; `None` when nothing does.
    pub fn arriving(&mut self, from: &Vertex, w: Vec3, target: Target) -> Option<Rgb> {
        let way = self.way(from, w, target, Rgb::ONE, |_| 1.0, &mut Always)?;
        self.is_clear(way.shadow.as_ref()).then_some(way.transmittance)
    }

    /// Whether nothing is in a path's way.
    #[inline]
    pub fn is_free(&mut self, path: &Connection) -> bool {
        self.is_clear(path.shadow.as_ref())
    }

    /// Whether nothing blocks what is left to test of a way.
    #[inline]
    fn is_clear(&mut self, shadow: Option<&Ray>) -> bool {
        let Some(ray) = shadow else { return true };
        self.counters.rays += 1;
        !self.scene.accel.occluded(ray)
    }

    /// Strategy (0, t): vertex t - 1 of the camera walk lies on a light.
    pub fn hit(&self, camera: &Subpath, t: usize) -> Option<Connection> {
        let at = &camera.vertices[t - 1];
        let (index, radiance) = at.emitted.filter(|(_, radiance)| !radiance.is_black())?;
        let value = at.beta * radiance;
        if t == 2 {
            return Some(Connection { value, weight: 1.0, shadow: None, raster: None, light: None });
        }
        let before = &camera.vertices[t - 2];
        let context = self.scene.light_context();
        let light = &self.scene.lights[index as usize];
        let w = (before.anchor.p - at.anchor.p).normalize();
        let pmf = self.selector.pmf(index as usize);
        let (pdf_pos, pdf_dir) = light.pdf_le(&context, at.anchor.ng, w);
        // The light's point when sampled from the surface before it, over when a walk starts there.
        let solid = f64::from(light.pdf_li(&context, before.anchor.p, &at.anchor));
        let direct = solid * at.edge.forward / at.edge.passes / f64::from(pdf_pos);
        let pdf_rev = f64::from(pmf * pdf_pos);
        let weight = self.hit_weight(camera, t, pdf_rev, at.pdf_fwd, direct, f64::from(pdf_dir) * at.edge.backward);
        Some(Connection { value, weight, shadow: None, raster: None, light: None })
    }

    /// Strategy (0, t) for a camera walk of t - 1 vertices that left the scene: one path for each light that it sees.
    pub fn escaped<'b>(&'b self, camera: &'b Subpath) -> impl Iterator<Item = Connection> + 'b {
        let lights = camera.escape.map(|e| self.scene.infinite_lights.iter().map(move |index| (e, *index)));
        lights.into_iter().flatten().filter_map(move |(e, index)| {
            let light = &self.scene.lights[index as usize];
            let radiance = light.le_infinite(e.w);
            if radiance.is_black() {
                return None;
            }
            let value = e.beta * radiance;
            let t = camera.vertices.len() + 1;
            if t == 2 {
                return Some(Connection { value, weight: 1.0, shadow: None, raster: None, light: None });
            }
            let last = &camera.vertices[t - 2];
            let pdf_rev = f64::from(self.selector.pmf(index as usize) * light.pdf_li_escaped(e.w));
            let (pdf_pos, _) = light.pdf_le(&self.scene.light_context(), -e.w, -e.w);
            let before = f64::from(pdf_pos) * abs_cos(&last.anchor, e.w);
            // Through the media on the way out, and back.
            let way =
                Way { shadow: None, transmittance: Rgb::ONE, tau: self.scene.features.has_media().then_some(e.tau) };
            let (out, back) = (way.density(None), way.density(last.medium()));
            let weight = self.hit_weight(camera, t, pdf_rev, e.pdf * out, 1.0, before * back);
            Some(Connection { value, weight, shadow: None, raster: None, light: None })
        })
    }

    /// Weight of (0, t), t > 2. The walk made its point on the light with density `pdf_fwd`; a walk from the light makes it with `pdf_rev`
    /// (times `direct` when it is sampled from the surface before), and that surface with `pdf_rev_before`.
    fn hit_weight(
        &self,
        camera: &Subpath,
        t: usize,
        pdf_rev: f64,
        pdf_fwd: f64,
        direct: f64,
        pdf_rev_before: f64,
    ) -> f64 {
        let h = self.heuristic;
        let before = camera.step(h, t - 2, pdf_rev_before, false);
        let sum = h.fold(camera.vertices[t - 3].tail, before);
        let reach = if camera.vertices[t - 2].delta || !h.has_path() { 0.0 } else { direct };
        h.weight(0.0, h.fold(sum, Step { ratio: pdf_rev / pdf_fwd, reach }), 1.0)
    }

    /// Strategy (1, t), t > 1: a light sampled from vertex t - 1 of the camera walk.
    pub fn next_event(
        &mut self,
        camera: &Subpath,
        t: usize,
        uc: f32,
        u: Vec2,
        chance: &mut impl Chance,
    ) -> Option<Connection> {
        let at = &camera.vertices[t - 1];
        let scattering = at.connectible()?;
        let choice = self.selector.sample(uc)?;
        let light = &self.scene.lights[choice.index];
        let context = self.scene.light_context();
        let li = light.sample_li(&context, at.anchor.p, choice.u, u)?;
        let (f, pdf_dir) = scattering.eval_pdf(li.wi, Transport::Radiance);
        let pdf = li.pdf * choice.pmf;
        let value = at.beta * f * li.radiance * (scattering.abs_cos(li.wi) / pdf);
        if value.is_black() {
            return None;
        }

        // Densities of a walk that starts at this point of the light.
        let flags = light.flags();
        let (pdf_pos, pdf_emit) = light.pdf_le(&context, li.light.ng, -li.wi);
        let (pdf_pos, pdf_emit) = (f64::from(pdf_pos), f64::from(pdf_emit));
        let (onwards, direct) = if flags.infinite {
            (pdf_pos * abs_cos(&at.anchor, li.wi), 1.0)
        } else {
            let d2 = f64::from(li.dist) * f64::from(li.dist);
            let direct = if li.delta { 1.0 } else { f64::from(li.pdf) * per_area(&li.light, li.wi, d2) / pdf_pos };
            (pdf_emit * per_area(&at.anchor, li.wi, d2), direct)
        };
        let back = at.pdf_back(scattering, li.wi, Transport::Radiance);
        let h = self.heuristic;
        let weight = |way: &Way| {
            let camera_sum = camera.beyond(h, t - 1, onwards * way.density(at.medium()), back);
            // The camera walk that hits the light: its density over that of sampling the light, in the same measure.
            let reach = if li.delta || !h.has_path() { 0.0 } else { direct };
            let ratio = f64::from(pdf_dir) * way.density(None) / f64::from(pdf);
            let light_sum = h.fold(0.0, Step { ratio, reach });
            h.weight(light_sum, camera_sum, direct)
        };
        let way = self.way(at, li.wi, (&li).into(), value, weight, chance)?;
        Some(way.connection(value, weight, None, Some(choice.index)))
    }

    /// Strategy (s, 1), s > 1: vertex s - 1 of the light walk seen from the lens. The contribution is that of the whole picture, to be
    /// weighted by the filter at `raster`; `None` beside the picture.
    pub fn to_lens(&mut self, light: &Subpath, s: usize, lens_u: Vec2) -> Option<Connection> {
        let at = &light.vertices[s - 1];
        let scattering = at.connectible()?;
        let we = self.camera.sample_we(at.anchor.p, lens_u)?;
        if !self.camera.shows(we.raster) {
            return None;
        }
        let (f, _) = scattering.eval_pdf(we.wi, Transport::Importance);
        let cos = scattering.abs_cos(we.wi) * scattering.adjoint_correction(we.wi);
        let value = at.beta * f * (cos * we.we / we.pdf);
        if value.is_black() {
            return None;
        }
        let (_, pdf_dir) = self.camera.pdf_we(-we.wi);
        let d2 = f64::from(we.dist) * f64::from(we.dist);
        let onwards = f64::from(pdf_dir) * per_area(&at.anchor, we.wi, d2);
        let back = at.pdf_back(scattering, we.wi, Transport::Importance);
        let h = self.heuristic;
        let weight = |way: &Way| h.weight(light.beyond(h, s - 1, onwards * way.density(at.medium()), back), 0.0, 1.0);
        let way = self.way(at, we.wi, Target::Point(we.lens), value, weight, &mut Always)?;
        Some(way.connection(value, weight, Some(we.raster), light.light.map(|l| l.index)))
    }

    /// Strategy (s, t), s > 1, t > 1: the two ends joined.
    pub fn join(
        &mut self,
        light: &Subpath,
        s: usize,
        camera: &Subpath,
        t: usize,
        chance: &mut impl Chance,
    ) -> Option<Connection> {
        let (x, z) = (&light.vertices[s - 1], &camera.vertices[t - 1]);
        let (at_x, at_z) = (x.connectible()?, z.connectible()?);
        let d = x.anchor.p - z.anchor.p;
        let d2 = d.length_squared();
        if !(d2 > 0.0) {
            return None;
        }
        let w = d / d2.sqrt();
        let (f_z, pdf_z) = at_z.eval_pdf(w, Transport::Radiance);
        if f_z.is_black() {
            return None;
        }
        let (f_x, pdf_x) = at_x.eval_pdf(-w, Transport::Importance);
        let cos = at_z.abs_cos(w) * at_x.abs_cos(w) * at_x.adjoint_correction(-w);
        let value = z.beta * x.beta * (f_z * f_x * (cos / d2));
        if value.is_black() {
            return None;
        }
        let d2 = f64::from(d2);
        let to_x = f64::from(pdf_z) * per_area(&x.anchor, w, d2);
        let to_z = f64::from(pdf_x) * per_area(&z.anchor, w, d2);
        let back_x = x.pdf_back(at_x, -w, Transport::Importance);
        let back_z = z.pdf_back(at_z, w, Transport::Radiance);
        let h = self.heuristic;
        let weight = |way: &Way| {
            let light_sum = light.beyond(h, s - 1, to_x * way.density(x.medium()), back_x);
            let camera_sum = camera.beyond(h, t - 1, to_z * way.density(z.medium()), back_z);
            h.weight(light_sum, camera_sum, 1.0)
        };
        let way = self.way(z, w, Target::Point(x.anchor), value, weight, chance)?;
        Some(way.connection(value, weight, None, light.light.map(|l| l.index)))
    }
}
