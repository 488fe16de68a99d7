//! What a path keeps of its first two vertices until its neighbours are there.

use crate::bsdf::{DirectionSample, ShadingPoint, Spread, Transport};
use crate::math::{Anchor, Vec3};
use crate::path::Scattering;
use crate::spectrum::Rgb;

/// What a path has to share.
#[derive(Default)]
pub(in crate::integrator) struct Kept {
    /// The first vertex, if there is one.
    pub first: Option<(Anchor, Scattering)>,
    /// Value times cosine of the direction taken there, and its density; none for a delta lobe.
    pub departed: Option<(Rgb, f32)>,
    /// The direction of the last light that next-event estimation chose, and its radiance times weight over density.
    pub lit: Option<(Vec3, Rgb)>,
    /// Of several samples of lights at the first vertex: the variance of what they find together, in luminance.
    pub scatter: Option<f64>,
    /// The second vertex, if it may be shared.
    pub(super) second: Option<Second>,
}

/// A second vertex.
pub(super) struct Second {
    pub anchor: Anchor,
    /// Unit shading normal.
    n: Vec3,
    /// Unit direction to the first vertex of its own path.
    wo: Vec3,
    /// What it reflects along `wo`.
    pub radiance: Rgb,
    /// What reflects, unless it reflects evenly.
    shading: Option<ShadingPoint>,
    /// Direction of a light, and its radiance times weight over density.
    lit: Option<(Vec3, Rgb)>,
    /// The direction in which its path goes on: weight, density, and what came from there.
    onward: Option<Onward>,
}

struct Onward {
    wi: Vec3,
    weight: Rgb,
    pdf: f32,
    radiance: Rgb,
}

impl Kept {
    /// Notes the second vertex of the path, seen along `wo`, if it is to be shared.
    #[inline]
    pub fn begin(&mut self, anchor: &Anchor, scattering: &Scattering, wo: Vec3) -> bool {
        let Scattering::Surface(shading) = scattering else { return false };
        let spread = shading.bsdf.spread();
        if self.departed.is_none() || spread == Spread::Narrow {
            return false;
        }
        self.second = Some(Second {
            anchor: *anchor,
            n: shading.frame.n,
            wo,
            radiance: Rgb::ZERO,
            shading: (spread == Spread::Broad).then_some(*shading),
            lit: None,
            onward: None,
        });
        true
    }

    /// Lights were connected to the second vertex, which reflects `radiance` of them.
    #[inline]
    pub fn connected(&mut self, radiance: Rgb) {
        if let Some(second) = &mut self.second {
            (second.radiance, second.lit) = (radiance, self.lit);
        }
    }

    /// The path goes on from its second vertex.
    #[inline]
    pub fn departs(&mut self, s: &DirectionSample) {
        if let Some(second) = &mut self.second {
            second.onward = Some(Onward { wi: s.wi, weight: s.weight(), pdf: s.pdf, radiance: Rgb::ZERO });
        }
    }

    /// The path has ended, and `radiance` came to its second vertex from where it went on. Whether there is such a vertex.
    #[inline]
    pub fn end(&mut self, radiance: Rgb) -> bool {
        let Some(second) = &mut self.second else { return false };
        if let Some(onward) = &mut second.onward {
            onward.radiance = radiance;
            second.radiance += onward.weight * radiance;
        }
        true
    }

    /// What comes to the pixel from its own path's second vertex, if it is not shared.
    #[inline]
    pub(super) fn unshared(&self) -> Rgb {
        match (&self.departed, &self.second) {
            (Some((value, pdf)), Some(second)) => *value * second.radiance * (1.0 / *pdf),
            _ => Rgb::ZERO,
        }
    }
}

impl Second {
    /// The geometric and the shading normal, both turned to the side from which its path came. From where both are seen, it is the same.
    #[inline]
    pub fn normals(&self) -> [Vec3; 2] {
        [self.anchor.ng, self.n].map(|n| if n.dot(self.wo) < 0.0 { -n } else { n })
    }

    /// What it reflects towards the unit direction `wo`, on the side from which its path came. The directions from which light comes
    /// were drawn for another `wo`, but on the whole side, and weighted by weights that add up to one for each of them.
    #[inline]
    pub fn radiance_towards(&self, wo: Vec3) -> Rgb {
        let Some(shading) = self.shading.as_ref().map(|s| s.seen_from(wo)) else { return self.radiance };
        let from = |wi: Vec3, radiance: Rgb| shading.eval(wi, Transport::Radiance) * radiance * shading.abs_cos(wi);
        let lit = self.lit.map_or(Rgb::ZERO, |(wi, radiance)| from(wi, radiance));
        self.onward.as_ref().map_or(lit, |o| lit + from(o.wi, o.radiance * (1.0 / o.pdf)))
    }
}
