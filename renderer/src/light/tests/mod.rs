//! Statistical tests of every light of the list, on the examples that each kind of light provides.

mod directions;
mod emission;
mod examples;
mod irradiance;
mod places;
mod shadow;
mod sky;
mod spots;

pub(super) use examples::{emitters, environments};

use super::{Light, LightContext};
use crate::accel::Accel;
use crate::geometry::{BoundingSphere, Geometry, Object, Shape};
use crate::math::{Anchor, DAffine3, DVec3, Frame, Ray, Transform, Vec2, Vec3};
use crate::sampling::{IndependentSampler, Sampler, warp};
use crate::texture::Texture;

/// A light in a scene of its own.
pub(super) struct Example {
    pub name: &'static str,
    /// For area lights the one object that emits; for other lights something that only gives the scene its bounds.
    pub geometry: Geometry,
    pub textures: Vec<Texture>,
    pub light: Light,
    bounds: BoundingSphere,
}

impl Example {
    pub fn new(name: &'static str, geometry: Geometry, textures: Vec<Texture>, light: Light) -> Self {
        let bounds = geometry.bounds();
        Self { name, geometry, textures, light, bounds }
    }

    /// A light without a surface, in a scene of radius 2 around the origin.
    pub fn free(name: &'static str, light: Light) -> Self {
        let to_world = Transform::new(DAffine3::from_scale(DVec3::splat(2.0 / 3f64.sqrt()))).unwrap();
        let objects = vec![Object { shape: Shape::Sphere, to_world, flip_normals: false }];
        Self::new(name, Geometry::new(Vec::new(), objects), Vec::new(), light)
    }

    pub fn ctx(&self) -> LightContext<'_> {
        LightContext { geometry: &self.geometry, textures: &self.textures, bounds: self.bounds }
    }

    pub fn is_area(&self) -> bool {
        matches!(self.light, Light::Area(_))
    }

    pub fn is_delta(&self) -> bool {
        self.light.flags().is_delta()
    }

    /// For visibility: empty for lights without a surface.
    pub fn accel(&self) -> Accel {
        let empty = Geometry::default();
        Accel::build(if self.is_area() { &self.geometry } else { &empty }).unwrap()
    }

    /// Radiance that arrives at `p` from the unit direction `w`, and the density with which `sample_li` takes it if it emits.
    pub fn look(&self, accel: &Accel, p: Vec3, w: Vec3) -> (f64, f64) {
        let ctx = self.ctx();
        let ray = Ray::new(p, w);
        let Some(hit) = accel.intersect(&ray) else {
            return (f64::from(self.light.le_infinite(w).luminance()), f64::from(self.light.pdf_li_escaped(w)));
        };
        let hit = self.geometry.interaction(&ray, &hit);
        let radiance = f64::from(self.light.radiance(&ctx, &hit, -w).luminance());
        (radiance, if radiance > 0.0 { f64::from(self.light.pdf_li(&ctx, p, &hit.anchor())) } else { 0.0 })
    }

    /// Points from which the light is looked at: near (on both sides of a surface), far, within.
    pub fn points(&self) -> Vec<Vec3> {
        let bounds = self.ctx().bounds;
        let mut s = IndependentSampler::new([1, self.name.len() as u64]);
        let mut points: Vec<Vec3> = [0.3f32, 1.3, 4.0, 40.0]
            .iter()
            .map(|distance| bounds.centre + warp::uniform_sphere(s.next_2d()) * (bounds.radius * distance))
            .collect();
        if self.is_area() && self.geometry.objects[0].shape != Shape::Sphere {
            // Not where the density by area has no bound to speak of: close to a surface.
            let on = self.a_point();
            let beside = (on.ng + 0.7 * warp::uniform_sphere(s.next_2d())).normalize();
            points[0] = on.p + beside * (0.3 * bounds.radius);
            points.push(on.p - beside * (0.3 * bounds.radius));
        }
        points
    }

    /// Some point of the light.
    pub fn a_point(&self) -> Anchor {
        let le = self.light.sample_le(&self.ctx(), 0.3, Vec2::new(0.4, 0.3), Vec2::splat(0.2));
        le.unwrap().light
    }
}

/// A direction with density 1 / (2 pi omc_max) in the cone around `frame.n`.
pub(super) fn in_cone(frame: &Frame, omc_max: f32, x: f32, y: f32) -> Vec3 {
    frame.to_world(warp::uniform_cone(Vec2::new(x, y), omc_max))
}

/// The luminance of one `sample_li` estimate of irradiance on a surface facing `n`, shadowed by the light itself.
pub(super) fn irradiance_sample_from(
    example: &Example,
    accel: &Accel,
    from: &Anchor,
    n: Vec3,
    s: &mut IndependentSampler,
) -> f64 {
    let (uc, u) = (s.next_1d(), s.next_2d());
    let Some(li) = example.light.sample_li(&example.ctx(), from.p, uc, u) else { return 0.0 };
    let cos = li.wi.dot(n);
    if !(cos > 0.0) || accel.occluded(&li.shadow_ray(from)) {
        return 0.0;
    }
    f64::from(li.radiance.luminance()) * f64::from(cos) / f64::from(li.pdf)
}

/// The same at a point in free space.
pub(super) fn irradiance_sample(example: &Example, accel: &Accel, p: Vec3, n: Vec3, s: &mut IndependentSampler) -> f64 {
    irradiance_sample_from(example, accel, &Anchor::free(p), n, s)
}
