use super::{TRIANGLE, document, faults};
use crate::scene::import::load;
use crate::scene::import::tests::{assert_error, damage, files};

/// Asserts that the scene around `content` has one error, at `line` of its file, that contains `parts`.
#[track_caller]
fn fault(content: &str, line: usize, parts: &[&str]) {
    let errors = faults(content);
    assert_eq!(errors.len(), 1, "{errors:#?}");
    let place = format!("error: scene.xml, line {line}, column ");
    for part in parts.iter().chain(&[place.as_str()]) {
        assert!(errors[0].contains(part), "{part:?} is not in {:?}", errors[0]);
    }
}

#[test]
fn every_unsupported_place_is_listed_at_once() {
    let errors = faults(
        "<bsdf type='principled' id='p'/>\n<bsdf type='twosided'><bsdf type='roughplastic'/></bsdf>\n<shape type='cylinder'/>
         <emitter type='sunsky'/>\n<medium type='heterogeneous'/><bsdf type='difuse'/>",
    );
    let expected = [
        ("line 2, column 1", "the bsdf `principled` is not supported"),
        ("line 3, column 23", "the bsdf `roughplastic` is not supported"),
        ("line 4, column 1", "the shape `cylinder` is not supported"),
        ("line 5, column 10", "the emitter `sunsky` is not supported"),
        ("line 6, column 1", "the medium `heterogeneous` is not supported"),
        ("line 6, column 31", "did you mean `diffuse`?"),
    ];
    assert_eq!(errors.len(), expected.len(), "{errors:#?}");
    for (error, (place, part)) in errors.iter().zip(expected) {
        assert!(error.contains(place) && error.contains(part), "{place} {part}: {error}");
    }
}

#[test]
fn wrong_values_name_their_place() {
    let diffuse = |inner: &str| format!("<bsdf type='diffuse'>\n{inner}</bsdf>");
    fault(&diffuse("<rgb name='reflectance' value='1 nan 0'/>"), 3, &["\"nan\" is not a finite number"]);
    fault(&diffuse("<rgb name='reflectance' value='1 inf 0'/>"), 3, &["\"inf\""]);
    fault(&diffuse("<rgb name='reflectance' value='1 2'/>"), 3, &["one or three numbers"]);
    fault(&diffuse("<rgb name='reflectance' value='1.5'/>"), 3, &["`reflectance` is 1.5", "from 0 to 1"]);
    fault(&diffuse("<rgb name='reflectance' vaule='1'/>"), 3, &["<rgb> has no attribute `value`", "`vaule`"]);
    fault(&diffuse("<string name='reflectance' value='red'/>"), 3, &["<string>, expected <rgb>"]);
    fault(&diffuse("<ref name='reflectance' id='nothing'/>"), 3, &["no object has the id \"nothing\""]);
    fault(&diffuse("<spectrum name='reflectance' value='400:1 700:0'/>"), 3, &["by wavelength"]);
    fault("<shape type='sphere'>\n<float name='radius' value='-1'/></shape>", 3, &["`radius` is -1", "greater than 0"]);
    fault("<shape type='sphere'>\n<float name='radius' value='1e300'/></shape>", 3, &["finite number"]);
    fault("<shape type='cube'>\n<boolean name='flip_normals' value='yes'/></shape>", 3, &["true or false"]);
    let rough = |inner: &str| format!("<bsdf type='roughconductor'>\n{inner}</bsdf>");
    fault(&rough("<string name='distribution' value='phong'/>"), 3, &["\"phong\"", "beckmann, ggx"]);
    fault(&rough("<string name='material' value='Gold'/>"), 3, &["no conductor is called \"Gold\""]);
    fault(&rough("<float name='alpha_u' value='0.1'/>"), 2, &["both `alpha_u` and `alpha_v`"]);
}

#[test]
fn wrong_transforms_name_their_place() {
    let place = |step: &str| format!("<shape type='cube'><transform name='to_world'>\n{step}</transform></shape>");
    fault(&place("<matrix value='1 2 3'/>"), 3, &["16 numbers", "found 3"]);
    fault(&place("<matrix value='1 0 0 0 0 1 0 0 0 0 1 0 0 0 1 1'/>"), 3, &["last row"]);
    fault(&place("<rotate angle='5'/>"), 3, &["no length"]);
    fault(&place("<lookat origin='1 1 1' target='1 1 1'/>"), 3, &["same point"]);
    fault(&place("<rotat y='1' angle='5'/>"), 3, &["did you mean <rotate>?"]);
    fault(&place("<scale z='0'/>"), 2, &["singular"]);
    fault(
        "<shape type='sphere'><transform name='to_world'>\n<scale z='2'/></transform></shape>",
        2,
        &["same along all axes"],
    );
}

