//! PNG for looking at: exposure, a soft shoulder, sRGB, 8 bits. No dither: the same image gives the same bytes.

use super::MergedImage;
use crate::math::fns::pow;
use ::image::codecs::png::{CompressionType, FilterType, PngEncoder};
use ::image::{ExtendedColorType, ImageEncoder};

/// Linear value up to which the tone curve changes nothing; 0.8 is sRGB 0.906.
const SHOULDER: f32 = 0.8;

/// The bytes of a PNG file of `image`, exposed by `exposure` stops.
pub fn encode(image: &MergedImage, exposure: f64) -> Result<Vec<u8>, String> {
    encode_pixels(image.width, image.height, &image.mean, exposure)
}

/// The bytes of a PNG file of linear Rec.709 `pixels`, row by row.
pub fn encode_pixels(width: u32, height: u32, pixels: &[[f32; 3]], exposure: f64) -> Result<Vec<u8>, String> {
    let scale = pow(2.0, exposure as f32);
    let table = SrgbTable::new();
    let bytes: Vec<u8> = pixels.iter().flat_map(|p| p.map(|v| table.byte(tone(v * scale)))).collect();
    encode_bytes(width, height, &bytes)
}

/// The bytes of a PNG file of 8-bit RGB triples that are sRGB already.
pub fn encode_bytes(width: u32, height: u32, rgb: &[u8]) -> Result<Vec<u8>, String> {
    let mut out = Vec::new();
    PngEncoder::new_with_quality(&mut out, CompressionType::Fast, FilterType::Adaptive)
        .write_image(rgb, width, height, ExtendedColorType::Rgb8)
        .map_err(|e| e.to_string())?;
    Ok(out)
}

/// The tone curve of one channel: the identity up to [`SHOULDER`] s, then `s + (1 - s) t / (1 + t)` with `t = (x - s) / (1 - s)`,
/// which goes on with the same slope and reaches 1 at infinity. Negative values and NaN are black.
fn tone(x: f32) -> f32 {
    if !(x > 0.0) {
        0.0
    } else if x <= SHOULDER {
        x
    } else if x.is_infinite() {
        1.0
    } else {
        let t = (x - SHOULDER) / (1.0 - SHOULDER);
        SHOULDER + (1.0 - SHOULDER) * (t / (1.0 + t))
    }
}

/// Linear to sRGB bytes by thresholds: far cheaper than a power per value, and the same result.
struct SrgbTable {
    /// The least linear value of each byte.
    least: [f32; 256],
    /// For each 4096th of [0, 1], the byte of its lower end.
    start: [u8; 4096],
}

impl SrgbTable {
    fn new() -> Self {
        // Byte n stands for sRGB values from (n - 0.5) / 255 on (IEC 61966-2-1).
        let least = std::array::from_fn(|n| {
            let s = (n as f32 - 0.5) / 255.0;
            if s <= 0.04045 { s / 12.92 } else { pow((s + 0.055) / 1.055, 2.4) }
        });
        let mut table = Self { least, start: [0; 4096] };
        for i in 0..4096 {
            table.start[i] = table.least.partition_point(|l| *l <= i as f32 / 4096.0).saturating_sub(1) as u8;
        }
        table
    }

    fn byte(&self, linear: f32) -> u8 {
        let mut n = self.start[((linear * 4096.0) as usize).min(4095)];
        while n < 255 && self.least[usize::from(n) + 1] <= linear {
            n += 1;
        }
        n
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bytes_are_rounded_srgb() {
        let table = SrgbTable::new();
        for i in 0..=100_000 {
            let x = i as f32 / 100_000.0;
            let srgb = if x <= 0.003_130_8 { 12.92 * x } else { 1.055 * pow(x, 1.0 / 2.4) - 0.055 };
            let exact = srgb * 255.0;
            assert!((f32::from(table.byte(x)) - exact).abs() <= 0.502, "{x}: {} for {exact}", table.byte(x));
        }
    }

    #[test]
    fn the_tone_curve_rises_smoothly_and_never_clips() {
        let mut last = (0.0, 0.0);
        for i in 1..40_000 {
            let x = i as f32 * 1e-3;
            let y = tone(x);
            assert!(y >= last.1 && y < 1.0, "{x}: {y}");
            assert!((y - last.1) / (x - last.0) < 1.001, "steeper than the identity at {x}");
            last = (x, y);
        }
        assert_eq!((tone(0.5), tone(f32::INFINITY), tone(f32::NAN), tone(-1.0)), (0.5, 1.0, 0.0, 0.0));
    }

    #[test]
    fn a_decoder_reads_the_same_pixels() {
        let pixels = [[0.0, 0.5, 1e9], [0.214_041_14, -1.0, 0.05]];
        let png = encode_pixels(2, 1, &pixels, 0.0).unwrap();
        let back = image::load_from_memory(&png).unwrap().to_rgb8();
        assert_eq!(back.as_raw(), &[0, 188, 255, 128, 0, 63]);
        assert_eq!(png, encode_pixels(2, 1, &pixels, 0.0).unwrap());
        let brighter = image::load_from_memory(&encode_pixels(2, 1, &pixels, 1.0).unwrap()).unwrap().to_rgb8();
        assert_eq!(brighter.get_pixel(1, 0).0, [175, 0, 89]);
    }
}
