//! Pictures: PNG, JPEG, Radiance HDR and OpenEXR bytes to linear texels, whatever the file claims to be.

mod exr;
mod integer;

use crate::spectrum::Rgb;
use crate::texture::{Image, Texels};
use ::image::ImageDecoder;
use std::cell::Cell;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::Once;

/// What the numbers of a picture mean.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum ImageKind {
    /// A colour: 8- and 16-bit samples are sRGB-encoded and made linear; float formats are linear already.
    Srgb,
    /// Data (roughness, normals): samples are taken as they are, integers scaled to [0, 1].
    Raw,
}

/// How large a picture may be. Checked before texels are allocated.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ImageLimits {
    /// Texels along each side.
    pub side: u32,
    /// Bytes of the texels as they are kept, or as they are decoded, with alpha.
    pub bytes: u64,
}

impl Default for ImageLimits {
    fn default() -> Self {
        Self { side: 32_768, bytes: 1 << 30 }
    }
}

impl ImageLimits {
    /// Bytes that a picture of this size takes at `texel` bytes a texel; an error when it is empty or beyond the limits.
    fn check(&self, width: u64, height: u64, texel: usize) -> Result<u64, String> {
        if width == 0 || height == 0 {
            return Err(format!("the picture is empty ({width} x {height} texels)"));
        }
        let side = u64::from(self.side);
        if width > side || height > side {
            return Err(format!("{width} x {height} texels are too many: at most {side} along a side are read"));
        }
        let bytes = width * height * texel as u64;
        if bytes > self.bytes {
            let mib = |b: u64| b.div_ceil(1 << 20);
            return Err(format!(
                "{width} x {height} texels take {} MiB when decoded, more than the limit of {} MiB",
                mib(bytes),
                mib(self.bytes)
            ));
        }
        Ok(bytes)
    }
}

/// A decoded picture.
#[derive(Clone, Debug, PartialEq)]
pub struct DecodedImage {
    /// Its texels, all finite.
    pub image: Image,
    /// What had to be changed or was ignored, for a warning.
    pub note: Option<String>,
}

/// Decodes `bytes`; the format is told by their first bytes. `path` is used in messages only.
pub fn decode_image(bytes: &[u8], path: &str, kind: ImageKind) -> Result<DecodedImage, String> {
    decode_image_within(bytes, path, kind, &ImageLimits::default())
}

/// [`decode_image`] with chosen limits.
pub fn decode_image_within(
    bytes: &[u8],
    path: &str,
    kind: ImageKind,
    limits: &ImageLimits,
) -> Result<DecodedImage, String> {
    let format = Format::of(bytes).ok_or_else(|| {
        let start = &bytes[..bytes.len().min(8)];
        format!("{path:?} is not a PNG, JPEG, Radiance HDR or OpenEXR file (it starts with {start:02x?})")
    })?;
    let decoded = quietly(|| match format {
        Format::Exr => exr::decode(bytes, limits).map(|image| (image, None)),
        Format::Hdr => decode_hdr(bytes, limits),
        Format::Png => integer::decode_png(bytes, kind, limits).map(|image| (image, None)),
        Format::Jpeg => integer::decode_jpeg(bytes, kind, limits).map(|image| (image, None)),
    });
    let (mut image, mut note) = decoded.map_err(|e| format!("{path:?} can't be read as {}: {e}", format.name()))?;
    // What is made of integers is finite.
    if let Texels::Float(texels) = &mut image.texels {
        check_texels(texels, image.width, kind, &mut note).map_err(|e| format!("{path:?}: {e}"))?;
    }
    Ok(DecodedImage { image, note: note.map(|n| format!("{path:?}: {n}")) })
}

#[derive(Clone, Copy)]
enum Format {
    Png,
    Jpeg,
    Hdr,
    Exr,
}

