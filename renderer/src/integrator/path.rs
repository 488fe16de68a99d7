//! Unidirectional path tracing: next-event estimation and BSDF sampling, combined by multiple importance sampling
//! (Kajiya 1986; Veach 1997, chapter 9).
//!
//! In media, lamps without extent are met in two ways: from where the path scatters, and from points of its flights that are chosen
//! near the lamp, since what a lamp gives to points chosen without regard to it has no finite variance.

use super::share::{self, Kept};
use super::{UnitContext, tile};
use crate::bsdf::Transport;
use crate::film::{Aov, Counters, Rect, TileSums};
use crate::geometry::{Interaction, ObjectId};
use crate::light::LightLessons;
use crate::math::{Anchor, Ray, Vec2, Vec3};
use crate::medium::{Channels, Equiangular, passing_probability};
use crate::path::{MediumPoint, Scattering, power_heuristic, roulette};
use crate::sampling::{Choice, Sampler};
use crate::scene::{Enclosures, Event, Target};
use crate::spectrum::Rgb;
use std::ops::Range;

/// Renders samples `samples` of each pixel of a tile; `None` when stopped. What next-event estimation finds teaches of the lights.
pub fn render_tile(
    c: &UnitContext<'_>,
    rect: Rect,
    samples: Range<u32>,
    lessons: &mut LightLessons,
    counters: &mut Counters,
) -> Option<TileSums> {
    counters.samples += rect.area() as u64 * u64::from(samples.end - samples.start);
    // Which of the two it is is decided once for the tile: scenes without media run no code for them.
    if c.scene.features.has_media() {
        render::<true>(c, rect, samples, lessons, counters)
    } else if share::is_of_use(c) {
        share::render(c, rect, samples, lessons, counters)
    } else {
        render::<false>(c, rect, samples, lessons, counters)
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
        Walk::<_, MEDIA, false> { c, lessons, counters, sampler: s.sampler, aov: s.aov, kept }.radiance(s.ray)
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
}

/// One path, through media or not.
pub(super) struct Walk<'a, 'b, S, const MEDIA: bool, const SHARE: bool> {
    pub c: &'a UnitContext<'a>,
    pub lessons: &'b mut LightLessons,
    pub counters: &'b mut Counters,
    pub sampler: S,
    pub aov: Option<&'b mut Aov>,
    /// Of a path that shares: what it has to share.
    pub kept: &'b mut Kept,
}

impl<S: Sampler, const MEDIA: bool, const SHARE: bool> Walk<'_, '_, S, MEDIA, SHARE> {
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
        let arrival = Arrival { from: lens, pdf: 0.0, alone: true };
        let mut leg = Leg { ray: camera_ray, around: scene.camera_enclosures, tau: Rgb::ZERO, arrival };
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
            let here = Here { anchor: &anchor, object, scattering: &scattering };
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

            // Connect to a light.
            if !here.scattering.is_delta_only()
                && self.c.carried.has(edges + 1)
                && let Some((choice, direct)) = self.next_event(here, &leg)
            {
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
            leg.arrival = Arrival { from: *here.anchor, pdf: s.pdf, alone: s.lobe.delta };
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

    /// Light of the sky, weighted.
    fn escaped(&self, ray: &Ray, arrival: &Arrival) -> Rgb {
        let scene = self.c.scene;
        let mut sum = Rgb::ZERO;
        for &i in &scene.infinite_lights {
            let light = &scene.lights[i as usize];
            let weight = if arrival.alone {
                1.0
            } else {
                power_heuristic(arrival.pdf, self.c.selector.pmf(i as usize) * light.pdf_li_escaped(ray.d))
            };
            sum += light.le_infinite(ray.d) * weight;
        }
        sum
    }

    /// Light of the surface that was hit, weighted.
    fn emitted(&self, hit: &Interaction, wo: Vec3, arrival: &Arrival) -> Rgb {
        let Some((index, light)) = self.c.scene.light_at(hit) else { return Rgb::ZERO };
        let context = self.c.scene.light_context();
        let radiance = light.radiance(&context, hit, wo);
        if radiance.is_black() || arrival.alone {
            return radiance;
        }
        let pdf_light = self.c.selector.pmf(index as usize) * light.pdf_li(&context, arrival.from.p, &hit.anchor());
        radiance * power_heuristic(arrival.pdf, pdf_light)
    }

    /// Light that comes straight from a chosen light, and the choice.
    fn next_event(&mut self, here: Here, leg: &Leg) -> Option<(Choice, Rgb)> {
        let scene = self.c.scene;
        let (uc, u) = self.sampler.next_3();
        let choice = self.c.selector.sample(uc)?;
        self.lessons.tried(choice.index, choice.pmf, 1);
        let light = &scene.lights[choice.index];
        let Here { anchor: from, object, scattering } = here;
        let sample = light.sample_li(&scene.light_context(), from.p, choice.u, u);
        let li = sample.as_ref()?;
        let (f, pdf_scattering) = scattering.eval_pdf(li.wi, Transport::Radiance);
        if f.is_black() {
            return None;
        }
        let cos = scattering.abs_cos(li.wi);
        let pdf = li.pdf * choice.pmf;
        let weight = |pdf_scattering: f32| if li.delta { 1.0 } else { power_heuristic(pdf, pdf_scattering) };
        let weighted = |pdf_scattering: f32| f * li.radiance * (cos * weight(pdf_scattering) / pdf);
        if MEDIA {
            let around = scene.beside(object, from, li.wi, &leg.around);
            let through = scene.transmission(from, &li.into(), around, &mut self.counters.rays)?;
            let direct = weighted(pdf_scattering * passing_probability(through.tau)) * through.transmittance;
            return Some((choice, direct * light.position().map_or(1.0, |lamp| not_near_lamp(here, leg, lamp))));
        }
        let contribution = weighted(pdf_scattering);
        if contribution.is_black() {
            return None;
        }
        if SHARE {
            self.kept.lit = Some((li.wi, li.radiance * (weight(pdf_scattering) / pdf)));
        }
        self.counters.rays += 1;
        (!scene.accel.occluded(&li.shadow_ray(from))).then_some((choice, contribution))
    }

    /// Light of a lamp without extent that is scattered once into the flight ahead, at a point chosen near the lamp.
    fn scattered_near_lamp(&mut self, leg: &Leg) -> Option<Rgb> {
        let scene = self.c.scene;
        let (uc, u) = (self.sampler.next_1d(), self.sampler.next_1d());
        let choice = self.c.selector.sample(uc)?;
        let light = &scene.lights[choice.index];
        let near = Equiangular::new(leg.ray.o, leg.ray.d, light.position()?)?;
        let t = near.sample(u);
        let p = Anchor::free(leg.ray.at(t));
        let li = light.sample_li(&scene.light_context(), p.p, choice.u, Vec2::ZERO)?;

        // To the point, and on to the lamp.
        let rays = &mut self.counters.rays;
        let to = scene.transmission(&leg.arrival.from, &Target::Point(p), leg.around, rays)?;
        let (_, medium) = scene.medium_in(&to.around).filter(|(_, m)| m.scatters())?;
        let on = scene.transmission(&p, &(&li).into(), to.around, rays)?;

        let phase = medium.phase.pdf(-leg.ray.d, li.wi);
        let pdf = near.pdf(t);
        let weight = power_heuristic(pdf, medium.scatter_density(to.tau));
        let arriving = medium.sigma_s() * to.transmittance * li.radiance * on.transmittance;
        Some(arriving * (phase * weight / (pdf * li.pdf * choice.pmf)))
    }
}

/// Weight of a point at which a flight was scattered by itself, against its choice near `lamp`.
fn not_near_lamp(here: Here, leg: &Leg, lamp: Vec3) -> f32 {
    match (here.scattering, Equiangular::new(leg.ray.o, leg.ray.d, lamp)) {
        (Scattering::Medium(point), Some(near)) => {
            let t = (here.anchor.p - leg.ray.o).length();
            power_heuristic(point.medium.scatter_density(leg.tau), near.pdf(t))
        }
        _ => 1.0,
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
