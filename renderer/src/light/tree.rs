//! A tree over lights that have a place, by which one is selected for a point (Conty Estevez and Kulla 2018).

use super::place::{Cone, LightBounds, Place, Reach};
use crate::math::{ONE_MINUS_EPSILON, Vec3};
use crate::sampling::Choice;

/// No parent, or no light.
const NONE: u32 = u32::MAX;
/// Most nodes that are opened for a sum.
const OPENED: usize = 32;
/// Splits tried along an axis.
const SPLITS: usize = 12;

/// A node. The first child follows its parent.
#[derive(Clone, Copy, Debug)]
struct Node {
    reach: Reach,
    parent: u32,
    /// Of an inner node.
    second: u32,
    /// Of a leaf.
    light: u32,
}

/// The lights' places, in a tree.
#[derive(Clone, Debug)]
pub(super) struct LightTree {
    nodes: Vec<Node>,
    /// By light, the node that is its leaf.
    leaves: Vec<u32>,
    /// By light.
    gains: Vec<f32>,
}

impl LightTree {
    /// Over the lights that have bounds and a weight; `None` when there are none.
    pub fn new(bounds: &[Option<LightBounds>], weights: &[f32]) -> Option<Self> {
        let usable = |i: &u32| weights[*i as usize] > 0.0 && weights[*i as usize].is_finite();
        let mut lights: Vec<(u32, LightBounds)> =
            (0..bounds.len() as u32).filter(usable).filter_map(|i| Some((i, bounds[i as usize]?))).collect();
        if lights.is_empty() {
            return None;
        }
        let gains = bounds.iter().map(|b| b.map_or(1.0, |b| b.gain)).collect();
        let mut tree = Self { nodes: Vec::new(), leaves: vec![NONE; bounds.len()], gains };
        tree.build(&mut lights, weights);
        Some(tree)
    }

    fn build(&mut self, lights: &mut [(u32, LightBounds)], weights: &[f32]) {
        // Ranges that wait for their node, with their parent; the first child is on top.
        let mut open = vec![(0, lights.len(), NONE)];
        while let Some((start, end, parent)) = open.pop() {
            let here = self.nodes.len() as u32;
            if parent != NONE && here != parent + 1 {
                self.nodes[parent as usize].second = here;
            }
            let range = &mut lights[start..end];
            let reach = Reach::new(&around(range));
            let mut light = NONE;
            if let [(only, _)] = range {
                light = *only;
                self.leaves[light as usize] = here;
            } else {
                let middle = start + split(range, weights);
                open.push((middle, end, here));
                open.push((start, middle, here));
            }
            self.nodes.push(Node { reach, parent, second: NONE, light });
        }
    }

    /// Sums of the lights' weights by node: the strength of what is below it.
    pub fn strengths(&self, weights: &[f32]) -> Vec<f32> {
        let mut sums = vec![0.0f64; self.nodes.len()];
        for (i, node) in self.nodes.iter().enumerate().rev() {
            if node.light != NONE {
                let light = node.light as usize;
                sums[i] = f64::from(weights[light]) * f64::from(self.gains[light]);
            }
            if node.parent != NONE {
                sums[node.parent as usize] += sums[i];
            }
        }
        sums.iter().map(|s| *s as f32).collect()
    }

    /// Whether it holds a light.
    #[inline]
    pub fn holds(&self, light: usize) -> bool {
        self.leaves[light] != NONE
    }

    #[inline]
    fn importance(&self, strengths: &[f32], node: usize, place: &Place) -> f32 {
        strengths[node] * self.nodes[node].reach.importance(place)
    }

    /// What all lights together may give to a place. The bound of a node says little from within, so those are opened.
    pub fn total(&self, strengths: &[f32], place: &Place) -> f32 {
        let (mut sum, mut opened) = (0.0, 0);
        let mut open = [0; OPENED + 1];
        let mut count = 1;
        while count > 0 {
            count -= 1;
            let at = open[count];
            let node = &self.nodes[at];
            if node.light == NONE && opened < OPENED && node.reach.contains(place.p) {
                (open[count], open[count + 1]) = (node.second as usize, at + 1);
                count += 2;
                opened += 1;
            } else {
                sum += self.importance(strengths, at, place);
            }
        }
        sum
    }

    /// What a light of unit weight may give to a place.
    pub fn alone(&self, light: usize, place: &Place) -> f32 {
        self.gains[light] * self.nodes[self.leaves[light] as usize].reach.importance(place)
    }

