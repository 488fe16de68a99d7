//! Unidirectional path tracing.

use super::UnitContext;
use crate::film::{Aov, Counters, Rect, TileSums};
use crate::spectrum::Rgb;
use std::ops::Range;

/// Renders samples `samples` of each pixel of a tile; `None` when stopped.
pub fn render_tile(c: &UnitContext<'_>, rect: Rect, samples: Range<u32>, counters: &mut Counters) -> Option<TileSums> {
    if (c.stopped)() {
        return None;
    }
    counters.samples += rect.area() as u64 * u64::from(samples.end - samples.start);
    let aovs = if c.replicate == 0 { vec![Aov::default(); rect.area()] } else { Vec::new() };
    Some(TileSums { rect, samples: samples.end - samples.start, sums: vec![Rgb::ZERO; rect.area()], aovs })
}
