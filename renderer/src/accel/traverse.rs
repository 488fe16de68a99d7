//! Walks an 8-wide tree with a ray: boxes and triangles eight at a time.

use super::binary;
use super::leaf::{LeafHits, ShearLanes};
use super::node::{Child, Leaf, Node};
use super::ray::{BoxLanes, BoxRay, prepare};
#[cfg(target_arch = "x86_64")]
use super::simd::{Avx2, Avx512};
use super::simd::{Lanes, Portable, Simd};
use super::wide::Tree;
use crate::math::Ray;
use std::mem::MaybeUninit;

/// Each level leaves at most seven children for later, and a wide tree has no more levels than the binary one it is made from.
const STACK: usize = 7 * binary::MAX_DEPTH + 8;

/// What a walk does at a leaf. (A closure would not inherit the SIMD features of the walk.)
pub(super) trait Visitor {
    /// Tests leaf `index`; may shorten `t_max`; true ends the walk.
    fn visit(&mut self, index: u32, t_max: &mut f32) -> bool;
}

/// What a walk has left for later, the nearest on top: children, and keys that hold their entry distances (see [`Lanes::keys`]).
struct Stack {
    children: [MaybeUninit<u32>; STACK],
    keys: [MaybeUninit<u32>; STACK],
    len: usize,
}

impl Stack {
    #[inline(always)]
    fn new() -> Self {
        Self {
            children: [const { MaybeUninit::uninit() }; STACK],
            keys: [const { MaybeUninit::uninit() }; STACK],
            len: 0,
        }
    }

    /// Puts the first `count` of eight children on.
    #[inline(always)]
    fn push<L: Lanes>(&mut self, children: L::K, keys: L::K, count: usize) {
        let (c, k) = (self.children[self.len..].first_chunk_mut::<8>(), self.keys[self.len..].first_chunk_mut::<8>());
        let (Some(c), Some(k)) = (c, k) else { unreachable!("no tree is deeper than binary::MAX_DEPTH") };
        L::store_keys(children, c);
        L::store_keys(keys, k);
        self.len += count;
    }

    /// Takes the nearest child off that the ray enters before `limit`.
    #[inline(always)]
    fn pop<const ORDERED: bool>(&mut self, limit: u32) -> Option<Child> {
        loop {
            self.len = self.len.checked_sub(1)?;
            // SAFETY: `len` only grows by `push`, which writes the entries that it comes to include.
            #[allow(unsafe_code, reason = "clearing kilobytes for every ray would cost more than the walk")]
            let (child, key) = unsafe { (self.children[self.len].assume_init(), self.keys[self.len].assume_init()) };
            if !ORDERED || key <= limit {
                return Some(Child(child));
            }
        }
    }
}

/// Visits the leaves that the ray meets within [0, `t_max`], roughly from near to far when `ORDERED`; the visitor may shorten `t_max`
/// and returns true to end the walk. Returns whether it did.
#[inline(always)]
fn walk<L: Lanes, const ORDERED: bool>(
    nodes: &[Node],
    root: Child,
    ray: &BoxRay,
    mut t_max: f32,
    visitor: &mut impl Visitor,
) -> bool {
    let lanes = BoxLanes::<L>::new(ray);
    let mut stack = Stack::new();
    let mut next = root;
    loop {
        if let Some(leaf) = next.as_leaf() {
            if visitor.visit(leaf, &mut t_max) {
                return true;
            }
        } else {
            let node = &nodes[next.0 as usize];
            let (hit, bits, enter) = lanes.test(node, L::splat(t_max));
            if bits != 0 {
                let first = bits.trailing_zeros() as usize & 7;
                let others = bits & (bits - 1);
                if others == 0 {
                    next = node.children[first];
                    continue;
                }
                // Go on with one child; leave the others. That nothing depends on their number spares mispredicted jumps.
                let count = others.count_ones() as usize;
                if ORDERED {
                    let keys = L::keys(enter, hit);
                    next = node.children[(L::least(keys) & 7) as usize];
                    let order = L::falling(keys);
                    stack.push::<L>(L::pick(node.children_bits(), order), order, count);
                } else {
                    next = node.children[first];
                    let children = L::gather(node.children_bits(), others);
                    stack.push::<L>(children, children, count);
                }
                continue;
            }
        }
        let Some(child) = stack.pop::<ORDERED>(t_max.to_bits() | 7) else { return false };
        next = child;
    }
}

/// Where a ray meets a tree's triangle.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct TreeHit {
    /// Ray parameter.
    pub t: f32,
    /// Barycentric weights of the second and third corner.
    pub b: [f32; 2],
    /// The triangle's number.
    pub id: u32,
}

