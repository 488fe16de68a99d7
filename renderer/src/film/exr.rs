//! OpenEXR: an image with its error and its history to bytes, and any scan-line or tiled EXR back to channels.
//!
//! One part, so that every reader finds the picture: `R`, `G`, `B` are the radiance; further layers follow OpenEXR's naming:
//!
//! | channels | content |
//! |---|---|
//! | `stderror.R/G/B` | standard error of each pixel, from the scatter between replicate groups |
//! | `blockerror.R/G/B` | standard error of the mean of the pixel's block of 16 x 16, from the same scatter |
//! | `samples.Y` | samples (or light paths) per pixel |
//! | `albedo.R/G/B`, `normal.X/Y/Z`, `depth.Z` | averages of the first hits; depth is infinite where nothing was hit |
//!
//! All are 32-bit floats, ZIP-compressed. The attribute `lightfarm` holds [`Metadata`] as JSON; nothing in the file tells the time or
//! the machine, so that the same image gives the same bytes.

use super::{Aov, ChannelMeans, Counters, ERROR_BLOCK, ErrorSummary, MergedImage};
use crate::scene::bundle::Digest;
use ::exr::block::lines::LineRef;
use ::exr::block::reader::{ChunksReader, Reader};
use ::exr::meta::attribute::{Chromaticities, SampleType};
use ::exr::meta::header::Header;
use ::exr::prelude::{
    AnyChannel, AnyChannels, AttributeValue, Encoding, FlatSamples, Image, Layer, LayerAttributes, Text, Vec2,
    WritableImage, f16,
};
use serde::{Deserialize, Serialize};
use std::io::Cursor;

/// Name of the attribute that holds [`Metadata`]. (A single one: the crate `exr` writes several in a random order.)
const ATTRIBUTE: &str = "lightfarm";

/// What an image was made of.
#[derive(Clone, Debug, PartialEq)]
pub struct Provenance {
    /// The scene's digest.
    pub scene: Digest,
    /// The job's seed.
    pub seed: u64,
    /// The render settings.
    pub settings: serde_json::Value,
    /// What the integrator `auto` chose, and why.
    pub choice: Option<serde_json::Value>,
}

/// The attribute `lightfarm` of an EXR.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Metadata {
    /// Version of the program.
    pub version: String,
    /// [`crate::FINGERPRINT`].
    pub fingerprint: String,
    /// The scene's digest.
    pub scene: Digest,
    /// The job's seed.
    pub seed: u64,
    /// The render settings.
    pub settings: serde_json::Value,
    /// What the integrator `auto` chose, and why.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub choice: Option<serde_json::Value>,
    /// The error of the whole.
    pub error: Option<ErrorSummary>,
    /// Mean of each channel with its standard error.
    pub channels: Option<ChannelMeans>,
    /// What was met while rendering.
    pub counters: Counters,
}

/// The bytes of an EXR file. `Err` says what the format can't hold.
pub fn encode(image: &MergedImage, about: &Provenance) -> Result<Vec<u8>, String> {
    let metadata = Metadata {
        version: env!("CARGO_PKG_VERSION").into(),
        fingerprint: crate::FINGERPRINT.into(),
        scene: about.scene,
        seed: about.seed,
        settings: about.settings.clone(),
        choice: about.choice.clone(),
        error: image.error,
        channels: image.blocks.image,
        counters: image.counters,
    };
    let json = serde_json::to_string(&metadata).map_err(|e| e.to_string())?;
    let mut attributes = LayerAttributes::default();
    let json = Text::new_or_none(json).ok_or("the settings hold characters beyond Latin-1")?;
    attributes.other.insert(Text::from_slice_unchecked(ATTRIBUTE.as_bytes()), AttributeValue::Text(json));
    attributes.software_name = Text::new_or_none(concat!("lightfarm ", env!("CARGO_PKG_VERSION")));
    let size = Vec2(image.width as usize, image.height as usize);
    let layer = Layer::new(size, attributes, Encoding::SMALL_LOSSLESS, AnyChannels::sort(channels(image).into()));
    let mut file = Image::from_layer(layer);
    file.attributes.chromaticities = Some(REC709);
    let mut bytes = Cursor::new(Vec::new());
    file.write().non_parallel().to_buffered(&mut bytes).map_err(|e| e.to_string())?;
    Ok(bytes.into_inner())
}

