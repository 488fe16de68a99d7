//! An error map for looking at.

use super::pair::Pair;
use renderer::film::png;

/// The bytes of a PNG of `map` (0 = no difference, 1 = the largest), black to violet, orange and pale yellow; green where the pixels
/// can't be compared.
pub fn encode(map: &[f32], pair: &Pair) -> Result<Vec<u8>, String> {
    let bytes: Vec<u8> =
        map.iter().zip(&pair.valid).flat_map(|(v, valid)| if *valid { ramp(*v) } else { [0, 255, 0] }).collect();
    png::encode_bytes(pair.width, pair.height, &bytes)
}

/// Nine colours of the map `magma` (Smith and van der Walt, CC0), linear in between.
const MAGMA: [[u8; 3]; 9] = [
    [0, 0, 4],
    [28, 16, 68],
    [79, 18, 123],
    [129, 37, 129],
    [181, 54, 122],
    [229, 80, 100],
    [251, 135, 97],
    [254, 194, 135],
    [252, 253, 191],
];

fn ramp(v: f32) -> [u8; 3] {
    let x = if v > 0.0 { 8.0 * v.min(1.0) } else { 0.0 };
    let i = (x as usize).min(7);
    let s = x - i as f32;
    std::array::from_fn(|c| {
        let (low, high) = (f32::from(MAGMA[i][c]), f32::from(MAGMA[i + 1][c]));
        (low + s * (high - low) + 0.5) as u8
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_ramp_gets_brighter_from_end_to_end() {
        let brightness = |v: f32| ramp(v).iter().map(|b| u32::from(*b)).sum::<u32>();
        assert_eq!((ramp(0.0), ramp(1.0), ramp(f32::NAN)), (MAGMA[0], MAGMA[8], MAGMA[0]));
        assert!((0..100).all(|i| brightness(i as f32 / 100.0) <= brightness((i + 1) as f32 / 100.0)));
    }
}
