//! Which objects a point is inside of, and so which medium is there.
//!
//! Nested dielectrics by priority follow Schmidt and Budge 2002, "Simple Nested Dielectrics in Ray Traced Images": of all objects
//! around a point only the one of the highest rank is there, and the surfaces of others are passed as if they were not.

use super::desc::{ShapeDesc, ShapeKind};
use super::{ObjectInfo, Scene};
use crate::bsdf::Material;
use crate::diagnostics::Diagnostics;
use crate::geometry::{Geometry, ObjectId, Shape};
use crate::light::Light;
use crate::math::{Anchor, DVec3, Ray, Vec2, Vec3};
use crate::medium::{Medium, MediumId};

/// More objects around one point are not told apart.
const MOST: usize = 6;
/// Surfaces that a ray which looks for the objects around its origin passes at most.
const MOST_PASSED: usize = 4096;

/// An object whose surface has an inside that light can come to.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Boundary {
    /// What fills it; `None` is empty space.
    pub interior: Option<MediumId>,
    /// Of overlapping objects that of the higher rank is there: by priority, then the smaller one (which may be inside the other),
    /// then the later one. The order is total, so that a path has the same media in both directions.
    pub rank: u32,
    /// Whether the surface itself is not there.
    pub null: bool,
}

/// The set of boundaries around a point.
///
/// What crosses a surface from outside is inside then, whatever it was before, and the other way round: a point that rounding moved
/// across a surface, or a surface with a hole, makes a difference up to the next crossing only.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Enclosures {
    objects: [u32; MOST],
    count: u8,
}

impl Default for Enclosures {
    /// Outside of everything.
    fn default() -> Self {
        Self { objects: [u32::MAX; MOST], count: 0 }
    }
}

impl Enclosures {
    /// Whether the point is outside of everything.
    #[inline]
    pub fn is_empty(&self) -> bool {
        self.count == 0
    }

    /// The objects, ascending.
    #[inline]
    pub fn iter(&self) -> impl Iterator<Item = ObjectId> + '_ {
        self.objects[..usize::from(self.count)].iter().map(|o| ObjectId(*o))
    }

    /// Whether the point is inside `object`.
    #[inline]
    pub fn contains(&self, object: ObjectId) -> bool {
        self.iter().any(|o| o == object)
    }

    /// The set with or without `object`; unchanged when there is no room for it.
    #[inline]
    pub fn set(&self, object: ObjectId, inside: bool) -> Self {
        let mut changed = *self;
        if inside == self.contains(object) || (inside && usize::from(self.count) == MOST) {
            return changed;
        }
        let at = self.iter().filter(|o| *o < object).count();
        let count = usize::from(self.count);
        if inside {
            changed.objects.copy_within(at..count, at + 1);
            changed.objects[at] = object.0;
            changed.count += 1;
        } else {
            changed.objects.copy_within(at + 1..count, at);
            changed.objects[count - 1] = u32::MAX;
            changed.count -= 1;
        }
        changed
    }
}

impl Scene {
    /// Of the objects around a point the one that is there.
    #[inline]
    fn topmost(&self, around: &Enclosures) -> Option<(ObjectId, &Boundary)> {
        let boundary = |o: ObjectId| Some((o, self.objects[o.0 as usize].boundary.as_ref()?));
        around.iter().filter_map(boundary).max_by_key(|(_, b)| b.rank)
    }

    /// The medium inside `around`.
    #[inline]
    pub fn medium_in(&self, around: &Enclosures) -> Option<(MediumId, &Medium)> {
        let id = match self.topmost(around) {
            Some((_, boundary)) => boundary.interior,
            None => self.global_medium,
        }?;
        Some((id, &self.media[id.0 as usize]))
    }

