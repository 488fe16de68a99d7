//! Binary trees by the surface area heuristic, in parallel (Wald 2007, "On fast Construction of SAH-based Bounding Volume
//! Hierarchies"): sorted into bins where there are many boxes, exactly where there are few. The tree does not depend on the number of
//! threads.

use super::binary::{BinaryNode, Box3};
use crate::math::Vec3;
use rayon::prelude::*;

/// Boxes below which a subtree is built by one thread.
const SEQUENTIAL: usize = 4096;
/// Boxes below which all splits are tried.
const EXACT: usize = 8;
/// Most bins.
const BINS: usize = 32;
/// Level from which on nodes are halved, so that no tree becomes deeper than `binary::MAX_DEPTH`: 32 levels more are enough for any
/// number of boxes.
const HALVE: usize = 60;

/// A box with its number, in four lanes; the fourth of `high` is not used.
#[derive(Clone, Copy)]
struct Item {
    low: [f32; 4],
    high: [f32; 4],
}

impl Item {
    fn new(b: &Box3, id: u32) -> Self {
        Self { low: [b.low.x, b.low.y, b.low.z, f32::from_bits(id)], high: [b.high.x, b.high.y, b.high.z, 0.0] }
    }

    fn id(&self) -> u32 {
        self.low[3].to_bits()
    }

    /// Twice the centre.
    #[inline(always)]
    fn centre(&self, axis: usize) -> f32 {
        self.low[axis] + self.high[axis]
    }
}

/// A box in four lanes.
#[derive(Clone, Copy)]
struct Bounds {
    low: [f32; 4],
    high: [f32; 4],
}

impl Bounds {
    const EMPTY: Self = Self { low: [f32::INFINITY; 4], high: [f32::NEG_INFINITY; 4] };

    #[inline(always)]
    fn add(&mut self, low: &[f32; 4], high: &[f32; 4]) {
        for k in 0..4 {
            self.low[k] = if low[k] < self.low[k] { low[k] } else { self.low[k] };
            self.high[k] = if high[k] > self.high[k] { high[k] } else { self.high[k] };
        }
    }

    #[inline(always)]
    fn half_area(&self) -> f32 {
        let d = [self.high[0] - self.low[0], self.high[1] - self.low[1], self.high[2] - self.low[2]];
        d[0] * d[1] + d[1] * d[2] + d[2] * d[0]
    }

    fn box3(&self) -> Box3 {
        let vec3 = |a: &[f32; 4]| Vec3::new(a[0], a[1], a[2]);
        Box3 { low: vec3(&self.low), high: vec3(&self.high) }
    }
}

/// What is known of a set of items: its box and that of the (doubled) centres.
#[derive(Clone, Copy)]
struct Extent {
    bounds: Bounds,
    centres: Bounds,
}

impl Extent {
    const EMPTY: Self = Self { bounds: Bounds::EMPTY, centres: Bounds::EMPTY };

    #[inline(always)]
    fn add(&mut self, item: &Item) {
        self.bounds.add(&item.low, &item.high);
        let c = std::array::from_fn(|k| item.low[k] + item.high[k]);
        self.centres.add(&c, &c);
    }

    fn of(items: &[Item]) -> Self {
        let mut e = Self::EMPTY;
        items.iter().for_each(|i| e.add(i));
        e
    }

    fn union(mut self, other: Self) -> Self {
        self.bounds.add(&other.bounds.low, &other.bounds.high);
        self.centres.add(&other.centres.low, &other.centres.high);
        self
    }
}

/// A tree with one primitive per leaf; at least one box.
pub(super) fn build(boxes: &[Box3]) -> Vec<BinaryNode> {
    let mut items: Vec<Item> = boxes.par_iter().enumerate().map(|(i, b)| Item::new(b, i as u32)).collect();
    let extent = items.par_chunks(1 << 16).map(Extent::of).reduce(|| Extent::EMPTY, Extent::union);
    let empty = BinaryNode { bounds: Box3::EMPTY, index: 0, count: 1 };
    let mut nodes = vec![empty; 2 * items.len() - 1];
    if let Some((root, below)) = nodes.split_first_mut() {
        subtree(&mut items, &extent, root, below, 1, 0);
    }
    nodes
}