/// The nearest hit with a parameter of at most `t_max`; of equal ones that of the smallest triangle number.
#[inline]
pub(super) fn closest(tree: &Tree, root: Child, ray: &Ray, t_max: f32, simd: Simd) -> Option<TreeHit> {
    match simd {
        Simd::Portable => closest_by::<Portable>(tree, root, ray, t_max),
        // SAFETY: `Simd::Avx2` is only made where the machine has AVX2 and FMA.
        #[cfg(target_arch = "x86_64")]
        #[allow(unsafe_code, reason = "functions with other instructions than the rest of the program")]
        Simd::Avx2 => unsafe { closest_avx2(tree, root, ray, t_max) },
        // SAFETY: `Simd::Avx512` is only made where the machine has these parts of it.
        #[cfg(target_arch = "x86_64")]
        #[allow(unsafe_code, reason = "functions with other instructions than the rest of the program")]
        Simd::Avx512 => unsafe { closest_avx512(tree, root, ray, t_max) },
    }
}

/// Whether any triangle is hit at a parameter of at most `t_max`.
#[inline]
pub(super) fn any(tree: &Tree, root: Child, ray: &Ray, t_max: f32, simd: Simd) -> bool {
    match simd {
        Simd::Portable => any_by::<Portable>(tree, root, ray, t_max),
        // SAFETY: `Simd::Avx2` is only made where the machine has AVX2 and FMA.
        #[cfg(target_arch = "x86_64")]
        #[allow(unsafe_code, reason = "functions with other instructions than the rest of the program")]
        Simd::Avx2 => unsafe { any_avx2(tree, root, ray, t_max) },
        // SAFETY: `Simd::Avx512` is only made where the machine has these parts of it.
        #[cfg(target_arch = "x86_64")]
        #[allow(unsafe_code, reason = "functions with other instructions than the rest of the program")]
        Simd::Avx512 => unsafe { any_avx512(tree, root, ray, t_max) },
    }
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx2,fma,bmi1,bmi2,lzcnt,popcnt")]
fn closest_avx2(tree: &Tree, root: Child, ray: &Ray, t_max: f32) -> Option<TreeHit> {
    closest_by::<Avx2>(tree, root, ray, t_max)
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx2,fma,bmi1,bmi2,lzcnt,popcnt")]
fn any_avx2(tree: &Tree, root: Child, ray: &Ray, t_max: f32) -> bool {
    any_by::<Avx2>(tree, root, ray, t_max)
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx2,fma,bmi1,bmi2,lzcnt,popcnt,avx512f,avx512vl,avx512bw,avx512dq")]
fn closest_avx512(tree: &Tree, root: Child, ray: &Ray, t_max: f32) -> Option<TreeHit> {
    closest_by::<Avx512>(tree, root, ray, t_max)
}

#[inline(always)]
fn closest_by<L: Lanes>(tree: &Tree, root: Child, ray: &Ray, t_max: f32) -> Option<TreeHit> {
    let (boxes, shear) = prepare(ray.o, ray.d, tree.reach);
    let mut visitor = Closest { lanes: ShearLanes::<L>::new(&shear), tree, best: None };
    walk::<L, true>(&tree.nodes, root, &boxes, t_max, &mut visitor);
    visitor.best
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx2,fma,bmi1,bmi2,lzcnt,popcnt,avx512f,avx512vl,avx512bw,avx512dq")]
fn any_avx512(tree: &Tree, root: Child, ray: &Ray, t_max: f32) -> bool {
    any_by::<Avx512>(tree, root, ray, t_max)
}

#[inline(always)]
fn any_by<L: Lanes>(tree: &Tree, root: Child, ray: &Ray, t_max: f32) -> bool {
    let (boxes, shear) = prepare(ray.o, ray.d, tree.reach);
    let mut visitor = Any { lanes: ShearLanes::<L>::new(&shear), leaves: &tree.leaves };
    walk::<L, false>(&tree.nodes, root, &boxes, t_max, &mut visitor)
}

/// Visits the leaves of a tree of boxes that the ray meets within [0, `t_max`]; see [`walk`]. `reach` is the largest absolute coordinate.
pub(super) fn visit<V: Visitor, const ORDERED: bool>(
    nodes: &[Node],
    root: Child,
    ray: &Ray,
    reach: f32,
    t_max: f32,
    simd: Simd,
    visitor: &mut V,
) -> bool {
    let boxes = prepare(ray.o, ray.d, reach).0;
    match simd {
        Simd::Portable => walk::<Portable, ORDERED>(nodes, root, &boxes, t_max, visitor),
        // SAFETY: `Simd::Avx2` is only made where the machine has AVX2 and FMA.
        #[cfg(target_arch = "x86_64")]
        #[allow(unsafe_code, reason = "functions with other instructions than the rest of the program")]
        Simd::Avx2 => unsafe { visit_avx2::<V, ORDERED>(nodes, root, &boxes, t_max, visitor) },
        // SAFETY: `Simd::Avx512` is only made where the machine has these parts of it.
        #[cfg(target_arch = "x86_64")]
        #[allow(unsafe_code, reason = "functions with other instructions than the rest of the program")]
        Simd::Avx512 => unsafe { visit_avx512::<V, ORDERED>(nodes, root, &boxes, t_max, visitor) },
    }
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx2,fma,bmi1,bmi2,lzcnt,popcnt")]
fn visit_avx2<V: Visitor, const ORDERED: bool>(
    nodes: &[Node],
    root: Child,
    ray: &BoxRay,
    t_max: f32,
    v: &mut V,
) -> bool {
    walk::<Avx2, ORDERED>(nodes, root, ray, t_max, v)
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx2,fma,bmi1,bmi2,lzcnt,popcnt,avx512f,avx512vl,avx512bw,avx512dq")]
fn visit_avx512<V: Visitor, const ORDERED: bool>(
    nodes: &[Node],
    root: Child,
    ray: &BoxRay,
    t_max: f32,
    v: &mut V,
) -> bool {
    walk::<Avx512, ORDERED>(nodes, root, ray, t_max, v)
}

/// Keeps the nearest hit.
struct Closest<'a, L: Lanes> {
    lanes: ShearLanes<'a, L>,
    tree: &'a Tree,
    best: Option<TreeHit>,
}

impl<L: Lanes> Closest<'_, L> {
    #[inline(always)]
    fn keep(&mut self, hit: TreeHit, t_max: &mut f32) {
        if self.best.is_none_or(|b| hit.t < b.t || (hit.t == b.t && hit.id < b.id)) {
            self.best = Some(hit);
            *t_max = hit.t;
        }
    }
}

impl<L: Lanes> Closest<'_, L> {
    /// Keeps what the lanes without a distance hit.
    #[inline(always)]
    fn rest(&mut self, leaf: &Leaf, ids: &[u32; 8], h: &LeafHits<L>, t_max: &mut f32) {
        let (mut around, mut hard) = (h.around, h.hard);
        if around != 0 {
            let (least, b1, b2) = (L::store(h.least_t), L::store(h.b[0]), L::store(h.b[1]));
            while around != 0 {
                let i = around.trailing_zeros() as usize & 7;
                around &= around - 1;
                if let Some(t) = self.lanes.distance(leaf, i, least[i])
                    && t <= *t_max
                {
                    self.keep(TreeHit { t, b: [b1[i], b2[i]], id: ids[i] }, t_max);
                }
            }
        }
        while hard != 0 {
            let i = hard.trailing_zeros() as usize & 7;
            hard &= hard - 1;
            if let Some(h) = self.lanes.reference(leaf, i, *t_max) {
                self.keep(TreeHit { t: h.t, b: h.b, id: ids[i] }, t_max);
            }
        }
    }
}

impl<L: Lanes> Visitor for Closest<'_, L> {
    #[inline(always)]
    fn visit(&mut self, index: u32, t_max: &mut f32) -> bool {
        let leaf = &self.tree.leaves[index as usize];
        let Some(h) = self.lanes.test(leaf, *t_max) else { return false };
        let ids = &self.tree.ids[index as usize];
        if h.easy != 0 {
            let (mut easy, t, b1, b2) = (h.easy, L::store(h.t), L::store(h.b[0]), L::store(h.b[1]));
            while easy != 0 {
                let i = easy.trailing_zeros() as usize & 7;
                easy &= easy - 1;
                self.keep(TreeHit { t: t[i], b: [b1[i], b2[i]], id: ids[i] }, t_max);
            }
        }
        if h.around | h.hard != 0 {
            self.rest(leaf, ids, &h, t_max);
        }
        false
    }
}

/// Ends at the first hit.
struct Any<'a, L: Lanes> {
    lanes: ShearLanes<'a, L>,
    leaves: &'a [Leaf],
}

impl<L: Lanes> Visitor for Any<'_, L> {
    #[inline(always)]
    fn visit(&mut self, index: u32, t_max: &mut f32) -> bool {
        let leaf = &self.leaves[index as usize];
        let Some(h) = self.lanes.test(leaf, *t_max) else { return false };
        if h.easy != 0 {
            return true;
        }
        let (mut around, mut hard) = (h.around, h.hard);
        if around != 0 {
            let least = L::store(h.least_t);
            while around != 0 {
                let i = around.trailing_zeros() as usize & 7;
                around &= around - 1;
                if self.lanes.distance(leaf, i, least[i]).is_some_and(|t| t <= *t_max) {
                    return true;
                }
            }
        }
        while hard != 0 {
            let i = hard.trailing_zeros() as usize & 7;
            hard &= hard - 1;
            if self.lanes.reference(leaf, i, *t_max).is_some() {
                return true;
            }
        }
        false
    }
}
