//! Two pictures of the same size, and the pixels that can be compared.

use renderer::film::exr::{self, Picture};
use std::path::Path;

/// A picture and its reference.
#[derive(Debug)]
pub struct Pair {
    /// Width in pixels.
    pub width: u32,
    /// Height in pixels.
    pub height: u32,
    /// The picture judged.
    pub a: Vec<[f32; 3]>,
    /// The reference.
    pub b: Vec<[f32; 3]>,
    /// Whether all channels of a pixel are finite in both.
    pub valid: Vec<bool>,
}

impl Pair {
    /// The colours of two files.
    pub fn new(a: &Picture, b: &Picture) -> Result<Self, String> {
        if (a.width, a.height) != (b.width, b.height) {
            return Err(format!(
                "pictures of different sizes can't be compared: {} x {} and {} x {} pixels",
                a.width, a.height, b.width, b.height
            ));
        }
        Ok(Self::from_pixels(a.width, a.height, colours(a)?, colours(b)?))
    }

    /// Two pictures of `width * height` pixels.
    pub fn from_pixels(width: u32, height: u32, a: Vec<[f32; 3]>, b: Vec<[f32; 3]>) -> Self {
        let finite = |p: &[f32; 3]| p.iter().all(|v| v.is_finite());
        let valid = a.iter().zip(&b).map(|(a, b)| finite(a) && finite(b)).collect();
        Self { width, height, a, b, valid }
    }

    /// Pixels that are NaN or infinite in either picture.
    pub fn masked(&self) -> usize {
        self.valid.iter().filter(|v| !**v).count()
    }

    /// The pixels that can be compared: index, picture, reference.
    pub fn pixels(&self) -> impl Iterator<Item = (usize, [f64; 3], [f64; 3])> + '_ {
        let both = self.a.iter().zip(&self.b).zip(&self.valid).enumerate();
        both.filter(|(_, (_, valid))| **valid).map(|(i, ((a, b), _))| (i, a.map(f64::from), b.map(f64::from)))
    }
}

/// Reads an EXR.
pub fn read(path: &Path) -> Result<Picture, String> {
    let fail = |e: String| format!("{}: {e}", path.display());
    let bytes = std::fs::read(path).map_err(|e| fail(e.to_string()))?;
    exr::decode(&bytes).map_err(|e| fail(format!("can't be read as OpenEXR: {e}")))
}

/// The colours of a picture: R, G, B of the default layer, else of `beauty` or of the only layer that has them; else its luminance.
pub fn colours(p: &Picture) -> Result<Vec<[f32; 3]>, String> {
    if let Some(v) = p.triple(["R", "G", "B"]).or_else(|| p.triple(["beauty.R", "beauty.G", "beauty.B"])) {
        return Ok(v);
    }
    let layers: Vec<&str> = p.channels.iter().filter_map(|(n, _)| n.strip_suffix(".R")).collect();
    let of_layer = |l: &str| p.triple([&format!("{l}.R"), &format!("{l}.G"), &format!("{l}.B")]);
    if let [layer] = layers[..]
        && let Some(v) = of_layer(layer)
    {
        return Ok(v);
    }
    let grey = match &p.channels[..] {
        [(_, only)] => Some(only.as_slice()),
        _ => p.channel("Y"),
    };
    grey.map(|g| g.iter().map(|v| [*v; 3]).collect()).ok_or_else(|| {
        let names: Vec<&str> = p.channels.iter().map(|(n, _)| n.as_str()).collect();
        format!("expected channels R, G, B or Y, found {}", names.join(", "))
    })
}