#[test]
fn wrong_structure_names_its_place() {
    fault("\n<bsdf type='twosided'/>", 3, &["one or two BSDFs inside, found 0"]);
    fault("\n<bsdf type='twosided'><bsdf type='dielectric'/></bsdf>", 3, &["can't be made two-sided"]);
    fault("<bsdf type='diffuse' id='a'/>\n<bsdf type='diffuse' id='a'/>", 3, &["the id \"a\" is given twice"]);
    fault("\n<bsdf type='twosided' id='a'><ref id='a'/></bsdf>", 3, &["contains itself"]);
    fault("\n<shape type='instance'/>", 3, &["needs one reference to a `shapegroup`"]);
    fault("\n<emitter type='area'/>", 3, &["lights a shape"]);
    fault("\n<bdsf type='diffuse'/>", 3, &["<bdsf> is not supported", "did you mean <bsdf>?"]);
    fault("\n<shape type='cube'><integrator type='path'/></shape>", 3, &["has no place in the shape `cube`"]);
    fault("\n<shape type='obj'/>", 3, &["needs a `filename`"]);
    fault("\n<shape type='cube' id='$who'/>", 3, &["$who has no value"]);
    fault("<shape type='obj'>\n<string name='filename' value='no.obj'/></shape>", 3, &["\"no.obj\"", "no such file"]);
    fault("<texture type='bitmap'>\n<string name='filename' value='models/t.obj'/></texture>", 3, &["models/t.obj"]);
    let group = "<shape type='shapegroup' id='g'>\n<shape type='cube'><emitter type='area'/></shape></shape>";
    fault(group, 3, &["can't be instanced"]);
}

#[test]
fn broken_files() {
    assert_error(
        &[("s.xml", b"<scene version='3.0.0'>\n<shape></scene>")],
        &["s.xml, line 2, column", "not well-formed"],
    );
    assert_error(&[("s.xml", b"<!DOCTYPE x [<!ENTITY a 'b'>]><scene version='3.0.0'/>")], &["s.xml, line 1"]);
    assert_error(&[("s.xml", b"<bsdf version='3.0.0'/>")], &["s.xml, line 1", "expected <scene>"]);
    assert_error(&[("s.xml", b"<scene version='3.0.0'>\n</scene>")], &["s.xml, line 1", "no sensor"]);
    assert_error(&[("s.xml", b"\xff\xfe")], &["s.xml, byte 0", "UTF-8"]);
    assert_error(&[("s.xml", b"")], &["s.xml, line 1"]);
    let (text, mesh) =
        (document("<shape type='obj'><string name='filename' value='m.obj'/></shape>"), b"v 0 0 0\nf 1 2 3\n");
    assert_error(&[("s.xml", text.as_bytes()), ("m.obj", mesh)], &["m.obj, line 2", "1 so far"]);
}

#[test]
fn hostile_documents_end() {
    // A file that includes itself twice, parameters that double, elements and references without end.
    let twice = document("<include filename='scene.xml'/><include filename='scene.xml'/>");
    assert!(load(&files(&[("scene.xml", twice.as_bytes())]), "scene.xml").is_err());
    let doubling: String = (0..60).map(|i| format!("<default name='p{}' value='$p{i}$p{i}'/>", i + 1)).collect();
    let text = document(&format!("<default name='p0' value='x'/>{doubling}<shape type='$p60'/>"));
    assert!(load(&files(&[("scene.xml", text.as_bytes())]), "scene.xml").is_err());
    let deep = document(&("<bsdf type='twosided'>".repeat(100_000) + &"</bsdf>".repeat(100_000)));
    assert!(load(&files(&[("scene.xml", deep.as_bytes())]), "scene.xml").is_err());
    let chain: String =
        (0..5000).map(|i| format!("<bsdf type='twosided' id='b{i}'><ref id='b{}'/></bsdf>", i + 1)).collect();
    assert!(load(&files(&[("scene.xml", document(&chain).as_bytes())]), "scene.xml").is_err());
    let many = "<foo/>".repeat(10_000);
    let Err(e) = load(&files(&[("scene.xml", document(&many).as_bytes())]), "scene.xml") else { panic!() };
    assert!(e.0.len() <= 201 && e.0.last().unwrap().message.contains("9800 more"), "{}", e.0.len());
}

