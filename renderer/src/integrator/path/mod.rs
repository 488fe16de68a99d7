//! Unidirectional path tracing: next-event estimation and BSDF sampling, combined by multiple importance sampling
//! (Kajiya 1986; Veach 1997, chapter 9).
//!
//! In media, lamps without extent are met in two ways: from where the path scatters, and from points of its flights that are chosen
//! near the lamp, since what a lamp gives to points chosen without regard to it has no finite variance.

mod lamps;
mod lights;
mod split;

use super::share::{self, Kept};
use super::{Lessons, UnitContext, tile};
use crate::bsdf::Transport;
use crate::film::{Aov, Counters, Rect, TileSums};
use crate::geometry::{Interaction, ObjectId};
use crate::light::{LightLessons, Place};
use crate::math::{Anchor, Ray};
use crate::medium::{Channels, passing_probability};
use crate::path::{MediumPoint, Scattering, roulette};
use crate::sampling::{Sampler, SobolSampler};
use crate::scene::{Enclosures, Event};
use crate::spectrum::Rgb;
pub(super) use split::LIGHTS;
use std::ops::Range;

/// Renders samples `samples` of each pixel of a tile; `None` when stopped. What is found teaches of the lights, and of
/// what pixels gain by sharing.
pub fn render_tile(
    c: &UnitContext<'_>,
    rect: Rect,
    samples: Range<u32>,
    lessons: &mut Lessons,
    counters: &mut Counters,
) -> Option<TileSums> {
    counters.samples += rect.area() as u64 * u64::from(samples.end - samples.start);
    // Which of the two it is is decided once for the tile: scenes without media run no code for them.
    if c.scene.features.has_media() {
        render::<true>(c, rect, samples, &mut lessons.lights, counters)
    } else if share::is_of_use(c) {
        share::render(c, rect, samples, lessons, counters)
    } else {
        render::<false>(c, rect, samples, &mut lessons.lights, counters)
    }
}

fn render<const MEDIA: bool>(
    c: &UnitContext<'_>,
    rect: Rect,
    samples: Range<u32>,
    lessons: &mut LightLessons,
    counters: &mut Counters,
) -> Option<TileSums> {
    let mut kept = Kept::default();
    tile::render(c, rect, samples, |s| {
        let (lessons, counters, kept) = (&mut *lessons, &mut *counters, &mut kept);
        Walk::<MEDIA, false> { c, lessons, counters, sampler: s.sampler, aov: s.aov, lights: 1, kept }.radiance(s.ray)
    })
}

/// Blocks of numbers for the lamps along the flights lie beyond those of all vertices.
const LAMPS: u32 = 1 << 20;

/// How the path came to where it is, for the weight of light that it runs into.
#[derive(Clone, Copy)]
struct Arrival {
    /// The vertex before.
    from: Anchor,
    /// Density per solid angle of the direction taken there, times the probability of coming through the media since.
    pdf: f32,
    /// Whether next-event estimation could not have found the same light: the camera, or a delta lobe.
    alone: bool,
    /// How many samples of lights the vertex before has taken.
    lights: u32,
    /// The vertex before, as lights were selected for it.
    place: Place,
}

/// A flight before it is made.
struct Leg {
    ray: Ray,
    /// What encloses the ray's origin; after the flight, its end.
    around: Enclosures,
    /// After the flight, optical depth of the scattering media on the way.
    tau: Rgb,
    arrival: Arrival,
}

/// Where a path scatters.
#[derive(Clone, Copy)]
struct Here<'a> {
    anchor: &'a Anchor,
    /// The object whose surface it is on; none in a medium.
    object: Option<ObjectId>,
    scattering: &'a Scattering,
    /// The same, as lights are selected for it.
    place: &'a Place,
}

/// One path, through media or not.
pub(super) struct Walk<'a, 'b, const MEDIA: bool, const SHARE: bool> {
    pub c: &'a UnitContext<'a>,
    pub lessons: &'b mut LightLessons,
    pub counters: &'b mut Counters,
    pub sampler: SobolSampler,
    pub aov: Option<&'b mut Aov>,
    /// How many samples of lights its first vertex takes; in media one.
    pub lights: u32,
    /// Of a path that shares: what it has to share.
    pub kept: &'b mut Kept,
}

