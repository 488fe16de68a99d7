//! Light that comes straight to a vertex of a path: found by its rays, or by next-event estimation.

use super::lamps::not_near_lamp;
use super::split::{LIGHTS, of_direction, of_light};
use super::{Arrival, Here, Leg, Walk};
use crate::bsdf::Transport;
use crate::geometry::Interaction;
use crate::light::LiSample;
use crate::math::{Ray, Vec2, Vec3};
use crate::medium::passing_probability;
use crate::sampling::{Choice, Sampler};
use crate::spectrum::Rgb;

/// A light that may shine on a vertex, if nothing is in between.
struct Candidate {
    choice: Choice,
    li: LiSample,
    /// Value of the BSDF or phase function, and the absolute cosine where it is a BSDF.
    f: Rgb,
    cos: f32,
    /// Density of the sample.
    pdf: f32,
    /// Density with which the BSDF or phase function has the same direction.
    pdf_scattering: f32,
}

impl Candidate {
    /// Its weight over its density as one of `lights` samples, where the other density is `pdf_scattering`.
    #[inline]
    fn factor(&self, pdf_scattering: f32, lights: u32) -> f32 {
        let weight = if self.li.delta { 1.0 / lights as f32 } else { of_light(self.pdf, pdf_scattering, lights) };
        weight / self.pdf
    }

    /// What it gives with that factor.
    #[inline]
    fn value(&self, factor: f32) -> Rgb {
        self.f * self.li.radiance * (self.cos * factor)
    }
}

impl<const MEDIA: bool, const SHARE: bool> Walk<'_, '_, MEDIA, SHARE> {
    /// Light of the sky, weighted.
    pub(super) fn escaped(&self, ray: &Ray, arrival: &Arrival) -> Rgb {
        let scene = self.c.scene;
        let mut sum = Rgb::ZERO;
        for &i in &scene.infinite_lights {
            let light = &scene.lights[i as usize];
            let weight = if arrival.alone {
                1.0
            } else {
                let pdf_light = self.c.selector.pmf_at(&arrival.place, i as usize) * light.pdf_li_escaped(ray.d);
                of_direction(arrival.pdf, pdf_light, arrival.lights)
            };
            sum += light.le_infinite(ray.d) * weight;
        }
        sum
    }

    /// Light of the surface that was hit, weighted.
    pub(super) fn emitted(&self, hit: &Interaction, wo: Vec3, arrival: &Arrival) -> Rgb {
        let Some((index, light)) = self.c.scene.light_at(hit) else { return Rgb::ZERO };
        let context = self.c.scene.light_context();
        let radiance = light.radiance(&context, hit, wo);
        if radiance.is_black() || arrival.alone {
            return radiance;
        }
        let pmf = self.c.selector.pmf_at(&arrival.place, index as usize);
        let pdf_light = pmf * light.pdf_li(&context, arrival.from.p, &hit.anchor());
        radiance * of_direction(arrival.pdf, pdf_light, arrival.lights)
    }

    /// A sample of a light by three numbers.
    #[inline(always)]
    fn candidate(&mut self, here: Here, beta: Rgb, (uc, u): (f32, Vec2)) -> Option<Candidate> {
        let scene = self.c.scene;
        let choice = self.c.selector.sample_at(here.place, uc)?;
        if self.lessons.learns() {
            let expected = f64::from(self.c.selector.expected(here.place, choice.index)) * f64::from(beta.luminance());
            self.lessons.expected(choice.index, choice.pmf, expected * expected);
        }
        let light = &scene.lights[choice.index];
        let li = light.sample_li(&scene.light_context(), here.anchor.p, choice.u, u)?;
        let (f, pdf_scattering) = here.scattering.eval_pdf(li.wi, Transport::Radiance);
        if f.is_black() {
            return None;
        }
        let (cos, pdf) = (here.scattering.abs_cos(li.wi), li.pdf * choice.pmf);
        Some(Candidate { choice, li, f, cos, pdf, pdf_scattering })
    }

    /// Light that comes straight from a chosen light, and the choice.
    pub(super) fn next_event(&mut self, here: Here, leg: &Leg, beta: Rgb) -> Option<(Choice, Rgb)> {
        let scene = self.c.scene;
        let numbers = self.sampler.next_3();
        let candidate = self.candidate(here, beta, numbers);
        let found = candidate.as_ref()?;
        let li = &found.li;
        if MEDIA {
            let around = scene.beside(here.object, here.anchor, li.wi, &leg.around);
            let through = scene.transmission(here.anchor, &li.into(), around, &mut self.counters.rays)?;
            let factor = found.factor(found.pdf_scattering * passing_probability(through.tau), 1);
            let direct = found.value(factor) * through.transmittance;
            let lamp = scene.lights[found.choice.index].position();
            return Some((found.choice, direct * lamp.map_or(1.0, |lamp| not_near_lamp(here, leg, lamp))));
        }
        let factor = found.factor(found.pdf_scattering, 1);
        let contribution = found.value(factor);
        if contribution.is_black() {
            return None;
        }
        if SHARE {
            self.kept.lit = Some((li.wi, li.radiance * factor));
        }
        self.counters.rays += 1;
        (!scene.accel.occluded(&li.shadow_ray(here.anchor))).then_some((found.choice, contribution))
    }

    /// Light that comes straight from chosen lights to the first vertex.
    pub(super) fn several_lights(&mut self, here: Here) -> Rgb {
        let mut open = [(Choice { index: 0, pmf: 1.0, u: 0.0 }, Rgb::ZERO); LIGHTS as usize];
        let mut rays = [Ray::new(Vec3::ZERO, Vec3::X); LIGHTS as usize];
        let mut count = 0;
        for i in 0..self.lights {
            let numbers = self.sampler.one_of(self.lights, i).next_3();
            let candidate = self.candidate(here, Rgb::ONE, numbers);
            let Some(found) = &candidate else { continue };
            let value = found.value(found.factor(found.pdf_scattering, self.lights));
            if !value.is_black() {
                open[count] = (found.choice, value);
                rays[count] = found.li.shadow_ray(here.anchor);
                count += 1;
            }
        }
        // The path's own numbers go on as if it had taken one sample.
        self.sampler.skip_3();

        self.counters.rays += count as u64;
        // Radiance may be as large as single precision has it; its square may not.
        let (mut sum, mut squares) = (Rgb::ZERO, 0.0f64);
        for ((choice, value), hidden) in open[..count].iter().zip(self.c.scene.accel.occluded_each(&rays[..count])) {
            if !hidden && self.counters.admit(*value) {
                sum += *value;
                squares += f64::from(value.luminance()) * f64::from(value.luminance());
                self.lessons.gave(choice.index, choice.pmf, *value);
            }
        }
        if SHARE {
            // Variance of their sum, from the squared differences of all pairs.
            let (n, total) = (f64::from(self.lights), f64::from(sum.luminance()));
            self.kept.scatter = Some((n * squares - total * total).max(0.0) / (n - 1.0));
        }
        sum
    }
}
