//! Binary trees over boxes, built by obvhs. The only file that knows obvhs and its SIMD vector type.
#![allow(clippy::disallowed_types, reason = "obvhs takes its boxes as Vec3A; nothing is computed with them here")]

use crate::math::Vec3;
use glam::Vec3A;
use obvhs::BvhBuildParams;
use obvhs::aabb::Aabb;
use obvhs::bvh2::reinsertion::ReinsertionOptimizer;
use obvhs::ploc::{PlocBuilder, SortPrecision};

/// Levels that a tree may have. obvhs makes deeper ones of coincident geometry; these are replaced by balanced ones.
pub(super) const MAX_DEPTH: usize = 96;

/// An axis-aligned box.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Box3 {
    pub low: Vec3,
    pub high: Vec3,
}

impl Box3 {
    /// Contains nothing.
    pub const EMPTY: Self = Self { low: Vec3::INFINITY, high: Vec3::NEG_INFINITY };

    /// Of points.
    pub fn around(points: &[Vec3]) -> Self {
        points.iter().fold(Self::EMPTY, |b, p| Self { low: b.low.min(*p), high: b.high.max(*p) })
    }

    /// Of both.
    pub fn union(&self, other: &Self) -> Self {
        Self { low: self.low.min(other.low), high: self.high.max(other.high) }
    }

    /// Half the surface area.
    pub fn half_area(&self) -> f32 {
        let d = self.high - self.low;
        d.x * d.y + d.y * d.z + d.z * d.x
    }

    /// Largest absolute coordinate.
    pub fn reach(&self) -> f32 {
        self.low.abs().max(self.high.abs()).max_element()
    }
}

/// A node of a binary tree.
#[derive(Clone, Copy, Debug)]
pub(super) struct BinaryNode {
    pub bounds: Box3,
    /// Inner node: the first child, the second follows it; leaf: number of the primitive.
    pub index: u32,
    pub is_leaf: bool,
}

/// A tree with one primitive per leaf; the root is node 0. Empty for no boxes.
pub(super) fn build(boxes: &[Box3]) -> Vec<BinaryNode> {
    if boxes.is_empty() {
        return Vec::new();
    }
    let nodes = if boxes.len() > 1 && !concentric(boxes) { build_by_area(boxes) } else { balanced(boxes) };
    if depth(&nodes) <= MAX_DEPTH { nodes } else { balanced(boxes) }
}

/// Most boxes with the very same centre that obvhs is given: it takes time quadratic in their number.
const MAX_CONCENTRIC: usize = 1024;

/// Whether too many boxes share their centre.
fn concentric(boxes: &[Box3]) -> bool {
    let mut centres: Vec<[u32; 3]> = boxes.iter().map(|b| (b.low + b.high).to_array().map(f32::to_bits)).collect();
    centres.sort_unstable();
    centres.len() > MAX_CONCENTRIC && centres.windows(MAX_CONCENTRIC + 1).any(|w| w[0] == w[MAX_CONCENTRIC])
}

/// obvhs's builder at its medium setting: PLOC (Meister and Bittner 2018), then reinsertion (Meister and Bittner 2018 again).
/// Sequential: its parallel form makes other trees.
fn build_by_area(boxes: &[Box3]) -> Vec<BinaryNode> {
    let aabbs: Vec<Aabb> = boxes.iter().map(|b| Aabb { min: Vec3A::from(b.low), max: Vec3A::from(b.high) }).collect();
    let indices = (0..aabbs.len() as u32).collect();
    let p = BvhBuildParams::medium_build();
    let builder = PlocBuilder::with_capacity(aabbs.len());
    let mut tree =
        { builder }.build(p.ploc_search_distance, &aabbs, indices, SortPrecision::U64, p.search_depth_threshold);
    ReinsertionOptimizer::default().run(&mut tree, p.reinsertion_batch_ratio, None);
    let node = |n: &obvhs::bvh2::node::Bvh2Node| BinaryNode {
        bounds: Box3 { low: n.aabb().min.into(), high: n.aabb().max.into() },
        index: if n.is_leaf() { tree.primitive_indices[n.first_index as usize] } else { n.first_index },
        is_leaf: n.is_leaf(),
    };
    tree.nodes.iter().map(node).collect()
}

/// A tree of least depth: boxes halved by their centres along the longest axis.
fn balanced(boxes: &[Box3]) -> Vec<BinaryNode> {
    let around = |ids: &[u32]| ids.iter().fold(Box3::EMPTY, |b, i| b.union(&boxes[*i as usize]));
    let mut ids: Vec<u32> = (0..boxes.len() as u32).collect();
    let mut nodes = vec![BinaryNode { bounds: around(&ids), index: 0, is_leaf: true }];
    let mut todo = vec![(0usize, 0usize, ids.len())];
    while let Some((at, first, end)) = todo.pop() {
        if end - first == 1 {
            nodes[at].index = ids[first];
            continue;
        }
        let size = nodes[at].bounds.high - nodes[at].bounds.low;
        let axis = (0..3).fold(0, |best, k| if size[k] > size[best] { k } else { best });
        let centre = |i: u32| boxes[i as usize].low[axis] + boxes[i as usize].high[axis];
        let middle = (end - first) / 2;
        ids[first..end].select_nth_unstable_by(middle, |a, b| centre(*a).total_cmp(&centre(*b)).then(a.cmp(b)));
        nodes[at].index = nodes.len() as u32;
        nodes[at].is_leaf = false;
        for (low, high) in [(first, first + middle), (first + middle, end)] {
            todo.push((nodes.len(), low, high));
            nodes.push(BinaryNode { bounds: around(&ids[low..high]), index: 0, is_leaf: true });
        }
    }
    nodes
}

/// Inner nodes and their children in an order in which parents come first.
pub(super) fn parents_first(nodes: &[BinaryNode]) -> Vec<u32> {
    let mut order = Vec::with_capacity(nodes.len());
    order.push(0u32);
    let mut i = 0;
    while i < order.len() {
        let n = &nodes[order[i] as usize];
        if !n.is_leaf {
            order.extend([n.index, n.index + 1]);
        }
        i += 1;
    }
    order
}

/// Levels of a tree.
fn depth(nodes: &[BinaryNode]) -> usize {
    let mut depth = vec![1u32; nodes.len()];
    let mut deepest = 1;
    for i in parents_first(nodes) {
        let (n, d) = (&nodes[i as usize], depth[i as usize]);
        deepest = deepest.max(d);
        if !n.is_leaf {
            depth[n.index as usize] = d + 1;
            depth[n.index as usize + 1] = d + 1;
        }
    }
    deepest as usize
}
