//! PNG and JPEG: 8- and 16-bit samples, and the tables that make them linear.

use super::{ImageKind, ImageLimits};
use crate::math::pow64;
use crate::texture::{Image, Samples, Texels};
use image::{ImageDecoder, ImageFormat, ImageReader};
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
    let ((width, height), colour) = (decoder.dimensions(), decoder.color_type());
    let (channels, texel) = (usize::from(colour.channel_count()), usize::from(colour.bytes_per_pixel()));
    limits.check(width.into(), height.into(), texel)?;
    let samples = width as usize * height as usize * channels;
    let texels = match texel / channels {
        1 => {
            let mut data = vec![0u8; samples];
            decoder.read_image(&mut data).map_err(|e| e.to_string())?;
            Samples::new(data, channels, table8(kind)).map(Texels::Bytes)
        }
        2 => {
            let mut data = vec![0u16; samples];
            decoder.read_image(bytemuck::cast_slice_mut(&mut data)).map_err(|e| e.to_string())?;
            Samples::new(data, channels, table16(kind)).map(Texels::Words)
        }
        _ => None,
    };
    let texels = texels.ok_or("its sample type is not supported; expected 8 or 16 bits")?;
    Ok(Image { width, height, texels })
}

/// JPEG, orientation tags not applied. The decoder is built without SIMD, because texels must not depend on the machine, and strict,
/// because it would otherwise fill up a truncated picture with grey.
pub(super) fn decode_jpeg(bytes: &[u8], kind: ImageKind, limits: &ImageLimits) -> Result<Image, String> {
    let side = limits.side as usize;
    let options = DecoderOptions::new_safe().set_strict_mode(true).set_max_width(side).set_max_height(side);
    let mut decoder = JpegDecoder::new_with_options(ZCursor::new(bytes), options);
    decoder.decode_headers().map_err(|e| e.to_string())?;
    let (width, height) = decoder.dimensions().ok_or("it has no size")?;
    let grey = decoder.input_colorspace() == Some(ColorSpace::Luma);
    let (channels, space) = if grey { (1, ColorSpace::Luma) } else { (3, ColorSpace::RGB) };
    limits.check(width as u64, height as u64, channels)?;
    decoder.set_options(options.jpeg_set_out_colorspace(space));
    let data = decoder.decode().map_err(|e| e.to_string())?;
    let samples = (data.len() == width * height * channels).then(|| Samples::new(data, channels, table8(kind)));
    let samples = samples.flatten().ok_or("it holds other numbers of texels than its header says")?;
    Ok(Image { width: width as u32, height: height as u32, texels: Texels::Bytes(samples) })
}

/// The sRGB decoding function (IEC 61966-2-1) of an encoded value in [0, 1].
fn srgb_to_linear(v: f64) -> f64 {
    if v <= 0.040_45 { v / 12.92 } else { pow64((v + 0.055) / 1.055, 2.4) }
}

/// Linear values of all samples of `LEVELS` levels: by table, since a power per texel is slow.
fn table<const LEVELS: usize>(kind: ImageKind) -> Box<[f32; LEVELS]> {
    let decode = |v: f64| if kind == ImageKind::Srgb { srgb_to_linear(v) } else { v };
    let mut values = Box::new([0.0; LEVELS]);
    values.iter_mut().enumerate().for_each(|(i, v)| *v = decode(i as f64 / (LEVELS - 1) as f64) as f32);
    values
}

fn table8(kind: ImageKind) -> &'static [f32; 256] {
    static TABLES: [OnceLock<Box<[f32; 256]>>; 2] = [OnceLock::new(), OnceLock::new()];
    TABLES[kind as usize].get_or_init(|| table(kind))
}

fn table16(kind: ImageKind) -> &'static [f32; 65_536] {
    static TABLES: [OnceLock<Box<[f32; 65_536]>>; 2] = [OnceLock::new(), OnceLock::new()];
    TABLES[kind as usize].get_or_init(|| table(kind))
}
