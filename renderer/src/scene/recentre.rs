//! Scenes far from the origin are moved to it when they are loaded, while coordinates are still in double precision.

use super::desc::{LightDesc, SceneDesc, ShapeKind};
use crate::math::DVec3;

/// Scenes whose centre lies further from the origin than this many times half their size are moved: they would lose so much of
/// their coordinates' precision. All others keep their coordinates.
const FAR: f64 = 32.0;

/// Moves a scene that is small for its distance from the origin; returns what was subtracted from all coordinates.
///
/// That is a multiple of a power of two near the scene's size, so that coordinates which were given in single precision lose nothing.
pub(super) fn recentre(scene: &mut SceneDesc) -> DVec3 {
    let Some((low, high)) = bounds(scene) else { return DVec3::ZERO };
    let (centre, half) = (0.5 * (low + high), (0.5 * (high - low)).max_element());
    if !(centre.abs().max_element() > FAR * half && half > 0.0 && centre.is_finite()) {
        return DVec3::ZERO;
    }
    let step = f64::from_bits(half.to_bits() & !((1 << 52) - 1));
    let shift = (centre / step).round() * step;
    scene.shapes.iter_mut().for_each(|s| s.to_world.translation -= shift);
    scene.camera.to_world.translation -= shift;
    for light in &mut scene.lights {
        if let LightDesc::Point { position, .. } | LightDesc::Spot { position, .. } = light {
            *position -= shift;
        }
    }
    shift
}

/// A box around all shapes; `None` without any.
fn bounds(scene: &SceneDesc) -> Option<(DVec3, DVec3)> {
    let boxes: Vec<_> = scene.meshes.iter().map(|m| around(m.positions.iter().map(|p| p.as_dvec3()))).collect();
    let mut points = Vec::with_capacity(8 * scene.shapes.len());
    for shape in &scene.shapes {
        let (low, high) = match shape.kind {
            ShapeKind::Mesh(id) => match boxes.get(id.0 as usize) {
                Some(Some(own)) => *own,
                _ => continue,
            },
            ShapeKind::Disk | ShapeKind::Rectangle => (DVec3::new(-1.0, -1.0, 0.0), DVec3::new(1.0, 1.0, 0.0)),
            ShapeKind::Sphere | ShapeKind::Cube => (-DVec3::ONE, DVec3::ONE),
        };
        let corner =
            |i: u32| DVec3::from_array(std::array::from_fn(|k| if i >> k & 1 == 0 { low[k] } else { high[k] }));
        points.extend((0..8).map(|i| shape.to_world.transform_point3(corner(i))));
    }
    around(points.into_iter())
}

fn around(mut points: impl Iterator<Item = DVec3>) -> Option<(DVec3, DVec3)> {
    let first = points.next()?;
    Some(points.fold((first, first), |(low, high), p| (low.min(p), high.max(p))))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::bsdf::MaterialId;
    use crate::math::DAffine3;
    use crate::scene::desc::ShapeDesc;

    fn scene(centre: DVec3) -> SceneDesc {
        let shape = |x: f64| ShapeDesc {
            name: String::new(),
            kind: ShapeKind::Cube,
            to_world: DAffine3::from_translation(centre + DVec3::X * x),
            flip_normals: false,
            material: MaterialId(0),
            emission: None,
            interior: None,
            priority: 0,
        };
        SceneDesc { shapes: vec![shape(0.0), shape(1.5)], ..SceneDesc::default() }
    }

    #[test]
    fn only_far_scenes_move_and_by_whole_steps() {
        let mut near = scene(DVec3::splat(30.0));
        assert_eq!(recentre(&mut near), DVec3::ZERO);
        let far = DVec3::new(2e4, -3.25, 1e5);
        let mut moved = scene(far);
        moved.camera.to_world.translation = far + DVec3::Y;
        let shift = recentre(&mut moved);
        assert_eq!(shift, DVec3::new(20001.0, -3.0, 1e5));
        assert_eq!(moved.shapes[0].to_world.translation, far - shift);
        assert_eq!(moved.camera.to_world.translation, far + DVec3::Y - shift);
    }
}
