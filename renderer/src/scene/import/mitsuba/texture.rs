//! Mitsuba's textures, and parameters that may be textured.

use super::Builder;
use super::document::NodeId;
use super::reader::Reader;
use crate::math::DAffine3;
use crate::scene::import::image::ImageKind;
use crate::scene::import::number::Bound;
use crate::spectrum::Rgb;
use crate::texture::{Filter, FloatParam, RgbParam, Texture, TextureId, UvTransform, Wrap};

/// The textures that can be rendered.
const TEXTURES: [&str; 2] = ["bitmap", "checkerboard"];
/// Wrap modes by name; those of version 0.6 that have no equal are left out.
const WRAPS: [(&str, Wrap); 3] = [("repeat", Wrap::Repeat), ("mirror", Wrap::Mirror), ("clamp", Wrap::Clamp)];

impl Builder<'_, '_, '_> {
    /// The texture `id`; with `luminance` its channels are replaced by their luminance, as Mitsuba does where it needs a number.
    pub(super) fn texture(&mut self, id: NodeId, luminance: bool) -> Option<TextureId> {
        if let Some(known) = self.textures.get(&(id, luminance)) {
            return *known;
        }
        let node = &self.document.nodes[id];
        let texture = match node.plugin.as_str() {
            "bitmap" => self.bitmap(id, luminance),
            "checkerboard" => Some(self.checkerboard(id, luminance)),
            _ => {
                self.unsupported(node.at, id, &TEXTURES);
                None
            }
        };
        let texture = texture.map(|t| self.importer.add_texture(t));
        self.textures.insert((id, luminance), texture);
        texture
    }

    fn bitmap(&mut self, id: NodeId, luminance: bool) -> Option<Texture> {
        let mut reader = self.reader(id);
        let importer = &mut *self.importer;
        let file = reader.string(importer, "filename");
        // Version 0.6 filters footprints; single points are all that is looked up here.
        let filters = [
            ("bilinear", Filter::Linear),
            ("nearest", Filter::Nearest),
            ("trilinear", Filter::Linear),
            ("ewa", Filter::Linear),
        ];
        let filter = reader.choice(importer, "filter_type", &filters);
        let both = reader.choice(importer, "wrap_mode", &WRAPS);
        let mut one = |name| if reader.has(name) { reader.choice(importer, name, &WRAPS) } else { both };
        let wrap = [one("wrap_mode_u"), one("wrap_mode_v")];
        let raw = reader.boolean(importer, "raw").unwrap_or(false);
        let uv = to_uv(&mut reader, importer);
        if let Some(channel) = reader.get("channel") {
            importer.error(channel.at, "a single channel of a bitmap is not supported", "");
        }
        let gamma = reader.float(importer, "gamma", Bound::Any);
        if gamma.is_some_and(|g| g != -1.0 && g != 1.0) {
            importer.warn(reader.node.at, "`gamma` is ignored: 8-bit pictures are decoded as sRGB", "");
        }
        let raw = raw || gamma == Some(1.0);
        let at = reader.node.at;
        reader.finish(importer, self.document, &["format", "accel", "cache", "max_anisotropy"]);
        let Some((name, at)) = file else {
            importer.error(at, "a bitmap needs a `filename`", "");
            return None;
        };
        let image = importer.image(at, name, if raw { ImageKind::Raw } else { ImageKind::Srgb }, luminance)?;
        Some(Texture::Image { image, wrap, filter, uv, scale: Rgb::ONE })
    }

    /// Where floor(2 u) + floor(2 v) is even, `color0`. (For numbers, as a roughness, Mitsuba 3.9 swaps the two: plainly a fault,
    /// not copied here.)
    fn checkerboard(&mut self, id: NodeId, luminance: bool) -> Texture {
        let mut reader = self.reader(id);
        let importer = &mut *self.importer;
        let mut colour = |name, default| {
            if let Some((child, _)) = reader.named_child(name) {
                importer.error(child.at, "a texture inside a checkerboard is not supported", "give it an <rgb>");
            }
            let colour = reader.rgb(importer, name, Bound::NotNegative).unwrap_or(Rgb::splat(default));
            if luminance { Rgb::splat(colour.luminance()) } else { colour }
        };
        let (a, b) = (colour("color0", 0.4), colour("color1", 0.2));
        let uv = to_uv(&mut reader, importer);
        reader.finish(importer, self.document, &[]);
        Texture::Checkerboard { a, b, uv }
    }

    /// The colour parameter `name`: constant, or a texture.
    pub(super) fn rgb_param(
        &mut self,
        reader: &mut Reader,
        name: &'static str,
        bound: Bound,
        default: f32,
    ) -> RgbParam {
        let constant = RgbParam::Const(Rgb::splat(default));
        match reader.named_child(name) {
            Some((_, id)) => self.texture(id, false).map_or(constant, |t| RgbParam::Texture(t, Rgb::ONE)),
            None => reader.rgb(self.importer, name, bound).map_or(constant, RgbParam::Const),
        }
    }

    /// The number parameter `name`: constant, or the luminance of a texture.
    pub(super) fn float_param(
        &mut self,
        reader: &mut Reader,
        name: &'static str,
        bound: Bound,
        default: f32,
    ) -> FloatParam {
        match reader.named_child(name) {
            Some((_, id)) => {
                self.texture(id, true).map_or(FloatParam::Const(default), |t| FloatParam::Texture(t, 0, 1.0))
            }
            None => FloatParam::Const(reader.float_or(self.importer, name, bound, f64::from(default)) as f32),
        }
    }
}

/// The map of texture coordinates: the rows of u and v of `to_uv`, or the scales and offsets of version 0.6.
fn to_uv(reader: &mut Reader, importer: &mut crate::scene::import::importer::Importer) -> UvTransform {
    let m: DAffine3 = reader.transform(importer, "to_uv");
    let (x, y, t) = (m.matrix3.x_axis, m.matrix3.y_axis, m.translation);
    let rows = [x.x, y.x, t.x, x.y, y.y, t.y];
    let both = reader.float_or(importer, "uvscale", Bound::Any, 1.0);
    let [su, sv] = ["uscale", "vscale"].map(|name| reader.float_or(importer, name, Bound::Any, both));
    let [ou, ov] = ["uoffset", "voffset"].map(|name| reader.float_or(importer, name, Bound::Any, 0.0));
    let scaled = [su * rows[0], su * rows[1], su * rows[2] + ou, sv * rows[3], sv * rows[4], sv * rows[5] + ov];
    UvTransform(scaled.map(|v| v as f32))
}
