//! Microfacet normal distributions with Smith shadowing, drawn by visible normals.

use super::Distribution;
use crate::math::{Vec2, Vec3, erf, exp, ln, safe_sqrt, sin_cos, sqr};
use std::f32::consts::PI;
use std::f64::consts::FRAC_2_SQRT_PI;

/// Surfaces whose larger alpha is below this are treated as smooth: f32 directions can't resolve so narrow a lobe.
pub const SMOOTH_ALPHA: f32 = 1e-3;

/// The smaller alpha of a rough anisotropic surface is kept above this.
const MIN_ALPHA: f32 = 1e-4;

/// A distribution of facet normals. Masking and shadowing are Smith's, uncorrelated (their product), as in Walter et al. 2007.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Microfacet {
    distribution: Distribution,
    alpha: Vec2,
}

impl Microfacet {
    /// `None` when both alphas are below [`SMOOTH_ALPHA`].
    pub fn new(distribution: Distribution, alpha_u: f32, alpha_v: f32) -> Option<Self> {
        let alpha = Vec2::new(alpha_u, alpha_v);
        (alpha.max_element() >= SMOOTH_ALPHA).then(|| Self { distribution, alpha: alpha.max(Vec2::splat(MIN_ALPHA)) })
    }

    /// The smaller of its two slope parameters.
    #[inline]
    pub fn least_alpha(&self) -> f32 {
        self.alpha.min_element()
    }

    /// Roughness along the rougher axis.
    #[inline]
    pub fn most_alpha(&self) -> f32 {
        self.alpha.max_element()
    }

    /// Density of facet normals `wm` (upper hemisphere, unit) per solid angle and projected area.
    #[inline]
    pub fn d(&self, wm: Vec3) -> f32 {
        let slope2 = sqr(wm.x / self.alpha.x) + sqr(wm.y / self.alpha.y);
        let z2 = sqr(wm.z);
        let scale = PI * self.alpha.x * self.alpha.y;
        match self.distribution {
            Distribution::Ggx => 1.0 / (scale * sqr(slope2 + z2)),
            Distribution::Beckmann if wm.z > 1e-6 => exp(-slope2 / z2) / (scale * sqr(z2)),
            Distribution::Beckmann => 0.0,
        }
    }

    /// Smith's masking `G1(w)` over `|cos w|`, on either side; finite at grazing angles.
    ///
    /// Facets turned away from `w` are the caller's to refuse.
    #[inline]
    pub fn g1_over_cos(&self, w: Vec3) -> f32 {
        let z = w.z.abs();
        let s2 = sqr(w.x * self.alpha.x) + sqr(w.y * self.alpha.y);
        match self.distribution {
            Distribution::Ggx => 2.0 / (z + (sqr(z) + s2).sqrt()),
            Distribution::Beckmann => {
                let s = s2.sqrt();
                let a = z / s;
                // From a = 4 on, G1 = 1 to all digits of f32.
                if !(a < 4.0) {
                    return 1.0 / z;
                }
                2.0 / (z * (1.0 + erf(a)) + s * exp(-sqr(a)) * (0.5 * FRAC_2_SQRT_PI as f32))
            }
        }
    }

    /// The masking `G1(w)` over `|cos w|` that BSDF values use: for Beckmann the rational fit of Walter et al. 2007 (section 5.2), up to
    /// 0.35 % from the exact function, as other renderers do. Densities need the exact one.
    #[inline]
    pub fn shadowing_over_cos(&self, w: Vec3) -> f32 {
        if self.distribution == Distribution::Ggx {
            return self.g1_over_cos(w);
        }
        let z = w.z.abs();
        let s = (sqr(w.x * self.alpha.x) + sqr(w.y * self.alpha.y)).sqrt();
        // With a = z / s: G1 = (3.535 a + 2.181 a^2) / (1 + 2.276 a + 2.577 a^2) below 1.6.
        if z < 1.6 * s { (3.535 * s + 2.181 * z) / (sqr(s) + 2.276 * s * z + 2.577 * sqr(z)) } else { 1.0 / z }
    }

    /// Draws a facet normal (upper hemisphere) among those that `w` sees, from either side of the surface. Its density per
    /// solid angle is `g1_over_cos(w) |w.wm| d(wm)`.
    #[inline]
    pub fn sample_visible(&self, w: Vec3, u: Vec2) -> Vec3 {
        // Stretch to alpha = 1.
        let w = if w.z < 0.0 { -w } else { w };
        let stretched = Vec3::new(w.x * self.alpha.x, w.y * self.alpha.y, w.z).normalize();
        let wm = match self.distribution {
            Distribution::Ggx => sample_visible_ggx(stretched, u),
            Distribution::Beckmann => sample_visible_beckmann(stretched, u),
        };
        // Unstretch the normal.
        Vec3::new(wm.x * self.alpha.x, wm.y * self.alpha.y, wm.z).normalize()
    }
}

