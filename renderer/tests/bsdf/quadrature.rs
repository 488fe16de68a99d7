//! Integrals over the cells of a grid on the sphere, by adaptive Gauss-Legendre quadrature.

use renderer::bsdf::Bsdf;
use renderer::math::Vec3;
use std::f64::consts::{FRAC_PI_2, PI, TAU};

/// Rows and columns in theta and phi. Both odd, so that no border of a density falls on that of a cell by construction.
pub const ROWS: usize = 21;
pub const COLUMNS: usize = 41;

/// Nodes and weights of the three-point rule on [0, 1].
const NODES: [(f64, f64); 3] =
    [(0.112_701_665_379_258_3, 5.0 / 18.0), (0.5, 8.0 / 18.0), (0.887_298_334_620_741_7, 5.0 / 18.0)];

/// Deepest subdivision of a cell.
const MAX_LEVEL: u32 = 16;

/// Polar coordinates (theta, phi), phi in [0, 2 pi).
pub fn polar(w: Vec3) -> [f64; 2] {
    let w = w.as_dvec3();
    [w.x.hypot(w.y).atan2(w.z), w.y.atan2(w.x).rem_euclid(TAU)]
}

/// Index of the grid cell that holds a direction.
pub fn cell(w: Vec3) -> usize {
    let [theta, phi] = polar(w);
    let row = ((theta / PI * ROWS as f64) as usize).min(ROWS - 1);
    let column = ((phi / TAU * COLUMNS as f64) as usize).min(COLUMNS - 1);
    row * COLUMNS + column
}

/// A function on the sphere.
pub struct Integrand<'a> {
    pub f: &'a dyn Fn(Vec3) -> f64,
    /// Angles theta at which it may jump, ascending: the grid's rows are split there.
    pub jumps: &'a [f64],
    /// Absolute error that a part of integral `x` may have.
    pub tolerance: &'a dyn Fn(f64) -> f64,
}

/// A direction drawn with the weight `f / pdf`: the weights of many, over their number, estimate the integral.
#[derive(Clone, Copy)]
pub struct Drawn {
    pub w: Vec3,
    pub weight: f64,
}

/// Where a BSDF seen from `wo` may jump: at the horizon, and where the facets that refract stand upright.
pub fn jumps(bsdf: &Bsdf, wo: Vec3) -> Vec<f64> {
    let ior = match bsdf {
        Bsdf::Dielectric(d) => d.eta,
        Bsdf::Gltf(g) => g.ior,
        _ => 1.0,
    };
    let eta = if wo.z > 0.0 { ior } else { 1.0 / ior };
    let mut jumps = vec![FRAC_PI_2, f64::from(-wo.z / eta).acos()];
    jumps.sort_by(f64::total_cmp);
    jumps
}

/// A [`Drawn`] in polar coordinates, weight over number.
#[derive(Clone, Copy)]
struct Seed {
    at: [f64; 2],
    share: f64,
}

#[derive(Clone, Copy)]
struct Rect {
    theta: [f64; 2],
    phi: [f64; 2],
}