/// Builds the tree over `items`: its root and the nodes `below`, the first of which has number `first`.
fn subtree(
    items: &mut [Item],
    extent: &Extent,
    root: &mut BinaryNode,
    below: &mut [BinaryNode],
    first: u32,
    level: usize,
) {
    let count = items.len();
    *root = BinaryNode { bounds: extent.bounds.box3(), index: first, count: count as u32 };
    let Some((pair, below)) = below.split_first_chunk_mut::<2>() else {
        root.index = items[0].id();
        return;
    };
    let parted = if count > EXACT && level < HALVE { split_by_bins(items, extent) } else { None };
    let (middle, a, b) = parted.unwrap_or_else(|| {
        let middle = if count <= EXACT && level < HALVE { split_exactly(items, extent) } else { halve(items, extent) };
        (middle, Extent::of(&items[..middle]), Extent::of(&items[middle..]))
    });
    let (left, right) = items.split_at_mut(middle);
    let (below_left, below_right) = below.split_at_mut(2 * middle - 2);
    let [root_left, root_right] = pair;
    let after = first + 2 * middle as u32;
    let mut build_left = || subtree(left, &a, root_left, below_left, first + 2, level + 1);
    let mut build_right = || subtree(right, &b, root_right, below_right, after, level + 1);
    if count > SEQUENTIAL {
        rayon::join(build_left, build_right);
    } else {
        build_left();
        build_right();
    }
}

/// The axis along which the centres lie farthest apart.
fn longest(extent: &Extent) -> usize {
    let size = |k: usize| extent.centres.high[k] - extent.centres.low[k];
    (1..3).fold(0, |best, k| if size(k) > size(best) { k } else { best })
}

/// Splits at the median of the centres.
fn halve(items: &mut [Item], extent: &Extent) -> usize {
    let (axis, middle) = (longest(extent), items.len() / 2);
    items.select_nth_unstable_by(middle, |a, b| a.centre(axis).total_cmp(&b.centre(axis)).then(a.id().cmp(&b.id())));
    middle
}

/// Sorts a few items along the axis with the best split, and returns how many come first.
fn split_exactly(items: &mut [Item], extent: &Extent) -> usize {
    let count = items.len();
    if count == 2 {
        return 1;
    }
    let mut best = (f32::INFINITY, 1, [0u8; EXACT]);
    for axis in 0..3 {
        if !(extent.centres.high[axis] > extent.centres.low[axis]) {
            continue;
        }
        let mut order: [u8; EXACT] = [0, 1, 2, 3, 4, 5, 6, 7];
        let key = |i: u8| (items[i as usize].centre(axis), items[i as usize].id());
        for i in 1..count {
            let mut k = i;
            while k > 0 && key(order[k]) < key(order[k - 1]) {
                order.swap(k, k - 1);
                k -= 1;
            }
        }
        let mut right = [0.0; EXACT];
        let mut b = Bounds::EMPTY;
        for i in (1..count).rev() {
            b.add(&items[order[i] as usize].low, &items[order[i] as usize].high);
            right[i] = b.half_area();
        }
        let mut b = Bounds::EMPTY;
        for i in 1..count {
            b.add(&items[order[i - 1] as usize].low, &items[order[i - 1] as usize].high);
            let cost = b.half_area() * i as f32 + right[i] * (count - i) as f32;
            if cost < best.0 {
                best = (cost, i, order);
            }
        }
    }
    let (cost, middle, order) = best;
    if cost == f32::INFINITY {
        return halve(items, extent);
    }
    let mut sorted = [items[0]; EXACT];
    for (to, from) in sorted.iter_mut().zip(&order[..count]) {
        *to = items[*from as usize];
    }
    items.copy_from_slice(&sorted[..count]);
    middle
}

