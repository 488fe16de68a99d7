//! Where lights are and where they shine: a bound of what they may give to a point (Conty Estevez and Kulla 2018, "Importance Sampling of
//! Many Lights with Adaptive Tree Splitting"; the cone of directions as in PBR book, 4th edition, section 12.6.3).

use crate::geometry::{Geometry, ObjectId, Shape};
use crate::math::rounding::gamma;
use crate::math::{self, Vec2, Vec3, safe_acos, sin_cos};
use std::f32::consts::PI;

/// A cosine less than this below its limit may be above it but for rounding.
const ROUNDING: f32 = 1e-4;
/// Least of a factor that is not 0: a bound by the geometric normal says little of what a bent normal reflects.
const LEAST: f32 = 0.05;

/// Where light is wanted.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Place {
    /// The point, world space.
    pub p: Vec3,
    /// Unit normal of the half space from which light counts; zero where it counts from everywhere.
    pub up: Vec3,
    /// What is reflected there, if not the same of light from all of that half space.
    pub lobe: Option<Gloss>,
}

impl Place {
    /// Where light from everywhere counts alike.
    pub fn anywhere(p: Vec3) -> Self {
        Self { p, up: Vec3::ZERO, lobe: None }
    }
}

/// A glossy lobe over a diffuse one.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Gloss {
    /// Unit shading normal, and unit direction in which light leaves.
    pub n: Vec3,
    /// On the side of `n`.
    pub wo: Vec3,
    /// Albedo of the diffuse lobe; not 0, since the lobe is known roughly only.
    pub diffuse: f32,
    /// About what the other reflects in all.
    pub specular: f32,
    /// Squared roughness.
    pub alpha2: f32,
}

/// Directions of up to an angle from an axis.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Cone {
    /// Unit vector.
    pub axis: Vec3,
    /// Radians; from pi on it is all directions.
    pub angle: f32,
}

impl Cone {
    /// All directions.
    pub const ALL: Self = Self { axis: Vec3::Z, angle: PI };

    /// A cone around both (PBR book, section 3.8.4).
    pub fn union(self, other: Self) -> Self {
        let (a, b) = if self.angle >= other.angle { (self, other) } else { (other, self) };
        if a.angle >= PI {
            return Self::ALL;
        }
        let apart = safe_acos(a.axis.dot(b.axis));
        if apart + b.angle <= a.angle {
            return a;
        }
        let angle = 0.5 * (a.angle + apart + b.angle);
        let aside = b.axis - a.axis * a.axis.dot(b.axis);
        if angle >= PI || !(aside.length_squared() > 0.0) {
            return Self::ALL;
        }
        let (s, c) = sin_cos(angle - a.angle);
        Self { axis: (a.axis * c + aside.normalize() * s).normalize(), angle }
    }
}

/// Where a light is, or several, and where it shines.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LightBounds {
    /// A sphere around it.
    pub(super) centre: Vec3,
    pub(super) radius: f32,
    /// Directions in which it shines with all its strength.
    pub(super) normals: Cone,
    /// How far around these directions it shines at all; pi/2 and less: falling with the cosine.
    pub(super) spread: f32,
    /// Intensity ahead, over what it would be if the power went evenly in all directions.
    pub(super) gain: f32,
}

impl LightBounds {
    /// Of a point that shines in all directions.
    pub(super) fn point(centre: Vec3) -> Self {
        Self { centre, radius: 0.0, normals: Cone::ALL, spread: 0.0, gain: 1.0 }
    }

    /// Of an emitting object.
    pub(super) fn object(geometry: &Geometry, object: ObjectId, two_sided: bool) -> Self {
        let (centre, radius, normals) = surface(geometry, object);
        let radius = radius + gamma(16) * (centre.abs().max_element() + radius);
        let normals = if two_sided { Cone::ALL } else { normals };
        let gain = match (normals.angle >= PI, geometry.sphere_world(object)) {
            (_, Some(_)) => 1.0,
            (true, None) => 2.0,
            (false, None) => 4.0,
        };
        Self { centre, radius, normals, spread: 0.5 * PI, gain }
    }
}

