//! Binary trees over boxes: small ones by obvhs, large ones in parallel (`sah.rs`). The only file that knows obvhs and its SIMD
//! vector type.
#![allow(clippy::disallowed_types, reason = "obvhs takes its boxes as Vec3A; nothing is computed with them here")]

use super::sah;
use crate::math::Vec3;
use glam::Vec3A;
use obvhs::BvhBuildParams;
use obvhs::aabb::Aabb;
use obvhs::bvh2::node::Bvh2Node;
use obvhs::bvh2::reinsertion::ReinsertionOptimizer;
use obvhs::ploc::{PlocBuilder, SortPrecision};

/// Levels that a tree may have. obvhs makes deeper ones of coincident geometry; these are replaced.
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
///
/// The nodes below an inner node with n primitives lie together in 2 n - 2 places: its two children, all that is below the first, all
/// that is below the second.
#[derive(Clone, Copy, Debug)]
pub(super) struct BinaryNode {
    pub bounds: Box3,
    /// Inner node: the first child, the second follows it; leaf: number of the primitive.
    pub index: u32,
    /// Primitives below; 1 of a leaf.
    pub count: u32,
}

impl BinaryNode {
    /// Whether it holds one primitive.
    #[inline]
    pub fn is_leaf(&self) -> bool {
        self.count == 1
    }
}

/// Most boxes for which obvhs builds the tree: its trees are the better ones, but it takes ten times as long.
const SMALL: usize = 4096;

/// A tree with one primitive per leaf; the root is node 0. Empty for no boxes.
pub(super) fn build(boxes: &[Box3]) -> Vec<BinaryNode> {
    if boxes.is_empty() {
        return Vec::new();
    }
    if boxes.len() > 1 && boxes.len() <= SMALL && !concentric(boxes) {
        let nodes = build_by_obvhs(boxes);
        if depth(&nodes) <= MAX_DEPTH {
            return nodes;
        }
    }
    sah::build(boxes)
}

/// Most boxes with the very same centre that obvhs is given: it takes time quadratic in their number.
const MAX_CONCENTRIC: usize = 1024;

/// Whether too many boxes share their centre.
fn concentric(boxes: &[Box3]) -> bool {
    let mut centres: Vec<[u32; 3]> = boxes.iter().map(|b| (b.low + b.high).to_array().map(f32::to_bits)).collect();
    centres.sort_unstable();
    centres.len() > MAX_CONCENTRIC && centres.windows(MAX_CONCENTRIC + 1).any(|w| w[0] == w[MAX_CONCENTRIC])
}

/// obvhs's builder at nearly its slowest setting: PLOC (Meister and Bittner 2018), then reinsertion (Meister and Bittner 2018 again).
/// Sequential: its parallel form makes other trees.
fn build_by_obvhs(boxes: &[Box3]) -> Vec<BinaryNode> {
    let aabbs: Vec<Aabb> = boxes.iter().map(|b| Aabb { min: Vec3A::from(b.low), max: Vec3A::from(b.high) }).collect();
    let indices = (0..aabbs.len() as u32).collect();
    let p = BvhBuildParams::very_slow_build();
    let builder = PlocBuilder::with_capacity(aabbs.len());
    let mut tree =
        { builder }.build(p.ploc_search_distance, &aabbs, indices, SortPrecision::U64, p.search_depth_threshold);
    ReinsertionOptimizer::default().run(&mut tree, p.reinsertion_batch_ratio, None);
    // Bring the nodes into our order: first counts from the leaves up, then places from the root down.
    let order = parents_first(&tree.nodes);
    let mut counts = vec![1u32; tree.nodes.len()];
    for &i in order.iter().rev() {
        let n = &tree.nodes[i as usize];
        if !n.is_leaf() {
            counts[i as usize] = counts[n.first_index as usize] + counts[n.first_index as usize + 1];
        }
    }
    let leaf = BinaryNode { bounds: Box3::EMPTY, index: 0, count: 1 };
    let mut nodes = vec![leaf; tree.nodes.len()];
    let mut todo = vec![(0usize, 0usize, 1u32)];
    while let Some((from, to, below)) = todo.pop() {
        let n = &tree.nodes[from];
        let bounds = Box3 { low: n.aabb().min.into(), high: n.aabb().max.into() };
        let first = n.first_index as usize;
        let index = if n.is_leaf() { tree.primitive_indices[first] } else { below };
        nodes[to] = BinaryNode { bounds, index, count: counts[from] };
        if !n.is_leaf() {
            let at = below as usize;
            todo.push((first, at, below + 2));
            todo.push((first + 1, at + 1, below + 2 * counts[first]));
        }
    }
    nodes
}