/// The facet normal (upper hemisphere) that mirrors `wo` into `wi` on the same side; `None` where f32 can't tell.
#[inline]
pub fn reflecting_facet(wo: Vec3, wi: Vec3) -> Option<Vec3> {
    let h = wo + wi;
    let length2 = h.length_squared();
    (length2 > 0.0).then(|| h * (1.0f32.copysign(h.z) / length2.sqrt()))
}

/// The facet normal (upper hemisphere) that refracts `wo` into `wi`, and its Jacobian `|d wm / d wi| / |wi.wm|`; `eta` =
/// index on the side of `wi` over that on the side of `wo`. `None` when no facet that both see does.
#[inline]
pub fn refracting_facet(wo: Vec3, wi: Vec3, eta: f32) -> Option<(Vec3, f32)> {
    let h = wi * eta + wo;
    let length2 = h.length_squared();
    let wm = h * (1.0f32.copysign(h.z) / length2.sqrt());
    let seen = length2 > 0.0 && wo.dot(wm) * wo.z > 0.0 && wi.dot(wm) * wi.z > 0.0;
    // Walter's denominator, eta (wi.wm) + wo.wm, is the length of h.
    seen.then(|| (wm, sqr(eta) / length2))
}

/// Visible normal of the unit-roughness GGX distribution, not of unit length: a spherical cap around `-w` shifted by `w` (Dupuy
/// and Benyoub 2023, "Sampling Visible GGX Normals with Spherical Caps").
#[inline]
fn sample_visible_ggx(w: Vec3, u: Vec2) -> Vec3 {
    // z of the normal, and with it that of the cap's point without cancellation.
    let z = (1.0 - u.y) * (1.0 + w.z);
    let cap_z = z - w.z;
    let (sin, cos) = sin_cos(2.0 * PI * u.x);
    let r = safe_sqrt((1.0 - cap_z) * (1.0 + cap_z));
    Vec3::new(r * cos + w.x, r * sin + w.y, z)
}

/// Visible normal of the unit-roughness Beckmann distribution, not of unit length.
///
/// Slopes along `w` have the density `(1 - x tan) exp(-x^2)` below `cot`, those across it `exp(-y^2)` (Heitz and d'Eon 2014);
/// the first is inverted numerically in the variable `erf(x)`, where its cumulative function is almost a parabola (Jakob 2014).
fn sample_visible_beckmann(w: Vec3, u: Vec2) -> Vec3 {
    const INV_SQRT_PI: f64 = 0.5 * FRAC_2_SQRT_PI;
    let sin = safe_sqrt(sqr(w.x) + sqr(w.y));
    let across = erf_inverse(f64::from(2.0 * u.y - 1.0));
    let Some(phi) = (sin > 0.0).then(|| Vec2::new(w.x, w.y) / sin) else {
        return Vec3::new(-erf_inverse(f64::from(2.0 * u.x - 1.0)) as f32, -across as f32, 1.0);
    };
    let cot = f64::from(w.z) / f64::from(sin);
    let tan = if cot > 1e-7 { 1.0 / cot } else { 1e7 };
    // Solve cumulative(z) = u, z = erf(x), by Newton steps that bisect when they leave the bracket.
    let (mut low, mut high) = (-1.0f64, f64::from(erf(cot as f32)));
    let cumulative = |z: f64, x: f64| 1.0 + z + INV_SQRT_PI * tan * f64::from(exp(-(x * x) as f32));
    let target = f64::from(u.x) * cumulative(high, cot);
    let mut z = high - (high - low) * f64::from(erf((-ln(u.x.max(1e-7))).sqrt()));
    for _ in 0..40 {
        let x = erf_inverse(z);
        let error = cumulative(z, x) - target;
        if error > 0.0 {
            high = z
        } else {
            low = z
        }
        let step = error / (1.0 - x * tan);
        // Newton steps square the error: after one so short it is below that of the inverse error function.
        if step.abs() < 1e-3 * (1.0 - z.abs()) {
            z -= step;
            break;
        }
        z = if z - step > low && z - step < high { z - step } else { 0.5 * (low + high) };
    }
    // Turn the slopes into the plane of w.
    let (along, across) = (erf_inverse(z) as f32, across as f32);
    Vec3::new(-(phi.x * along - phi.y * across), -(phi.y * along + phi.x * across), 1.0)
}