impl Format {
    fn of(bytes: &[u8]) -> Option<Self> {
        Some(match bytes {
            [0x89, b'P', b'N', b'G', ..] => Self::Png,
            [0xff, 0xd8, 0xff, ..] => Self::Jpeg,
            [0x76, 0x2f, 0x31, 0x01, ..] => Self::Exr,
            _ if bytes.starts_with(b"#?RADIANCE") || bytes.starts_with(b"#?RGBE") => Self::Hdr,
            _ => return None,
        })
    }

    fn name(self) -> &'static str {
        match self {
            Self::Png => "PNG",
            Self::Jpeg => "JPEG",
            Self::Hdr => "Radiance HDR",
            Self::Exr => "OpenEXR",
        }
    }
}

/// Radiance pictures. The exposure noted in the header is not applied, as in most renderers, but said.
fn decode_hdr(bytes: &[u8], limits: &ImageLimits) -> Result<(Image, Option<String>), String> {
    // The decoder's strict mode knows only one of the two signatures in use; both are checked already.
    let decoder = ::image::codecs::hdr::HdrDecoder::new_nonstrict(bytes).map_err(|e| e.to_string())?;
    let meta = decoder.metadata();
    limits.check(meta.width.into(), meta.height.into(), size_of::<Rgb>())?;
    let factor = meta.exposure.filter(|e| *e != 1.0);
    let note = factor.map(|e| format!("EXPOSURE={e} in the header is not applied: texels are taken as stored"));
    let mut texels = vec![Rgb::ZERO; meta.width as usize * meta.height as usize];
    decoder.read_image(bytemuck::cast_slice_mut(&mut texels)).map_err(|e| e.to_string())?;
    Ok((Image { width: meta.width, height: meta.height, texels: texels.into() }, note))
}

/// Refuses NaN and infinity, saying where; raises negative colours to zero, saying how many.
fn check_texels(texels: &mut [Rgb], width: u32, kind: ImageKind, note: &mut Option<String>) -> Result<(), String> {
    let place = |i: usize| (i % width as usize, i / width as usize);
    let finite = |t: &Rgb| t.r.is_finite() && t.g.is_finite() && t.b.is_finite();
    if let Some(first) = texels.iter().position(|t| !finite(t)) {
        let count = texels.iter().filter(|t| !finite(t)).count();
        let (x, y) = place(first);
        let t = texels[first];
        return Err(format!(
            "{count} of its texels are infinite or not numbers, first at column {x}, row {y} ({}, {}, {}); \
             every texel must be finite",
            t.r, t.g, t.b
        ));
    }
    if kind == ImageKind::Srgb && texels.iter().any(|t| t.min_component() < 0.0) {
        let (mut count, mut lowest) = (0, 0.0f32);
        for t in texels.iter_mut().filter(|t| t.min_component() < 0.0) {
            count += 1;
            lowest = lowest.min(t.min_component());
            *t = t.map(|v| v.max(0.0));
        }
        let text = format!("{count} of its texels were negative (down to {lowest}) and are taken as zero");
        *note = Some(note.take().map_or(text.clone(), |n| format!("{n}; {text}")));
    }
    Ok(())
}

thread_local! {
    static QUIET: Cell<bool> = const { Cell::new(false) };
}

/// Runs a third-party decoder and turns a panic of it into an error. The decoders index and multiply numbers of damaged files in
/// places that can't be checked from outside (Huffman tables, wavelet blocks, run lengths). The panic message is kept off the
/// terminal, where it would read like a fault of the user's.
pub(crate) fn quietly<T>(decode: impl FnOnce() -> Result<T, String>) -> Result<T, String> {
    static HOOK: Once = Once::new();
    HOOK.call_once(|| {
        let previous = std::panic::take_hook();
        std::panic::set_hook(Box::new(move |info| {
            if !QUIET.get() {
                previous(info);
            }
        }));
    });
    QUIET.set(true);
    // Unwind safety: whatever the decoder was writing is dropped with it.
    let result = catch_unwind(AssertUnwindSafe(decode));
    QUIET.set(false);
    result.unwrap_or_else(|_| Err("it is damaged (the decoder gave up in the middle)".into()))
}

#[cfg(test)]
mod tests;
