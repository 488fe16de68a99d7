//! Unidirectional path tracing: next-event estimation and BSDF sampling, combined by multiple importance sampling
//! (Kajiya 1986; Veach 1997, chapter 9).

use super::{UnitContext, tile};
use crate::bsdf::{ShadingPoint, Transport};
use crate::film::{Aov, Counters, Rect, TileSums};
use crate::geometry::Interaction;
use crate::math::{Ray, Vec3};
use crate::path::{power_heuristic, roulette};
use crate::sampling::Sampler;
use crate::spectrum::Rgb;
use std::ops::Range;

/// Renders samples `samples` of each pixel of a tile; `None` when stopped.
pub fn render_tile(c: &UnitContext<'_>, rect: Rect, samples: Range<u32>, counters: &mut Counters) -> Option<TileSums> {
    counters.samples += rect.area() as u64 * u64::from(samples.end - samples.start);
    tile::render(c, rect, samples, |s| {
        Walk { c, counters: &mut *counters, sampler: s.sampler, aov: s.aov }.radiance(s.ray)
    })
}

/// How the path came to where it is, for the weight of light that it runs into.
#[derive(Clone, Copy)]
struct Arrival {
    /// The vertex before.
    p: Vec3,
    /// Density per solid angle of the direction taken there.
    pdf: f32,
    /// Whether next-event estimation could not have found the same light: the camera, or a delta lobe.
    alone: bool,
}

/// One path.
struct Walk<'a, 'b, S> {
    c: &'a UnitContext<'a>,
    counters: &'b mut Counters,
    sampler: S,
    aov: Option<&'b mut Aov>,
}

impl<S: Sampler> Walk<'_, '_, S> {
    /// Radiance that arrives along a camera ray.
    fn radiance(&mut self, camera_ray: Ray) -> Rgb {
        let scene = self.c.scene;
        let mut total = Rgb::ZERO;
        let mut beta = Rgb::ONE;
        // Product of squared index ratios so far: radiance is scaled by it inside glass, which must not steer the roulette.
        let mut eta_scale = 1.0f32;
        let mut ray = camera_ray;
        let mut arrival = Arrival { p: ray.o, pdf: 0.0, alone: true };
        let mut edges = 0;
        while edges < self.c.max_depth {
            edges += 1;
            self.sampler.start_vertex(edges);
            self.counters.rays += 1;
            let Some(hit) = scene.accel.intersect(&ray) else {
                if self.c.carried.has(edges) {
                    self.add(&mut total, beta, self.escaped(&ray, &arrival));
                }
                break;
            };
            let hit = scene.geometry.interaction(&ray, &hit);
            let wo = -ray.d;
            if self.c.carried.has(edges) {
                self.add(&mut total, beta, self.emitted(&hit, wo, &arrival));
            }
            let material = scene.objects[hit.object.0 as usize].material;
            let shading = ShadingPoint::new(&scene.materials, &scene.textures, material, &hit, wo);
            if edges == 1 {
                self.first_hit(&camera_ray, &hit, &shading);
            }
            if edges == self.c.max_depth {
                break;
            }

            // Connect to a light.
            if !shading.is_delta_only() && self.c.carried.has(edges + 1) {
                let direct = self.next_event(&hit, &shading);
                self.add(&mut total, beta, direct);
            }

            // Go on in a direction drawn from the BSDF.
            let uc = self.sampler.next_1d();
            let u = self.sampler.next_2d();
            let Some(s) = shading.sample(uc, u, Transport::Radiance) else { break };
            beta *= s.weight();
            if beta.is_black() || !beta.is_valid() {
                self.counters.admit(beta);
                break;
            }
            eta_scale *= s.eta * s.eta;
            ray = hit.spawn_ray(s.wi);
            arrival = Arrival { p: hit.p, pdf: s.pdf, alone: s.lobe.delta };

            // End the path by chance when it carries little.
            if edges >= self.c.rr_depth {
                let Some(factor) = roulette(beta * eta_scale, self.sampler.next_1d()) else { break };
                beta *= factor;
            }
        }
        total
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
        let pdf_light = self.c.selector.pmf(index as usize) * light.pdf_li(&context, arrival.p, &hit.anchor());
        radiance * power_heuristic(arrival.pdf, pdf_light)
    }

    /// Light that comes straight from a chosen light.
    fn next_event(&mut self, hit: &Interaction, shading: &ShadingPoint) -> Rgb {
        let scene = self.c.scene;
        let uc = self.sampler.next_1d();
        let u = self.sampler.next_2d();
        let Some(choice) = self.c.selector.sample(uc) else { return Rgb::ZERO };
        let light = &scene.lights[choice.index];
        let Some(li) = light.sample_li(&scene.light_context(), hit.p, choice.u, u) else { return Rgb::ZERO };
        let (f, pdf_bsdf) = shading.eval_pdf(li.wi, Transport::Radiance);
        if f.is_black() {
            return Rgb::ZERO;
        }
        let pdf = li.pdf * choice.pmf;
        let weight = if li.delta { 1.0 } else { power_heuristic(pdf, pdf_bsdf) };
        let contribution = f * li.radiance * (shading.abs_cos(li.wi) * weight / pdf);
        if contribution.is_black() {
            return Rgb::ZERO;
        }
        self.counters.rays += 1;
        if scene.accel.occluded(&li.shadow_ray(&hit.anchor())) { Rgb::ZERO } else { contribution }
    }

    /// What the first surface is, for the auxiliary images.
    fn first_hit(&mut self, ray: &Ray, hit: &Interaction, shading: &ShadingPoint) {
        if let Some(aov) = self.aov.as_deref_mut() {
            aov.add(&Aov {
                albedo: shading.bsdf.albedo().to_array(),
                normal: shading.frame.n.to_array(),
                depth: (hit.p - ray.o).length(),
                hits: 1.0,
            });
        }
    }
}