#[test]
fn what_costs_the_parser_a_square_is_refused() {
    let many: String = (0..200_000).map(|i| format!(" a{i}=''")).collect();
    fault(&format!("\n<shape type='cube'{many}/>"), 3, &["more than 32 attributes"]);
    let deep: String = (0..50_000).map(|i| format!("<a xmlns:n{i}='x'>")).collect();
    fault(&format!("\n{deep}"), 3, &["name spaces"]);
    // Neither is found where there is no tag.
    let quiet = format!("<!-- <a xmlns:b='c'{many}> --><shape type='cube' id=\"a = b > c{many}\"/>");
    assert!(faults(&quiet).is_empty());
    let props: String = (0..2000).map(|i| format!("<float name='a{i}' value='1'/>")).collect();
    assert!(!faults(&format!("<shape type='cube'>{props}</shape>")).is_empty());
    let defaults: String = (0..2000).map(|i| format!("<default name='a{i}' value='1'/>")).collect();
    assert!(!faults(&defaults).is_empty());
    // Long names, and many of them, are not compared.
    let long = "n".repeat(2_000_000);
    fault(
        &format!("<bsdf type='diffuse' id='{long}'/><shape type='cube'>\n<ref id='{long}m'/></shape>"),
        3,
        &["no object"],
    );
}

#[test]
fn many_scales_of_one_mesh_end() {
    let shape = |i| {
        format!(
            "<shape type='obj'><string name='filename' value='models/t.obj'/><transform name='to_world'><scale x='1.{i}'/></transform></shape>"
        )
    };
    let (scene, warnings) = super::import_with_warnings(&(0..200).map(shape).collect::<String>());
    assert_eq!((scene.shapes.len(), warnings.len()), (200, 1), "{warnings:#?}");
    assert!(scene.meshes.len() <= 65, "{}", scene.meshes.len());
}

#[test]
fn damaged_scenes_never_panic() {
    let valid = "<scene version='3.0.0'><default name='x' value='2'/>
        <sensor type='thinlens'><float name='fov' value='40'/><float name='aperture_radius' value='0.1'/>
          <transform name='to_world'><lookat origin='0 1 5' target='0 0 0' up='0 1 0'/><rotate y='1' angle='20'/></transform>
          <film type='hdrfilm'><integer name='width' value='32'/><rfilter type='tent'/></film></sensor>
        <bsdf type='twosided' id='m'><bsdf type='roughconductor'><string name='material' value='Cu'/>
          <texture name='alpha' type='checkerboard'><transform name='to_uv'><scale x='$x'/></transform></texture></bsdf></bsdf>
        <shape type='obj'><string name='filename' value='t.obj'/><ref id='m'/></shape>
        <shape type='shapegroup' id='g'><shape type='sphere'><point name='center' x='1' y='0' z='0'/></shape></shape>
        <shape type='instance'><ref id='g'/><transform name='to_world'><matrix value='1 0 0 0 0 1 0 0 0 0 1 0 0 0 0 1'/></transform></shape>
        <shape type='disk'><emitter type='area'><rgb name='radiance' value='#ffee00'/></emitter></shape>
        <medium type='homogeneous' id='fog'><rgb name='sigma_t' value='1 2 3'/><phase type='hg'><float name='g' value='0.5'/></phase></medium>
        <shape type='cube'><bsdf type='null'/><ref name='interior' id='fog'/></shape>
        <emitter type='spot'><spectrum name='intensity' value='4'/></emitter></scene>";
    let mut loaded = 0;
    damage(valid.as_bytes(), 4000, |bytes| {
        loaded += u32::from(load(&files(&[("s.xml", bytes), ("t.obj", TRIANGLE)]), "s.xml").is_ok());
    });
    // Some damage is harmless (a digit for another); most is not.
    assert!((1..3000).contains(&loaded), "{loaded}");
}
