//! Scenes that use every number which TOML and Mitsuba files can hold.

use std::ops::Range;

/// lightfarm's own format: every key of `scenes/REFERENCE.md` that takes a number.
pub const TOML: &str = r##"medium = 'air'
[render]
spp = 4
size = [16, 8]
max_depth = 5
rr_depth = 3
seed = 1
filter = { kind = 'gaussian', stddev = 0.5 }
[camera]
from = [0.1, 1.2, 5.3]
to = [0.2, 0.3, 0.4]
up = [0.01, 1.5, 0.02]
fov = 45.5
aperture_radius = 0.01
focus_distance = 4.5
[textures.written]
kind = 'image'
size = [2, 1]
pixels = [[0.1, 0.2, 0.3], 0.4]
scale = [0.5, 0.6, 0.7]
uv = { scale = [2.0, 3.0], rotate = 30.5, translate = [0.1, 0.2] }
[textures.board]
kind = 'checkerboard'
a = 0.4
b = [0.1, 0.2, 0.3]
uv = { scale = 2.5 }
[materials.grey]
kind = 'diffuse'
reflectance = 0.5
[materials.painted]
kind = 'diffuse'
reflectance = { texture = 'written', scale = 0.9 }
[materials.gold]
kind = 'conductor'
eta = [0.2, 0.3, 1.4]
k = [3.9, 2.4, 1.6]
reflectance = [0.9, 0.8, 0.7]
alpha = 0.2
[materials.brushed]
kind = 'conductor'
metal = 'Al'
alpha = [0.1, { texture = 'board', channel = 'red', scale = 0.5 }]
[materials.glass]
kind = 'dielectric'
ior = 1.5
exterior_ior = 1.1
reflectance = 0.9
transmittance = [0.8, 0.9, 1.0]
alpha = 0.3
[materials.plastic]
kind = 'gltf'
base_color = [0.8, 0.2, 0.1]
metallic = 0.1
roughness = 0.6
ior = 1.4
transmission = 0.2
[materials.bumpy]
kind = 'normal-map'
material = 'grey'
texture = 'written'
scale = 0.7
[materials.nothing]
kind = 'null'
[meshes.tile]
positions = [[0.0, 0.1, 0.2], [1.0, 0.1, 0.2], [0.0, 1.1, 0.2]]
triangles = [[0, 1, 2]]
normals = [[0.0, 0.1, 1.0], [0.0, 0.2, 1.0], [0.1, 0.0, 1.0]]
uvs = [[0.0, 0.1], [1.0, 0.1], [0.0, 1.1]]
[media.air]
sigma_t = [0.1, 0.2, 0.3]
albedo = 0.5
scale = 0.5
[media.milk]
sigma_a = 0.1
sigma_s = [1.1, 1.2, 1.3]
g = 0.5
[[shapes]]
kind = 'sphere'
center = [0.5, 0.6, 0.7]
radius = 0.3
material = 'nothing'
interior = 'milk'
priority = 2
[[shapes]]
kind = 'mesh'
mesh = 'tile'
material = 'painted'
transform = [{ translate = [1.5, 2.5, 3.5] }, { scale = 2.5 }, { scale = [1.5, 2.5, 3.5] }, { rotate_x = 10.5 }]
emission = [1.5, 2.5, 3.5]
[[shapes]]
kind = 'cube'
material = 'gold'
transform = [{ rotate_y = 20.5 }, { rotate_z = 30.5 }, { rotate = 40.5, axis = [1.5, 2.5, 3.5] }]
instances = [[{ translate = [4.5, 5.5, 6.5] }], [{ translate = [7.5, 8.5, 9.5] }]]
[[shapes]]
kind = 'rectangle'
material = 'glass'
transform = [{ look_at = { from = [0.1, 3.2, 0.3], to = [0.4, 0.5, 0.6], up = [1.1, 0.2, 0.3] } }]
[[shapes]]
kind = 'disk'
material = 'plastic'
emission = 0.5
transform = [{ matrix = [[1.1, 0.2, 0.3, 0.4], [0.5, 1.6, 0.7, 0.8], [0.9, 0.1, 1.2, 0.3]] }]
[[shapes]]
kind = 'cube'
material = 'brushed'
transform = [{ translate = [0.5, -9.5, 0.5] }]
[[shapes]]
kind = 'cube'
material = 'bumpy'
transform = [{ translate = [0.5, -19.5, 0.5] }]
[[lights]]
kind = 'point'
position = [0.1, 0.2, 0.3]
intensity = [1.1, 1.2, 1.3]
[[lights]]
kind = 'spot'
position = [0.4, 0.5, 0.6]
direction = [0.1, -1.2, 0.3]
intensity = 1.5
cutoff = 30.5
beam = 20.5
[[lights]]
kind = 'spot'
position = [0.4, 0.5, 0.6]
to = [0.1, -1.2, 0.3]
[[lights]]
kind = 'directional'
direction = [0.1, -1.2, 0.3]
irradiance = [1.1, 1.2, 1.3]
[[lights]]
kind = 'constant'
radiance = 0.5
[[lights]]
kind = 'environment'
size = [2, 1]
pixels = [[0.1, 0.2, 0.3], 0.4]
scale = [0.1, 0.2, 0.3]
transform = [{ rotate_y = 10.5 }]
"##;

