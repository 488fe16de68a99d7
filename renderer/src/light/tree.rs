//! A tree over lights that have a place, by which one is selected for a point (Conty Estevez and Kulla 2018).

use super::place::{Cone, LANES, Lanes, LightBounds, Place, Reach};
use crate::math::{ONE_MINUS_EPSILON, Vec3};
use crate::sampling::Choice;
use std::ops::Range;

/// No light, no parent.
const NONE: u32 = u32::MAX;
/// Most children that are opened for a sum.
const OPENED: usize = 16;
/// Splits tried along an axis.
const SPLITS: usize = 12;

/// What a child of a node is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Child {
    Empty,
    Node(u32),
    Light(u32),
}

/// A node, with the bounds of its children.
#[derive(Clone, Debug)]
struct Node {
    reach: Reach,
    children: [Child; LANES],
    /// The node whose child it is, and which.
    parent: (u32, u32),
}

/// The lights' places, in a tree.
#[derive(Clone, Debug)]
pub(super) struct LightTree {
    /// Children come after their parent.
    nodes: Vec<Node>,
    /// By light, the node whose child it is, and which.
    leaves: Vec<(u32, u32)>,
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
        let mut tree = Self { nodes: Vec::new(), leaves: vec![(NONE, 0); bounds.len()], gains };
        tree.build(&mut lights, weights);
        Some(tree)
    }

    fn build(&mut self, lights: &mut [(u32, LightBounds)], weights: &[f32]) {
        // Ranges that wait for their node, with their parent.
        let mut open = vec![(0..lights.len(), (NONE, 0))];
        while let Some((range, parent)) = open.pop() {
            let here = self.nodes.len() as u32;
            if let Some(above) = self.nodes.get_mut(parent.0 as usize) {
                above.children[parent.1 as usize] = Child::Node(here);
            }
            let mut node = Node { reach: Reach::default(), children: [Child::Empty; LANES], parent };
            for (lane, part) in parts(lights, range, weights).into_iter().enumerate() {
                node.reach.set(lane, &around(&lights[part.clone()]));
                if part.len() == 1 {
                    let (light, _) = lights[part.start];
                    node.children[lane] = Child::Light(light);
                    self.leaves[light as usize] = (here, lane as u32);
                } else {
                    open.push((part, (here, lane as u32)));
                }
            }
            self.nodes.push(node);
        }
    }

    /// Sums of the lights' weights, times their gain, by node and child.
    pub fn strengths(&self, weights: &[f32]) -> Vec<Lanes> {
        let mut sums = vec![[0.0f64; LANES]; self.nodes.len()];
        for (i, node) in self.nodes.iter().enumerate().rev() {
            for (lane, child) in node.children.iter().enumerate() {
                if let Child::Light(light) = child {
                    let light = *light as usize;
                    sums[i][lane] = f64::from(weights[light]) * f64::from(self.gains[light]);
                }
            }
            let (parent, lane) = node.parent;
            let sum: f64 = sums[i].iter().sum();
            if let Some(above) = sums.get_mut(parent as usize) {
                above[lane as usize] = sum;
            }
        }
        sums.iter().map(|s| s.map(|s| s as f32)).collect()
    }

    /// Whether it holds a light.
    #[inline]
    pub fn holds(&self, light: usize) -> bool {
        self.leaves[light].0 != NONE
    }

    /// What all lights together may give to a place. The bound of a node says little from within, so those are opened.
    pub fn total(&self, strengths: &[Lanes], place: &Place) -> f32 {
        let (mut sum, mut opened) = (0.0, 0);
        let mut open = [0u32; OPENED + 1];
        let mut count = 1;
        while count > 0 {
            count -= 1;
            let at = open[count] as usize;
            let node = &self.nodes[at];
            let each = node.reach.importance(&strengths[at], place);
            for (lane, child) in node.children.iter().enumerate() {
                match child {
                    Child::Node(child) if opened < OPENED && node.reach.contains(lane, place.p) => {
                        open[count] = *child;
                        count += 1;
                        opened += 1;
                    }
                    Child::Empty => {}
                    _ => sum += each[lane],
                }
            }
        }
        sum
    }

    /// What a light of unit weight may give to a place.
    pub fn alone(&self, light: usize, place: &Place) -> f32 {
        let (node, lane) = self.leaves[light];
        self.nodes[node as usize].reach.importance(&[self.gains[light]; LANES], place)[lane as usize]
    }

    /// Selects a light for a place by `u`; `None` where no light may give any.
    #[inline]
    pub fn sample(&self, strengths: &[Lanes], place: &Place, mut u: f32) -> Option<Choice> {
        let (mut node, mut pmf) = (0, 1.0f32);
        loop {
            let shares = self.shares(strengths, node, place)?;
            // The child whose share of [0, 1) has the number, or by rounding the last with a share.
            let (mut below, mut chosen) = (0.0, None);
            for (lane, share) in shares.into_iter().enumerate() {
                if share > 0.0 && (chosen.is_none() || u >= below) {
                    chosen = Some((lane, below, share));
                }
                below += share;
            }
            let (lane, below, share) = chosen?;
            u = ((u - below) / share).clamp(0.0, ONE_MINUS_EPSILON);
            pmf *= share;
            match self.nodes[node].children[lane] {
                Child::Node(child) => node = child as usize,
                Child::Light(light) => return (pmf > 0.0).then_some(Choice { index: light as usize, pmf, u }),
                Child::Empty => return None,
            }
        }
    }

    /// Probability with which `sample` selects a light.
    pub fn pmf(&self, strengths: &[Lanes], place: &Place, light: usize) -> f32 {
        let (mut node, mut lane) = self.leaves[light];
        let mut pmf = 1.0f32;
        while node != NONE {
            let Some(shares) = self.shares(strengths, node as usize, place) else { return 0.0 };
            pmf *= shares[lane as usize];
            (node, lane) = self.nodes[node as usize].parent;
        }
        pmf
    }

    /// Probabilities of a node's children; `None` if none gives light.
    #[inline]
    fn shares(&self, strengths: &[Lanes], node: usize, place: &Place) -> Option<Lanes> {
        let each = self.nodes[node].reach.importance(&strengths[node], place);
        let sum: f32 = each.iter().sum();
        (sum > 0.0 && sum.is_finite()).then(|| each.map(|e| e / sum))
    }
}

/// Divides a range of lights into as many as a node has children, or single ones.
fn parts(lights: &mut [(u32, LightBounds)], range: Range<usize>, weights: &[f32]) -> Vec<Range<usize>> {
    let mut parts = vec![range];
    while parts.len() < LANES {
        // Divide what is strongest and largest.
        let cost = |part: &Range<usize>| {
            let own = &lights[part.clone()];
            let strength: f32 = own.iter().map(|(i, light)| weights[*i as usize] * light.gain).sum();
            let cost = strength * around(own).radius;
            if own.len() > 1 { 1.0 + cost } else { 0.0 }
        };
        let costs: Vec<f32> = parts.iter().map(cost).collect();
        let most = (0..parts.len()).fold(0, |best, i| if costs[i] > costs[best] { i } else { best });
        let part = parts[most].clone();
        if part.len() < 2 {
            break;
        }
        let middle = part.start + split(&mut lights[part.clone()], weights);
        parts[most] = part.start..middle;
        parts.insert(most + 1, middle..part.end);
    }
    parts
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
