//! OpenEXR: the first layer's R, G, B, or Y, or only channel, as half or float.

use super::ImageLimits;
use crate::spectrum::Rgb;
use crate::texture::Image;
use exr::block::reader::{ChunksReader, Reader};
use exr::meta::attribute::{ChannelList, SampleType};
use exr::meta::header::Header;
use exr::prelude::{Compression, f16};
use std::io::Cursor;

/// Where a channel of the file goes.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Target {
    Colour(usize),
    Grey,
    None,
}

/// Decodes block by block into the image, so that nothing but the image and one block is held.
pub(super) fn decode(bytes: &[u8], limits: &ImageLimits) -> Result<Image, String> {
    // Not pedantic: the pedantic mode refuses files that other programs write.
    let reader = Reader::read_from_buffered(Cursor::new(bytes), false).map_err(text)?;
    check_headers(reader.headers(), bytes.len(), limits)?;
    let header = reader.headers().first().ok_or("it has no layers")?.clone();
    let targets = targets(&header.channels)?;
    let (width, height) = (header.layer_size.0, header.layer_size.1);
    let mut texels = vec![Rgb::ZERO; width * height];
    // Pedantic about the offset table: it must name every block once.
    let chunks = reader
        .filter_chunks(true, |_, tile, block| block.layer == 0 && tile.is_largest_resolution_level())
        .map_err(text)?;
    let mut covered = 0;
    for block in chunks.sequential_decompressor(false) {
        let block = block.map_err(text)?;
        if block.index.layer != 0 || block.index.level != exr::math::Vec2(0, 0) {
            return Err("its offset table points to another layer's block".into());
        }
        covered += block.index.pixel_size.area();
        for line in block.lines(&header.channels) {
            let at = line.location;
            let start = at.position.1 * width + at.position.0;
            let range = start..start + at.sample_count;
            let target = targets[at.channel];
            if target == Target::None {
                continue;
            }
            if at.position.0 + at.sample_count > width || at.position.1 >= height {
                return Err("a block lies outside the picture".into());
            }
            let samples: Vec<f32> = match header.channels.list[at.channel].sample_type {
                SampleType::F16 => {
                    line.read_samples::<f16>().map(|v| v.map(f16::to_f32)).collect::<Result<_, _>>().map_err(text)?
                }
                _ => line.read_samples::<f32>().collect::<Result<_, _>>().map_err(text)?,
            };
            match target {
                Target::Grey => texels[range].iter_mut().zip(samples).for_each(|(t, v)| *t = Rgb::splat(v)),
                Target::Colour(0) => texels[range].iter_mut().zip(samples).for_each(|(t, v)| t.r = v),
                Target::Colour(1) => texels[range].iter_mut().zip(samples).for_each(|(t, v)| t.g = v),
                _ => texels[range].iter_mut().zip(samples).for_each(|(t, v)| t.b = v),
            }
        }
    }
    if covered != width * height {
        return Err(format!("it is incomplete: {covered} of {} texels are there", width * height));
    }
    Ok(Image { width: width as u32, height: height as u32, texels: texels.into() })
}

/// Checks sizes of all layers against the limits and against what the file can hold.
fn check_headers(headers: &[Header], file: usize, limits: &ImageLimits) -> Result<(), String> {
    let mut chunks = 0u64;
    for h in headers {
        // The decoder picks FMA, SSE2 or plain code at run time, and they differ in the last bits.
        if matches!(h.compression, Compression::DWAA(_) | Compression::DWAB(_)) {
            return Err(
                "DWA compression is not supported (its texels depend on the machine); save it as ZIP or PIZ".into()
            );
        }
        limits.check(h.layer_size.0 as u64, h.layer_size.1 as u64, size_of::<Rgb>())?;
        // One block may hold every line of the picture with all channels.
        let area = h.layer_size.0 as u64 * h.layer_size.1 as u64;
        let bytes = area.saturating_mul(h.channels.bytes_per_pixel as u64);
        if bytes > limits.bytes {
            return Err(format!("its {} channels take more than {} MiB", h.channels.list.len(), limits.bytes >> 20));
        }
        chunks += h.chunk_count as u64;
    }
    if chunks.saturating_mul(8) > file as u64 {
        return Err(format!("it claims {chunks} blocks, but is only {file} bytes long"));
    }
    Ok(())
}

/// Finds the channels by name: R, G and B, alone or behind one prefix (`diffuse.R`), else Y, else the only one there is.
fn targets(channels: &ChannelList) -> Result<Vec<Target>, String> {
    let names: Vec<String> = channels.list.iter().map(|c| c.name.to_string()).collect();
    let find = |name: &str| names.iter().position(|n| n.eq_ignore_ascii_case(name));
    let prefixes = names.iter().filter_map(|n| n.rsplit_once('.')).map(|(prefix, _)| format!("{prefix}."));
    let mut out = vec![Target::None; names.len()];
    for prefix in std::iter::once(String::new()).chain(prefixes) {
        let rgb = ["R", "G", "B"].map(|c| find(&format!("{prefix}{c}")));
        if let [Some(r), Some(g), Some(b)] = rgb {
            (out[r], out[g], out[b]) = (Target::Colour(0), Target::Colour(1), Target::Colour(2));
            return checked(channels, out);
        }
    }
    if find("RY").is_some() || find("BY").is_some() {
        return Err("luminance/chroma (Y, RY, BY) is not supported; save it as RGB".into());
    }
    let grey = find("Y").or((names.len() == 1).then_some(0));
    let grey = grey.ok_or_else(|| format!("expected channels R, G, B or Y, found {}", names.join(", ")))?;
    out[grey] = Target::Grey;
    checked(channels, out)
}

fn checked(channels: &ChannelList, targets: Vec<Target>) -> Result<Vec<Target>, String> {
    for (c, target) in channels.list.iter().zip(&targets) {
        if c.sampling != exr::math::Vec2(1, 1) {
            return Err(format!("channel {} is subsampled, which is not supported", c.name));
        }
        if *target != Target::None && c.sample_type == SampleType::U32 {
            return Err(format!("channel {} holds integers; expected half or float", c.name));
        }
    }
    Ok(targets)
}

fn text(e: exr::error::Error) -> String {
    e.to_string()
}
