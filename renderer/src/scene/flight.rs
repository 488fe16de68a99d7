//! Straight flights through media: how far light comes, and how much of it arrives. Null surfaces and such as are hidden inside an
//! object of higher rank are passed; along the way the media are constant piece by piece.

use super::{Enclosures, Scene};
use crate::geometry::Interaction;
use crate::light::LiSample;
use crate::math::rounding::{gamma, offset_ray_origin};
use crate::math::{Anchor, Ray, Vec3};
use crate::medium::{Channels, Medium, MediumId, Reach, passing_weight, transmittance};
use crate::spectrum::Rgb;

/// A flight through more surfaces than this comes to nothing: coincident surfaces might hold it for ever.
const MOST_CROSSED: usize = 4096;
/// Flatter rays than of this cosine are taken for as flat: the surface may bend away below them.
const FLATTEST: f32 = 1e-3;
/// What is scattered beyond this does not come back: squares of distances must be finite.
const FARTHEST: f32 = 1e15;
/// Nothing of a beam is left, in single precision, after this optical depth.
const OPAQUE: f32 = 104.0;

/// Where a flight ends.
#[derive(Clone, Copy, Debug)]
pub enum Event {
    /// At a surface that is there.
    Surface(Interaction),
    /// In a medium, which scatters it.
    Scatter {
        /// The point.
        p: Vec3,
        /// The medium there.
        medium: MediumId,
    },
    /// Nowhere: it left the scene.
    Escaped,
}

/// A sampled flight.
#[derive(Clone, Copy, Debug)]
pub struct Flight {
    /// Where it ends.
    pub event: Event,
    /// What the path's throughput is multiplied by: at a scattering `sigma_s T / density`, else `T` over the probability of coming
    /// that far.
    pub weight: Rgb,
    /// Optical depth of the scattering media on the way, from which densities follow: `medium::passing_probability`, or at a
    /// scattering `Medium::scatter_density`, and the same with the medium at the start for the flight back.
    pub tau: Rgb,
    /// What encloses the end; at a surface, on the side from which it was reached.
    pub around: Enclosures,
}

/// What a shadow ray ends at.
#[derive(Clone, Copy, Debug)]
pub enum Target {
    /// A point.
    Point(Anchor),
    /// Infinitely far, in this unit direction.
    Direction(Vec3),
}

impl From<&LiSample> for Target {
    fn from(li: &LiSample) -> Self {
        if li.dist.is_infinite() { Self::Direction(li.wi) } else { Self::Point(li.light) }
    }
}

/// What comes through between two points.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Transmission {
    /// Share of light.
    pub transmittance: Rgb,
    /// Optical depth of the scattering media alone, as in [`Flight::tau`].
    pub tau: Rgb,
    /// What encloses the far end; at a surface, on the side from which it was reached.
    pub around: Enclosures,
}

/// Optical depths that have added up on the way.
#[derive(Clone, Copy, Debug, Default)]
struct Depth {
    /// Of media that scatter.
    scattering: Rgb,
    /// Of media that only absorb.
    absorbing: Rgb,
}

impl Depth {
    #[inline]
    fn add(&mut self, medium: &Medium, distance: f32) {
        let tau = medium.tau(distance);
        if medium.scatters() {
            self.scattering += tau;
        } else {
            self.absorbing += tau;
        }
    }
}