/// Primaries and white point (D65) of the radiance channels.
const REC709: Chromaticities =
    Chromaticities { red: Vec2(0.64, 0.33), green: Vec2(0.3, 0.6), blue: Vec2(0.15, 0.06), white: Vec2(0.3127, 0.329) };

type Channel = AnyChannel<FlatSamples>;

fn channel(name: String, samples: Vec<f32>) -> Channel {
    // All names are ours: ASCII.
    AnyChannel::new(Text::from_slice_unchecked(name.as_bytes()), FlatSamples::F32(samples))
}

fn channels(image: &MergedImage) -> Vec<Channel> {
    let mut out = triple("", "RGB", &image.mean, |v| *v);
    out.push(channel("samples.Y".into(), image.samples.clone()));
    if image.error.is_some() {
        out.extend(triple("stderror.", "RGB", &image.std_error, |v| *v));
        let across = image.width.div_ceil(ERROR_BLOCK);
        let block_of = |i: u32| i / image.width / ERROR_BLOCK * across + i % image.width / ERROR_BLOCK;
        let spread: Vec<[f32; 3]> =
            (0..image.mean.len() as u32).map(|i| image.blocks.std_error[block_of(i) as usize]).collect();
        out.extend(triple("blockerror.", "RGB", &spread, |v| *v));
    }
    if !image.aovs.is_empty() {
        out.extend(triple("albedo.", "RGB", &image.aovs, |a: &Aov| a.albedo));
        out.extend(triple("normal.", "XYZ", &image.aovs, |a: &Aov| a.normal));
        out.push(channel("depth.Z".into(), image.aovs.iter().map(|a| a.depth).collect()));
    }
    out
}

fn triple<T>(layer: &str, names: &str, pixels: &[T], value: impl Fn(&T) -> [f32; 3]) -> Vec<Channel> {
    let one = |(c, name)| channel(format!("{layer}{name}"), pixels.iter().map(|p| value(p)[c]).collect());
    names.chars().enumerate().map(one).collect()
}

/// The channels of an EXR.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Picture {
    /// Width in pixels.
    pub width: u32,
    /// Height in pixels.
    pub height: u32,
    /// Name and values of each channel, row by row. Channels of further parts are named `part.channel`.
    pub channels: Vec<(String, Vec<f32>)>,
    /// What lightfarm wrote beside the pixels.
    pub metadata: Option<Metadata>,
    /// The attribute `comments`.
    pub comments: String,
}

impl Picture {
    /// The values of a channel.
    pub fn channel(&self, name: &str) -> Option<&[f32]> {
        self.channels.iter().find(|(n, _)| n == name).map(|(_, v)| v.as_slice())
    }

    /// Three channels as pixels.
    pub fn triple(&self, names: [&str; 3]) -> Option<Vec<[f32; 3]>> {
        let [a, b, c] = names.map(|n| self.channel(n));
        Some(a?.iter().zip(b?).zip(c?).map(|((a, b), c)| [*a, *b, *c]).collect())
    }
}

/// The most bytes that a picture may take when read.
const MAX_BYTES: u64 = 1 << 34;

/// Reads the channels (half, float or integer) of all parts that have the size of the first. Sizes are checked before anything is
/// allocated; subsampled channels and deep data are refused.
pub fn decode(bytes: &[u8]) -> Result<Picture, String> {
    crate::scene::import::image::quietly(|| decode_blocks(bytes))
}

