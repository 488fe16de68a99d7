//! Walks an 8-wide tree with a ray: boxes and triangles eight at a time.

use super::binary;
use super::node::{Child, Leaf, Node};
#[cfg(target_arch = "x86_64")]
use super::simd::Avx2;
use super::simd::{Lanes, Portable, Simd};
use super::wide::Tree;
use crate::geometry::triangle::{Shear, TriangleHit};
use crate::math::{Ray, Vec3};
use std::mem::MaybeUninit;

/// Each level leaves at most seven children for later, and a wide tree has no more levels than the binary one it is made from.
const STACK: usize = 7 * binary::MAX_DEPTH + 8;

/// Relative to the largest coordinate: covers the roundings of the box test (four operations on numbers of that size, fused or
/// not) and those of the sheared corners of the triangle test (three), twice over.
const PAD: f32 = 16.0 * f32::EPSILON;
/// A direction component this small against the largest moves the ray by less than the padding within the scene.
const FLAT: f32 = 1e-9;

/// A ray prepared for box tests: `t = plane * inv + offset`, with padded offsets.
///
/// Conservative (after Ize 2013, "Robust BVH Ray Traversal"): a box that holds a triangle which [`Shear`]'s test hits is never
/// missed, and its entry never lies behind the hit. The padding is absolute, so that negative zeros, planes through the origin
/// and distances near zero need no cases of their own.
#[derive(Clone, Copy, Debug)]
struct BoxRay {
    inv: [f32; 3],
    near: [f32; 3],
    far: [f32; 3],
    /// 1 where the direction is negative.
    negative: [usize; 3],
}

/// Both forms of a ray.
#[inline(always)]
fn prepare(o: Vec3, d: Vec3, reach: f32) -> (BoxRay, Shear) {
    let (o, d, a, ao) = (o.to_array(), d.to_array(), d.abs().to_array(), o.abs().to_array());
    let kz = if a[0] > a[1] && a[0] > a[2] {
        0
    } else if a[1] > a[2] {
        1
    } else {
        2
    };
    let axes = [[1, 2, 0], [2, 0, 1], [0, 1, 2]][kz];
    let floor = FLAT * a[kz];
    let steep = [a[0] > floor, a[1] > floor, a[2] > floor];
    let pick = |k: usize| 1.0 / if steep[k] { d[k] } else { floor.copysign(d[k]) };
    let inv = [pick(0), pick(1), pick(2)];
    let tri =
        [if steep[0] { inv[0] } else { 0.0 }, if steep[1] { inv[1] } else { 0.0 }, if steep[2] { inv[2] } else { 0.0 }];
    let pad = PAD * (ao[0].max(ao[1]).max(ao[2]) + reach);
    let (p, q) =
        ([pad * inv[0].abs(), pad * inv[1].abs(), pad * inv[2].abs()], [o[0] * inv[0], o[1] * inv[1], o[2] * inv[2]]);
    let boxes = BoxRay {
        inv,
        near: [-q[0] - p[0], -q[1] - p[1], -q[2] - p[2]],
        far: [p[0] - q[0], p[1] - q[1], p[2] - q[2]],
        negative: [(d[0].to_bits() >> 31) as usize, (d[1].to_bits() >> 31) as usize, (d[2].to_bits() >> 31) as usize],
    };
    let [kx, ky, _] = axes;
    let (dx, dy, iz) = (d[kx], d[ky], inv[kz]);
    let shear = Shear {
        axes,
        o: [o[kx], o[ky], o[kz]],
        d: [dx, dy, d[kz]],
        s: [dx * iz, dy * iz, iz],
        inv: [tri[kx], tri[ky], iz],
    };
    (boxes, shear)
}

#[inline(always)]
fn splat3<L: Lanes>(x: [f32; 3]) -> [L::F; 3] {
    [L::splat(x[0]), L::splat(x[1]), L::splat(x[2])]
}

/// The same, in lanes.
struct BoxLanes<L: Lanes> {
    inv: [L::F; 3],
    near: [L::F; 3],
    far: [L::F; 3],
    /// Byte offsets of the rows of near planes.
    near_rows: [usize; 3],
    far_rows: [usize; 3],
}

