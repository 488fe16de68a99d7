//! Collapses a binary tree into 8-wide nodes and packs its leaves.

use super::binary::{self, BinaryNode, parents_first};
use super::node::{Child, Leaf, Node};
use super::simd::Simd;
use super::traverse::{self, TreeHit};
use crate::math::{Ray, Vec3};

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

/// Cost of a leaf against that of a node, whatever the number of its triangles: both are two or three cache lines and some forty
/// SIMD instructions.
const LEAF_COST: f32 = 1.0;

impl Tree {
    /// Builds the tree over triangles given by their corners; triangle numbers are places in the slice.
    pub fn build(triangles: &[[Vec3; 3]]) -> Self {
        let boxes: Vec<_> = triangles.iter().map(|t| binary::Box3::around(t)).collect();
        let binary = binary::build(&boxes);
        let mut tree = Self {
            nodes: Vec::new(),
            leaves: Vec::new(),
            ids: Vec::new(),
            root: None,
            reach: 0.0,
            simd: Simd::detect(),
        };
        let Some(root) = binary.first() else { return tree };
        tree.reach = root.bounds.reach();
        let plan = Plan::new(&binary, &packable(&binary, triangles));
        tree.root = Some(tree.child(&plan, &binary, triangles, 0));
        // The tree's depth is at most that of the binary one; nodes wait here with their place and their binary root.
        let mut todo = vec![0u32];
        if tree.nodes.is_empty() {
            return tree;
        }
        let mut sources = vec![0u32];
        let mut children = Vec::with_capacity(8);
        while let Some(at) = todo.pop() {
            children.clear();
            plan.children(&binary, sources[at as usize], &mut children);
            for (slot, &c) in children.iter().enumerate() {
                let before = tree.nodes.len() as u32;
                let child = tree.child(&plan, &binary, triangles, c);
                if child.as_leaf().is_none() {
                    sources.push(c);
                    todo.push(before);
                }
                let b = binary[c as usize].bounds;
                tree.nodes[at as usize].set(slot, b.low, b.high, child);
            }
        }
        tree
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

    /// Walks with other instructions, for tests.
    #[cfg(test)]
    pub fn set_simd(&mut self, simd: Simd) {
        self.simd = simd;
    }

    /// Bytes of the tree.
    pub fn bytes(&self) -> usize {
        size_of_val(&*self.nodes) + size_of_val(&*self.leaves) + size_of_val(&*self.ids)
    }

    /// Makes the leaf or the empty node of a binary subtree.
    fn child(&mut self, plan: &Plan, binary: &[BinaryNode], triangles: &[[Vec3; 3]], at: u32) -> Child {
        if plan.is_leaf[at as usize]
            && let Some((leaf, ids)) = pack(binary, triangles, at)
        {
            self.leaves.push(leaf);
            self.ids.push(ids);
            return Child::leaf(self.leaves.len() as u32 - 1);
        }
        self.nodes.push(Node::EMPTY);
        Child(self.nodes.len() as u32 - 1)
    }
}

/// Fills a leaf with all triangles below a node; `None` when they do not fit.
fn pack(binary: &[BinaryNode], triangles: &[[Vec3; 3]], at: u32) -> Option<(Leaf, [u32; 8])> {
    let mut leaf = Leaf::EMPTY;
    let mut ids = [0; 8];
    let mut lane = 0;
    let mut todo = vec![at];
    while let Some(i) = todo.pop() {
        let n = &binary[i as usize];
        if n.is_leaf {
            if !leaf.push(&triangles[n.index as usize]) {
                return None;
            }
            ids[lane] = n.index;
            lane += 1;
        } else {
            todo.extend([n.index, n.index + 1]);
        }
    }
    Some((leaf, ids))
}

/// Which nodes' triangles fit into one leaf.
fn packable(binary: &[BinaryNode], triangles: &[[Vec3; 3]]) -> Vec<bool> {
    let mut counts = vec![1u32; binary.len()];
    for &i in parents_first(binary).iter().rev() {
        let n = &binary[i as usize];
        if !n.is_leaf {
            counts[i as usize] = counts[n.index as usize].saturating_add(counts[n.index as usize + 1]);
        }
    }
    (0..binary.len()).map(|i| counts[i] <= 8 && pack(binary, triangles, i as u32).is_some()).collect()
}

/// Which binary nodes become the children of wide ones: dynamic programming over the number of children that a subtree may give to its
/// parent, by surface area (Ylitie, Karras, Laine 2017, section 3.2).
struct Plan {
    /// Least cost of a node's subtree when it gives its parent at most 1, 2, ... 7 children.
    cost: Vec<[f32; 7]>,
    is_leaf: Vec<bool>,
}

impl Plan {
    fn new(nodes: &[BinaryNode], packable: &[bool]) -> Self {
        let mut plan = Self { cost: vec![[0.0; 7]; nodes.len()], is_leaf: vec![false; nodes.len()] };
        for &i in parents_first(nodes).iter().rev() {
            let (n, i) = (&nodes[i as usize], i as usize);
            let area = n.bounds.half_area();
            let leaf = if packable[i] { area * LEAF_COST } else { f32::INFINITY };
            if n.is_leaf {
                plan.cost[i] = [leaf; 7];
                plan.is_leaf[i] = true;
                continue;
            }
            let inner = area + plan.split(n.index, 8).0;
            let mut cost = [inner.min(leaf); 7];
            plan.is_leaf[i] = leaf <= inner;
            for j in 2..=7 {
                cost[j - 1] = cost[j - 2].min(plan.split(n.index, j).0);
            }
            plan.cost[i] = cost;
        }
        plan
    }

    /// The least cost of dealing `n` (2 to 8) children to a pair of siblings, and the share of the first.
    fn split(&self, first: u32, n: usize) -> (f32, usize) {
        let cost = |node: u32, share: usize| self.cost[node as usize][share - 1];
        let mut best = (f32::INFINITY, 1);
        for k in 1..n {
            if k <= 7 && n - k <= 7 {
                let c = cost(first, k) + cost(first + 1, n - k);
                if c < best.0 {
                    best = (c, k);
                }
            }
        }
        best
    }

    /// The up to eight children of the wide node that `root` becomes.
    fn children(&self, nodes: &[BinaryNode], root: u32, out: &mut Vec<u32>) {
        let mut todo = vec![(root, 8, true)];
        while let Some((node, mut budget, open)) = todo.pop() {
            let cost = &self.cost[node as usize];
            if !open {
                while budget > 1 && cost[budget - 2] == cost[budget - 1] {
                    budget -= 1;
                }
                if budget == 1 || nodes[node as usize].is_leaf {
                    out.push(node);
                    continue;
                }
            }
            let first = nodes[node as usize].index;
            let share = self.split(first, budget).1;
            todo.push((first + 1, budget - share, false));
            todo.push((first, share, false));
        }
    }
}
