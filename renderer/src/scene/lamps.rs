//! Lamps that lie in the plane of another surface, where rounding decides which of the two is in front.

use super::Scene;
use super::desc::ShapeDesc;
use crate::diagnostics::Diagnostics;
use crate::light::Light;
use crate::math::{Ray, Vec2};

/// More lamps are not looked at.
const MOST: usize = 4096;
/// Points of each lamp that are looked at.
const POINTS: u32 = 16;

impl Scene {
    /// Warns of lamps that share their place with another surface, which rays meet instead: they would light the scene, but not be
    /// seen from it.
    pub(super) fn warn_of_covered_lamps(&self, shapes: &[ShapeDesc], file: &str, diagnostics: &mut Diagnostics) {
        let lamps = self.lights.iter().filter_map(|l| if let Light::Area(lamp) = l { Some(lamp.object()) } else { None });
        for lamp in lamps.take(MOST) {
            let name = |object: crate::geometry::ObjectId| &shapes[object.0 as usize].name;
            let count = u64::from(self.geometry.primitive_count(lamp));
            let cover = (0..POINTS).find_map(|i| {
                let primitive = (u64::from(i) * count / u64::from(POINTS)) as u32;
                let step = i as f32 + 0.5;
                let u = Vec2::new((step / POINTS as f32).fract(), (step * 0.618_034).fract());
                let s = self.geometry.sample_area(lamp, primitive, u);
                // From just above: nearer than what coordinates can tell from far away.
                let unit = f32::EPSILON * s.p.abs().max_element();
                let above = 256.0 * unit;
                let hit = self.accel.intersect(&Ray::new(s.p + s.ng * above, -s.ng))?;
                (hit.object != lamp && (hit.t - above).abs() <= 16.0 * unit).then_some(hit.object)
            });
            if let Some(cover) = cover {
                let message = format!("the lamp {:?} lies in the same place as {:?}", name(lamp), name(cover));
                let help = "move it off the other, by a thousandth of its size or so: rounding decides which of them is seen";
                diagnostics.warn(file, name(lamp).clone(), message, help);
            }
        }
    }
}
