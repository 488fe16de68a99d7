//! Instances, spheres and disks, and the small binary tree over them.

use super::binary::{self, BinaryNode, Box3};
use super::wide::Tree;
use crate::geometry::{Geometry, Hit, Mesh, ObjectId, WorldDisk, sphere};
use crate::math::{DAffine3, DVec3, Ray, Transform, Vec3};

/// Something placed in the world by itself.
#[derive(Debug)]
pub(super) struct Item {
    pub object: ObjectId,
    pub bounds: Box3,
    kind: Kind,
}

#[derive(Debug)]
enum Kind {
    /// A mesh's tree, and the way to its space.
    Instance {
        tree: usize,
        to_object: DAffine3,
    },
    Sphere {
        centre: Vec3,
        radius: f32,
    },
    Disk(WorldDisk),
}

impl Item {
    /// A mesh under a transform.
    pub fn instance(object: ObjectId, tree: usize, mesh: &Mesh, to_world: Transform) -> Self {
        let matrix = to_world.matrix();
        // Of the mesh's box in its own space: never larger than the scene needs, never smaller than the mesh.
        let local = Box3::around(&mesh.positions);
        let corners: Vec<Vec3> = (0..8)
            .map(|i| {
                Vec3::from_array(std::array::from_fn(|k| if i >> k & 1 == 0 { local.low[k] } else { local.high[k] }))
            })
            .map(|p| matrix.transform_point3(p.as_dvec3()).as_vec3())
            .collect();
        let kind = Kind::Instance { tree, to_object: matrix.inverse() };
        Self { object, bounds: Box3::around(&corners), kind }
    }

    /// A sphere or a disk.
    pub fn curved(geometry: &Geometry, object: ObjectId) -> Self {
        if let Some((centre, radius)) = geometry.sphere_world(object) {
            let bounds = Box3 { low: centre - radius, high: centre + radius };
            return Self { object, bounds, kind: Kind::Sphere { centre, radius } };
        }
        let o = &geometry.objects[object.0 as usize];
        let m = o.to_world.matrix();
        let (x, y) = (m.matrix3.x_axis, m.matrix3.y_axis);
        let half: DVec3 = (x * x + y * y).to_array().map(f64::sqrt).into();
        let bounds = Box3 { low: (m.translation - half).as_vec3(), high: (m.translation + half).as_vec3() };
        Self { object, bounds, kind: Kind::Disk(WorldDisk::of(o)) }
    }
}

/// Instances, spheres and disks under a binary tree.
#[derive(Debug)]
pub(super) struct Placed {
    items: Vec<Item>,
    nodes: Vec<BinaryNode>,
    reach: f32,
}

/// Relative to the largest coordinate: covers the rounding of item boxes and of the box test.
const PAD: f32 = 16.0 * f32::EPSILON;

impl Placed {
    /// Builds the tree.
    pub fn new(items: Vec<Item>) -> Self {
        let boxes: Vec<Box3> = items.iter().map(|i| i.bounds).collect();
        let nodes = binary::build(&boxes);
        let reach = nodes.first().map_or(0.0, |n| n.bounds.reach());
        Self { items, nodes, reach }
    }

    #[inline]
    pub fn is_empty(&self) -> bool {
        self.items.is_empty()
    }

    /// Shortens `t_max` and replaces `best` by what is nearer, or equally near with a smaller index.
    pub fn closest(&self, trees: &[Tree], ray: &Ray, mut t_max: f32, best: &mut Option<Hit>) {
        let mut consider = |hit: Hit, t_max: &mut f32| {
            let key = |h: &Hit| (h.object, h.primitive);
            if best.as_ref().is_none_or(|b| hit.t < b.t || (hit.t == b.t && key(&hit) < key(b))) {
                *t_max = hit.t;
                *best = Some(hit);
            }
        };
        self.walk(ray, &mut t_max, &mut |item, t_max| {
            let curved = |t: f32| Hit { t, object: item.object, primitive: 0, b: [0.0; 2] };
            let hit = match &item.kind {
                Kind::Instance { tree, to_object } => trees[*tree]
                    .closest(&local_ray(ray, to_object), *t_max)
                    .map(|h| Hit { t: h.t, object: item.object, primitive: h.id, b: h.b }),
                Kind::Sphere { centre, radius } => sphere::intersect(*centre, *radius, &until(ray, *t_max)).map(curved),
                Kind::Disk(disk) => disk.intersect(&until(ray, *t_max)).map(curved),
            };
            if let Some(hit) = hit {
                consider(hit, t_max);
            }
            false
        });
    }

    /// Whether anything is hit up to `t_max`.
    pub fn any(&self, trees: &[Tree], ray: &Ray, mut t_max: f32) -> bool {
        self.walk(ray, &mut t_max, &mut |item, t_max| match &item.kind {
            Kind::Instance { tree, to_object } => trees[*tree].any(&local_ray(ray, to_object), *t_max),
            Kind::Sphere { centre, radius } => sphere::intersect(*centre, *radius, &until(ray, *t_max)).is_some(),
            Kind::Disk(disk) => disk.intersect(&until(ray, *t_max)).is_some(),
        })
    }

    /// Visits the items whose boxes the ray meets, until `visit` returns true; returns whether it did.
    fn walk(&self, ray: &Ray, t_max: &mut f32, visit: &mut dyn FnMut(&Item, &mut f32) -> bool) -> bool {
        if self.nodes.is_empty() {
            return false;
        }
        let pad = PAD * (ray.o.abs().max_element() + self.reach);
        // Deferred nodes: at most one per level, and `binary::build` keeps to `MAX_DEPTH` levels.
        let mut stack = [0u32; binary::MAX_DEPTH + 1];
        let mut len = 1;
        while len > 0 {
            len -= 1;
            let node = &self.nodes[stack[len] as usize];
            if !meets(&node.bounds, ray, pad, *t_max) {
                continue;
            }
            if node.is_leaf {
                if visit(&self.items[node.index as usize], t_max) {
                    return true;
                }
                continue;
            }
            stack[len] = node.index;
            stack[len + 1] = node.index + 1;
            len += 2;
        }
        false
    }
}

/// The ray with another inclusive end.
fn until(ray: &Ray, t_max: f32) -> Ray {
    Ray { t_max, ..*ray }
}

/// The ray in an instance's space; parameters stay those of the world.
fn local_ray(ray: &Ray, to_object: &DAffine3) -> Ray {
    let o = to_object.transform_point3(ray.o.as_dvec3()).as_vec3();
    let d = to_object.transform_vector3(ray.d.as_dvec3()).as_vec3();
    Ray::segment(o, d, ray.t_max)
}

/// Whether a ray meets a box, padded to all sides, within [0, `t_max`].
fn meets(b: &Box3, ray: &Ray, pad: f32, t_max: f32) -> bool {
    // The roundings of the divisions are relative to the distances themselves.
    const SLACK: f32 = 1.0 + 4.0 * f32::EPSILON;
    let (mut near, mut far) = (0.0f32, t_max * SLACK);
    for k in 0..3 {
        let (low, high) = (b.low[k] - pad - ray.o[k], b.high[k] + pad - ray.o[k]);
        if ray.d[k] == 0.0 {
            if low > 0.0 || high < 0.0 {
                return false;
            }
            continue;
        }
        let (t0, t1) = (low / ray.d[k], high / ray.d[k]);
        near = near.max(t0.min(t1));
        far = far.min(t0.max(t1) * SLACK);
    }
    near <= far
}
