//! Lamps without extent in media: light that they give to points of a flight that are chosen near them.

use super::{Here, Leg, Walk};
use crate::math::{Anchor, Vec2, Vec3};
use crate::medium::Equiangular;
use crate::path::{Scattering, power_heuristic};
use crate::sampling::Sampler;
use crate::scene::Target;
use crate::spectrum::Rgb;

impl<const MEDIA: bool, const SHARE: bool> Walk<'_, '_, MEDIA, SHARE> {
    /// Light of a lamp without extent that is scattered once into the flight ahead, at a point chosen near the lamp.
    pub(super) fn scattered_near_lamp(&mut self, leg: &Leg) -> Option<Rgb> {
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
pub(super) fn not_near_lamp(here: Here, leg: &Leg, lamp: Vec3) -> f32 {
    match (here.scattering, Equiangular::new(leg.ray.o, leg.ray.d, lamp)) {
        (Scattering::Medium(point), Some(near)) => {
            let t = (here.anchor.p - leg.ray.o).length();
            power_heuristic(point.medium.scatter_density(leg.tau), near.pdf(t))
        }
        _ => 1.0,
    }
}