/// Mitsuba's format.
pub const XML: &str = r##"<scene version="3.0.0">
  <integrator type="path">
    <integer name="max_depth" value="5"/>
    <integer name="rr_depth" value="3"/>
  </integrator>
  <sensor type="thinlens">
    <float name="fov" value="45.5"/>
    <float name="aperture_radius" value="0.01"/>
    <float name="focus_distance" value="4.5"/>
    <transform name="to_world"><lookat origin="0.1, 1.2, 5.3" target="0.2, 0.3, 0.4" up="0.01, 1.5, 0.02"/></transform>
    <film type="hdrfilm">
      <integer name="width" value="16"/>
      <integer name="height" value="8"/>
      <rfilter type="gaussian"><float name="stddev" value="0.5"/></rfilter>
    </film>
    <sampler type="independent"><integer name="sample_count" value="4"/><integer name="seed" value="1"/></sampler>
  </sensor>
  <bsdf type="diffuse" id="grey"><rgb name="reflectance" value="0.1, 0.2, 0.3"/></bsdf>
  <bsdf type="diffuse" id="board">
    <texture name="reflectance" type="checkerboard">
      <rgb name="color0" value="0.4"/>
      <rgb name="color1" value="0.1 0.2 0.3"/>
      <transform name="to_uv"><scale x="2.5" y="3.5"/><translate x="0.5" y="0.6"/></transform>
    </texture>
  </bsdf>
  <bsdf type="roughconductor" id="gold">
    <rgb name="eta" value="0.2 0.3 1.4"/>
    <rgb name="k" value="3.9 2.4 1.6"/>
    <rgb name="specular_reflectance" value="0.9 0.8 0.7"/>
    <float name="alpha" value="0.2"/>
  </bsdf>
  <bsdf type="roughconductor" id="brushed">
    <float name="alpha_u" value="0.2"/>
    <float name="alpha_v" value="0.3"/>
  </bsdf>
  <bsdf type="roughdielectric" id="glass">
    <float name="int_ior" value="1.5"/>
    <float name="ext_ior" value="1.1"/>
    <float name="alpha" value="0.3"/>
    <rgb name="specular_reflectance" value="0.9"/>
    <rgb name="specular_transmittance" value="0.8 0.9 1.0"/>
  </bsdf>
  <medium type="homogeneous" id="milk">
    <rgb name="sigma_t" value="1.1 1.2 1.3"/>
    <rgb name="albedo" value="0.5 0.6 0.7"/>
    <float name="scale" value="2.5"/>
    <phase type="hg"><float name="g" value="0.5"/></phase>
  </medium>
  <medium type="homogeneous" id="tea">
    <rgb name="sigma_a" value="0.1 0.2 0.3"/>
    <rgb name="sigma_s" value="0.5"/>
  </medium>
  <shape type="sphere">
    <point name="center" x="0.5" y="0.6" z="0.7"/>
    <float name="radius" value="0.3"/>
    <ref id="glass"/>
    <ref name="interior" id="milk"/>
  </shape>
  <shape type="cube">
    <transform name="to_world">
      <translate x="1.5" y="2.5" z="3.5"/>
      <scale value="2.5"/>
      <scale x="1.5" y="2.5" z="3.5"/>
      <rotate x="1.5" y="2.5" z="3.5" angle="40.5"/>
    </transform>
    <ref id="gold"/>
    <ref name="interior" id="tea"/>
  </shape>
  <shape type="rectangle">
    <transform name="to_world">
      <matrix value="1.1 0.2 0.3 0.4 0.5 1.6 0.7 0.8 0.9 0.1 1.2 0.3 0 0 0 1"/>
    </transform>
    <emitter type="area"><rgb name="radiance" value="1.5 2.5 3.5"/></emitter>
    <ref id="board"/>
  </shape>
  <shape type="disk"><ref id="brushed"/></shape>
  <shape type="shapegroup" id="group"><shape type="cube"><ref id="grey"/></shape></shape>
  <shape type="instance">
    <ref id="group"/>
    <transform name="to_world"><translate x="5.5" y="6.5" z="7.5"/></transform>
  </shape>
  <emitter type="point">
    <point name="position" x="0.1" y="0.2" z="0.3"/>
    <rgb name="intensity" value="1.1 1.2 1.3"/>
  </emitter>
  <emitter type="spot">
    <transform name="to_world"><lookat origin="0.1, 3.2, 0.3" target="0.4, 0.5, 0.6" up="1.1, 0.2, 0.3"/></transform>
    <rgb name="intensity" value="1.5"/>
    <float name="cutoff_angle" value="30.5"/>
    <float name="beam_width" value="20.5"/>
  </emitter>
  <emitter type="directional">
    <vector name="direction" x="0.1" y="-1.2" z="0.3"/>
    <rgb name="irradiance" value="1.1 1.2 1.3"/>
  </emitter>
  <emitter type="constant"><rgb name="radiance" value="0.5"/></emitter>