/// Boxes and numbers of what lies in each bin, by axis.
struct Bins {
    bounds: [[Bounds; BINS]; 3],
    counts: [[u32; BINS]; 3],
    used: usize,
    from: [f32; 3],
    scale: [f32; 3],
}

impl Bins {
    fn new(count: usize, extent: &Extent) -> Self {
        let used = if count > 1024 {
            BINS
        } else if count > 64 {
            16
        } else {
            8
        };
        let size: [f32; 3] = std::array::from_fn(|k| extent.centres.high[k] - extent.centres.low[k]);
        let scale = size.map(|s| {
            // A little less, so that the last centre falls into the last bin.
            let scale = used as f32 * 0.9999 / s;
            if scale.is_finite() { scale } else { 0.0 }
        });
        let from = [extent.centres.low[0], extent.centres.low[1], extent.centres.low[2]];
        Self { bounds: [[Bounds::EMPTY; BINS]; 3], counts: [[0; BINS]; 3], used, from, scale }
    }

    #[inline(always)]
    fn bin(&self, item: &Item, axis: usize) -> usize {
        (((item.centre(axis) - self.from[axis]) * self.scale[axis]) as usize).min(self.used - 1)
    }

    fn fill(&mut self, items: &[Item]) {
        for item in items {
            for axis in 0..3 {
                let bin = self.bin(item, axis) % BINS;
                self.counts[axis][bin] += 1;
                self.bounds[axis][bin].add(&item.low, &item.high);
            }
        }
    }

    fn merge(mut self, other: &Self) -> Self {
        for axis in 0..3 {
            for bin in 0..self.used {
                let b = &other.bounds[axis][bin];
                self.bounds[axis][bin].add(&b.low, &b.high);
                self.counts[axis][bin] += other.counts[axis][bin];
            }
        }
        self
    }

    /// The axis and the first bin of the second part of the best split; `None` when no split parts the items.
    fn best(&self) -> Option<(usize, usize)> {
        let mut best = (f32::INFINITY, None);
        for axis in 0..3 {
            let (bounds, counts) = (&self.bounds[axis], &self.counts[axis]);
            let mut right = [0.0; BINS];
            let (mut b, mut n) = (Bounds::EMPTY, 0);
            for i in (1..self.used).rev() {
                b.add(&bounds[i].low, &bounds[i].high);
                n += counts[i];
                right[i] = if n > 0 { b.half_area() * n as f32 } else { f32::INFINITY };
            }
            let (mut b, mut n) = (Bounds::EMPTY, 0);
            for i in 1..self.used {
                b.add(&bounds[i - 1].low, &bounds[i - 1].high);
                n += counts[i - 1];
                let cost = if n > 0 { b.half_area() * n as f32 + right[i] } else { f32::INFINITY };
                if cost < best.0 {
                    best = (cost, Some((axis, i)));
                }
            }
        }
        best.1
    }
}

/// Parts many items by the best split between bins: how many come first, and the two extents; `None` when no split parts them.
fn split_by_bins(items: &mut [Item], extent: &Extent) -> Option<(usize, Extent, Extent)> {
    let new = || Bins::new(items.len(), extent);
    let filled = |chunk: &[Item]| {
        let mut bins = new();
        bins.fill(chunk);
        bins
    };
    let bins = if items.len() > 1 << 17 {
        // Boxes and numbers do not depend on the order of the sum.
        let parts: Vec<Bins> = items.par_chunks(1 << 15).map(filled).collect();
        parts.iter().fold(new(), Bins::merge)
    } else {
        filled(items)
    };
    let (axis, first) = bins.best()?;
    let (mut low, mut high) = (0, items.len());
    let (mut a, mut b) = (Extent::EMPTY, Extent::EMPTY);
    while low < high {
        if bins.bin(&items[low], axis) < first {
            a.add(&items[low]);
            low += 1;
        } else {
            high -= 1;
            b.add(&items[low]);
            items.swap(low, high);
        }
    }
    Some((low, a, b))
}