/// A sphere around an object, and a cone around its normals.
fn surface(geometry: &Geometry, id: ObjectId) -> (Vec3, f32, Cone) {
    let object = &geometry.objects[id.0 as usize];
    match object.shape {
        Shape::Sphere => {
            let (centre, radius) = geometry.sphere_world(id).unwrap_or((Vec3::ZERO, f32::INFINITY));
            (centre, radius, Cone::ALL)
        }
        Shape::Disk => {
            let m = object.to_world.matrix();
            let (a, b) = (m.matrix3.x_axis, m.matrix3.y_axis);
            // The larger half axis of the ellipse.
            let (aa, bb, ab) = (a.length_squared(), b.length_squared(), a.dot(b));
            let radius = (0.5 * (aa + bb + ((aa - bb) * (aa - bb) + 4.0 * ab * ab).sqrt())).sqrt();
            let axis = geometry.sample_area(id, 0, Vec2::ZERO).ng;
            (m.translation.as_vec3(), radius as f32, Cone { axis, angle: 0.0 })
        }
        Shape::Mesh(_) => {
            let corners = || {
                (0..geometry.primitive_count(id))
                    .filter(|i| geometry.area(id, *i) > 0.0)
                    .flat_map(|i| [Vec2::ZERO, Vec2::X, Vec2::ONE].map(|u| geometry.sample_area(id, i, u)))
            };
            let (mut low, mut high) = (Vec3::INFINITY, Vec3::NEG_INFINITY);
            let mut normals: Option<Cone> = None;
            for corner in corners() {
                (low, high) = (low.min(corner.p), high.max(corner.p));
                let own = Cone { axis: corner.ng, angle: 0.0 };
                normals = Some(normals.map_or(own, |cone| cone.union(own)));
            }
            let centre = 0.5 * low + 0.5 * high;
            let radius = corners().map(|c| (c.p - centre).length()).fold(0.0, f32::max);
            (centre, radius, normals.unwrap_or(Cone::ALL))
        }
    }
}

/// How many bounds are asked at once.
pub(super) const LANES: usize = 4;
/// A number for each of them.
pub(super) type Lanes = [f32; LANES];

/// Bounds as they are asked, several at once.
#[derive(Clone, Copy, Debug)]
pub(super) struct Reach {
    centre: [Lanes; 3],
    radius2: Lanes,
    axis: [Lanes; 3],
    /// Cosine and sine of the angle of the normals.
    cos: Lanes,
    sin: Lanes,
    /// Cosine of the spread, less what rounding may do.
    spread: Lanes,
}

impl Default for Reach {
    /// Of nothing: finite everywhere.
    fn default() -> Self {
        let (zero, one) = (Lanes::default(), [1.0; LANES]);
        Self { centre: [zero; 3], radius2: one, axis: [zero; 3], cos: zero, sin: one, spread: zero }
    }
}

impl Reach {
    /// Sets one of them.
    pub fn set(&mut self, lane: usize, bounds: &LightBounds) {
        let (sin, cos) = if bounds.normals.angle >= PI { (0.0, -1.0) } else { sin_cos(bounds.normals.angle) };
        (self.cos[lane], self.sin[lane]) = (cos, sin);
        for axis in 0..3 {
            self.centre[axis][lane] = bounds.centre[axis];
            self.axis[axis][lane] = bounds.normals.axis[axis];
        }
        // A point has a size too, or all would be infinite there.
        self.radius2[lane] = (bounds.radius * bounds.radius).max(f32::MIN_POSITIVE);
        self.spread[lane] = math::cos(bounds.spread) - ROUNDING;
    }

    /// Whether a point is within the sphere of one of them.
    #[inline]
    pub fn contains(&self, lane: usize, p: Vec3) -> bool {
        let centre = Vec3::from_array([0, 1, 2].map(|axis| self.centre[axis][lane]));
        (centre - p).length_squared() <= self.radius2[lane]
    }

