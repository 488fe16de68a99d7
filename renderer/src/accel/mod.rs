//! Ray casting: the nearest hit and occlusion. The hit depends on the geometry and the ray only, never on the tree.
//!
//! Small binary trees are built by obvhs, large ones in parallel by `sah.rs`; they are collapsed into 8-wide nodes over leaves of up to
//! eight triangles, and walked with boxes and triangles eight at a time. Faults of obvhs 0.4.0's own traversal do not reach us: none of
//! it is used.
//!
//! Meshes in world space (see `Geometry::bake`) form one tree; instances, spheres and disks lie in a tree above.

mod binary;
mod bundle;
mod leaf;
mod node;
mod pages;
mod placed;
mod plan;
mod ray;
mod sah;
mod shaft;
mod simd;
mod traverse;
mod wide;

use crate::geometry::{Geometry, Hit, Mesh, ObjectId, Shape};
use crate::math::{Ray, Vec3};
use placed::{Item, Placed};
use wide::Tree;

/// Why no acceleration tree could be built.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum AccelError {
    /// The scene is too large for 32-bit indices.
    #[error("{0} triangles are more than {max}", max = MAX_TRIANGLES)]
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
/// A table of more triangles' objects would not stay in caches.
const MAX_OWNED: usize = 1 << 16;
/// The top bit of a child tells leaves from nodes.
const MAX_TRIANGLES: usize = (1 << 31) - 1;

/// Everything that rays are tested against, in the order in which it is tested.
#[derive(Debug)]
pub struct Accel {
    /// All triangles in world space; numbered through, object after object.
    world: Tree,
    /// First triangle of each object in `world`, ascending.
    starts: Vec<(u32, ObjectId)>,
    /// The place in `starts` of each triangle of `world`, where there are few: a search takes as long as a leaf.
    owners: Vec<u32>,
    /// The trees of instanced meshes.
    trees: Vec<Tree>,
    placed: Placed,
}

impl Accel {
    /// Builds the trees; the result does not depend on the number of threads.
    pub fn build(geometry: &Geometry) -> Result<Self, AccelError> {
        let mut world = Vec::new();
        let mut starts = Vec::new();
        let mut instanced: Vec<usize> = Vec::new();
        let mut tree_of = vec![usize::MAX; geometry.meshes.len()];
        let mut items = Vec::new();
        for (i, o) in geometry.objects.iter().enumerate() {
            let object = ObjectId(i as u32);
            let Shape::Mesh(id) = o.shape else {
                items.push(Item::curved(geometry, object));
                continue;
            };
            let mesh = &geometry.meshes[id.0 as usize];
            if !mesh.positions.iter().all(|p| p.abs().max_element() <= LIMIT) {
                return Err(AccelError::TooLarge { object: i });
            }
            if world.len() + mesh.triangles.len() > MAX_TRIANGLES {
                return Err(AccelError::TooManyTriangles(world.len() + mesh.triangles.len()));
            }
            if o.to_world.is_identity() {
                starts.push((world.len() as u32, object));
                world.extend(triangles(mesh));
            } else if !mesh.triangles.is_empty() {
                let tree = &mut tree_of[id.0 as usize];
                if *tree == usize::MAX {
                    *tree = instanced.len();
                    instanced.push(id.0 as usize);
                }
                items.push(Item::instance(object, *tree, mesh, o.to_world));
            }
        }
        if let Some(bad) = items.iter().find(|i| !i.bounds.reach().is_finite()) {
            return Err(AccelError::TooLarge { object: bad.object.0 as usize });
        }
        let build = |mesh: usize| Tree::build(&triangles(&geometry.meshes[mesh]).collect::<Vec<_>>());
        let trees = instanced.into_iter().map(build).collect();
        let owners = if world.len() <= MAX_OWNED { owners(&starts, world.len()) } else { Vec::new() };
        Ok(Self { world: Tree::build(&world), starts, owners, trees, placed: Placed::new(items) })
    }

    /// The nearest hit; of equal distances that of the smaller (object, primitive).
    pub fn intersect(&self, ray: &Ray) -> Option<Hit> {
        if !usable(ray) {
            return None;
        }
        // `t_max` is exclusive, but distances found are inclusive: ties are settled by index.
        let mut t_max = ray.t_max.next_down();
        let mut best = self.world.closest(ray, t_max).as_ref().map(|h| {
            let slot = match self.owners.get(h.id as usize) {
                Some(slot) => *slot as usize,
                None => self.starts.partition_point(|s| s.0 <= h.id) - 1,
            };
            let (start, object) = self.starts[slot];
            Hit { t: h.t, object, primitive: h.id - start, b: h.b }
        });
        if !self.placed.is_empty() {
            t_max = best.map_or(t_max, |b| b.t);
            self.placed.closest(&self.trees, ray, t_max, &mut best);
        }
        best
    }

    /// Whether anything lies on the ray before its end.
    pub fn occluded(&self, ray: &Ray) -> bool {
        let t_max = ray.t_max.next_down();
        usable(ray) && (self.world.any(ray, t_max) || self.placed.any(&self.trees, ray, t_max))
    }

    /// [`Self::occluded`] of each ray: faster if they begin close together and end close together.
    pub fn occluded_each<'a>(&'a self, rays: &'a [Ray]) -> impl Iterator<Item = bool> + 'a {
        rays.chunks(bundle::MAX_RAYS).flat_map(|rays| {
            let hidden = self.occluded_bundle(rays);
            (0..rays.len()).map(move |i| hidden >> i & 1 == 1)
        })
    }

    /// The same of at most [`bundle::MAX_RAYS`] rays, a bit for each.
    fn occluded_bundle(&self, rays: &[Ray]) -> u64 {
        let Some(found) = self.world.any_of_bundle(rays) else {
            return (0..).zip(rays).fold(0, |hit, (i, ray)| hit | u64::from(self.occluded(ray)) << i);
        };
        if self.placed.is_empty() {
            return found;
        }
        let placed = |ray: &Ray| usable(ray) && self.placed.any(&self.trees, ray, ray.t_max.next_down());
        let open = (0..).zip(rays).filter(|(i, _)| found >> i & 1 == 0);
        open.fold(found, |hit, (i, ray)| hit | u64::from(placed(ray)) << i)
    }

    /// Bytes that the trees take.
    pub fn bytes(&self) -> usize {
        self.world.bytes() + self.trees.iter().map(Tree::bytes).sum::<usize>()
    }
}

/// For each of `count` triangles, the place in `starts` of its object.
fn owners(starts: &[(u32, ObjectId)], count: usize) -> Vec<u32> {
    let ends = starts.iter().skip(1).map(|s| s.0).chain([count as u32]);
    starts.iter().zip(ends).enumerate().flat_map(|(slot, (s, end))| (s.0..end).map(move |_| slot as u32)).collect()
}

/// Rays with NaN or without a direction hit nothing.
fn usable(ray: &Ray) -> bool {
    ray.d.is_finite() && ray.d != Vec3::ZERO && ray.o.is_finite() && ray.t_max > 0.0
}

/// The corners of a mesh's triangles.
fn triangles(mesh: &Mesh) -> impl Iterator<Item = [Vec3; 3]> + '_ {
    mesh.triangles.iter().map(|t| t.map(|v| mesh.positions[v as usize]))
}

#[cfg(test)]
mod tests;
