//! Collapses a binary tree into 8-wide nodes and packs its leaves.

use super::binary::{self, BinaryNode, Box3};
use super::bundle;
use super::node::{Child, Leaf, Node};
use super::pages;
use super::plan::Plan;
use super::simd::Simd;
use super::traverse::{self, TreeHit};
use crate::math::{Ray, Vec3};
use rayon::prelude::*;

/// An 8-wide tree over triangles.
#[derive(Debug)]
pub(super) struct Tree {
    pub nodes: Vec<Node>,
    pub leaves: Vec<Leaf>,
    /// Numbers of the triangles of each leaf.
    pub ids: Vec<[u32; 8]>,
    pub root: Option<Child>,
    /// Largest absolute coordinate.
    pub reach: f32,
    simd: Simd,
}

/// Subtrees of at most so many triangles are written by one thread.
const CHUNK: u32 = 8192;

impl Tree {
    /// Builds the tree over triangles given by their corners; triangle numbers are places in the slice. The result does not depend on
    /// the number of threads.
    pub fn build(triangles: &[[Vec3; 3]]) -> Self {
        let boxes: Vec<_> = triangles.par_iter().map(|t| Box3::around(t)).collect();
        let binary = binary::build(&boxes);
        let Some(top) = binary.first() else { return Self::of(Parts::default(), None, 0.0) };
        let plan = Plan::new(&binary, triangles);
        let writer = Writer { plan: &plan, binary: &binary, triangles };
        let mut parts = Parts::default();
        let mut chunks = Vec::new();
        let root = writer.write(0, &mut parts, Some(&mut chunks));
        let written: Vec<(Child, Parts)> = chunks
            .par_iter()
            .map(|&(_, _, binary_root)| {
                let mut parts = Parts::default();
                (writer.write(binary_root, &mut parts, None), parts)
            })
            .collect();
        // Put the chunks one behind the other.
        let total = |of: fn(&Parts) -> usize| of(&parts) + written.iter().map(|(_, p)| of(p)).sum::<usize>();
        let mut whole = Parts {
            nodes: pages::with_capacity(total(|p| p.nodes.len())),
            leaves: pages::with_capacity(total(|p| p.leaves.len())),
            ids: Vec::with_capacity(total(|p| p.ids.len())),
        };
        whole.nodes.append(&mut parts.nodes);
        whole.leaves.append(&mut parts.leaves);
        whole.ids.append(&mut parts.ids);
        for ((node, slot, _), (child, mut part)) in chunks.into_iter().zip(written) {
            let moved = |c: Child| c.moved(whole.nodes.len() as u32, whole.leaves.len() as u32);
            let child = moved(child);
            for n in &mut part.nodes {
                let used = n.children.iter_mut().zip(n.planes[0]).filter(|(_, low)| *low < f32::INFINITY);
                used.for_each(|(c, _)| *c = moved(*c));
            }
            whole.nodes[node as usize].children[slot] = child;
            whole.nodes.append(&mut part.nodes);
            whole.leaves.append(&mut part.leaves);
            whole.ids.append(&mut part.ids);
        }
        Self::of(whole, Some(root), top.bounds.reach())
    }

    fn of(parts: Parts, root: Option<Child>, reach: f32) -> Self {
        let Parts { nodes, leaves, ids } = parts;
        Self { nodes, leaves, ids, root, reach, simd: Simd::detect() }
    }

    /// The nearest hit with a parameter of at most `t_max`; of equal ones the triangle with the smallest number.
    #[inline]
    pub fn closest(&self, ray: &Ray, t_max: f32) -> Option<TreeHit> {
        traverse::closest(self, self.root?, ray, t_max, self.simd)
    }

    /// Whether a triangle is hit at a parameter of at most `t_max`.
    #[inline]
    pub fn any(&self, ray: &Ray, t_max: f32) -> bool {
        self.root.is_some_and(|root| traverse::any(self, root, ray, t_max, self.simd))
    }

