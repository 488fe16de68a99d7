use super::sphere::Sphere;
use super::{Emission, Emitter, LeSample, LiSample, LightBounds, LightContext, LightFlags};
use crate::geometry::{Geometry, Hit, Interaction, ObjectId, SurfaceSample};
use crate::math::rounding::gamma;
use crate::math::{Anchor, Frame, INV_PI, ONE_MINUS_EPSILON, Ray, Vec2, Vec3};
use crate::sampling::{Discrete, warp};
use crate::spectrum::Rgb;
use crate::texture::RgbParam;
use std::f32::consts::PI;

/// Light emitted by an object's surface. Spheres are sampled by solid angle, everything else (and spheres from inside) by area.
#[derive(Clone, Debug)]
pub struct AreaLight {
    object: ObjectId,
    /// Chooses among a mesh's triangles by their area; `None` for a single one and for other shapes.
    primitives: Option<Discrete>,
    sphere: Option<Sphere>,
    /// In the world, m^2.
    area: f32,
    radiance: RgbParam,
    two_sided: bool,
}

impl AreaLight {
    /// The emission of an object; `None` when it has no area or its emission is a constant black.
    pub fn new(geometry: &Geometry, object: ObjectId, emission: &Emission) -> Option<Self> {
        let (RgbParam::Const(factor) | RgbParam::Texture(_, factor)) = emission.radiance;
        if factor.is_black() {
            return None;
        }
        let count = geometry.primitive_count(object);
        let areas: Vec<f32> = (0..count).map(|i| geometry.area(object, i)).collect();
        let table = Discrete::new(&areas)?;
        let area = table.total() as f32;
        if !(area > 0.0 && area.is_finite()) {
            return None;
        }
        let sphere = geometry.sphere_world(object).map(|(centre, radius)| Sphere { centre, radius });
        let primitives = (count > 1).then_some(table);
        Some(Self { object, primitives, sphere, area, radiance: emission.radiance, two_sided: emission.two_sided })
    }

    /// The object that emits.
    #[inline]
    pub fn object(&self) -> ObjectId {
        self.object
    }

    /// A uniform point of the surface.
    #[inline(always)]
    fn sample_surface(&self, ctx: &LightContext, uc: f32, u: Vec2) -> SurfaceSample {
        let primitive = self.primitives.as_ref().map_or(0, |table| table.sample(uc).index as u32);
        ctx.geometry.sample_area(self.object, primitive, u)
    }

    fn radiance_at(&self, ctx: &LightContext, uv: Vec2) -> Rgb {
        self.radiance.eval(ctx.textures, uv)
    }

    /// Density per solid angle of a point drawn by area; `None` where the surface is seen edge-on.
    fn solid_angle_pdf(&self, dist2: f32, cos: f32) -> Option<f32> {
        let pdf = dist2 / (cos.abs() * self.area);
        (pdf > 0.0 && pdf.is_finite()).then_some(pdf)
    }

    fn emits_towards(&self, ng: Vec3, w: Vec3) -> bool {
        self.two_sided || ng.dot(w) > 0.0
    }

    /// Texture coordinates of the sphere's point whose outward normal is `n`: those of a hit by a ray from the centre.
    fn sphere_uv(&self, ctx: &LightContext, sphere: Sphere, n: Vec3) -> Vec2 {
        let hit = Hit { t: sphere.radius, object: self.object, primitive: 0, b: [0.0; 2] };
        ctx.geometry.interaction(&Ray::new(sphere.centre, n), &hit).uv
    }

    /// The near side of a sphere seen from outside; `None` from inside.
    fn sample_sphere(&self, ctx: &LightContext, p: Vec3, u: Vec2) -> Option<Option<LiSample>> {
        let sphere = self.sphere?;
        let s = sphere.sample(p, u)?;
        let n = (s.offset / f64::from(sphere.radius)).as_vec3();
        let flip = ctx.geometry.objects[self.object.0 as usize].flip_normals;
        let ng = if flip { -n } else { n };
        if !self.emits_towards(ng, -s.wi) || !s.pdf.is_finite() {
            return Some(None);
        }
        let point = (sphere.centre.as_dvec3() + s.offset).as_vec3();
        let light = Anchor { p: point, p_error: point.abs() * gamma(2), ng };
        let radiance = match self.radiance {
            RgbParam::Const(radiance) => radiance,
            RgbParam::Texture(..) => self.radiance_at(ctx, self.sphere_uv(ctx, sphere, n)),
        };
        Some(Some(LiSample { wi: s.wi, dist: s.dist, radiance, pdf: s.pdf, delta: false, light }))
    }
}

impl Emitter for AreaLight {
    fn flags(&self) -> LightFlags {
        LightFlags::default()
    }

