//! PNG and JPEG: 8- and 16-bit samples to linear f32.

use super::{ImageKind, ImageLimits};
use crate::math::pow64;
use crate::spectrum::Rgb;
use crate::texture::Image;
use image::{DynamicImage, ImageBuffer, ImageDecoder, ImageFormat, ImageReader};
use std::io::Cursor;
use std::sync::OnceLock;
use zune_jpeg::JpegDecoder;
use zune_jpeg::zune_core::bytestream::ZCursor;
use zune_jpeg::zune_core::colorspace::ColorSpace;
use zune_jpeg::zune_core::options::DecoderOptions;

/// PNG of any bit depth and colour type; gamma and colour profiles are not applied, as glTF 2.0 (3.8.3) demands.
pub(super) fn decode_png(bytes: &[u8], kind: ImageKind, limits: &ImageLimits) -> Result<Image, String> {
    let mut own = image::Limits::default();
    own.max_alloc = Some(limits.bytes);
    let mut reader = ImageReader::with_format(Cursor::new(bytes), ImageFormat::Png);
    reader.limits(own);
    let decoder = reader.into_decoder().map_err(|e| e.to_string())?;
    let (width, height) = decoder.dimensions();
    limits.check(width.into(), height.into(), decoder.color_type().has_alpha())?;
    let decoded = DynamicImage::from_decoder(decoder).map_err(|e| e.to_string())?;
    to_linear(&decoded, kind)
}

/// JPEG, orientation tags not applied. The decoder is built without SIMD, because texels must not depend on the machine, and strict,
/// because it would otherwise fill up a truncated picture with grey.
pub(super) fn decode_jpeg(bytes: &[u8], kind: ImageKind, limits: &ImageLimits) -> Result<Image, String> {
    let side = limits.side as usize;
    let options = DecoderOptions::new_safe().set_strict_mode(true).set_max_width(side).set_max_height(side);
    let mut decoder = JpegDecoder::new_with_options(ZCursor::new(bytes), options);
    decoder.decode_headers().map_err(|e| e.to_string())?;
    let (width, height) = decoder.dimensions().ok_or("it has no size")?;
    limits.check(width as u64, height as u64, false)?;
    let grey = decoder.input_colorspace() == Some(ColorSpace::Luma);
    decoder.set_options(options.jpeg_set_out_colorspace(if grey { ColorSpace::Luma } else { ColorSpace::RGB }));
    let samples = decoder.decode().map_err(|e| e.to_string())?;
    let (width, height) = (width as u32, height as u32);
    let decoded = if grey {
        ImageBuffer::from_raw(width, height, samples).map(DynamicImage::ImageLuma8)
    } else {
        ImageBuffer::from_raw(width, height, samples).map(DynamicImage::ImageRgb8)
    };
    to_linear(&decoded.ok_or("it holds fewer texels than its header says")?, kind)
}

/// The sRGB decoding function (IEC 61966-2-1) of an encoded value in [0, 1].
fn srgb_to_linear(v: f64) -> f64 {
    if v <= 0.040_45 { v / 12.92 } else { pow64((v + 0.055) / 1.055, 2.4) }
}

/// Linear values of all samples of `levels` levels: by table, since a power per texel is slow.
fn table(levels: u32, kind: ImageKind) -> Vec<f32> {
    let top = f64::from(levels - 1);
    let decode = |v: f64| if kind == ImageKind::Srgb { srgb_to_linear(v) } else { v };
    (0..levels).map(|i| decode(f64::from(i) / top) as f32).collect()
}

fn table8(kind: ImageKind) -> &'static [f32] {
    static TABLES: [OnceLock<Vec<f32>>; 2] = [OnceLock::new(), OnceLock::new()];
    TABLES[kind as usize].get_or_init(|| table(256, kind))
}

fn table16(kind: ImageKind) -> &'static [f32] {
    static TABLES: [OnceLock<Vec<f32>>; 2] = [OnceLock::new(), OnceLock::new()];
    TABLES[kind as usize].get_or_init(|| table(65_536, kind))
}

/// Converts a decoded picture; alpha is never sRGB-encoded.
fn to_linear(decoded: &DynamicImage, kind: ImageKind) -> Result<Image, String> {
    let (t8, t16) = (table8(kind), table16(kind));
    let (a8, a16) = (table8(ImageKind::Raw), table16(ImageKind::Raw));
    let (texels, alpha) = match decoded {
        DynamicImage::ImageLuma8(b) => split::<_, 1>(b, t8, a8),
        DynamicImage::ImageLumaA8(b) => split::<_, 2>(b, t8, a8),
        DynamicImage::ImageRgb8(b) => split::<_, 3>(b, t8, a8),
        DynamicImage::ImageRgba8(b) => split::<_, 4>(b, t8, a8),
        DynamicImage::ImageLuma16(b) => split::<_, 1>(b, t16, a16),
        DynamicImage::ImageLumaA16(b) => split::<_, 2>(b, t16, a16),
        DynamicImage::ImageRgb16(b) => split::<_, 3>(b, t16, a16),
        DynamicImage::ImageRgba16(b) => split::<_, 4>(b, t16, a16),
        _ => return Err("its sample type is not supported; expected 8 or 16 bits".into()),
    };
    Ok(Image { width: decoded.width(), height: decoded.height(), texels, alpha })
}

/// Texels and alpha of interleaved samples with `N` channels: grey, grey and alpha, RGB, or RGBA.
fn split<T: Copy + Into<usize>, const N: usize>(samples: &[T], colour: &[f32], alpha: &[f32]) -> (Vec<Rgb>, Vec<f32>) {
    let (pixels, _) = samples.as_chunks::<N>();
    let value = |p: &[T; N], i: usize| colour[p[i].into()];
    let texel = |p| if N < 3 { Rgb::splat(value(p, 0)) } else { Rgb::new(value(p, 0), value(p, 1), value(p, 2)) };
    let alphas = if N.is_multiple_of(2) { pixels.iter().map(|p| alpha[p[N - 1].into()]).collect() } else { Vec::new() };
    (pixels.iter().map(texel).collect(), alphas)
}