/// Inverse of the error function (Giles 2010, "Approximating the erfinv function", single precision). Values stay within +-3.8:
/// what is cut off has a probability of 1e-7.
fn erf_inverse(x: f64) -> f64 {
    let x = x.clamp(-1.0 + 1e-7, 1.0 - 1e-7);
    let w = -ln(((1.0 - x) * (1.0 + x)) as f32);
    const CENTRE: [f32; 9] = [
        2.810_226_4e-8,
        3.432_739_4e-7,
        -3.523_387_7e-6,
        -4.391_506_5e-6,
        2.185_808_7e-4,
        -1.253_725_1e-3,
        -4.177_681_6e-3,
        2.466_407_3e-1,
        1.501_409_4,
    ];
    const TAILS: [f32; 9] = [
        -2.002_142_6e-4,
        1.009_505_6e-4,
        1.349_343_2e-3,
        -3.673_428_4e-3,
        5.739_507_7e-3,
        -7.622_461_3e-3,
        9.438_870_5e-3,
        1.001_674,
        2.832_976_8,
    ];
    let factor = if w < 5.0 { polynomial(&CENTRE, w - 2.5) } else { polynomial(&TAILS, w.sqrt() - 3.0) };
    f64::from(factor) * x
}

/// The polynomial with coefficients from the highest power down; even and odd powers apart, for two short chains of operations.
#[inline]
fn polynomial(c: &[f32; 9], t: f32) -> f32 {
    let t2 = t * t;
    let even = (((c[0] * t2 + c[2]) * t2 + c[4]) * t2 + c[6]) * t2 + c[8];
    let odd = ((c[1] * t2 + c[3]) * t2 + c[5]) * t2 + c[7];
    even + odd * t
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::{cos, erf64, sin};

    fn distributions() -> Vec<Microfacet> {
        let mut all = Vec::new();
        for distribution in [Distribution::Ggx, Distribution::Beckmann] {
            for (u, v) in [(0.1, 0.1), (0.5, 0.5), (1.0, 1.0), (0.2, 0.6)] {
                all.push(Microfacet { distribution, alpha: Vec2::new(u, v) });
            }
        }
        all
    }

    /// Midpoint rule over the upper hemisphere.
    fn hemisphere(f: impl Fn(Vec3) -> f32) -> f64 {
        const N: usize = 300;
        let mut sum = 0.0;
        for i in 0..N {
            let theta = (i as f32 + 0.5) / N as f32 * 0.5 * PI;
            for j in 0..N {
                let phi = (j as f32 + 0.5) / N as f32 * 2.0 * PI;
                let w = Vec3::new(sin(theta) * cos(phi), sin(theta) * sin(phi), cos(theta));
                sum += f64::from(f(w) * sin(theta));
            }
        }
        sum * f64::from(PI * PI) / (N * N) as f64
    }

    /// The facets' projected areas add up to that of the surface, from above and from any side that sees them.
    #[test]
    fn facets_cover_the_surface() {
        for m in distributions() {
            let area = hemisphere(|wm| m.d(wm) * wm.z);
            assert!((area - 1.0).abs() < 1e-3, "{m:?}: {area}");
            for theta in [0.3f32, 1.2, 1.5] {
                let w = Vec3::new(sin(theta) * 0.8, sin(theta) * 0.6, cos(theta));
                let visible = hemisphere(|wm| m.g1_over_cos(w) * w.dot(wm).max(0.0) * m.d(wm));
                assert!((visible - 1.0).abs() < 2e-3, "{m:?}, theta {theta}: {visible}");
            }
        }
    }

    #[test]
    fn erf_is_undone() {
        for i in -3000..=3000 {
            let x = f64::from(i) * 1e-3;
            let error = (erf_inverse(erf64(x)) - x).abs();
            assert!(error < 2e-6 * x.abs() + 1e-12, "{x}: off by {error}");
        }
        assert!(erf_inverse(1.0).is_finite() && erf_inverse(-1.0) == -erf_inverse(1.0));
    }

    #[test]
    fn narrow_lobes_are_smooth() {
        assert_eq!(Microfacet::new(Distribution::Ggx, 0.0, 0.9e-3), None);
        assert_eq!(Microfacet::new(Distribution::Ggx, 0.0, 0.5).map(|m| m.alpha), Some(Vec2::new(MIN_ALPHA, 0.5)));
    }

    /// The Beckmann masking function agrees with the rational fit of Walter et al. 2007 (0.35 % error).
    #[test]
    fn beckmann_masking_agrees_with_walters_fit() {
        let m = Microfacet { distribution: Distribution::Beckmann, alpha: Vec2::splat(0.4) };
        for i in 1..157 {
            let theta = i as f32 * 0.01;
            let w = Vec3::new(sin(theta), 0.0, cos(theta));
            let a = cos(theta) / (sin(theta) * 0.4);
            let fit = if a < 1.6 { (3.535 * a + 2.181 * a * a) / (1.0 + 2.276 * a + 2.577 * a * a) } else { 1.0 };
            let g1 = m.g1_over_cos(w) * w.z;
            assert!((g1 / fit - 1.0).abs() < 5e-3, "theta {theta}: {g1}, fit {fit}");
        }
    }
}
