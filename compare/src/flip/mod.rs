//! FLIP: the difference that an observer sees when flipping between two pictures. 0 = none, 1 = the largest.
//!
//! LDR-FLIP: Andersson et al., "FLIP: A Difference Evaluator for Alternating Images", 2020. HDR-FLIP: Andersson et al., "Visualizing
//! Errors in Rendered High Dynamic Range Images", 2021: the largest LDR-FLIP over exposures, with the ACES tone map. Both for a
//! monitor of 3840 pixels over 0.7 m, seen from 0.7 m, and with separable filters, as in NVIDIA's implementation 1.7.

mod colour;
mod filter;

use crate::pair::Pair;
use filter::{Detectors, Plane, Sensitivity, Size};
use renderer::math::fns::{ln, pow};
use std::sync::atomic::{AtomicUsize, Ordering};

/// 0.7 m * 3840 pixels / 0.7 m, per degree.
const PIXELS_PER_DEGREE: f32 = 3840.0 * std::f32::consts::PI / 180.0;
/// Exponent of the colour difference.
const QC: f32 = 0.7;
/// The colour difference, as a share of the largest, that maps to [`PT`].
const PC: f32 = 0.4;
/// See [`PC`].
const PT: f32 = 0.95;
/// Exponent of the feature difference.
const QF: f32 = 0.5;

/// A FLIP map and its mean over the pixels that can be compared.
#[derive(Clone, Debug)]
pub struct Flip {
    /// Per pixel.
    pub map: Vec<f32>,
    /// Mean of `map`.
    pub mean: f64,
}

impl Flip {
    fn new(map: Vec<f32>, pair: &Pair) -> Self {
        let valid = || map.iter().zip(&pair.valid).filter(|(_, v)| **v).map(|(m, _)| f64::from(*m));
        let mean = valid().sum::<f64>() / valid().count().max(1) as f64;
        Self { map, mean }
    }
}

/// LDR-FLIP of the linear values clamped to [0, 1] (exposure 0, no tone curve). Pixels that can't be compared are black in both.
pub fn ldr(pair: &Pair) -> Flip {
    let flip = Evaluator::new(pair);
    let shown = |pixels: &[[f32; 3]]| flip.prepare(pixels, &pair.valid, |p| p);
    Flip::new(flip.difference(&shown(&pair.b), &shown(&pair.a)), pair)
}

/// HDR-FLIP. `None` when the reference is black.
pub fn hdr(pair: &Pair) -> Option<Flip> {
    let exposures = exposures(pair)?;
    let flip = Evaluator::new(pair);
    // Exposures are independent and the largest difference counts: any order gives the same map.
    let next = AtomicUsize::new(0);
    let work = || {
        let mut largest = vec![0.0f32; pair.a.len()];
        while let Some(stops) = exposures.get(next.fetch_add(1, Ordering::Relaxed)) {
            let scale = pow(2.0, *stops);
            let shown = |pixels: &[[f32; 3]]| flip.prepare(pixels, &pair.valid, |p| p.map(|v| aces(v * scale)));
            let map = flip.difference(&shown(&pair.b), &shown(&pair.a));
            largest.iter_mut().zip(map).for_each(|(l, m)| *l = l.max(m));
        }
        largest
    };
    let threads = std::thread::available_parallelism().map_or(1, usize::from).min(exposures.len());
    let maps: Vec<Vec<f32>> = std::thread::scope(|scope| {
        let handles: Vec<_> = (0..threads).map(|_| scope.spawn(work)).collect();
        handles.into_iter().filter_map(|h| h.join().ok()).collect()
    });
    let mut largest = vec![0.0f32; pair.a.len()];
    for map in maps {
        largest.iter_mut().zip(map).for_each(|(l, m)| *l = l.max(m));
    }
    Some(Flip::new(largest, pair))
}

/// `(a x^2 + b x) / (c x^2 + d x + e)`: Narkowicz' fit of the ACES curve, without its pre-exposure of 0.6.
const ACES: [f32; 5] = [0.6 * 0.6 * 2.51, 0.6 * 0.03, 0.6 * 0.6 * 2.43, 0.6 * 0.59, 0.14];

fn aces(x: f32) -> f32 {
    (ACES[0] * x * x + ACES[1] * x) / (ACES[2] * x * x + ACES[3] * x + ACES[4])
}