/// Inner nodes and their children in an order in which parents come first.
fn parents_first(nodes: &[Bvh2Node]) -> Vec<u32> {
    let mut order = Vec::with_capacity(nodes.len());
    order.push(0u32);
    let mut i = 0;
    while i < order.len() {
        let n = &nodes[order[i] as usize];
        if !n.is_leaf() {
            order.extend([n.first_index, n.first_index + 1]);
        }
        i += 1;
    }
    order
}

/// Levels of a tree.
fn depth(nodes: &[BinaryNode]) -> usize {
    let mut deepest = 0;
    let mut todo = vec![(0u32, 1usize)];
    while let Some((at, level)) = todo.pop() {
        let n = &nodes[at as usize];
        deepest = deepest.max(level);
        if !n.is_leaf() {
            todo.extend([(n.index, level + 1), (n.index + 1, level + 1)]);
        }
    }
    deepest
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sampling::{IndependentSampler, Sampler};

    /// Every primitive once, boxes that hold what is below, and the places in memory that `BinaryNode` tells of.
    fn check(boxes: &[Box3], nodes: &[BinaryNode]) {
        assert_eq!(nodes.len(), 2 * boxes.len() - 1);
        assert!(depth(nodes) <= MAX_DEPTH, "{} levels for {} boxes", depth(nodes), boxes.len());
        let mut seen = vec![false; boxes.len()];
        let mut todo = vec![(0u32, 1u32, boxes.len() as u32)];
        while let Some((at, first, count)) = todo.pop() {
            let n = &nodes[at as usize];
            assert_eq!(n.count, count);
            if n.is_leaf() {
                assert_eq!(n.bounds, boxes[n.index as usize]);
                assert!(!std::mem::replace(&mut seen[n.index as usize], true));
                continue;
            }
            assert_eq!(n.index, first);
            let [a, b] = [nodes[first as usize], nodes[first as usize + 1]];
            assert_eq!(n.bounds, Box3::around(&[a.bounds.low, a.bounds.high, b.bounds.low, b.bounds.high]));
            assert_eq!(a.count + b.count, count);
            todo.extend([(first, first + 2, a.count), (first + 1, first + 2 * a.count, b.count)]);
        }
        assert!(seen.iter().all(|s| *s));
    }

    #[test]
    fn trees_hold_every_box_once_however_the_boxes_lie() {
        let mut s = IndependentSampler::new([12]);
        let mut scale = 1.0f32;
        let shapes: [&mut dyn FnMut() -> [Vec3; 2]; 4] = [
            &mut || {
                let p = Vec3::new(s.next_1d(), s.next_1d(), s.next_1d());
                [p, p + 0.1 * Vec3::new(s.next_1d(), s.next_1d(), s.next_1d())]
            },
            &mut || [Vec3::ZERO, Vec3::ONE],
            // Each half as far away as the last: splits by area peel them off one at a time.
            &mut || {
                scale = if scale > 1e-30 { scale * 0.5 } else { 1e6 };
                [Vec3::splat(scale), Vec3::splat(scale * 1.1)]
            },
            // All centres on one point.
            &mut || [Vec3::splat(-1.0), Vec3::splat(1.0)],
        ];
        for shape in shapes {
            for count in [1, 2, 3, 8, 9, 100, 5000] {
                let boxes: Vec<Box3> = (0..count).map(|_| Box3::around(&shape())).collect();
                check(&boxes, &build(&boxes));
                check(&boxes, &sah::build(&boxes));
            }
        }
    }
}
