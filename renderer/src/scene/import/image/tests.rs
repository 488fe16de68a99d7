use super::*;
use ::exr::prelude::{
    AnyChannel, AnyChannels, Encoding, FlatSamples, Image as ExrImage, Layer, LayerAttributes, SmallVec,
    SpecificChannels, WritableImage, f16,
};
use ::image::{DynamicImage, ImageBuffer};
use std::io::Cursor;

fn png(image: &DynamicImage) -> Vec<u8> {
    let mut out = Cursor::new(Vec::new());
    image.write_to(&mut out, ::image::ImageFormat::Png).unwrap();
    out.into_inner()
}

fn exr_of(width: usize, height: usize, channels: &[(&str, FlatSamples)]) -> Vec<u8> {
    let list: SmallVec<[AnyChannel<FlatSamples>; 4]> =
        channels.iter().map(|(name, samples)| AnyChannel::new(*name, samples.clone())).collect();
    let layer =
        Layer::new((width, height), LayerAttributes::named(""), Encoding::FAST_LOSSLESS, AnyChannels::sort(list));
    let mut out = Cursor::new(Vec::new());
    ExrImage::from_layer(layer).write().non_parallel().to_buffered(&mut out).unwrap();
    out.into_inner()
}

fn decode(bytes: &[u8], kind: ImageKind) -> Image {
    decode_image(bytes, "test", kind).unwrap().image
}

fn all(image: &Image) -> Vec<Rgb> {
    image.texels.iter().collect()
}

fn message(bytes: &[u8]) -> String {
    decode_image(bytes, "bad.png", ImageKind::Srgb).unwrap_err()
}

#[test]
fn srgb_samples_become_linear_and_raw_ones_do_not() {
    let values = [0u8, 10, 11, 128, 188, 255];
    let bytes = png(&DynamicImage::ImageLuma8(ImageBuffer::from_raw(6, 1, values.to_vec()).unwrap()));
    // From the formula of IEC 61966-2-1 in 30-digit arithmetic.
    let expected = [0.0, 0.003_035_27, 0.003_346_535_8, 0.215_860_5, 0.502_886_5, 1.0];
    for ((texel, &v), e) in decode(&bytes, ImageKind::Srgb).texels.iter().zip(&values).zip(expected) {
        assert!((texel.r - e).abs() < 1e-7 && texel.r == texel.b, "{v}: {texel:?}, expected {e}");
    }
    for (texel, v) in decode(&bytes, ImageKind::Raw).texels.iter().zip(values) {
        assert_eq!(texel, Rgb::splat((f64::from(v) / 255.0) as f32));
    }
    let wide = png(&DynamicImage::ImageLuma16(ImageBuffer::from_raw(2, 1, vec![32_768u16, 65_535]).unwrap()));
    assert!((decode(&wide, ImageKind::Srgb).texel(0, 0).r - 0.214_048_26).abs() < 1e-6);
    assert!((decode(&wide, ImageKind::Raw).texel(0, 0).r - 0.500_007_6).abs() < 1e-7);
}

/// What a sample stands for, as before there was a table.
fn formula(sample: u32, levels: u32, kind: ImageKind) -> f32 {
    let v = f64::from(sample) / f64::from(levels - 1);
    let linear = if v <= 0.040_45 { v / 12.92 } else { crate::math::pow64((v + 0.055) / 1.055, 2.4) };
    if kind == ImageKind::Srgb { linear as f32 } else { v as f32 }
}

