use super::*;

const WIDTH: u32 = 64;
const HEIGHT: u32 = 48;

/// Ramps, dark squares, a bright disk, noise and a corner whose red is too strong, in exactly representable steps.
fn pair(scale: f32) -> Pair {
    let mut state = 1u64;
    let mut noise = || {
        state = state.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = state;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        ((z ^ (z >> 31)) >> 40) as f32 / 16_777_216.0
    };
    let (mut a, mut b) = (Vec::new(), Vec::new());
    for (y, x) in (0..HEIGHT as i32).flat_map(|y| (0..WIDTH as i32).map(move |x| (y, x))) {
        let (mut test, mut reference) = ([0.0; 3], [0.0; 3]);
        for c in 0..3 {
            let mut v = x as f32 / 64.0 * ((1 + c) as f32 / 3.0) + 0.05;
            if (x - 40) * (x - 40) + (y - 20) * (y - 20) < 36 {
                v = 20.0;
            }
            if (x / 8 + y / 8) % 2 == 0 {
                v *= 0.25;
            }
            let noisy = v * (0.75 + 0.5 * noise());
            let corner = x < 16 && y >= 32;
            reference[c] = v * scale;
            test[c] = scale * if !corner { noisy } else { v * if c == 0 { 1.5 } else { 1.0 } };
        }
        a.push(test);
        b.push(reference);
    }
    Pair::from_pixels(WIDTH, HEIGHT, a, b)
}

/// (5, 40), (40, 20), (34, 20), (63, 47), (20, 10)
fn probes(flip: &Flip) -> [f32; 5] {
    [(5, 40), (40, 20), (34, 20), (63, 47), (20, 10)].map(|(x, y)| flip.map[y * WIDTH as usize + x])
}

fn agree(flip: &Flip, mean: f64, values: [f32; 5]) {
    assert!((flip.mean - mean).abs() < 2e-5, "mean {} for {mean}", flip.mean);
    for (got, want) in probes(flip).into_iter().zip(values) {
        assert!((got - want).abs() < 1e-4, "{:?} for {values:?}", probes(flip));
    }
}

// The expected values are those of NVIDIA's `flip_evaluator` 1.7 for the same pixels.

#[test]
fn ldr_flip_agrees_with_the_reference_implementation() {
    agree(&ldr(&pair(1.0)), 0.088_695_4, [0.147_409_5, 0.004_149_18, 0.031_276_8, 0.111_328_2, 0.076_507_04]);
}

#[test]
fn hdr_flip_agrees_with_the_reference_implementation() {
    agree(
        &hdr(&pair(1.0)).unwrap(),
        0.113_797_09,
        [0.265_909_55, 0.044_389_34, 0.051_414_31, 0.111_342_36, 0.077_157_51],
    );
    agree(
        &hdr(&pair(0.001)).unwrap(),
        0.113_797,
        [0.265_909_55, 0.044_389_41, 0.051_414_91, 0.111_342_6, 0.077_157_27],
    );
}

#[test]
fn equal_pictures_and_masked_pixels_have_no_difference() {
    let p = pair(1.0);
    let mut b = p.b.clone();
    b[100] = [f32::NAN; 3];
    let same = Pair::from_pixels(WIDTH, HEIGHT, b.clone(), b);
    assert_eq!((ldr(&same).mean, hdr(&same).unwrap().mean), (0.0, 0.0));
    let black = Pair::from_pixels(2, 2, vec![[1.0; 3]; 4], vec![[0.0; 3]; 4]);
    assert!(hdr(&black).is_none() && ldr(&black).mean > 0.5);
    // More than half of it black: the published median would be zero.
    let mostly = Pair::from_pixels(4, 1, vec![[1.0; 3]; 4], vec![[0.0; 3], [0.0; 3], [0.0; 3], [1.0; 3]]);
    assert!(hdr(&mostly).unwrap().mean > 0.5);
}