    /// What encloses a ray that leaves `from` in direction `w`: a point of the surface of `object`, either side of which `around`
    /// encloses, or of free space.
    #[inline]
    pub fn beside(&self, object: Option<ObjectId>, from: &Anchor, w: Vec3, around: &Enclosures) -> Enclosures {
        match object {
            Some(o) if self.objects[o.0 as usize].boundary.is_some() => around.set(o, from.ng.dot(w) < 0.0),
            _ => *around,
        }
    }

    /// What encloses a ray beyond a surface that it passes straight on: a null one, or one inside an object of higher rank, where it
    /// is not there. `None` for a surface that is.
    #[inline]
    pub(super) fn passes(&self, object: ObjectId, entering: bool, around: &Enclosures) -> Option<Enclosures> {
        let info = &self.objects[object.0 as usize];
        let boundary = info.boundary?;
        let after = around.set(object, entering);
        if boundary.null {
            return Some(after);
        }
        // Seen from the inside the surface of an object that is not known to be around is there, as is one for which there is no
        // room, and one that emits: lights are sampled wherever they are.
        let inside = if entering { &after } else { around };
        let hidden = inside.contains(object) && self.topmost(inside).is_some_and(|(top, _)| top != object);
        (hidden && info.light.is_none()).then_some(after)
    }

    /// The objects around a point in free space, by where rays from there first meet each: from inside or from outside. Several
    /// rays vote, since one may slip through between two triangles or through a hole.
    pub fn enclosures_at(&self, p: Vec3) -> Enclosures {
        let mut votes: Vec<(ObjectId, u32)> = Vec::new();
        for d in DIRECTIONS {
            let mut met = Vec::new();
            let mut ray = Ray::new(p, d.normalize());
            for _ in 0..MOST_PASSED {
                let Some(hit) = self.accel.intersect(&ray) else { break };
                let hit = self.geometry.interaction(&ray, &hit);
                if self.objects[hit.object.0 as usize].boundary.is_some() && !met.contains(&hit.object) {
                    met.push(hit.object);
                    if hit.ng.dot(ray.d) > 0.0 {
                        match votes.iter_mut().find(|(o, _)| *o == hit.object) {
                            Some((_, n)) => *n += 1,
                            None => votes.push((hit.object, 1)),
                        }
                    }
                }
                ray = hit.spawn_ray(ray.d);
            }
        }
        let majority = DIRECTIONS.len() as u32 / 2;
        let inside = votes.into_iter().filter(|(_, n)| *n > majority);
        inside.fold(Enclosures::default(), |e, (o, _)| e.set(o, true))
    }

    /// What encloses a ray that leaves `light` from `start` (as `sample_le` gives it) in direction `w`.
    pub fn enclosures_of_light(&self, light: usize, start: &Anchor, w: Vec3) -> Enclosures {
        let known = self.light_enclosures.get(light).copied().flatten();
        let around = known.unwrap_or_else(|| self.enclosures_at(start.ray(w).o));
        let object = match &self.lights[light] {
            Light::Area(area) => Some(area.object()),
            _ => None,
        };
        self.beside(object, start, w, &around)
    }

    /// Finds what encloses the camera and the lights.
    pub(super) fn enclose(&mut self, file: &str, diagnostics: &mut Diagnostics) {
        self.camera_enclosures = self.enclosures_at(self.camera.to_world.translation.as_vec3());
        self.light_enclosures = self.lights.iter().map(|l| self.around_light(l)).collect();
        let filled = self.global_medium.is_some_and(|id| self.media[id.0 as usize].sigma_t.min_component() > 0.0);
        if filled && self.lights.iter().any(|l| l.flags().infinite) {
            let message = "light from infinitely far does not arrive through the medium that fills the scene";
            diagnostics.warn(file, "", message, "let a shape with that medium as its interior bound it");
        }
        let reach = self.bounds.centre.abs().max_element() + self.bounds.radius;
        if self.media.iter().any(|m| m.scatters() && m.sigma_t.max_component() * reach * f32::EPSILON > 0.5) {
            let message = "a medium is so dense that light goes unhindered in it for less than coordinates can tell";
            diagnostics.warn(file, "", message, "a thinner one, or a diffuse surface, looks the same and is faster");
        }
    }