</scene>
"##;

fn starts_number(text: &[u8], i: usize) -> bool {
    let digit = |i: usize| text.get(i).is_some_and(u8::is_ascii_digit);
    let free = i == 0 || !(text[i - 1].is_ascii_alphanumeric() || b"_.-+#".contains(&text[i - 1]));
    free && (digit(i) || text[i] == b'-' && digit(i + 1))
}

fn end_of_number(text: &[u8], start: usize) -> usize {
    let part = |i: usize| {
        text[i].is_ascii_digit()
            || text[i] == b'.'
            || text[i] == b'e'
            || (b"+-".contains(&text[i]) && (i == start || text[i - 1] == b'e'))
    };
    (start..text.len()).find(|&i| !part(i)).unwrap_or(text.len())
}

/// Numbers outside of quoted strings and of comments, which begin with `comment` and end with the line.
pub fn outside_of_strings(text: &str, comment: Option<char>) -> Vec<Range<usize>> {
    let bytes = text.as_bytes();
    let (mut found, mut i) = (Vec::new(), 0);
    while i < bytes.len() {
        let c = bytes[i];
        if c == b'"' || c == b'\'' {
            i += 1 + bytes[i + 1..].iter().position(|b| *b == c).unwrap_or(bytes.len() - i - 1);
        } else if comment.is_some_and(|k| c == k as u8) {
            i += bytes[i..].iter().position(|b| *b == b'\n').unwrap_or(bytes.len() - i);
        } else if starts_number(bytes, i) {
            let end = end_of_number(bytes, i);
            found.push(i..end);
            i = end;
            continue;
        }
        i += 1;
    }
    found
}

/// Numbers in the attributes of XML that hold values.
pub fn attributes(text: &str) -> Vec<Range<usize>> {
    const NAMES: [&str; 8] = ["value", "x", "y", "z", "angle", "origin", "target", "up"];
    let bytes = text.as_bytes();
    let mut found = Vec::new();
    for name in NAMES {
        let opening = format!(" {name}=\"");
        for (at, _) in text.match_indices(&opening) {
            let mut i = at + opening.len();
            while bytes[i] != b'"' {
                if starts_number(bytes, i) {
                    let end = end_of_number(bytes, i);
                    found.push(i..end);
                    i = end;
                } else {
                    i += 1;
                }
            }
        }
    }
    found
}