/// Stops from the one that brings the reference's brightest pixel to 0.85 after tone mapping to the one that does so for its median.
fn exposures(pair: &Pair) -> Option<Vec<f32>> {
    let luminance = |p: &[f32; 3]| 0.2126 * p[0].max(0.0) + 0.7152 * p[1].max(0.0) + 0.0722 * p[2].max(0.0);
    let mut luminances: Vec<f32> =
        pair.b.iter().zip(&pair.valid).filter(|(_, v)| **v).map(|(p, _)| luminance(p)).collect();
    luminances.sort_unstable_by(f32::total_cmp);
    let brightest = luminances.last().copied().filter(|l| *l > 0.0 && l.is_finite())?;
    // The published median is undefined where half the picture is black: the lit half's is taken then.
    let lit = if luminances[luminances.len() / 2] > 0.0 { 0 } else { luminances.partition_point(|l| *l <= 0.0) };
    let median = luminances[lit + (luminances.len() - lit) / 2];
    // The input that the tone map takes to 0.85.
    let (a, b, c) = (ACES[0] - 0.85 * ACES[2], ACES[1] - 0.85 * ACES[3], -0.85 * ACES[4]);
    let half = -0.5 * b / a;
    let root = half + (half * half - c / a).sqrt();
    let stops = |l: f32| ln(root / l) / std::f32::consts::LN_2;
    let (start, stop) = (stops(brightest), stops(median));
    let count = (stop - start).ceil().max(2.0) as usize;
    let step = (stop - start) / (count - 1) as f32;
    Some((0..count).map(|i| start + i as f32 * step).collect())
}

/// What is compared of a picture.
struct Seen {
    /// Colour after the eye's blur.
    lab: Vec<[f32; 3]>,
    /// Strength of edges.
    edges: Plane,
    /// Strength of points.
    points: Plane,
}

struct Evaluator {
    size: Size,
    sensitivity: Sensitivity,
    detectors: Detectors,
    /// The largest colour difference: between green and blue.
    largest: f32,
}

impl Evaluator {
    fn new(pair: &Pair) -> Self {
        let green = colour::hunt_lab([0.0, 1.0, 0.0]);
        let blue = colour::hunt_lab([0.0, 0.0, 1.0]);
        Self {
            size: Size { width: pair.width as usize, height: pair.height as usize },
            sensitivity: Sensitivity::new(),
            detectors: Detectors::new(),
            largest: pow(colour::hyab(green, blue), QC),
        }
    }

    /// Shows a picture through `tone`, clamps it to [0, 1] and filters it.
    fn prepare(&self, pixels: &[[f32; 3]], valid: &[bool], tone: impl Fn([f32; 3]) -> [f32; 3]) -> Seen {
        let show = |(p, valid): (&[f32; 3], &bool)| {
            let p = if *valid { p.map(|v| v.max(0.0)) } else { [0.0; 3] };
            colour::ycxcz(tone(p).map(|v| v.min(1.0)))
        };
        let opponent: Vec<[f32; 3]> = pixels.iter().zip(valid).map(show).collect();
        let plane = |c: usize| -> Plane { opponent.iter().map(|p| p[c]).collect() };
        let (y, cx, cz) = (plane(0), plane(1), plane(2));
        drop(opponent);
        // Blur each channel by the eye's contrast sensitivity.
        let s = &self.sensitivity;
        let blurred_cx = self.size.filter(&cx, &s.cx, &s.cx);
        let [cz1, cz2] = [0, 1].map(|i| self.size.filter(&cz, &s.cz[i], &s.cz[i]));
        let blurred_y = self.size.filter(&y, &s.y, &s.y);
        let lab = |i: usize| {
            let linear = colour::from_ycxcz([blurred_y[i], blurred_cx[i], cz1[i] + cz2[i]]);
            colour::hunt_lab(linear.map(|v| v.clamp(0.0, 1.0)))
        };
        let lab = (0..y.len()).map(lab).collect();
        // Find edges and points in the unblurred lightness.
        let d = &self.detectors;
        let lightness: Plane = y.iter().map(|v| (v + 16.0) / 116.0).collect();
        let strength = |kernel: &[f32]| -> Plane {
            let x = self.size.filter(&lightness, kernel, &d.smooth);
            let y = self.size.filter(&lightness, &d.smooth, kernel);
            x.iter().zip(y).map(|(x, y)| (x * x + y * y).sqrt()).collect()
        };
        Seen { lab, edges: strength(&d.edge), points: strength(&d.point) }
    }

    fn difference(&self, a: &Seen, b: &Seen) -> Vec<f32> {
        let knee = PC * self.largest;
        let one = |i: usize| {
            // Compress the colour difference into [0, 1].
            let distance = pow(colour::hyab(a.lab[i], b.lab[i]), QC);
            let colour = if distance < knee {
                distance * PT / knee
            } else {
                PT + (distance - knee) / (self.largest - knee) * (1.0 - PT)
            };
            // A difference of edges or points amplifies it.
            let edge = (a.edges[i] - b.edges[i]).abs();
            let point = (a.points[i] - b.points[i]).abs();
            let feature = pow(std::f32::consts::FRAC_1_SQRT_2 * edge.max(point), QF);
            pow(colour, 1.0 - feature)
        };
        (0..a.lab.len()).map(one).collect()
    }
}

#[cfg(test)]
mod tests;
