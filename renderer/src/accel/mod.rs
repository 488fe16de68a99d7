//! Ray casting: the nearest hit and occlusion. The hit depends on the geometry and the ray only, never on the tree.

use crate::geometry::triangle::{self, Shear};
use crate::geometry::{Geometry, Hit, Mesh, ObjectId, Shape, WorldDisk, sphere};
use crate::math::{DAffine3, Ray, Transform, Vec3};

/// Why no acceleration tree could be built.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum AccelError {
    /// The scene is too large for 32-bit indices.
    #[error("{0} triangles are more than {max}", max = u32::MAX)]
    TooManyTriangles(usize),
    /// A coordinate is NaN, infinite or beyond what single precision can intersect.
    #[error("object {object} reaches beyond {limit:e} from the origin", limit = LIMIT)]
    TooLarge {
        /// Index of the object.
        object: usize,
    },
}

/// Largest coordinate: cubes of it (determinants) must not overflow.
pub const LIMIT: f32 = 1e12;

/// Everything that rays are tested against, in the order in which it is tested.
#[derive(Debug)]
pub struct Accel {
    world: Tree,
    placed: Vec<Placed>,
    trees: Vec<Tree>,
}

#[derive(Debug)]
enum Placed {
    Instance { object: ObjectId, tree: usize, to_object: DAffine3 },
    Sphere { object: ObjectId, centre: Vec3, radius: f32 },
    Disk { object: ObjectId, disk: WorldDisk },
}

#[derive(Debug, Default)]
struct Tree {
    nodes: Vec<Node>,
    triangles: Vec<Triangle>,
}

#[derive(Debug)]
struct Triangle {
    corners: [Vec3; 3],
    object: ObjectId,
    primitive: u32,
}

#[derive(Debug)]
struct Node {
    low: Vec3,
    high: Vec3,
    /// Leaf: first triangle; inner node: second child (the first follows the node).
    index: u32,
    /// 0 = inner node.
    count: u32,
}

impl Accel {
    /// Builds the trees.
    pub fn build(geometry: &Geometry) -> Result<Self, AccelError> {
        let mut world = Vec::new();
        let mut trees: Vec<Tree> = Vec::new();
        let mut tree_of = vec![usize::MAX; geometry.meshes.len()];
        let mut placed = Vec::new();
        for (i, o) in geometry.objects.iter().enumerate() {
            let object = ObjectId(i as u32);
            match o.shape {
                Shape::Mesh(id) => {
                    let mesh = &geometry.meshes[id.0 as usize];
                    if !mesh.positions.iter().all(|p| p.abs().max_element() <= LIMIT) {
                        return Err(AccelError::TooLarge { object: i });
                    }
                    if o.to_world == Transform::IDENTITY {
                        world.extend(triangles(mesh, object));
                        continue;
                    }
                    let tree = &mut tree_of[id.0 as usize];
                    if *tree == usize::MAX {
                        *tree = trees.len();
                        trees.push(Tree::build(triangles(mesh, object).collect()));
                    }
                    placed.push(Placed::Instance { object, tree: *tree, to_object: o.to_world.matrix().inverse() });
                }
                Shape::Sphere => {
                    if let Some((centre, radius)) = geometry.sphere_world(object) {
                        placed.push(Placed::Sphere { object, centre, radius });
                    }
                }
                Shape::Disk => placed.push(Placed::Disk { object, disk: WorldDisk::of(o) }),
            }
        }
        Ok(Self { world: Tree::build(world), placed, trees })
    }

    /// The nearest hit; of equal distances that of the smaller (object, primitive).
    pub fn intersect(&self, ray: &Ray) -> Option<Hit> {
        let mut best = None;
        let mut ray = *ray;
        if !(ray.d.is_finite() && ray.d != Vec3::ZERO && ray.o.is_finite()) {
            return None;
        }
        // `t_max` is exclusive, but distances found are inclusive: ties are settled by index.
        ray.t_max = ray.t_max.next_down();
        let mut keep = |hit: Hit, t_max: &mut f32| {
            let key = |h: &Hit| (h.object, h.primitive);
            if best.as_ref().is_none_or(|b: &Hit| hit.t < b.t || (hit.t == b.t && key(&hit) < key(b))) {
                *t_max = hit.t;
                best = Some(hit);
            }
        };
        self.world.intersect(&ray.clone(), &mut ray.t_max, &mut keep, None);
        for p in &self.placed {
            match p {
                Placed::Instance { object, tree, to_object } => {
                    let local = local_ray(&ray, to_object);
                    self.trees[*tree].intersect(&local, &mut ray.t_max, &mut keep, Some(*object));
                }
                Placed::Sphere { object, centre, radius } => {
                    if let Some(t) = sphere::intersect(*centre, *radius, &ray) {
                        keep(Hit { t, object: *object, primitive: 0, b: [0.0; 2] }, &mut ray.t_max);
                    }
                }
                Placed::Disk { object, disk } => {
                    if let Some(t) = disk.intersect(&ray) {
                        keep(Hit { t, object: *object, primitive: 0, b: [0.0; 2] }, &mut ray.t_max);
                    }
                }
            }
        }
        best
    }

