use crate::spectrum::Rgb;
use serde::{Deserialize, Serialize};

/// What was met while rendering; summed over units, shown in the job's summary and the image's metadata.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Counters {
    /// Image samples, light paths or mutations.
    pub samples: u64,
    /// Rays traced (closest hit and occlusion).
    pub rays: u64,
    /// Contributions dropped because they were NaN or infinite.
    pub non_finite: u64,
    /// Contributions dropped because they were negative.
    pub negative: u64,
}

impl Counters {
    /// Adds another unit's counts.
    pub fn add(&mut self, o: &Self) {
        self.samples += o.samples;
        self.rays += o.rays;
        self.non_finite += o.non_finite;
        self.negative += o.negative;
    }

    /// Whether a contribution may be added to a sum; counts those that may not.
    #[inline]
    pub fn admit(&mut self, v: Rgb) -> bool {
        if v.is_valid() {
            return true;
        }
        if v.r.is_finite() && v.g.is_finite() && v.b.is_finite() {
            self.negative += 1;
        } else {
            self.non_finite += 1;
        }
        false
    }
}
