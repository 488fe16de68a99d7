//! Pictures for the page: PNGs in base 64.

use crate::error::measure::Target;
use base64::Engine;
use compare::{flip, map, pair::Pair};
use renderer::film::png;

/// The relative deviation that the brightest colour stands for.
pub const WORST: f64 = 1.0;

fn encode(png: &[u8]) -> String {
    base64::engine::general_purpose::STANDARD.encode(png)
}

/// Radiance, by the tone curve of lightfarm's PNGs.
pub fn of_pixels(pixels: &[[f32; 3]], (w, h): (u32, u32)) -> Result<String, String> {
    Ok(encode(&png::encode_pixels(w, h, pixels, 0.0)?))
}

/// The same of a reference.
pub fn of_radiance(mean: &[[f64; 3]], size: (u32, u32)) -> Result<String, String> {
    let pixels: Vec<[f32; 3]> = mean.iter().map(|p| p.map(|v| v as f32)).collect();
    of_pixels(&pixels, size)
}

/// Root mean square over renders and channels of (I - R) / sqrt(R^2 + 0.01), less the variance of the reference; its square root, so
/// that small deviations can be told apart as well.
pub fn deviation(renders: &[&[[f32; 3]]], target: &Target, (w, h): (u32, u32)) -> Result<String, String> {
    let shade = |i: usize| {
        let mut sum = 0.0;
        for c in 0..3 {
            let (r, v) = (target.mean[i][c], target.variance[i][c]);
            let squares = renders.iter().map(|p| (f64::from(p[i][c]) - r) * (f64::from(p[i][c]) - r));
            sum += (squares.sum::<f64>() / renders.len() as f64 - v).max(0.0) / (r * r + 0.01);
        }
        ((sum / 3.0).sqrt() / WORST).sqrt() as f32
    };
    let shades: Vec<f32> = (0..target.mean.len()).map(shade).collect();
    let valid = shades.iter().map(|s| s.is_finite()).collect();
    let pair = Pair { width: w, height: h, a: Vec::new(), b: Vec::new(), valid };
    Ok(encode(&map::encode(&shades, &pair)?))
}

/// The map of HDR-FLIP (LDR where the reference is black).
pub fn flip(pixels: &[[f32; 3]], reference: &[[f64; 3]], (w, h): (u32, u32)) -> Result<String, String> {
    let reference = reference.iter().map(|p| p.map(|v| v as f32)).collect();
    let pair = Pair::from_pixels(w, h, pixels.to_vec(), reference);
    let found = flip::hdr(&pair).unwrap_or_else(|| flip::ldr(&pair));
    Ok(encode(&map::encode(&found.map, &pair)?))
}
