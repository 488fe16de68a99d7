//! Instances, spheres and disks, and the tree over them.

use super::binary::{self, BinaryNode, Box3};
use super::node::{Child, Node};
use super::simd::Simd;
use super::traverse::{self, Visitor};
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

/// Instances, spheres and disks under a tree of 8-wide nodes, one in each leaf.
#[derive(Debug)]
pub(super) struct Placed {
    items: Vec<Item>,
    nodes: Vec<Node>,
    root: Option<Child>,
    /// Largest absolute coordinate.
    reach: f32,
    simd: Simd,
}

/// Distances of items are rounded in other ways than those of their boxes, whose padding covers all but this.
const SLACK: f32 = 1.0 + 4.0 * f32::EPSILON;

impl Placed {
    /// Builds the tree.
    pub fn new(items: Vec<Item>) -> Self {
        let boxes: Vec<Box3> = items.iter().map(|i| i.bounds).collect();
        let binary = binary::build(&boxes);
        let reach = binary.first().map_or(0.0, |n| n.bounds.reach());
        let (nodes, root) = collapse(&binary);
        Self { items, nodes, root, reach, simd: Simd::detect() }
    }

    #[inline]
    pub fn is_empty(&self) -> bool {
        self.items.is_empty()
    }

    /// Replaces `best` by what is nearer than `t_max`, or equally near with a smaller index.
    pub fn closest(&self, trees: &[Tree], ray: &Ray, t_max: f32, best: &mut Option<Hit>) {
        let Some(root) = self.root else { return };
        let mut visitor = Closest { items: &self.items, trees, ray, t_max, best };
        traverse::visit::<_, true>(&self.nodes, root, ray, self.reach, t_max * SLACK, self.simd, &mut visitor);
    }

    /// Whether anything is hit up to `t_max`.
    pub fn any(&self, trees: &[Tree], ray: &Ray, t_max: f32) -> bool {
        self.root.is_some_and(|root| {
            let mut visitor = Any { items: &self.items, trees, ray, t_max };
            traverse::visit::<_, false>(&self.nodes, root, ray, self.reach, t_max * SLACK, self.simd, &mut visitor)
        })
    }
}

/// Wide nodes over items: the child of largest area is opened until there are eight.
fn collapse(binary: &[BinaryNode]) -> (Vec<Node>, Option<Child>) {
    let Some(top) = binary.first() else { return (Vec::new(), None) };
    if top.is_leaf() {
        return (Vec::new(), Some(Child::leaf(top.index)));
    }
    let mut nodes = vec![Node::EMPTY];
    let mut todo = vec![(0usize, 0u32)];
    while let Some((at, source)) = todo.pop() {
        let first = binary[source as usize].index;
        let mut children = vec![first, first + 1];
        while children.len() < 8 {
            let area = |c: u32| binary[c as usize].bounds.half_area();
            let inner = (0..children.len()).filter(|&i| !binary[children[i] as usize].is_leaf());
            let Some(i) = inner.max_by(|&i, &j| area(children[i]).total_cmp(&area(children[j]))) else { break };
            let first = binary[children[i] as usize].index;
            children[i] = first;
            children.push(first + 1);
        }
        for (slot, &c) in children.iter().enumerate() {
            let b = &binary[c as usize];
            let child = if b.is_leaf() {
                Child::leaf(b.index)
            } else {
                todo.push((nodes.len(), c));
                nodes.push(Node::EMPTY);
                Child(nodes.len() as u32 - 1)
            };
            nodes[at].set(slot, b.bounds.low, b.bounds.high, child);
        }
    }
    (nodes, Some(Child(0)))
}

/// Keeps the nearest hit.
struct Closest<'a> {
    items: &'a [Item],
    trees: &'a [Tree],
    ray: &'a Ray,
    t_max: f32,
    best: &'a mut Option<Hit>,
}

impl Visitor for Closest<'_> {
    #[inline(always)]
    fn visit(&mut self, index: u32, t_max: &mut f32) -> bool {
        let item = &self.items[index as usize];
        let curved = |t: f32| Hit { t, object: item.object, primitive: 0, b: [0.0; 2] };
        let ray = self.ray;
        let hit = match &item.kind {
            Kind::Instance { tree, to_object } => self.trees[*tree]
                .closest(&local_ray(ray, to_object), self.t_max)
                .map(|h| Hit { t: h.t, object: item.object, primitive: h.id, b: h.b }),
            Kind::Sphere { centre, radius } => sphere::intersect(*centre, *radius, &until(ray, self.t_max)).map(curved),
            Kind::Disk(disk) => disk.intersect(&until(ray, self.t_max)).map(curved),
        };
        let key = |h: &Hit| (h.object, h.primitive);
        if let Some(hit) = hit
            && self.best.as_ref().is_none_or(|b| hit.t < b.t || (hit.t == b.t && key(&hit) < key(b)))
        {
            self.t_max = hit.t;
            *t_max = hit.t * SLACK;
            *self.best = Some(hit);
        }
        false
    }
}

/// Ends at the first hit.
struct Any<'a> {
    items: &'a [Item],
    trees: &'a [Tree],
    ray: &'a Ray,
    t_max: f32,
}

impl Visitor for Any<'_> {
    #[inline(always)]
    fn visit(&mut self, index: u32, _: &mut f32) -> bool {
        let ray = self.ray;
        match &self.items[index as usize].kind {
            Kind::Instance { tree, to_object } => self.trees[*tree].any(&local_ray(ray, to_object), self.t_max),
            Kind::Sphere { centre, radius } => sphere::intersect(*centre, *radius, &until(ray, self.t_max)).is_some(),
            Kind::Disk(disk) => disk.intersect(&until(ray, self.t_max)).is_some(),
        }
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