impl<const MEDIA: bool, const SHARE: bool> Walk<'_, '_, MEDIA, SHARE> {
    /// Radiance that arrives along a camera ray. Of a path that shares it is without what its second vertex reflects.
    pub fn radiance(&mut self, camera_ray: Ray) -> Rgb {
        let scene = self.c.scene;
        let mut total = Rgb::ZERO;
        let mut beta = Rgb::ONE;
        // What was found and carried before the vertex that is shared, from which on they are counted anew.
        let (mut before, mut prefix) = (Rgb::ZERO, Rgb::ONE);
        if SHARE {
            *self.kept = Kept::default();
        }
        // Product of squared index ratios so far: radiance is scaled by it inside glass, which must not steer the roulette.
        let mut eta_scale = 1.0f32;
        let lens = Anchor::free(camera_ray.o);
        let arrival = Arrival { from: lens, pdf: 0.0, alone: true, lights: 1, place: Place::anywhere(lens.p) };
        let mut leg = Leg { ray: camera_ray, around: scene.camera_enclosures, tau: Rgb::ZERO, arrival };
        let selects = self.c.selector.by_place();
        let mut edges = 0;
        while edges < self.c.max_depth {
            edges += 1;
            if MEDIA && edges < self.c.max_depth && self.c.carried.has(edges + 1) {
                self.sampler.start_vertex(LAMPS + edges);
                let scattered = self.scattered_near_lamp(&leg);
                self.add(&mut total, beta, scattered.unwrap_or(Rgb::ZERO));
            }
            self.sampler.start_vertex(edges);
            // The parts of `Here` are made in their places: every copy would wait for what was just written.
            let (anchor, object, scattering);
            if MEDIA {
                match self.fly(&mut leg, &mut beta) {
                    Event::Surface(hit) => {
                        scattering = self.arrive(&hit, &leg, beta, edges, &mut total);
                        (anchor, object) = (hit.anchor(), Some(hit.object));
                    }
                    Event::Scatter { p, medium } => {
                        let medium = scene.media[medium.0 as usize];
                        scattering = Scattering::Medium(MediumPoint { medium, wo: -leg.ray.d });
                        (anchor, object) = (Anchor::free(p), None);
                    }
                    Event::Escaped => {
                        self.escape(&leg, beta, edges, &mut total);
                        break;
                    }
                }
            } else {
                self.counters.rays += 1;
                let hit = scene.accel.intersect(&leg.ray);
                let Some(hit) = &hit else {
                    self.escape(&leg, beta, edges, &mut total);
                    break;
                };
                let hit = scene.geometry.interaction(&leg.ray, hit);
                scattering = self.arrive(&hit, &leg, beta, edges, &mut total);
                anchor = hit.anchor();
                object = Some(hit.object);
            }
            let place = if selects { scattering.place(anchor.p) } else { Place::anywhere(anchor.p) };
            let here = Here { anchor: &anchor, object, scattering: &scattering, place: &place };
            if let (1, Some(aov)) = (edges, self.aov.as_deref_mut()) {
                aov.add(&tile::shown(here.scattering, &lens, here.anchor));
            }
            if edges == self.c.max_depth {
                break;
            }
            if SHARE && edges == 1 {
                self.kept.first = Some((anchor, scattering));
            }
            let shared = SHARE && edges == 2 && self.kept.begin(&anchor, &scattering, -leg.ray.d);
            if shared {
                (before, prefix) = (total, beta);
                (total, beta) = (Rgb::ZERO, Rgb::ONE);
            }

            // Connect to lights.
            let connects = !here.scattering.is_delta_only() && self.c.carried.has(edges + 1);
            let lights = if !MEDIA && edges == 1 && connects { self.lights } else { 1 };
            if lights > 1 {
                let direct = self.several_lights(here);
                self.add(&mut total, beta, direct);
            } else if connects && let Some((choice, direct)) = self.next_event(here, &leg, prefix * beta) {
                self.add(&mut total, beta, direct);
                self.lessons.gave(choice.index, choice.pmf, prefix * beta * direct);
            } else if SHARE {
                self.kept.lit = None;
            }
            if shared {
                self.kept.connected(total);
                total = Rgb::ZERO;
            }

            // Go on in a direction drawn from the BSDF or the phase function.
            let (uc, u) = here.scattering.numbers(&mut self.sampler);
            let sample = here.scattering.sample(uc, u, Transport::Radiance);
            let Some(s) = &sample else { break };
            beta *= here.scattering.weight(s);
            if beta.is_black() || !beta.is_valid() {
                self.counters.admit(beta);
                break;
            }
            if SHARE && edges == 1 && !s.lobe.delta {
                self.kept.departed = Some((s.f * s.cos_theta, s.pdf));
            } else if shared {
                self.kept.departs(s);
                (prefix, beta) = (prefix * beta, Rgb::ONE);
            }
            eta_scale *= s.eta * s.eta;
            leg.ray = here.anchor.ray(s.wi);
            leg.arrival = Arrival { from: *here.anchor, pdf: s.pdf, alone: s.lobe.delta, lights, place };
            if MEDIA {
                leg.around = scene.beside(here.object, here.anchor, s.wi, &leg.around);
            }

            // End the path by chance when it carries little.
            if edges >= self.c.rr_depth && !(SHARE && edges == 1) {
                let u = self.sampler.next_1d();
                let carried = prefix * beta * eta_scale;
                let factor = match here.scattering {
                    Scattering::Medium(_) if !scene.is_far(here.anchor.p) => roulette_in_medium(carried, u),
                    _ => roulette(carried, u),
                };
                let Some(factor) = factor else { break };
                beta *= factor;
            }
        }
        if SHARE && self.kept.end(total) { before } else { total }
    }

