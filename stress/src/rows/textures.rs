//! Textures of one texel and of very many.

use crate::probe::{Probe, Shot};
use crate::scene::room;
use renderer::bsdf::Material;
use renderer::integrator::IntegratorKind::{Bdpt, Light, Mmlt, Path};
use renderer::scene::Scene;
use renderer::scene::bundle::MemorySource;
use renderer::spectrum::Rgb;
use renderer::texture::{Filter, Image, RgbParam, Texture, TextureId, UvTransform, Wrap};
use std::sync::Arc;

/// One texel is a colour.
pub fn textures(probe: &mut Probe) {
    for filter in [Filter::Nearest, Filter::Linear] {
        for wrap in [Wrap::Repeat, Wrap::Mirror, Wrap::Clamp] {
            one_texel(probe, filter, wrap);
        }
    }
    large(probe);
}

fn one_texel(probe: &mut Probe, filter: Filter, wrap: Wrap) {
    let what = format!("one texel, {filter:?}, {wrap:?}");
    let Some(plain) = probe.build(&what, room()) else { return };
    let mut desc = room();
    for material in &mut desc.materials {
        let Material::Lambert { reflectance: RgbParam::Const(colour) } = *material else { continue };
        let image = Arc::new(Image { width: 1, height: 1, texels: vec![colour].into() });
        let uv = UvTransform([1e3, 0.0, -0.3, 0.0, -1e-3, 1e4]);
        desc.textures.push(Texture::Image { image, wrap: [wrap; 2], filter, uv, scale: Rgb::ONE });
        let id = TextureId(desc.textures.len() as u32 - 1);
        *material = Material::Lambert { reflectance: RgbParam::Texture(id, Rgb::ONE) };
    }
    let Some(textured) = probe.build(&what, desc) else { return };
    for kind in [Path, Light, Bdpt, Mmlt] {
        let shot = Shot { size: (12, 12), ..Shot::new(kind, 32, 5, 71) };
        let (Some(a), Some(b)) = (probe.shoot(&what, &plain, &shot), probe.shoot(&what, &textured, &shot)) else {
            continue;
        };
        // Weights of the four texels add up to 1 but for rounding.
        let off =
            a.mean.as_flattened().iter().zip(b.mean.as_flattened()).map(|(x, y)| (x - y).abs() / (x + y).max(1e-6));
        let off = off.fold(0.0, f32::max);
        probe.holds(off <= 1e-5 || kind == Mmlt, || format!("{what}, {}: off by {off:e}", kind.name()));
    }
}

/// The longest sides, and the largest area.
fn large(probe: &mut Probe) {
    let side = 16384u32;
    for (width, height) in [(side, 1), (1, side), (side, 64), (side, side)] {
        if width == height && probe.pick(true, false) {
            continue;
        }
        let what = format!("{width} x {height} texels");
        let png = png(width, height);
        let scene = "[camera]\nfrom = [0, 0, 1]\nto = [0, 0, 0]\n[textures.t]\nkind = 'image'\nfile = 't.png'\n\
                     [materials.m]\nkind = 'diffuse'\nreflectance = 't'\n\
                     [[shapes]]\nkind = 'rectangle'\nmaterial = 'm'\n[[lights]]\nkind = 'constant'\n";
        let files = [("scene.toml", scene.as_bytes().to_vec()), ("t.png", png)];
        let source = MemorySource { files: files.into_iter().map(|(n, b)| (n.to_string(), b.into())).collect() };
        // From now on the peak is that of what follows.
        let _ = std::fs::write("/proc/self/clear_refs", "5");
        let before = peak();
        let scene = match Scene::load(&source, "scene.toml") {
            Ok((scene, _)) => scene,
            Err(e) => {
                probe.holds(false, || format!("{what}: {e}"));
                continue;
            }
        };
        if let (Some(before), Some(after)) = (before, peak()) {
            let mib = after.saturating_sub(before) >> 20;
            // What it takes decoded and encoded, and while it is decoded.
            probe.holds(mib <= 1800, || format!("{what}: loading takes {mib} MiB"));
            probe.figure(format!("{what}: at most {mib} MiB more than before"));
        }
        for kind in [Path, Bdpt] {
            // A grey that is the same all over, in a white sky.
            if let Some(image) = probe.shoot(&what, &scene, &Shot { size: (8, 8), ..Shot::new(kind, 128, 2, 72) }) {
                let grey = ((188.0f64 / 255.0 + 0.055) / 1.055).powf(2.4);
                probe.is(&format!("{what}, {}", kind.name()), &image, [grey; 3], 0.02);
            }
        }
    }
}

/// A grey picture, written here: deflate's stored blocks need no compressor, and zlib's checksum is simple.
fn png(width: u32, height: u32) -> Vec<u8> {
    let mut out = b"\x89PNG\r\n\x1a\n".to_vec();
    let mut header = Vec::new();
    header.extend(width.to_be_bytes());
    header.extend(height.to_be_bytes());
    header.extend([8, 0, 0, 0, 0]);
    chunk(&mut out, b"IHDR", &header);
    let mut row = vec![0u8];
    row.resize(width as usize + 1, 188);
    let mut data = vec![0x78, 0x01];
    let (mut a, mut b) = (1u32, 0u32);
    for y in 0..height {
        data.push(u8::from(y + 1 == height));
        data.extend((row.len() as u16).to_le_bytes());
        data.extend((!(row.len() as u16)).to_le_bytes());
        data.extend(&row);
        for v in &row {
            a = (a + u32::from(*v)) % 65521;
            b = (b + a) % 65521;
        }
    }
    data.extend((b << 16 | a).to_be_bytes());
    chunk(&mut out, b"IDAT", &data);
    chunk(&mut out, b"IEND", &[]);
    out
}

fn chunk(out: &mut Vec<u8>, kind: &[u8; 4], data: &[u8]) {
    out.extend((data.len() as u32).to_be_bytes());
    let start = out.len();
    out.extend(kind);
    out.extend(data);
    let table: Vec<u32> =
        (0..256u32).map(|i| (0..8).fold(i, |c, _| if c & 1 == 1 { 0xedb8_8320 ^ (c >> 1) } else { c >> 1 })).collect();
    let crc = out[start..].iter().fold(!0u32, |c, v| table[usize::from(c as u8 ^ v)] ^ (c >> 8));
    out.extend((!crc).to_be_bytes());
}

/// The most bytes of memory that this process has held at once, where the system tells.
fn peak() -> Option<u64> {
    let text = std::fs::read_to_string("/proc/self/status").ok()?;
    let line = text.lines().find_map(|l| l.strip_prefix("VmHWM:"))?;
    line.trim().strip_suffix("kB")?.trim().parse::<u64>().ok().map(|kib| kib << 10)
}