#[test]
fn every_sample_is_looked_up_to_the_bits_of_the_formula() {
    let narrow: Vec<u8> = (0..=255).flat_map(|v| [v, 255 - v, v ^ 0x5a]).collect();
    let wide: Vec<u16> = (0..=65_535).flat_map(|v: u16| [v, 65_535 - v, v ^ 0x5a5a]).collect();
    let narrow_png = png(&DynamicImage::ImageRgb8(ImageBuffer::from_raw(16, 16, narrow.clone()).unwrap()));
    let wide_png = png(&DynamicImage::ImageRgb16(ImageBuffer::from_raw(256, 256, wide.clone()).unwrap()));
    let bits = |texels: &[Rgb]| texels.iter().flat_map(|t| t.to_array().map(f32::to_bits)).collect::<Vec<_>>();
    for kind in [ImageKind::Srgb, ImageKind::Raw] {
        let expected: Vec<u32> = narrow.iter().map(|v| formula((*v).into(), 256, kind).to_bits()).collect();
        assert_eq!(bits(&all(&decode(&narrow_png, kind))), expected, "{kind:?}");
        let expected: Vec<u32> = wide.iter().map(|v| formula((*v).into(), 65_536, kind).to_bits()).collect();
        assert!(bits(&all(&decode(&wide_png, kind))) == expected, "{kind:?}");
    }
}

#[test]
fn every_png_layout_keeps_its_channels() {
    let rgba = DynamicImage::ImageRgba8(ImageBuffer::from_raw(1, 2, vec![255, 0, 51, 102, 0, 255, 0, 255]).unwrap());
    let image = decode(&png(&rgba), ImageKind::Raw);
    assert_eq!((image.width, image.height), (1, 2));
    assert_eq!(all(&image), [Rgb::new(1.0, 0.0, 0.2), Rgb::new(0.0, 1.0, 0.0)]);
    // Alpha is not kept, grey is kept once.
    assert_eq!(image.texels.bytes(), 6);
    for (other, bytes) in [
        (DynamicImage::ImageRgb8(rgba.to_rgb8()), 6),
        (DynamicImage::ImageRgba16(rgba.to_rgba16()), 12),
        (DynamicImage::ImageRgb16(rgba.to_rgb16()), 12),
    ] {
        let other = decode(&png(&other), ImageKind::Raw);
        assert_eq!((all(&other), other.texels.bytes()), (all(&image), bytes));
    }
    let grey = rgba.to_luma_alpha8();
    let expected: Vec<Rgb> = grey.pixels().map(|p| Rgb::splat((f64::from(p.0[0]) / 255.0) as f32)).collect();
    for (other, bytes) in [
        (DynamicImage::ImageLuma8(rgba.to_luma8()), 2),
        (DynamicImage::ImageLuma16(DynamicImage::from(rgba.to_luma8()).to_luma16()), 4),
        (DynamicImage::ImageLumaA16(DynamicImage::from(grey.clone()).to_luma_alpha16()), 4),
        (DynamicImage::ImageLumaA8(grey), 2),
    ] {
        let other = decode(&png(&other), ImageKind::Raw);
        assert_eq!((all(&other), other.texels.bytes()), (expected.clone(), bytes));
    }
}

/// 32 x 32 texels, red rising by 8 to the right and green by 8 downwards, blue 128; quality 90.
const JPEG: &[u8] = include_bytes!(concat!(env!("CARGO_MANIFEST_DIR"), "/tests/data/ramps.jpg"));

#[test]
fn jpeg_is_read_and_a_truncated_one_refused() {
    let image = decode(JPEG, ImageKind::Raw);
    assert_eq!((image.width, image.height), (32, 32));
    for (i, texel) in image.texels.iter().enumerate() {
        let expected = [(i % 32 * 8) as f32 / 255.0, (i / 32 * 8) as f32 / 255.0, 128.0 / 255.0];
        let difference = texel.to_array().iter().zip(expected).map(|(a, b)| (a - b).abs()).fold(0.0, f32::max);
        assert!(difference < 0.05, "{i}: {texel:?}, expected {expected:?}");
    }
    for end in [3, 100, JPEG.len() / 2, JPEG.len() - 40] {
        assert!(message(&JPEG[..end]).contains("JPEG"), "{end}");
    }
}