    /// Goes on through media to what the ray meets.
    fn fly(&mut self, leg: &mut Leg, beta: &mut Rgb) -> Event {
        let u = self.sampler.next_1d();
        let channels = Channels::by_throughput(*beta);
        let flight = self.c.scene.fly(&channels, &leg.ray, leg.around, u, &mut self.counters.rays);
        *beta *= flight.weight;
        leg.around = flight.around;
        leg.tau = flight.tau;
        leg.arrival.pdf *= passing_probability(flight.tau);
        flight.event
    }

    /// Adds the light of the surface that is met; what scatters the path there.
    #[inline(always)]
    fn arrive(&mut self, hit: &Interaction, leg: &Leg, beta: Rgb, edges: u32, total: &mut Rgb) -> Scattering {
        let scene = self.c.scene;
        let wo = -leg.ray.d;
        if self.c.carried.has(edges) {
            self.add(total, beta, self.emitted(hit, wo, &leg.arrival));
        }
        let material = scene.objects[hit.object.0 as usize].material;
        Scattering::at_surface(&scene.materials, &scene.textures, material, hit, wo)
    }

    /// Adds the light of the sky.
    #[inline]
    fn escape(&mut self, leg: &Leg, beta: Rgb, edges: u32, total: &mut Rgb) {
        if self.c.carried.has(edges) {
            self.add(total, beta, self.escaped(&leg.ray, &leg.arrival));
        }
    }

    /// Adds a contribution unless it is not a number or negative, which is counted.
    #[inline]
    fn add(&mut self, total: &mut Rgb, beta: Rgb, radiance: Rgb) {
        if !radiance.is_black() {
            let contribution = beta * radiance;
            if self.counters.admit(contribution) {
                *total += contribution;
            }
        }
    }
}

/// Russian roulette in a medium. Where little is absorbed paths are long by nature: as many as the square of the optical thickness.
/// Surfaces end one in twenty at each vertex, whatever it carries; here the few that came far would carry all of the light. (Paths
/// that have left the scene for a medium without end hardly come back: those are treated as at surfaces.)
#[inline]
fn roulette_in_medium(throughput: Rgb, u: f32) -> Option<f32> {
    let q = throughput.max_component().min(0.9999);
    (u < q).then(|| 1.0 / q)
}