fn decode_blocks(bytes: &[u8]) -> Result<Picture, String> {
    // Not pedantic: the pedantic mode refuses files that other programs write.
    let reader = Reader::read_from_buffered(Cursor::new(bytes), false).map_err(text)?;
    let headers = reader.headers().to_vec();
    let size = check(&headers, bytes.len())?;
    let first = &headers[0];
    let json = first.own_attributes.other.iter().find(|(name, _)| name.as_slice() == ATTRIBUTE.as_bytes());
    let mut picture = Picture {
        width: size.0 as u32,
        height: size.1 as u32,
        channels: Vec::new(),
        metadata: match json {
            Some((_, AttributeValue::Text(t))) => serde_json::from_str(&t.to_string()).ok(),
            _ => None,
        },
        comments: first.own_attributes.comments.as_ref().map_or(String::new(), Text::to_string),
    };
    // Where each channel of each part goes.
    let mut places = Vec::new();
    for (part, h) in headers.iter().enumerate() {
        places.push(picture.channels.len());
        if h.layer_size == size {
            let name = h.own_attributes.layer_name.as_ref().filter(|_| part > 0);
            let prefix = name.map_or(String::new(), |n| format!("{n}."));
            let names = h.channels.list.iter().map(|c| format!("{prefix}{}", c.name));
            picture.channels.extend(names.map(|n| (n, vec![0.0; size.area()])));
        }
    }
    let mut covered = vec![0; headers.len()];
    let chunks = reader
        .filter_chunks(true, |_, tile, block| {
            headers[block.layer].layer_size == size && tile.is_largest_resolution_level()
        })
        .map_err(text)?;
    for block in chunks.sequential_decompressor(false) {
        let block = block.map_err(text)?;
        let part = block.index.layer;
        let header = headers.get(part).filter(|h| h.layer_size == size && block.index.level == Vec2(0, 0));
        let header = header.ok_or("its offset table points to a block of another part or level")?;
        covered[part] += block.index.pixel_size.area();
        for line in block.lines(&header.channels) {
            let at = line.location;
            if at.position.0 + at.sample_count > size.0 || at.position.1 >= size.1 {
                return Err("a block lies outside the picture".into());
            }
            let start = at.position.1 * size.0 + at.position.0;
            let to = &mut picture.channels[places[part] + at.channel].1[start..start + at.sample_count];
            fill(to, header.channels.list[at.channel].sample_type, &line).map_err(text)?;
        }
    }
    match covered.iter().zip(&headers).find(|(n, h)| h.layer_size == size && **n != size.area()) {
        Some((n, _)) => Err(format!("it is incomplete: {n} of {} pixels are there", size.area())),
        None => Ok(picture),
    }
}

fn fill(to: &mut [f32], kind: SampleType, line: &LineRef<'_>) -> ::exr::error::UnitResult {
    fn copy<T>(
        to: &mut [f32],
        from: impl Iterator<Item = ::exr::error::Result<T>>,
        f: impl Fn(T) -> f32,
    ) -> ::exr::error::UnitResult {
        to.iter_mut().zip(from).try_for_each(|(to, from)| from.map(|v| *to = f(v)))
    }
    match kind {
        SampleType::F16 => copy(to, line.read_samples::<f16>(), f16::to_f32),
        SampleType::F32 => copy(to, line.read_samples::<f32>(), |v| v),
        SampleType::U32 => copy(to, line.read_samples::<u32>(), |v| v as f32),
    }
}

/// Checks all parts against the limits and against what the file can hold; returns the size of the first.
fn check(headers: &[Header], file: usize) -> Result<Vec2<usize>, String> {
    let size = headers.first().ok_or("it has no parts")?.layer_size;
    let (mut chunks, mut total) = (0u64, 0u64);
    for h in headers {
        let (w, h_) = (h.layer_size.0 as u64, h.layer_size.1 as u64);
        if w == 0 || h_ == 0 || w > 1 << 20 || h_ > 1 << 20 {
            return Err(format!("a picture of {w} x {h_} pixels can't be read; sides go from 1 to {}", 1 << 20));
        }
        if let Some(c) = h.channels.list.iter().find(|c| c.sampling != Vec2(1, 1)) {
            return Err(format!("channel {} is subsampled, which is not supported", c.name));
        }
        // What is decoded, as f32, and the block under way: at most all of the part.
        let values = (w * h_).saturating_mul(h.channels.list.len() as u64);
        total = total.saturating_add(values.saturating_mul(8));
        chunks = chunks.saturating_add(h.chunk_count as u64);
    }
    if total > MAX_BYTES {
        return Err(format!("its channels take more than {} MiB", MAX_BYTES >> 20));
    }
    // Every block has an entry in the offset table.
    if chunks.saturating_mul(8) > file as u64 {
        return Err(format!("it claims {chunks} blocks, but is only {file} bytes long"));
    }
    Ok(size)
}

fn text(e: ::exr::error::Error) -> String {
    e.to_string()
}