    /// Bounds of the irradiance that light of unit strength may give to a place, in 1 / m^2, times `strengths` and about what the place
    /// reflects; 0 only where it gives none. Without branches, so that all are computed at once.
    #[inline(always)]
    pub fn importance(&self, strengths: &Lanes, place: &Place) -> Lanes {
        let sided = place.up != Vec3::ZERO;
        let (mut result, mut gloss) = (Lanes::default(), Lanes::default());
        if let Some(lobe) = &place.lobe {
            gloss = self.reflected(place.p, lobe);
        }
        let diffuse = place.lobe.map_or(1.0, |lobe| lobe.diffuse);
        for i in 0..LANES {
            let [x, y, z] = self.way(place.p, i);
            let distance2 = x * x + y * y + z * z;
            let radius2 = self.radius2[i];
            let within = distance2 <= radius2;
            let inverse2 = 1.0 / distance2;
            let inverse = inverse2.sqrt();

            // Half the angle that the sphere covers.
            let sin2 = radius2 * inverse2;
            let covered = (positive(1.0 - sin2).sqrt(), sin2.sqrt());

            // The least angle between a normal and the way to the place.
            let ahead = -(self.axis[0][i] * x + self.axis[1][i] * y + self.axis[2][i] * z) * inverse;
            let leaving = less(less(with_sine(ahead), (self.cos[i], self.sin[i])), covered).0;
            let from = if leaving < self.spread[i] { 0.0 } else { at_least(leaving) };

            // The least angle of the light that arrives.
            let above = (place.up.x * x + place.up.y * y + place.up.z * z) * inverse;
            let arriving = less(with_sine(above), covered).0;
            let to = diffuse * at_least(arriving) + gloss[i];
            let to = if arriving < -ROUNDING { 0.0 } else { to };
            let to = if sided { to } else { 1.0 };

            let outside = from * to * inverse2;
            result[i] = strengths[i] * if within { (diffuse + gloss[i]) / radius2 } else { outside };
        }
        result
    }

    /// About what a lobe reflects of light from the middles of the spheres, times pi and the cosine: GGX, wider by what they cover. (A
    /// half vector turns by half of what the direction turns.)
    #[inline(always)]
    fn reflected(&self, p: Vec3, lobe: &Gloss) -> Lanes {
        let (n, wo) = (lobe.n, lobe.wo);
        let cos_o = n.dot(wo);
        let mut result = Lanes::default();
        for (i, result) in result.iter_mut().enumerate() {
            let [x, y, z] = self.way(p, i);
            let inverse2 = 1.0 / at_least_tiny(x * x + y * y + z * z);
            let inverse = inverse2.sqrt();
            let sin2 = at_most_one(self.radius2[i] * inverse2);
            let alpha2 = at_most_one(lobe.alpha2 + 0.25 * sin2);
            let cos_i = (n.x * x + n.y * y + n.z * z) * inverse;
            let between = (wo.x * x + wo.y * y + wo.z * z) * inverse;
            let cos_h = positive(cos_i + cos_o);
            let cos2_h = at_most_one(cos_h * cos_h / (2.0 * positive(1.0 + between) + 1e-6));
            let t = cos2_h * (alpha2 - 1.0) + 1.0;
            *result = lobe.specular * alpha2 / (4.0 * t * t);
        }
        result
    }

    /// From a point to the middle of one of them.
    #[inline(always)]
    fn way(&self, p: Vec3, lane: usize) -> [f32; 3] {
        [self.centre[0][lane] - p.x, self.centre[1][lane] - p.y, self.centre[2][lane] - p.z]
    }
}

#[inline]
fn at_most_one(x: f32) -> f32 {
    if x < 1.0 { x } else { 1.0 }
}

#[inline]
fn at_least_tiny(x: f32) -> f32 {
    if x > f32::MIN_POSITIVE { x } else { f32::MIN_POSITIVE }
}

#[inline]
fn positive(x: f32) -> f32 {
    if x > 0.0 { x } else { 0.0 }
}

#[inline]
fn at_least(x: f32) -> f32 {
    if x > LEAST { x } else { LEAST }
}

#[inline]
fn with_sine(cos: f32) -> (f32, f32) {
    (cos, positive(1.0 - cos * cos).sqrt())
}

/// Cosine and sine of the angle `a` less the angle `b`, or of 0 if that is less; both in [0, pi].
#[inline]
fn less(a: (f32, f32), b: (f32, f32)) -> (f32, f32) {
    let (cos, sin) = (a.0 * b.0 + a.1 * b.1, a.1 * b.0 - a.0 * b.1);
    if a.0 > b.0 { (1.0, 0.0) } else { (cos, sin) }
}
