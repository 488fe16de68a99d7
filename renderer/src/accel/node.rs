//! The tree in memory: 8-wide nodes and leaves of up to eight triangles, both in structure-of-arrays form.

use crate::math::Vec3;

/// A child of a node: an inner node, or with the top bit set a leaf.
#[derive(Clone, Copy, Debug, PartialEq, Eq, bytemuck::Pod, bytemuck::Zeroable)]
#[repr(transparent)]
pub(super) struct Child(pub u32);

impl Child {
    const LEAF: u32 = 1 << 31;

    /// The leaf numbered `index`, below 2^31.
    pub fn leaf(index: u32) -> Self {
        Self(index | Self::LEAF)
    }

    /// The same where nodes and leaves have moved by so many places.
    pub fn moved(self, nodes: u32, leaves: u32) -> Self {
        if self.as_leaf().is_some() { Self(self.0 + leaves) } else { Self(self.0 + nodes) }
    }

    /// Its leaf number.
    #[inline(always)]
    pub fn as_leaf(self) -> Option<u32> {
        (self.0 & Self::LEAF != 0).then_some(self.0 & !Self::LEAF)
    }
}

/// Eight children and their boxes. Missing children have a box that no ray meets.
#[derive(Clone, Debug)]
#[repr(C, align(64))]
pub(super) struct Node {
    /// Low x, high x, low y, high y, low z, high z of the eight boxes.
    pub planes: [[f32; 8]; 6],
    /// What is in the boxes.
    pub children: [Child; 8],
}

impl Node {
    /// A node without children.
    pub const EMPTY: Self = {
        let (low, high) = ([f32::INFINITY; 8], [f32::NEG_INFINITY; 8]);
        Self { planes: [low, high, low, high, low, high], children: [Child(0); 8] }
    };

    /// The children as numbers.
    #[inline(always)]
    pub fn children_bits(&self) -> &[u32; 8] {
        bytemuck::cast_ref(&self.children)
    }

    /// Sets one child.
    pub fn set(&mut self, slot: usize, low: Vec3, high: Vec3, child: Child) {
        for k in 0..3 {
            self.planes[2 * k][slot] = low[k];
            self.planes[2 * k + 1][slot] = high[k];
        }
        self.children[slot] = child;
    }
}

/// Most triangles of a leaf.
pub(super) const LEAF_TRIANGLES: usize = 8;
/// Most vertices of a leaf.
pub(super) const LEAF_VERTICES: usize = 8;

/// Up to eight triangles between up to eight vertices: two cache lines.
#[derive(Clone, Debug)]
#[repr(C, align(64))]
pub(super) struct Leaf {
    /// x, y, z of the vertices.
    pub vertices: [[f32; 8]; 3],
    /// First, second and third corner of the triangles.
    pub corners: [[u8; 8]; 3],
    /// One bit for every triangle.
    pub used: u32,
    /// Number of vertices.
    pub count: u32,
}

impl Leaf {
    /// A leaf without triangles.
    pub const EMPTY: Self = Self { vertices: [[0.0; 8]; 3], corners: [[0; 8]; 3], used: 0, count: 0 };

    /// Adds a triangle; returns false when there is no room.
    pub fn push(&mut self, corners: &[Vec3; 3]) -> bool {
        let lane = self.used.count_ones() as usize;
        if lane == 8 {
            return false;
        }
        for (c, p) in corners.iter().enumerate() {
            let n = self.count as usize;
            let i = (0..n).find(|&i| (0..3).all(|k| self.vertices[k][i].to_bits() == p[k].to_bits())).unwrap_or(n);
            if i == 8 {
                return false;
            }
            if i == n {
                for k in 0..3 {
                    self.vertices[k][i] = p[k];
                }
                self.count += 1;
            }
            self.corners[c][lane] = i as u8;
        }
        self.used |= 1 << lane;
        true
    }

    /// The corners of a triangle.
    #[inline(always)]
    pub fn triangle(&self, lane: usize) -> [[f32; 3]; 3] {
        let [x, y, z] = &self.vertices;
        let corner = |c: usize| {
            let i = usize::from(self.corners[c][lane & 7] & 7);
            [x[i], y[i], z[i]]
        };
        [corner(0), corner(1), corner(2)]
    }
}