#[inline(always)]
fn row(node: &Node, offset: usize) -> &[f32; 8] {
    let offset = offset.min(5 * 32);
    // SAFETY: a node begins with six rows of eight f32, 32 bytes each; the offset is a multiple of 32 of at most 5 * 32.
    #[allow(unsafe_code, reason = "a row chosen by the ray's signs, without a jump")]
    unsafe {
        &*std::ptr::from_ref(node).cast::<u8>().add(offset).cast()
    }
}

impl<L: Lanes> BoxLanes<L> {
    #[inline(always)]
    fn new(r: &BoxRay) -> Self {
        let n = [32 * r.negative[0], 64 + 32 * r.negative[1], 128 + 32 * r.negative[2]];
        Self {
            inv: splat3::<L>(r.inv),
            near: splat3::<L>(r.near),
            far: splat3::<L>(r.far),
            near_rows: n,
            far_rows: [n[0] ^ 32, n[1] ^ 32, n[2] ^ 32],
        }
    }

    /// Which boxes the ray meets in [0, `t_max`], and where it enters them.
    #[inline(always)]
    fn test(&self, node: &Node, t_max: L::F) -> (u32, L::F) {
        let enter_x = L::mul_add(L::load(row(node, self.near_rows[0])), self.inv[0], self.near[0]);
        let enter_y = L::mul_add(L::load(row(node, self.near_rows[1])), self.inv[1], self.near[1]);
        let enter_z = L::mul_add(L::load(row(node, self.near_rows[2])), self.inv[2], self.near[2]);
        let leave_x = L::mul_add(L::load(row(node, self.far_rows[0])), self.inv[0], self.far[0]);
        let leave_y = L::mul_add(L::load(row(node, self.far_rows[1])), self.inv[1], self.far[1]);
        let leave_z = L::mul_add(L::load(row(node, self.far_rows[2])), self.inv[2], self.far[2]);
        let enter = L::max(L::max(enter_x, enter_y), L::max(enter_z, L::splat(0.0)));
        let leave = L::min(L::min(leave_x, leave_y), L::min(leave_z, t_max));
        (L::le(enter, leave), enter)
    }
}

/// What a walk does at a leaf. (A closure would not inherit the SIMD features of the walk.)
trait Visitor {
    /// Tests leaf `index`; may shorten `t_max`; true ends the walk.
    fn visit(&mut self, index: u32, t_max: &mut f32) -> bool;
}

/// What a walk has left for later: children with the bits of their entry distances above their numbers. Distances are not negative, so
/// that their bits are ordered as they are.
struct Stack {
    entries: [MaybeUninit<u64>; STACK],
    len: usize,
}

impl Stack {
    #[inline(always)]
    fn new() -> Self {
        Self { entries: [const { MaybeUninit::uninit() }; STACK], len: 0 }
    }

    #[inline(always)]
    fn push(&mut self, entry: u64) {
        self.entries[self.len].write(entry);
        self.len += 1;
    }

    #[inline(always)]
    fn pop(&mut self) -> Option<u64> {
        self.len = self.len.checked_sub(1)?;
        Some(self.get(self.len))
    }

    /// An entry below `len`, or just taken off.
    #[inline(always)]
    fn get(&self, i: usize) -> u64 {
        // SAFETY: `len` only grows by `push`, which writes the entry that it comes to include.
        #[allow(unsafe_code, reason = "clearing two kilobytes for every ray would cost more than the walk")]
        unsafe {
            self.entries[i].assume_init()
        }
    }