#[test]
fn exr_channels_are_found_by_name() {
    let floats = |v: &[f32]| FlatSamples::F32(v.to_vec());
    let halves = |v: &[f32]| FlatSamples::F16(v.iter().map(|v| f16::from_f32(*v)).collect());
    let (r, g, b) = (floats(&[1.0, 2.0]), halves(&[3.0, 0.5]), floats(&[5.0, 6.0]));
    let expected = vec![Rgb::new(1.0, 3.0, 5.0), Rgb::new(2.0, 0.5, 6.0)];
    for prefix in ["", "diffuse."] {
        let name = |c| format!("{prefix}{c}");
        let (nr, ng, nb, na) = (name("R"), name("G"), name("B"), name("A"));
        let list = [
            (nr.as_str(), r.clone()),
            (&ng, g.clone()),
            (&nb, b.clone()),
            (&na, floats(&[0.25, 1.0])),
            ("Z", r.clone()),
        ];
        let image = decode(&exr_of(2, 1, &list), ImageKind::Srgb);
        assert_eq!(image.texels, expected.clone().into(), "{prefix}");
    }
    assert_eq!(all(&decode(&exr_of(1, 2, &[("Y", g.clone())]), ImageKind::Raw)), [Rgb::splat(3.0), Rgb::splat(0.5)]);
    assert!(message(&exr_of(1, 2, &[("P", g.clone()), ("Q", g.clone())])).contains("found P, Q"));
    assert!(message(&exr_of(1, 2, &[("Y", FlatSamples::U32(vec![1, 2]))])).contains("integers"));
    assert!(message(&exr_of(1, 2, &[("Y", g.clone()), ("RY", g.clone()), ("BY", g)])).contains("save it as RGB"));
}

#[test]
fn tiled_compressed_exr_is_whole() {
    let value = |x: usize, y: usize| ((x * 7 + y) as f32, x as f32 / 16.0, y as f32 * 0.5);
    let channels = SpecificChannels::rgb(|p: ::exr::math::Vec2<usize>| value(p.0, p.1));
    let encoding = Encoding {
        compression: ::exr::prelude::Compression::PIZ,
        blocks: ::exr::prelude::Blocks::Tiles(::exr::math::Vec2(16, 8)),
        line_order: ::exr::prelude::LineOrder::Unspecified,
    };
    let layer = Layer::new((50, 30), LayerAttributes::named("beauty"), encoding, channels);
    let mut out = Cursor::new(Vec::new());
    ExrImage::from_layer(layer).write().non_parallel().to_buffered(&mut out).unwrap();
    let image = decode(out.get_ref(), ImageKind::Raw);
    for (i, t) in image.texels.iter().enumerate() {
        let (r, g, b) = value(i % 50, i / 50);
        assert_eq!(t, Rgb::new(r, g, b), "{i}");
    }
}

#[test]
fn infinite_texels_are_refused_with_their_place_and_negative_ones_counted() {
    let with = |v: f32| exr_of(3, 2, &[("Y", FlatSamples::F32(vec![0.0, 1.0, 2.0, 3.0, v, 5.0]))]);
    for v in [f32::INFINITY, f32::NAN] {
        let text = message(&with(v));
        assert!(text.contains("1 of its texels") && text.contains("column 1, row 1"), "{text}");
    }
    let colour = decode_image(&with(-0.5), "sky.exr", ImageKind::Srgb).unwrap();
    assert_eq!(colour.image.texel(1, 1), Rgb::ZERO);
    assert!(colour.note.unwrap().contains("1 of its texels were negative (down to -0.5)"));
    let data = decode_image(&with(-0.5), "bump.exr", ImageKind::Raw).unwrap();
    assert_eq!((data.image.texel(1, 1), data.note), (Rgb::splat(-0.5), None));
}

