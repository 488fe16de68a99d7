//! Lamps that rounding changes: those in the plane of another surface, where it decides which of the two is in front, and those so
//! small that it changes their area.

use super::Scene;
use super::desc::ShapeDesc;
use crate::diagnostics::Diagnostics;
use crate::geometry::{Geometry, Object, ObjectId, Shape};
use crate::light::Light;
use crate::math::{DMat3, Ray, Vec2};

/// More lamps are not looked at.
const MOST: usize = 4096;
/// A relative change of the area, and so of the light, beyond which there is a warning.
const CHANGE: f64 = 0.01;
/// Points of each lamp that are looked at.
const POINTS: u32 = 16;

impl Scene {
    /// Warns of lamps that share their place with another surface, which rays meet instead: they would light the scene, but not be
    /// seen from it.
    pub(super) fn warn_of_covered_lamps(&self, shapes: &[ShapeDesc], file: &str, diagnostics: &mut Diagnostics) {
        let lamps =
            self.lights.iter().filter_map(|l| if let Light::Area(lamp) = l { Some(lamp.object()) } else { None });
        for lamp in lamps.take(MOST) {
            let name = |object: ObjectId| &shapes[object.0 as usize].name;
            let count = u64::from(self.geometry.primitive_count(lamp));
            let covers: Vec<ObjectId> = (0..POINTS)
                .filter_map(|i| {
                    let primitive = (u64::from(i) * count / u64::from(POINTS)) as u32;
                    let step = i as f32 + 0.5;
                    let u = Vec2::new((step / POINTS as f32).fract(), (step * 0.618_034).fract());
                    let s = self.geometry.sample_area(lamp, primitive, u);
                    // From just above: nearer than what coordinates can tell from far away.
                    let unit = f32::EPSILON * s.p.abs().max_element();
                    let above = 256.0 * unit;
                    let hit = self.accel.intersect(&Ray::new(s.p + s.ng * above, -s.ng))?;
                    (hit.object != lamp && (hit.t - above).abs() <= 16.0 * unit).then_some(hit.object)
                })
                .collect();
            // A few covered points are no more than a glowing box that stands on the floor.
            if 4 * covers.len() > POINTS as usize {
                let cover = covers[0];
                let message = format!("the lamp {:?} lies in the same place as {:?}", name(lamp), name(cover));
                let help =
                    "move it off the other, by a thousandth of its size or so: rounding decides which of them is seen";
                diagnostics.warn(file, name(lamp).clone(), message, help);
            }
        }
    }
}

/// Area of a shape's mesh as it is described, in double precision; `None` for other shapes and those that do not emit.
pub(super) fn described_area(shape: &ShapeDesc, object: &Object, geometry: &Geometry) -> Option<f64> {
    let (Shape::Mesh(id), true) = (object.shape, shape.emission.is_some()) else { return None };
    let (mesh, m): (_, DMat3) = (&geometry.meshes[id.0 as usize], shape.to_world.matrix3);
    let area = |t: &[u32; 3]| {
        let [a, b, c] = t.map(|i| mesh.positions[i as usize].as_dvec3());
        (m * (b - a)).cross(m * (c - a)).length()
    };
    Some(0.5 * mesh.triangles.iter().map(area).sum::<f64>())
}

/// Warns of a lamp that has another area than was described.
pub(super) fn warn_of_rounded_area(
    described: f64,
    id: ObjectId,
    geometry: &Geometry,
    shape: &ShapeDesc,
    (file, diagnostics): (&str, &mut Diagnostics),
) {
    let area: f64 = (0..geometry.primitive_count(id)).map(|i| f64::from(geometry.area(id, i))).sum();
    let change = area / described - 1.0;
    if change.abs() > CHANGE {
        let name = &shape.name;
        let message = format!(
            "the corners of the lamp {name:?} are so near each other that single precision changes its area by {:.1} %",
            100.0 * change
        );
        let help = "a disk or a sphere keeps its area; or bring it nearer to the origin";
        diagnostics.warn(file, name.clone(), message, help);
    }
}