impl Scene {
    /// Follows a ray (of unit direction) from a point inside `around` to what it meets; `u` in [0, 1) samples how far it comes, in a
    /// channel chosen by `channels`, which the weight takes into account. Densities that follow from `tau` are those of channels
    /// chosen alike, and serve as such in weights of multiple importance sampling. `rays` counts the rays that are cast.
    pub fn fly(&self, channels: &Channels, ray: &Ray, around: Enclosures, u: f32, rays: &mut u64) -> Flight {
        let mut reach = Reach::new(u, self.features.chromatic_media.then_some(channels));
        let (mut ray, mut around) = (*ray, around);
        let mut depth = Depth::default();
        // What lies between the last surface and the origin that is clear of it. Left out, it would show where light goes unhindered
        // for less than 1e-4 of the coordinates: a half-space of albedo 0.9 lost 0.3 % of its reflectance there, at 1e-6 14 %.
        let mut skipped = 0.0;
        for _ in 0..MOST_CROSSED {
            let medium = self.medium_in(&around);
            let scattering = medium.filter(|(_, m)| m.scatters());
            let whole = scattering.map_or(f32::INFINITY, |(_, m)| reach.distance(m));
            let limit = (whole - skipped).max(0.0);
            // A little further: a point that rounding would move through a surface must be kept from it.
            ray.t_max = limit + (limit + ray.o.abs().max_element()) * gamma(8);
            *rays += 1;
            let hit = self.accel.intersect(&ray);
            let end = hit.map_or(f32::INFINITY, |h| h.t);
            let passed = end + skipped;
            let surface = hit.map(|h| self.geometry.interaction(&ray, &h));
            if let (Some((id, m)), true) = (scattering, limit.is_finite() && limit <= end) {
                let p = scattering_point(&ray, limit, surface.as_ref());
                if limit > FARTHEST {
                    return Flight { event: Event::Escaped, weight: Rgb::ZERO, tau: depth.scattering, around };
                }
                if !self.is_stray(p, &around) {
                    depth.add(m, whole);
                    let weight = transmittance(depth.absorbing) * m.scatter_weight(depth.scattering, channels);
                    return Flight { event: Event::Scatter { p, medium: id }, weight, tau: depth.scattering, around };
                }
                around = Enclosures::default();
                continue;
            }
            let Some(surface) = surface else {
                if !around.is_empty() {
                    // No object reaches to infinity: the ray had left them through a hole or by rounding.
                    around = Enclosures::default();
                    continue;
                }
                if let Some((_, m)) = medium {
                    depth.add(m, f32::INFINITY);
                }
                return depth.passed(Event::Escaped, around, channels);
            };
            if let Some((_, m)) = medium {
                depth.add(m, passed);
            }
            if let Some((_, m)) = scattering {
                // Not quite to zero, which rounding might do: zero over zero would be no distance.
                reach.tau = (reach.tau - m.tau(passed)[reach.channel]).max(f32::MIN_POSITIVE);
            }
            match self.passes(surface.object, surface.ng.dot(ray.d) < 0.0, &around) {
                None => return depth.passed(Event::Surface(surface), around, channels),
                Some(beyond) => {
                    around = beyond;
                    ray = surface.spawn_ray(ray.d);
                    skipped = skipped_before(&ray, &surface);
                }
            }
        }
        Flight { event: Event::Escaped, weight: Rgb::ZERO, tau: depth.scattering, around }
    }

    /// What comes through from a point inside `around` to `target`; `None` when nothing does. `rays` counts the rays that are cast.
    pub fn transmission(
        &self,
        from: &Anchor,
        target: &Target,
        around: Enclosures,
        rays: &mut u64,
    ) -> Option<Transmission> {
        let (mut from, mut around) = (*from, around);
        let mut depth = Depth::default();
        for _ in 0..MOST_CROSSED {
            let ray = match target {
                Target::Point(end) => from.segment_to(end),
                Target::Direction(d) => from.ray(*d),
            };
            *rays += 1;
            let surface = self.accel.intersect(&ray).map(|h| self.geometry.interaction(&ray, &h));
            if surface.is_none() && matches!(target, Target::Direction(_)) {
                around = Enclosures::default();
            }
            if let Some((_, m)) = self.medium_in(&around) {
                let distance = match (&surface, target) {
                    (Some(s), _) => (s.p - from.p).length(),
                    (None, Target::Point(end)) => (end.p - from.p).length(),
                    (None, Target::Direction(_)) => f32::INFINITY,
                };
                depth.add(m, distance);
            }
            let tau = depth.scattering + depth.absorbing;
            if tau.min_component() > OPAQUE {
                return None;
            }
            let Some(surface) = surface else {
                return Some(Transmission { transmittance: transmittance(tau), tau: depth.scattering, around });
            };
            around = self.passes(surface.object, surface.ng.dot(ray.d) < 0.0, &around)?;
            from = surface.anchor();
        }
        None
    }

    /// Whether a point can't be inside any of the objects that are said to be around it.
    #[inline]
    fn is_stray(&self, p: Vec3, around: &Enclosures) -> bool {
        !around.is_empty() && self.is_far(p)
    }

    /// Whether a point is outside of the bounds of all objects.
    #[inline]
    pub fn is_far(&self, p: Vec3) -> bool {
        let r = self.bounds.radius * (1.0 + gamma(16));
        !((p - self.bounds.centre).length_squared() <= r * r)
    }
}

/// Where a flight is scattered, `t` along its ray: before the surface, if it comes so near to one.
#[inline]
fn scattering_point(ray: &Ray, t: f32, surface: Option<&Interaction>) -> Vec3 {
    match surface {
        Some(s) => offset_ray_origin(s.p, s.p_error, s.ng, -ray.d),
        // At least a unit in the last place on: an edge without length has no direction and no density.
        None => ray.at(t.max(ray.o.abs().max_element() * f32::EPSILON)),
    }
}

/// How far a ray would have come from the plane of the surface that it leaves to the depth of its origin below.
#[inline]
fn skipped_before(ray: &Ray, surface: &Interaction) -> f32 {
    let cos = ray.d.dot(surface.ng).abs();
    ((ray.o - surface.p).dot(surface.ng)).abs() / cos.max(FLATTEST)
}

impl Depth {
    /// A flight that has passed it all.
    #[inline]
    fn passed(&self, event: Event, around: Enclosures, channels: &Channels) -> Flight {
        let weight = transmittance(self.absorbing) * passing_weight(self.scattering, channels);
        Flight { event, weight, tau: self.scattering, around }
    }
}
