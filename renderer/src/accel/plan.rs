//! Which binary nodes become leaves and which become the children of wide nodes.

use super::binary::BinaryNode;
use super::node::{LEAF_TRIANGLES, LEAF_VERTICES};
use crate::math::Vec3;

/// Cost of a leaf against that of a node, whatever the number of its triangles: both are two or three cache lines and some forty
/// SIMD instructions.
const LEAF_COST: f32 = 1.0;
/// Triangles below which a subtree is planned by one thread.
const SEQUENTIAL: u32 = 4096;

/// What is decided of a binary node.
#[derive(Clone, Copy)]
struct Choice {
    /// Least cost of the node's subtree when it gives its parent at most 1, 2, ... 7 children.
    cost: [f32; 7],
    is_leaf: bool,
}

/// Dynamic programming over the number of children that a subtree may give to its parent, by surface area (Ylitie, Karras, Laine 2017,
/// section 3.2).
pub(super) struct Plan(Vec<Choice>);

/// The vertices of a subtree that fits into a leaf.
struct Corners {
    points: [[u32; 3]; LEAF_VERTICES],
    count: usize,
}

impl Corners {
    /// Of one triangle.
    fn of(triangle: &[Vec3; 3]) -> Self {
        let mut all = Self { points: [[0; 3]; LEAF_VERTICES], count: 0 };
        for p in triangle {
            all.push(p.to_array().map(f32::to_bits));
        }
        all
    }

    /// Adds a vertex unless it is there; whether there was room.
    fn push(&mut self, p: [u32; 3]) -> bool {
        if self.points[..self.count].contains(&p) {
            return true;
        }
        if self.count == LEAF_VERTICES {
            return false;
        }
        self.points[self.count] = p;
        self.count += 1;
        true
    }
}

impl Plan {
    /// For a tree over `triangles`; not for an empty one.
    pub fn new(nodes: &[BinaryNode], triangles: &[[Vec3; 3]]) -> Self {
        let mut choices = vec![Choice { cost: [0.0; 7], is_leaf: false }; nodes.len()];
        if let Some((root, below)) = choices.split_first_mut() {
            choose(nodes, triangles, 0, root, below);
        }
        Self(choices)
    }

    /// Whether the node's triangles make one leaf.
    pub fn is_leaf(&self, node: u32) -> bool {
        self.0[node as usize].is_leaf
    }

    /// The up to eight children of the wide node that `root` becomes.
    pub fn children(&self, nodes: &[BinaryNode], root: u32, out: &mut Vec<u32>) {
        let mut todo = [(root, 8, true); 8];
        let mut left = 1;
        while left > 0 {
            left -= 1;
            let (node, mut budget, open) = todo[left];
            let cost = &self.0[node as usize].cost;
            if !open {
                while budget > 1 && cost[budget - 2] == cost[budget - 1] {
                    budget -= 1;
                }
                if budget == 1 || nodes[node as usize].is_leaf() {
                    out.push(node);
                    continue;
                }
            }
            let first = nodes[node as usize].index;
            let (a, b) = (&self.0[first as usize].cost, &self.0[first as usize + 1].cost);
            let share = split(a, b, budget).1;
            todo[left] = (first + 1, budget - share, false);
            todo[left + 1] = (first, share, false);
            left += 2;
        }
    }
}

/// Decides a subtree from the leaves up: its root and what is `below`. Returns the vertices when it may be a leaf.
fn choose(
    nodes: &[BinaryNode],
    triangles: &[[Vec3; 3]],
    at: u32,
    root: &mut Choice,
    below: &mut [Choice],
) -> Option<Corners> {
    let n = &nodes[at as usize];
    let area = n.bounds.half_area();
    let Some((pair, below)) = below.split_first_chunk_mut::<2>() else {
        *root = Choice { cost: [area * LEAF_COST; 7], is_leaf: true };
        return Some(Corners::of(&triangles[n.index as usize]));
    };
    let [a, b] = pair;
    let (below_a, below_b) = below.split_at_mut(2 * nodes[n.index as usize].count as usize - 2);
    let mut first = || choose(nodes, triangles, n.index, a, below_a);
    let mut second = || choose(nodes, triangles, n.index + 1, b, below_b);
    let (x, y) = if n.count > SEQUENTIAL { rayon::join(first, second) } else { (first(), second()) };
    let corners = if n.count as usize <= LEAF_TRIANGLES {
        x.zip(y).and_then(|(mut x, y)| y.points[..y.count].iter().all(|p| x.push(*p)).then_some(x))
    } else {
        None
    };
    let leaf = if corners.is_some() { area * LEAF_COST } else { f32::INFINITY };
    let inner = area + split(&a.cost, &b.cost, 8).0;
    root.is_leaf = leaf <= inner;
    root.cost[0] = inner.min(leaf);
    for j in 2..=7 {
        root.cost[j - 1] = root.cost[j - 2].min(split(&a.cost, &b.cost, j).0);
    }
    corners
}

/// The least cost of dealing `n` (2 to 8) children to a pair of siblings, and the share of the first.
#[inline]
fn split(a: &[f32; 7], b: &[f32; 7], n: usize) -> (f32, usize) {
    let mut best = (f32::INFINITY, 1);
    for k in 1..n.min(8) {
        let c = a[k - 1] + b[(n - k - 1).min(6)];
        if c < best.0 {
            best = (c, k);
        }
    }
    best
}