    /// Puts the entries from `base` on in order, the nearest on top.
    #[inline(always)]
    fn sort_from(&mut self, base: usize) {
        for i in base + 1..self.len {
            let entry = self.get(i);
            let mut k = i;
            while k > base && self.get(k - 1) < entry {
                self.entries[k] = self.entries[k - 1];
                k -= 1;
            }
            self.entries[k].write(entry);
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
        // Go down to a leaf.
        let leaf = loop {
            if let Some(leaf) = next.as_leaf() {
                break Some(leaf);
            }
            let node = &nodes[next.0 as usize];
            let (mut hits, enter) = lanes.test(node, L::splat(t_max));
            if hits == 0 {
                break None;
            }
            let first = hits.trailing_zeros() as usize & 7;
            hits &= hits - 1;
            if hits == 0 {
                next = node.children[first];
                continue;
            }
            if !ORDERED {
                while hits != 0 {
                    stack.push(u64::from(node.children[hits.trailing_zeros() as usize & 7].0));
                    hits &= hits - 1;
                }
                next = node.children[first];
                continue;
            }
            // Take the nearest child; leave the others in order.
            let keys = L::keys(enter, &node.children.map(|c| c.0));
            let second = hits.trailing_zeros() as usize & 7;
            hits &= hits - 1;
            let (near, far) = (keys[first].min(keys[second]), keys[first].max(keys[second]));
            stack.push(far);
            if hits == 0 {
                next = Child(near as u32);
                continue;
            }
            let base = stack.len - 1;
            stack.push(near);
            while hits != 0 {
                stack.push(keys[hits.trailing_zeros() as usize & 7]);
                hits &= hits - 1;
            }
            stack.sort_from(base);
            stack.len -= 1;
            next = Child(stack.get(stack.len) as u32);
        };
        if let Some(leaf) = leaf
            && visitor.visit(leaf, &mut t_max)
        {
            return true;
        }
        // Take up the nearest child left for later that is still within reach.
        let limit = u64::from(t_max.to_bits()) << 32 | 0xffff_ffff;
        loop {
            let Some(entry) = stack.pop() else { return false };
            if !ORDERED || entry <= limit {
                next = Child(entry as u32);
                break;
            }
        }
    }
}

/// A ray prepared for eight triangles at a time.
struct ShearLanes<'a, L: Lanes> {
    shear: &'a Shear,
    o: [L::F; 3],
    s: [L::F; 3],
    inv: [L::F; 2],
}

/// What the ray hits in a leaf.
struct LeafHits<L: Lanes> {
    /// Lanes with a hit, complete.
    pub easy: u32,
    /// Lanes that only the reference test can decide.
    pub hard: u32,
    pub t: L::F,
    pub b: [L::F; 2],
}

impl<'a, L: Lanes> ShearLanes<'a, L> {
    #[inline(always)]
    pub fn new(shear: &'a Shear) -> Self {
        Self {
            shear,
            o: splat3::<L>(shear.o),
            s: splat3::<L>(shear.s),
            inv: [L::splat(shear.inv[0]), L::splat(shear.inv[1])],
        }
    }

    /// Eight triangles at once.
    #[inline(always)]
    pub fn test(&self, leaf: &Leaf, t_max: f32) -> Option<LeafHits<L>> {
        let [kx, ky, kz] = self.shear.axes;
        let [sx, sy, sz] = self.s;
        let rz = L::sub(L::load(&leaf.vertices[kz]), self.o[2]);
        let rx = L::sub(L::load(&leaf.vertices[kx]), self.o[0]);
        let ry = L::sub(L::load(&leaf.vertices[ky]), self.o[1]);
        let x = L::sub(rx, L::mul(sx, rz));
        let y = L::sub(ry, L::mul(sy, rz));
        let (ia, ib, ic) = (L::lanes(&leaf.corners[0]), L::lanes(&leaf.corners[1]), L::lanes(&leaf.corners[2]));
        let (ax, ay) = (L::permute(x, ia), L::permute(y, ia));
        let (bx, by) = (L::permute(x, ib), L::permute(y, ib));
        let (cx, cy) = (L::permute(x, ic), L::permute(y, ic));
        let u = L::sub(L::mul(cx, by), L::mul(cy, bx));
        let v = L::sub(L::mul(ax, cy), L::mul(ay, cx));
        let w = L::sub(L::mul(bx, ay), L::mul(by, ax));
        let zero = L::splat(0.0);
        let (least, most) = (L::min(L::min(u, v), w), L::max(L::max(u, v), w));
        let inside = (L::le(zero, least) | L::le(most, zero)) & leaf.used;
        if inside == 0 {
            return None;
        }
        let strictly = L::lt(zero, least) | L::lt(most, zero);
        let (az, bz, cz) = (L::permute(rz, ia), L::permute(rz, ib), L::permute(rz, ic));
        let (ez_a, ez_b, ez_c) = (L::mul(az, sz), L::mul(bz, sz), L::mul(cz, sz));
        let near_z = L::min(L::min(ez_a, ez_b), ez_c);
        let far_z = L::max(L::max(ez_a, ez_b), ez_c);
        let in_front = L::lt(zero, near_z);
        let not_behind = L::lt(zero, far_z);
        let inv_det = L::div(L::splat(1.0), L::add(L::add(u, v), w));
        let t = L::mul(L::mul(L::add(L::add(L::mul(u, az), L::mul(v, bz)), L::mul(w, cz)), sz), inv_det);
        let finite = L::le(t, L::splat(f32::MAX));
        let (ex, ey) = (L::mul(rx, self.inv[0]), L::mul(ry, self.inv[1]));
        let near_x = L::min(L::min(L::permute(ex, ia), L::permute(ex, ib)), L::permute(ex, ic));
        let near_y = L::min(L::min(L::permute(ey, ia), L::permute(ey, ib)), L::permute(ey, ic));
        let t = L::max(L::max(L::max(t, near_z), L::max(near_x, near_y)), zero);
        let easy = inside & strictly & in_front & finite & L::le(t, L::splat(t_max));
        let hard = inside & not_behind & !(strictly & in_front);
        Some(LeafHits { easy, hard, t, b: [L::mul(v, inv_det), L::mul(w, inv_det)] })
    }

