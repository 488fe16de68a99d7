use super::import;
use crate::bsdf::{Material, MaterialId};
use crate::geometry::MeshId;
use crate::math::{DAffine3, DMat3, DVec3, Transform, Vec2, Vec3};
use crate::scene::desc::{Emission, ShapeKind};
use crate::spectrum::Rgb;
use crate::texture::RgbParam;

fn near(a: DAffine3, b: DAffine3) -> bool {
    a.abs_diff_eq(b, 1e-12)
}

#[test]
fn every_kind_of_shape() {
    let scene = import(
        "<shape type='rectangle' id='floor'/><shape type='cube'/><shape type='disk'><boolean name='flip_normals' value='true'/></shape>
         <shape type='sphere'><point name='center' x='1' y='2' z='3'/><float name='radius' value='2'/>
           <transform name='to_world'><scale value='10'/></transform></shape>
         <shape type='obj'><string name='filename' value='models/t.obj'/></shape>",
    );
    let kinds: Vec<ShapeKind> = scene.shapes.iter().map(|s| s.kind).collect();
    let mesh = ShapeKind::Mesh(MeshId(0));
    assert_eq!(kinds, [ShapeKind::Rectangle, ShapeKind::Cube, ShapeKind::Disk, ShapeKind::Sphere, mesh]);
    let names: Vec<&str> = scene.shapes.iter().map(|s| s.name.as_str()).collect();
    assert_eq!(names, ["floor", "cube 1", "disk 1", "sphere 1", "obj 1"]);
    assert!(scene.shapes[2].flip_normals && !scene.shapes[1].flip_normals);
    // Centre and radius come before the transform.
    let expected = DAffine3::from_scale_rotation_translation(
        DVec3::splat(20.0),
        Default::default(),
        10.0 * DVec3::new(1.0, 2.0, 3.0),
    );
    assert!(near(scene.shapes[3].to_world, expected), "{:?}", scene.shapes[3].to_world);
    assert!(scene.shapes.iter().all(|s| s.material == MaterialId(0)), "one default material");
    assert_eq!(scene.materials[0], Material::Lambert { reflectance: RgbParam::Const(Rgb::splat(0.5)) });
}

#[test]
fn emitters_make_shapes_shine() {
    let scene = import(
        "<shape type='rectangle'><emitter type='area'><rgb name='radiance' value='1 2 3'/></emitter></shape>
         <shape type='sphere'><emitter type='area'><texture name='radiance' type='checkerboard'/></emitter><ref id='m'/></shape>
         <bsdf type='diffuse' id='m'/>",
    );
    let emission = Emission { radiance: RgbParam::Const(Rgb::new(1.0, 2.0, 3.0)), two_sided: false };
    assert_eq!(scene.shapes[0].emission, Some(emission));
    assert!(matches!(scene.shapes[1].emission, Some(Emission { radiance: RgbParam::Texture(..), .. })));
    let black = Material::Lambert { reflectance: RgbParam::Const(Rgb::ZERO) };
    assert_eq!(scene.materials[scene.shapes[0].material.0 as usize], black, "an emitter without BSDF is black");
    assert_ne!(scene.materials[scene.shapes[1].material.0 as usize], black);
}

#[test]
fn transforms_apply_in_the_order_written() {
    let place = |steps: &str| {
        import(&format!("<shape type='cube'><transform name='to_world'>{steps}</transform></shape>")).shapes[0].to_world
    };
    let (t, s) =
        (DAffine3::from_translation(DVec3::new(1.0, 2.0, 3.0)), DAffine3::from_scale(DVec3::new(2.0, 1.0, 4.0)));
    assert!(near(place("<translate x='1' y='2' z='3'/><scale x='2' z='4'/>"), s * t));
    assert!(near(place("<scale value='2 1 4'/><translate value='1, 2, 3'/>"), t * s));
    assert!(near(
        place("<rotate y='1' angle='90'/>"),
        DAffine3::from_mat3(DMat3::from_cols(-DVec3::Z, DVec3::Y, DVec3::X))
    ));
    // Half a turn about (1, 1, 0) swaps x and y.
    assert!(near(
        place("<rotate x='2' y='2' angle='180'/>"),
        DAffine3::from_mat3(DMat3::from_cols(DVec3::Y, DVec3::X, -DVec3::Z))
    ));
    let matrix = place("<matrix value='1 2 3 4  0 5 6 7  0 0 8 9  0 0 0 1'/>");
    assert!(near(matrix, DAffine3::from_cols_array(&[1.0, 0.0, 0.0, 2.0, 5.0, 0.0, 3.0, 6.0, 8.0, 4.0, 7.0, 9.0])));
    assert!(near(place("<matrix value='2 0 0 0 3 0 0 0 4'/>"), DAffine3::from_scale(DVec3::new(2.0, 3.0, 4.0))));
    // +Z looks at the target, +Y is up, +X to the left of one who looks.
    let look = place("<lookat origin='1 0 0' target='1 0 -5' up='0 1 0'/>");
    assert!(near(look, DAffine3::from_mat3_translation(DMat3::from_diagonal(DVec3::new(-1.0, 1.0, -1.0)), DVec3::X)));
}