    /// Selects a light for a place by `u`; `None` where no light may give any.
    pub fn sample(&self, strengths: &[f32], place: &Place, mut u: f32) -> Option<Choice> {
        let (mut node, mut pmf) = (0, 1.0f32);
        while self.nodes[node].light == NONE {
            let second = self.nodes[node].second as usize;
            let first = self.share(strengths, (node + 1, second), place)?;
            if u < first {
                (node, pmf, u) = (node + 1, pmf * first, u / first);
            } else {
                (node, pmf, u) = (second, pmf * (1.0 - first), (u - first) / (1.0 - first));
            }
            u = u.min(ONE_MINUS_EPSILON);
        }
        (pmf > 0.0).then_some(Choice { index: self.nodes[node].light as usize, pmf, u })
    }

    /// Probability with which `sample` selects a light.
    pub fn pmf(&self, strengths: &[f32], place: &Place, light: usize) -> f32 {
        let (mut node, mut pmf) = (self.leaves[light] as usize, 1.0f32);
        while self.nodes[node].parent != NONE {
            let parent = self.nodes[node].parent as usize;
            let second = self.nodes[parent].second as usize;
            let Some(first) = self.share(strengths, (parent + 1, second), place) else { return 0.0 };
            pmf *= if node == second { 1.0 - first } else { first };
            node = parent;
        }
        pmf
    }

    /// Probability of the first of two nodes; `None` if neither gives light.
    #[inline]
    fn share(&self, strengths: &[f32], (first, second): (usize, usize), place: &Place) -> Option<f32> {
        let (a, b) = (self.importance(strengths, first, place), self.importance(strengths, second, place));
        // Halves, for the sum of two large ones.
        let sum = 0.5 * a + 0.5 * b;
        (sum > 0.0 && sum.is_finite()).then(|| 0.5 * a / sum)
    }
}

/// Bounds of several lights. Their strength counts the gains already.
fn around(lights: &[(u32, LightBounds)]) -> LightBounds {
    let (_, first) = lights[0];
    let (mut low, mut high) = (Vec3::INFINITY, Vec3::NEG_INFINITY);
    let mut all = first;
    for (_, light) in lights {
        (low, high) = (low.min(light.centre - light.radius), high.max(light.centre + light.radius));
        all.normals = all.normals.union(light.normals);
        all.spread = all.spread.max(light.spread);
    }
    if lights.len() > 1 {
        (all.centre, all.radius) = (0.5 * low + 0.5 * high, (0.5 * high - 0.5 * low).length().next_up());
    }
    if all.normals.angle >= std::f32::consts::PI {
        all.normals = Cone::ALL;
    }
    all
}

/// Orders lights so that the first part and the rest lie well apart; the size of the first part.
fn split(lights: &mut [(u32, LightBounds)], weights: &[f32]) -> usize {
    let (mut low, mut high) = (Vec3::INFINITY, Vec3::NEG_INFINITY);
    for (_, light) in lights.iter() {
        (low, high) = (low.min(light.centre), high.max(light.centre));
    }
    let extent = high - low;
    let mut best = (f32::INFINITY, 0, 0);
    for axis in 0..3 {
        if !(extent[axis] > 0.0) {
            continue;
        }
        let mut buckets: [Option<(Vec3, Vec3, f32)>; SPLITS] = [None; SPLITS];
        for (i, light) in lights.iter() {
            let (l, h) = (light.centre - light.radius, light.centre + light.radius);
            let weight = weights[*i as usize] * light.gain;
            let bucket = &mut buckets[bucket(light, low, extent, axis)];
            *bucket = Some(bucket.map_or((l, h, weight), |(a, b, w)| (a.min(l), b.max(h), w + weight)));
        }
        for at in 1..SPLITS {
            let cost = cost(&buckets[..at]) + cost(&buckets[at..]);
            if cost.is_finite() && cost < best.0 {
                best = (cost, axis, at);
            }
        }
    }
    let (_, axis, at) = best;
    let mut first = 0;
    for i in 0..lights.len() {
        if at > 0 && bucket(&lights[i].1, low, extent, axis) < at {
            lights.swap(first, i);
            first += 1;
        }
    }
    // All in one place, or on one side.
    if first == 0 || first == lights.len() { lights.len() / 2 } else { first }
}

fn bucket(light: &LightBounds, low: Vec3, extent: Vec3, axis: usize) -> usize {
    let at = (light.centre[axis] - low[axis]) / extent[axis];
    ((at * SPLITS as f32) as usize).min(SPLITS - 1)
}

/// Strength times the squared size of what lies in the buckets; infinite if nothing does.
fn cost(buckets: &[Option<(Vec3, Vec3, f32)>]) -> f32 {
    let all = buckets.iter().flatten().copied().reduce(|a, b| (a.0.min(b.0), a.1.max(b.1), a.2 + b.2));
    all.map_or(f32::INFINITY, |(low, high, weight)| weight * (high - low).length_squared())
}