    fn sample_li(&self, ctx: &LightContext, p: Vec3, uc: f32, u: Vec2) -> Option<LiSample> {
        if let Some(sample) = self.sample_sphere(ctx, p, u) {
            return sample;
        }
        let s = self.sample_surface(ctx, uc, u);
        let to_light = s.p - p;
        let dist2 = to_light.length_squared();
        let dist = dist2.sqrt();
        let wi = to_light / dist;
        if !(dist > 0.0) || !self.emits_towards(s.ng, -wi) {
            return None;
        }
        let pdf = self.solid_angle_pdf(dist2, s.ng.dot(wi))?;
        let light = Anchor { p: s.p, p_error: s.p_error, ng: s.ng };
        Some(LiSample { wi, dist, radiance: self.radiance_at(ctx, s.uv), pdf, delta: false, light })
    }

    fn pdf_li(&self, _ctx: &LightContext, p: Vec3, at: &Anchor) -> f32 {
        if let Some(pdf) = self.sphere.and_then(|sphere| sphere.pdf(p)) {
            return if pdf.is_finite() { pdf } else { 0.0 };
        }
        let to_light = at.p - p;
        let dist2 = to_light.length_squared();
        self.solid_angle_pdf(dist2, at.ng.dot(to_light) / dist2.sqrt()).unwrap_or(0.0)
    }

    fn radiance(&self, ctx: &LightContext, hit: &Interaction, w: Vec3) -> Rgb {
        if self.emits_towards(hit.ng, w) { self.radiance_at(ctx, hit.uv) } else { Rgb::ZERO }
    }

    fn sample_le(&self, ctx: &LightContext, uc: f32, u_pos: Vec2, u_dir: Vec2) -> Option<LeSample> {
        let s = self.sample_surface(ctx, uc, u_pos);
        // Choose the side, and a direction with density cos / pi on it.
        let (side, u_dir) = if !self.two_sided {
            (1.0, u_dir)
        } else if u_dir.x < 0.5 {
            (1.0, Vec2::new(2.0 * u_dir.x, u_dir.y))
        } else {
            (-1.0, Vec2::new((2.0 * u_dir.x - 1.0).min(ONE_MINUS_EPSILON), u_dir.y))
        };
        let local = warp::cosine_hemisphere(u_dir);
        if !(local.z > 0.0) {
            return None;
        }
        let w = Frame::from_normal(s.ng * side).to_world(local);
        let light = Anchor { p: s.p, p_error: s.p_error, ng: s.ng };
        let sides = if self.two_sided { 2.0 } else { 1.0 };
        Some(LeSample {
            ray: light.ray(w),
            light,
            radiance: self.radiance_at(ctx, s.uv),
            cos: local.z,
            pdf_pos: 1.0 / self.area,
            pdf_dir: local.z * INV_PI / sides,
            flags: self.flags(),
        })
    }

    fn pdf_le(&self, _ctx: &LightContext, ng: Vec3, w: Vec3) -> (f32, f32) {
        let cos = ng.dot(w);
        let pdf_dir = if self.two_sided { 0.5 * cos.abs() } else { cos.max(0.0) };
        (1.0 / self.area, pdf_dir * INV_PI)
    }

    fn bounds(&self, ctx: &LightContext) -> Option<LightBounds> {
        Some(LightBounds::object(ctx.geometry, self.object, self.two_sided))
    }

    fn power(&self, ctx: &LightContext) -> Rgb {
        let mean = match self.radiance {
            RgbParam::Const(radiance) => radiance,
            RgbParam::Texture(..) => self.mean_radiance(ctx),
        };
        let sides = if self.two_sided { 2.0 } else { 1.0 };
        mean * (PI * self.area * sides)
    }

    #[cfg(test)]
    fn examples() -> Vec<super::tests::Example> {
        super::tests::emitters()
            .into_iter()
            .map(|(name, geometry, textures, emission)| {
                let light = Self::new(&geometry, ObjectId(0), &emission).unwrap().into();
                super::tests::Example::new(name, geometry, textures, light)
            })
            .collect()
    }
}

impl AreaLight {
    /// Mean radiance of a textured surface over points of Roberts's R3 sequence (2018, "The Unreasonable Effectiveness of
    /// Quasirandom Sequences").
    fn mean_radiance(&self, ctx: &LightContext) -> Rgb {
        const POINTS: u32 = 1024;
        /// Powers of the reciprocal of the root of x^4 = x + 1.
        const STEP: [f64; 3] = [0.819_172_513_396_164_4, 0.671_043_606_703_789_2, 0.549_700_477_901_970_3];
        let mut sum = [0.0f64; 3];
        for i in 0..POINTS {
            let [uc, x, y] = STEP.map(|step| ((0.5 + f64::from(i) * step).fract() as f32).min(ONE_MINUS_EPSILON));
            let radiance = self.radiance_at(ctx, self.sample_surface(ctx, uc, Vec2::new(x, y)).uv).to_array();
            for (s, v) in sum.iter_mut().zip(radiance) {
                *s += f64::from(v);
            }
        }
        Rgb::from(sum.map(|s| (s / f64::from(POINTS)) as f32))
    }
}