#[test]
fn obj_flips_v_and_gets_smooth_normals_unless_flat() {
    let obj =
        |more: &str| import(&format!("<shape type='obj'><string name='filename' value='models/t.obj'/>{more}</shape>"));
    let scene = obj("");
    assert_eq!(scene.meshes[0].uvs, [Vec2::new(0.0, 1.0), Vec2::new(1.0, 1.0), Vec2::new(0.0, 0.75)]);
    assert_eq!(scene.meshes[0].normals, [Vec3::Z; 3]);
    let scene = obj("<boolean name='face_normals' value='true'/><boolean name='flip_tex_coords' value='false'/>");
    assert!(scene.meshes[0].normals.is_empty());
    assert_eq!(scene.meshes[0].uvs[2], Vec2::new(0.0, 0.25));
}

#[test]
fn mirrored_meshes_turn_as_in_mitsuba() {
    // Mitsuba computes normals from the winding in world space: a mirrored mesh without normals is seen from its inside.
    let mirror = "<transform name='to_world'><scale x='-1'/></transform>";
    let file = "<string name='filename' value='models/t.obj'/>";
    let scene = import(&format!("<shape type='obj'>{file}{mirror}</shape>"));
    let to_world = Transform::new(scene.shapes[0].to_world).unwrap();
    assert_eq!(to_world.normal(scene.meshes[0].normals[0]), -Vec3::Z);
    assert!(!scene.shapes[0].flip_normals);
    let scene = import(&format!("<shape type='obj'>{file}{mirror}<boolean name='face_normals' value='true'/></shape>"));
    assert!(scene.shapes[0].flip_normals);
}

#[test]
fn meshes_are_shared() {
    let shape = |more: &str| format!("<shape type='obj'><string name='filename' value='models/t.obj'/>{more}</shape>");
    let scale = |v: &str| format!("<transform name='to_world'><scale value='{v}'/></transform>");
    let scene = import(&[shape(""), shape(&scale("3")), shape("<boolean name='face_normals' value='true'/>")].concat());
    let kinds: Vec<ShapeKind> = scene.shapes.iter().map(|s| s.kind).collect();
    let mesh = |i| ShapeKind::Mesh(MeshId(i));
    assert_eq!(kinds, [mesh(0), mesh(0), mesh(1)], "one mesh smooth, one flat");
    // Smooth normals depend on what the scale does to angles.
    let scene = import(&[shape(""), shape(&scale("1 2 1"))].concat());
    assert_eq!(scene.meshes.len(), 2);
}

#[test]
fn instances_place_groups() {
    let scene = import(
        "<shape type='shapegroup' id='g'>
           <shape type='cube'><transform name='to_world'><translate x='1'/></transform></shape><shape type='disk' id='d'/>
         </shape>
         <shape type='instance'><ref id='g'/><transform name='to_world'><scale value='2'/></transform></shape>
         <shape type='instance' id='second'><ref id='g'/></shape>",
    );
    let names: Vec<&str> = scene.shapes.iter().map(|s| s.name.as_str()).collect();
    assert_eq!(names, ["instance 1/cube 1", "instance 1/d", "second/cube 1", "second/d"]);
    let expected = DAffine3::from_scale(DVec3::splat(2.0)) * DAffine3::from_translation(DVec3::X);
    assert!(near(scene.shapes[0].to_world, expected));
}