#[test]
fn sizes_are_checked_before_texels_are_allocated() {
    let small = png(&DynamicImage::ImageRgb8(ImageBuffer::new(64, 64)));
    let limits = ImageLimits { side: 63, bytes: 1 << 20 };
    let text = decode_image_within(&small, "a.png", ImageKind::Raw, &limits).unwrap_err();
    assert!(text.contains("at most 63"), "{text}");
    // What counts is what texels take as they are kept.
    let limits = ImageLimits { side: 64, bytes: 64 * 64 * 3 };
    assert!(decode_image_within(&small, "a.png", ImageKind::Raw, &limits).is_ok());
    let limits = ImageLimits { bytes: 64 * 64 * 3 - 1, ..limits };
    let text = decode_image_within(&small, "a.png", ImageKind::Raw, &limits).unwrap_err();
    assert!(text.contains("64 x 64 texels take 1 MiB when decoded, more than the limit of 1 MiB"), "{text}");
    // Headers that promise far more than the file holds.
    let radiance = b"#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y 4294967295 +X 4294967295\n";
    assert!(decode_image(radiance, "a.hdr", ImageKind::Srgb).is_err());
    let radiance = b"#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y 32768 +X 32768\n";
    assert!(
        message(radiance).contains("32768 x 32768 texels take 12288 MiB when decoded, more than the limit of 1024 MiB")
    );
    let mut ihdr = small.clone();
    ihdr[16..24].copy_from_slice(&[0, 0, 0x80, 0, 0, 0, 0x80, 0]);
    assert!(decode_image(&ihdr, "a.png", ImageKind::Raw).is_err());
}

#[test]
fn unknown_bytes_are_named() {
    assert!(message(b"").contains("is not a PNG"));
    assert!(message(b"RIFF....WEBPVP8 ").contains("52, 49, 46, 46"));
}

#[test]
fn radiance_headers() {
    let texel = [128u8, 64, 32, 129];
    let file = |header: &str| [header.as_bytes(), &texel].concat();
    let plain = decode_image(&file("#?RGBE\nFORMAT=32-bit_rle_rgbe\n\n-Y 1 +X 1\n"), "a", ImageKind::Srgb).unwrap();
    assert_eq!((plain.image.texel(0, 0), plain.note), (Rgb::new(1.0, 0.5, 0.25), None));
    let exposed = file("#?RADIANCE\nEXPOSURE=2\nFORMAT=32-bit_rle_rgbe\n\n-Y 1 +X 1\n");
    assert!(decode_image(&exposed, "a", ImageKind::Srgb).unwrap().note.unwrap().contains("EXPOSURE=2"));
    assert!(message(&file("#?RADIANCE\nFORMAT=32-bit_rle_xyze\n\n-Y 1 +X 1\n")).contains("xyze"));
}

/// Radiance files of the `image` crate's conformance set against their TIFF references, by a weighted sum of all samples (computed
/// from the TIFFs by an independent program, in the same order of operations) and the first texel.
#[test]
fn radiance_conformance() {
    let folder =
        std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("../../shared/data/hdr-conformance/image-rs/images");
    let references = [
        ("image1.hdr", 128, 85, 61_349_029.637_872_43, [0.519_531_25, 0.441_406_25, 0.433_593_75]),
        ("old-rle.hdr", 551, 276, 465_409_469.125, [0.125, 0.25, 0.375]),
        ("rgbr4x4.hdr", 4, 4, 1_974.464_965_820_312_5, [0.009_948_730_5, 0.0, 0.0]),
        ("scale.hdr", 256, 8, 1.406_033_049_068_959_4e43, [0.0, 0.0, 0.0]),
    ];
    for (name, width, height, sum, first) in references {
        let Ok(bytes) = std::fs::read(folder.join(name)) else {
            println!("skipped: {} is not there", folder.join(name).display());
            continue;
        };
        let image = decode(&bytes, ImageKind::Srgb);
        assert_eq!((image.width, image.height), (width, height), "{name}");
        assert_eq!(image.texel(0, 0).to_array(), first, "{name}");
        let samples = image.texels.iter().flat_map(|t| t.to_array());
        let weighted = samples.enumerate().fold(0.0, |s, (i, v)| s + f64::from(v) * ((i % 8191) as f64 + 1.0));
        assert_eq!(weighted, sum, "{name}");
    }
}