    /// Which of some rays meet a triangle, a bit for each; `None` if only each alone can tell.
    #[inline]
    pub fn any_of_bundle(&self, rays: &[Ray]) -> Option<u64> {
        if !(bundle::MIN_RAYS..=bundle::MAX_RAYS).contains(&rays.len()) {
            return None;
        }
        self.root.map_or(Some(0), |root| bundle::any(self, root, rays, self.simd))
    }

    /// Walks with other instructions, for tests.
    #[cfg(test)]
    pub fn set_simd(&mut self, simd: Simd) {
        self.simd = simd;
    }

    /// Bytes of the tree.
    pub fn bytes(&self) -> usize {
        size_of_val(&*self.nodes) + size_of_val(&*self.leaves) + size_of_val(&*self.ids)
    }
}

/// Nodes and leaves of a part of a tree, numbered from 0.
#[derive(Debug, Default)]
struct Parts {
    nodes: Vec<Node>,
    leaves: Vec<Leaf>,
    ids: Vec<[u32; 8]>,
}

/// Writes wide nodes and leaves as planned.
struct Writer<'a> {
    plan: &'a Plan,
    binary: &'a [BinaryNode],
    triangles: &'a [[Vec3; 3]],
}

impl Writer<'_> {
    /// Writes the subtree of binary node `root`. With `later`, subtrees of at most [`CHUNK`] triangles below the root are left for later:
    /// their node, place in it and binary root.
    fn write(&self, root: u32, parts: &mut Parts, mut later: Option<&mut Vec<(u32, usize, u32)>>) -> Child {
        let top = self.child(root, parts);
        let mut todo = if top.as_leaf().is_some() { Vec::new() } else { vec![(top.0, root)] };
        let mut children = Vec::with_capacity(8);
        while let Some((at, source)) = todo.pop() {
            children.clear();
            self.plan.children(self.binary, source, &mut children);
            // Occlusion takes them in this order: first those that hide most for their triangles.
            let hides = |c: u32| self.binary[c as usize].bounds.half_area() / self.binary[c as usize].count as f32;
            children.sort_by(|&a, &b| hides(b).total_cmp(&hides(a)));
            for (slot, &c) in children.iter().enumerate() {
                let b = &self.binary[c as usize];
                let child = match &mut later {
                    Some(later) if b.count <= CHUNK => {
                        later.push((at, slot, c));
                        Child(0)
                    }
                    _ => self.child(c, parts),
                };
                parts.nodes[at as usize].set(slot, b.bounds.low, b.bounds.high, child);
                let postponed = later.is_some() && b.count <= CHUNK;
                if !postponed && child.as_leaf().is_none() {
                    todo.push((child.0, c));
                }
            }
        }
        top
    }

    /// Makes the leaf or the empty node of a binary subtree.
    fn child(&self, at: u32, parts: &mut Parts) -> Child {
        if self.plan.is_leaf(at) {
            let (leaf, ids) = self.pack(at);
            parts.leaves.push(leaf);
            parts.ids.push(ids);
            return Child::leaf(parts.leaves.len() as u32 - 1);
        }
        parts.nodes.push(Node::EMPTY);
        Child(parts.nodes.len() as u32 - 1)
    }

    /// Fills a leaf with all triangles below a node; they fit, as planned.
    fn pack(&self, at: u32) -> (Leaf, [u32; 8]) {
        let mut leaf = Leaf::EMPTY;
        let mut ids = [0; 8];
        let mut todo = [at; 8];
        let mut left = 1;
        while left > 0 {
            left -= 1;
            let n = &self.binary[todo[left] as usize];
            if n.is_leaf() {
                let lane = leaf.used.count_ones() as usize;
                let fits = leaf.push(&self.triangles[n.index as usize]);
                debug_assert!(fits, "planned as a leaf");
                ids[lane & 7] = n.index;
            } else {
                todo[left] = n.index;
                todo[left + 1] = n.index + 1;
                left += 2;
            }
        }
        (leaf, ids)
    }
}
