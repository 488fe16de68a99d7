//! The colour spaces of FLIP. Constants as in the reference implementation (NVIDIA FLIP 1.7).

use renderer::math::fns::pow;

/// D65.
const WHITE: [f32; 3] = [0.950_428_55, 1.0, 1.088_900_4];

/// Linear Rec.709 to CIE XYZ, relative to the white point.
fn xyz([r, g, b]: [f32; 3]) -> [f32; 3] {
    let x = (10_135_552.0 * r + 8_788_810.0 * g + 4_435_075.0 * b) / 24_577_794.0;
    let y = (2_613_072.0 * r + 8_788_810.0 * g + 887_015.0 * b) / 12_288_897.0;
    let z = (1_425_312.0 * r + 8_788_810.0 * g + 70_074_185.0 * b) / 73_733_382.0;
    [x / WHITE[0], y / WHITE[1], z / WHITE[2]]
}

/// CIE XYZ relative to the white point to linear Rec.709.
fn rgb(relative: [f32; 3]) -> [f32; 3] {
    let [x, y, z] = [relative[0] * WHITE[0], relative[1] * WHITE[1], relative[2] * WHITE[2]];
    [
        3.241_003_3 * x - 1.537_398_9 * y - 0.498_615_86 * z,
        -0.969_224_33 * x + 1.875_930_1 * y + 0.041_554_224 * z,
        0.055_639_423 * x - 0.204_011_2 * y + 1.057_148_9 * z,
    ]
}

/// Linear Rec.709 to the opponent space YCxCz, in which vision blurs the channels one by one.
pub fn ycxcz(linear: [f32; 3]) -> [f32; 3] {
    let [x, y, z] = xyz(linear);
    [116.0 * y - 16.0, 500.0 * (x - y), 200.0 * (y - z)]
}

/// YCxCz to linear Rec.709.
pub fn from_ycxcz([y, cx, cz]: [f32; 3]) -> [f32; 3] {
    let y = (y + 16.0) / 116.0;
    rgb([y + cx / 500.0, y, y - cz / 200.0])
}

/// Linear Rec.709 to L*a*b* with a and b scaled by lightness (the Hunt effect).
pub fn hunt_lab(linear: [f32; 3]) -> [f32; 3] {
    const DELTA: f32 = 6.0 / 29.0;
    let f = |t: f32| {
        if t > DELTA * DELTA * DELTA { pow(t, 1.0 / 3.0) } else { t / (3.0 * DELTA * DELTA) + 4.0 / 29.0 }
    };
    let [x, y, z] = xyz(linear).map(f);
    let l = 116.0 * y - 16.0;
    [l, 0.01 * l * 500.0 * (x - y), 0.01 * l * 200.0 * (y - z)]
}

/// HyAB distance: city block in lightness, Euclidean in chroma.
pub fn hyab(a: [f32; 3], b: [f32; 3]) -> f32 {
    let (da, db) = (a[1] - b[1], a[2] - b[2]);
    (a[0] - b[0]).abs() + (da * da + db * db).sqrt()
}