impl Integrand<'_> {
    /// The integral of each cell of the grid. Of `n` directions, `drawn` are not absorbed: they show where nodes miss a peak.
    pub fn cells(&self, drawn: &[Drawn], n: usize) -> Vec<f64> {
        let mut seeds = vec![Vec::new(); ROWS * COLUMNS];
        for d in drawn {
            seeds[cell(d.w)].push(Seed { at: polar(d.w), share: d.weight / n as f64 });
        }
        let mut integrals = vec![0.0; ROWS * COLUMNS];
        for row in 0..ROWS {
            let edges = [row, row + 1].map(|r| r as f64 / ROWS as f64 * PI);
            // Gauss nodes on one side of a jump agree with each other, however wrong they are.
            let mut bands = vec![edges];
            for &jump in self.jumps.iter().filter(|j| edges[0] < **j && **j < edges[1]) {
                let last = bands.len() - 1;
                bands[last][1] = jump;
                bands.push([jump, edges[1]]);
            }
            for column in 0..COLUMNS {
                let phi = [column, column + 1].map(|c| c as f64 / COLUMNS as f64 * TAU);
                let i = row * COLUMNS + column;
                for &theta in &bands {
                    let rect = Rect { theta, phi };
                    let inside: Vec<_> = seeds[i].iter().copied().filter(|s| rect.holds(s.at)).collect();
                    integrals[i] += self.refine(rect, self.gauss(rect), &inside, 1.0 / n as f64, false, 0);
                }
            }
        }
        integrals
    }

    /// The integral of `rect`: halves both sides until the sum agrees with the whole and with what was
    /// drawn; `one` = the share of one direction of weight 1, `sure` = the level above agreed.
    fn refine(&self, rect: Rect, whole: f64, seeds: &[Seed], one: f64, sure: bool, level: u32) -> f64 {
        let quarters = rect.quarters().map(|q| (q, self.gauss(q)));
        let sum: f64 = quarters.iter().map(|(_, g)| g).sum();
        let tolerance = (self.tolerance)(sum);
        // Nodes that all miss a peak agree with each other; drawn directions don't.
        let share: f64 = seeds.iter().map(|s| s.share).sum();
        let largest = seeds.iter().map(|s| s.share).fold(one, f64::max);
        let missed = (share - sum).abs() > 4.0 * (largest * (share + sum)).sqrt() + tolerance
            || (share > 3.0 * largest && sum < 0.25 * share);
        // Near agreement can be luck, and the same in every cell of a symmetric density: then the next level must agree too.
        let difference = (sum - whole).abs();
        let agrees = difference <= tolerance && !missed;
        if level == MAX_LEVEL || (agrees && (sure || difference <= 1e-4 * sum)) {
            return sum;
        }
        quarters
            .into_iter()
            .map(|(q, g)| {
                let inside: Vec<_> = seeds.iter().copied().filter(|s| q.holds(s.at)).collect();
                self.refine(q, g, &inside, one, agrees, level + 1)
            })
            .sum()
    }

    /// The rule's integral over `rect`.
    fn gauss(&self, rect: Rect) -> f64 {
        let (dt, dp) = (rect.theta[1] - rect.theta[0], rect.phi[1] - rect.phi[0]);
        let mut sum = 0.0;
        for (t, wt) in NODES {
            let theta = rect.theta[0] + t * dt;
            let row: f64 = NODES.iter().map(|(p, wp)| wp * (self.f)(unit(theta, rect.phi[0] + p * dp))).sum();
            sum += wt * row * theta.sin();
        }
        sum * dt * dp
    }
}

impl Rect {
    fn quarters(self) -> [Self; 4] {
        let split = |r: [f64; 2]| {
            let middle = 0.5 * (r[0] + r[1]);
            [[r[0], middle], [middle, r[1]]]
        };
        let (theta, phi) = (split(self.theta), split(self.phi));
        [0, 1, 2, 3].map(|i| Self { theta: theta[i / 2], phi: phi[i % 2] })
    }

    fn holds(self, s: [f64; 2]) -> bool {
        self.theta[0] <= s[0] && s[0] < self.theta[1] && self.phi[0] <= s[1] && s[1] < self.phi[1]
    }
}

fn unit(theta: f64, phi: f64) -> Vec3 {
    let (sin, cos) = theta.sin_cos();
    Vec3::new((sin * phi.cos()) as f32, (sin * phi.sin()) as f32, cos as f32)
}

/// The rule and the subdivision integrate what has a known integral: 1, cos^2 and a peak narrower than a cell.
#[test]
fn known_integrals() {
    let tolerance = |_: f64| 1e-9;
    let total = |f: &dyn Fn(Vec3) -> f64, drawn: &[Drawn]| -> f64 {
        Integrand { f, jumps: &[], tolerance: &tolerance }.cells(drawn, 1000).iter().sum()
    };
    assert!((total(&|_| 1.0, &[]) - 4.0 * PI).abs() < 1e-5);
    assert!((total(&|w| f64::from(w.z * w.z), &[]) - 4.0 * PI / 3.0).abs() < 1e-5);
    // A peak of 1e-3 rad: found by what was drawn there.
    let axis = unit(1.0, 2.0);
    let drawn = [Drawn { w: axis, weight: 1.0 }; 1000];
    let gaussian = |w: Vec3| (-(w - axis).as_dvec3().length_squared() / 2e-6).exp() / (TAU * 1e-6);
    let integral = total(&gaussian, &drawn);
    assert!((integral - 1.0).abs() < 1e-3, "{integral}");
}