    /// Whether anything lies on the ray before its end.
    pub fn occluded(&self, ray: &Ray) -> bool {
        self.intersect(ray).is_some()
    }
}

fn local_ray(ray: &Ray, to_object: &DAffine3) -> Ray {
    let o = to_object.transform_point3(ray.o.as_dvec3()).as_vec3();
    let d = to_object.transform_vector3(ray.d.as_dvec3()).as_vec3();
    Ray::segment(o, d, ray.t_max)
}

fn triangles(mesh: &Mesh, object: ObjectId) -> impl Iterator<Item = Triangle> + '_ {
    mesh.triangles.iter().enumerate().map(move |(i, t)| Triangle {
        corners: t.map(|v| mesh.positions[v as usize]),
        object,
        primitive: i as u32,
    })
}

impl Tree {
    fn build(mut triangles: Vec<Triangle>) -> Self {
        let mut nodes = Vec::new();
        let count = triangles.len();
        if count > 0 {
            split(&mut triangles, 0, &mut nodes);
        }
        Self { nodes, triangles }
    }

    fn intersect(&self, ray: &Ray, t_max: &mut f32, keep: &mut impl FnMut(Hit, &mut f32), instance: Option<ObjectId>) {
        let shear = Shear::new(ray.o, ray.d);
        let pad = 1e-6
            * (ray.o.abs().max_element()
                + self.nodes.first().map_or(0.0, |n| n.low.abs().max(n.high.abs()).max_element()));
        let mut stack = vec![0u32];
        while let Some(n) = stack.pop() {
            let Some(node) = self.nodes.get(n as usize) else { continue };
            if !node.meets(ray, pad, *t_max) {
                continue;
            }
            if node.count == 0 {
                stack.extend([node.index, n + 1]);
                continue;
            }
            for t in &self.triangles[node.index as usize..(node.index + node.count) as usize] {
                if let Some(h) = triangle::intersect(&shear, &t.corners, *t_max) {
                    let object = instance.unwrap_or(t.object);
                    keep(Hit { t: h.t, object, primitive: t.primitive, b: h.b }, t_max);
                }
            }
        }
    }
}

impl Node {
    fn meets(&self, ray: &Ray, pad: f32, t_max: f32) -> bool {
        let (mut near, mut far) = (0.0f32, t_max);
        for k in 0..3 {
            let (low, high) = (self.low[k] - pad - ray.o[k], self.high[k] + pad - ray.o[k]);
            if ray.d[k] == 0.0 {
                if low > 0.0 || high < 0.0 {
                    return false;
                }
                continue;
            }
            let (a, b) = (low / ray.d[k], high / ray.d[k]);
            near = near.max(a.min(b));
            far = far.min(a.max(b));
        }
        near <= far
    }
}

fn split(triangles: &mut [Triangle], first: u32, nodes: &mut Vec<Node>) {
    let (mut low, mut high) = (Vec3::INFINITY, Vec3::NEG_INFINITY);
    for c in triangles.iter().flat_map(|t| t.corners) {
        (low, high) = (low.min(c), high.max(c));
    }
    let at = nodes.len();
    nodes.push(Node { low, high, index: first, count: triangles.len() as u32 });
    if triangles.len() <= 4 {
        return;
    }
    let size = high - low;
    let k = if size.x >= size.max_element() {
        0
    } else if size.y >= size.z {
        1
    } else {
        2
    };
    let centre = |t: &Triangle| t.corners[0][k] + t.corners[1][k] + t.corners[2][k];
    let half = triangles.len() / 2;
    triangles.select_nth_unstable_by(half, |a, b| centre(a).total_cmp(&centre(b)));
    let (left, right) = triangles.split_at_mut(half);
    split(left, first, nodes);
    nodes[at].index = nodes.len() as u32;
    nodes[at].count = 0;
    split(right, first + half as u32, nodes);
}

#[cfg(test)]
mod tests;