    /// The reference test on one lane.
    #[inline(never)]
    fn reference(shear: &Shear, leaf: &Leaf, lane: usize, t_max: f32) -> Option<TriangleHit> {
        let corner = |c: usize| {
            let v = usize::from(leaf.corners[c][lane] & 7);
            shear.axes.map(|k| leaf.vertices[k][v])
        };
        shear.intersect(corner(0), corner(1), corner(2), t_max)
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
pub(super) fn closest(tree: &Tree, root: Child, ray: &Ray, t_max: f32, simd: Simd) -> Option<TreeHit> {
    match simd {
        Simd::Portable => closest_by::<Portable>(tree, root, ray, t_max),
        // SAFETY: `Simd::Avx2` is only made where the machine has AVX2 and FMA.
        #[cfg(target_arch = "x86_64")]
        #[allow(unsafe_code, reason = "functions with other instructions than the rest of the program")]
        Simd::Avx2 => unsafe { closest_avx2(tree, root, ray, t_max) },
    }
}

/// Whether any triangle is hit at a parameter of at most `t_max`.
pub(super) fn any(tree: &Tree, root: Child, ray: &Ray, t_max: f32, simd: Simd) -> bool {
    match simd {
        Simd::Portable => any_by::<Portable>(tree, root, ray, t_max),
        // SAFETY: `Simd::Avx2` is only made where the machine has AVX2 and FMA.
        #[cfg(target_arch = "x86_64")]
        #[allow(unsafe_code, reason = "functions with other instructions than the rest of the program")]
        Simd::Avx2 => unsafe { any_avx2(tree, root, ray, t_max) },
    }
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx2,fma")]
fn closest_avx2(tree: &Tree, root: Child, ray: &Ray, t_max: f32) -> Option<TreeHit> {
    closest_by::<Avx2>(tree, root, ray, t_max)
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx2,fma")]
fn any_avx2(tree: &Tree, root: Child, ray: &Ray, t_max: f32) -> bool {
    any_by::<Avx2>(tree, root, ray, t_max)
}

#[inline(always)]
fn closest_by<L: Lanes>(tree: &Tree, root: Child, ray: &Ray, t_max: f32) -> Option<TreeHit> {
    let (boxes, shear) = prepare(ray.o, ray.d, tree.reach);
    let mut visitor = Closest { lanes: ShearLanes::<L>::new(&shear), tree, best: None };
    walk::<L, true>(&tree.nodes, root, &boxes, t_max, &mut visitor);
    visitor.best
}

#[inline(always)]
fn any_by<L: Lanes>(tree: &Tree, root: Child, ray: &Ray, t_max: f32) -> bool {
    let (boxes, shear) = prepare(ray.o, ray.d, tree.reach);
    let mut visitor = Any { lanes: ShearLanes::<L>::new(&shear), leaves: &tree.leaves };
    walk::<L, false>(&tree.nodes, root, &boxes, t_max, &mut visitor)
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
        let mut hard = h.hard;
        while hard != 0 {
            let i = hard.trailing_zeros() as usize & 7;
            hard &= hard - 1;
            if let Some(h) = ShearLanes::<L>::reference(self.lanes.shear, leaf, i, *t_max) {
                self.keep(TreeHit { t: h.t, b: h.b, id: ids[i] }, t_max);
            }
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
        let reference = |i: usize| ShearLanes::<L>::reference(self.lanes.shear, leaf, i, *t_max).is_some();
        h.easy != 0 || (0..8).any(|i| h.hard >> i & 1 == 1 && reference(i))
    }
}