    /// What encloses a light, if it is the same all over it.
    fn around_light(&self, light: &Light) -> Option<Enclosures> {
        if let Some(p) = light.position() {
            return Some(self.enclosures_at(p));
        }
        match light {
            Light::Area(l) => {
                let count = self.geometry.primitive_count(l.object());
                let at = |k: u32| {
                    let primitive = (u64::from(k) * u64::from(count) / u64::from(PROBES)) as u32;
                    let s = self.geometry.sample_area(l.object(), primitive, PROBE_POINTS[k as usize % 4]);
                    let start = Anchor { p: s.p, p_error: s.p_error, ng: s.ng };
                    self.enclosures_at(start.ray(s.ng).o).set(l.object(), false)
                };
                let first = at(0);
                (1..PROBES).all(|k| at(k) == first).then_some(first)
            }
            _ => Some(Enclosures::default()),
        }
    }
}

/// Points of an area light that are looked at.
const PROBES: u32 = 8;
const PROBE_POINTS: [Vec2; 4] =
    [Vec2::new(0.31, 0.37), Vec2::new(0.93, 0.06), Vec2::new(0.95, 0.91), Vec2::new(0.06, 0.48)];

/// Directions along no axis or diagonal, where models have their edges.
const DIRECTIONS: [Vec3; 5] = [
    Vec3::new(0.293, 0.911, 0.291),
    Vec3::new(-0.741, 0.233, 0.629),
    Vec3::new(0.817, -0.399, 0.417),
    Vec3::new(-0.157, -0.621, -0.769),
    Vec3::new(0.211, 0.107, -0.971),
];

/// Finds the objects that have an inside and ranks them.
pub(super) fn mark_boundaries(
    objects: &mut [ObjectInfo],
    shapes: &[ShapeDesc],
    materials: &[Material],
    geometry: &Geometry,
    any_medium: bool,
) {
    let mut found: Vec<(i32, f64, usize)> = Vec::new();
    for (i, shape) in shapes.iter().enumerate() {
        let material = &materials[shape.material.0 as usize];
        let null = if any_medium && shape.emission.is_none() {
            material.is_invisible()
        } else {
            matches!(material, Material::Null)
        };
        let closed = !matches!(shape.kind, ShapeKind::Rectangle | ShapeKind::Disk);
        if null || shape.interior.is_some() || (closed && material.admits(materials)) {
            objects[i].boundary = Some(Boundary { interior: shape.interior, rank: 0, null });
            found.push((shape.priority, box_area(geometry, i), i));
        }
    }
    found.sort_by(|a, b| a.0.cmp(&b.0).then(b.1.total_cmp(&a.1)).then(a.2.cmp(&b.2)));
    for (rank, (_, _, i)) in found.into_iter().enumerate() {
        if let Some(boundary) = &mut objects[i].boundary {
            boundary.rank = rank as u32;
        }
    }
}

/// Half the surface of an object's box: not larger than that of any object around it.
fn box_area(geometry: &Geometry, object: usize) -> f64 {
    let placed = &geometry.objects[object];
    let m = placed.to_world.matrix();
    let size = match placed.shape {
        Shape::Mesh(id) => {
            let (mut low, mut high) = (DVec3::INFINITY, DVec3::NEG_INFINITY);
            for p in &geometry.meshes[id.0 as usize].positions {
                let p = m.transform_point3(p.as_dvec3());
                low = low.min(p);
                high = high.max(p);
            }
            (high - low).max(DVec3::ZERO)
        }
        Shape::Sphere | Shape::Disk => DVec3::splat(2.0 * m.matrix3.x_axis.length()),
    };
    size.x * size.y + size.y * size.z + size.z * size.x
}
