//! Textures and pictures, and parameters that may be textured.

use super::Builder;
use super::table::{Item, Table, choose};
use crate::diagnostics::nearest;
use crate::math::{DAffine3, DVec3, pow64};
use crate::scene::import::image::ImageKind;
use crate::scene::import::importer::{Importer, Place};
use crate::scene::import::number::Bound;
use crate::scene::import::transform::rotate;
use crate::spectrum::Rgb;
use crate::texture::{Filter, FloatParam, Image, RgbParam, Texture, TextureId, UvTransform, Wrap};
use std::sync::Arc;
use toml::de::DeValue;

/// Most texels along a side of a picture written in the file.
const MAX_SIDE: i64 = 4096;
const WRAPS: [(&str, Wrap); 3] = [("repeat", Wrap::Repeat), ("mirror", Wrap::Mirror), ("clamp", Wrap::Clamp)];

impl<'t> Builder<'t, '_, '_> {
    /// Builds the textures, in the order of their names.
    pub(super) fn textures(&mut self, table: &Table<'t>) {
        for (name, _, item) in table.all() {
            let table = item.table(self.importer, &format!("the texture {name:?}"));
            let texture = table.and_then(|t| texture(self.importer, t));
            let id = texture.map(|texture| self.importer.add_texture(texture));
            self.textures.insert(name, id);
        }
    }

    /// The texture called `name`; `None` after an error, there or here.
    fn texture_id(&mut self, at: Place, name: &str) -> Option<TextureId> {
        if let Some(known) = self.textures.get(name) {
            return *known;
        }
        let near = nearest(name, self.textures.keys().copied());
        let help = near.map_or("textures are tables [textures.NAME]".into(), |n| format!("did you mean {n:?}?"));
        self.importer.error(at, format!("no texture is called {name:?}"), help);
        None
    }

    /// The texture that `key` must name.
    pub(super) fn required_texture(&mut self, table: &mut Table<'t>, key: &'static str) -> Option<TextureId> {
        let item = table.require(self.importer, key, "the name of a texture")?;
        let name = item.string(self.importer, key)?;
        self.texture_id(item.at, name)
    }

    /// A colour: constant, the name of a texture, or `{ texture = "name", scale = colour }`.
    pub(super) fn rgb_param(
        &mut self,
        table: &mut Table<'t>,
        key: &'static str,
        bound: Bound,
        default: f32,
    ) -> RgbParam {
        let constant = RgbParam::Const(Rgb::splat(default));
        let Some(item) = table.get(key) else { return constant };
        match item.value {
            DeValue::String(name) if !name.starts_with('#') => {
                self.texture_id(item.at, name).map_or(constant, |id| RgbParam::Texture(id, Rgb::ONE))
            }
            DeValue::Table(_) => {
                let Some(mut table) = item.table(self.importer, &format!("`{key}`")) else { return constant };
                let id = self.required_texture(&mut table, "texture");
                let scale = table.rgb(self.importer, "scale", Bound::NotNegative, Rgb::ONE);
                table.finish(self.importer);
                id.map_or(constant, |id| RgbParam::Texture(id, scale))
            }
            _ => item.rgb(self.importer, key, bound).map_or(constant, RgbParam::Const),
        }
    }

    /// A number: constant, the name of a texture (its red channel), or `{ texture = "name", channel = "green", scale = number }`.
    pub(super) fn float_param(&mut self, key: &'static str, item: Item<'t>, bound: Bound) -> Option<FloatParam> {
        match item.value {
            DeValue::String(name) => Some(FloatParam::Texture(self.texture_id(item.at, name)?, 0, 1.0)),
            DeValue::Table(_) => {
                let mut table = item.table(self.importer, &format!("`{key}`"))?;
                let id = self.required_texture(&mut table, "texture");
                let channel = table.choice(self.importer, "channel", &[("red", 0), ("green", 1), ("blue", 2)]);
                let scale = table.number_or(self.importer, "scale", Bound::NotNegative, 1.0);
                table.finish(self.importer);
                Some(FloatParam::Texture(id?, channel, scale as f32))
            }
            _ => item.number(self.importer, key, bound).map(|v| FloatParam::Const(v as f32)),
        }
    }
}

fn texture(importer: &mut Importer, mut table: Table) -> Option<Texture> {
    let is_image = table.kind(importer, &[("image", true), ("checkerboard", false)])?;
    let uv = uv_transform(importer, &mut table);
    let texture = if is_image {
        let wrap = wrap(importer, &mut table);
        let filter = table.choice(importer, "filter", &[("linear", Filter::Linear), ("nearest", Filter::Nearest)]);
        let scale = table.rgb(importer, "scale", Bound::NotNegative, Rgb::ONE);
        let kind = table.choice(importer, "color_space", &[("srgb", ImageKind::Srgb), ("raw", ImageKind::Raw)]);
        picture(importer, &mut table, kind).map(|image| Texture::Image { image, wrap, filter, uv, scale })
    } else {
        let a = table.rgb(importer, "a", Bound::NotNegative, Rgb::splat(0.4));
        let b = table.rgb(importer, "b", Bound::NotNegative, Rgb::splat(0.2));
        Some(Texture::Checkerboard { a, b, uv })
    };
    table.finish(importer);
    texture
}

/// One mode for both directions, or a list of two.
fn wrap(importer: &mut Importer, table: &mut Table) -> [Wrap; 2] {
    let Some(item) = table.get("wrap") else { return [Wrap::Repeat; 2] };
    let items = match item.value {
        DeValue::Array(_) => item.exactly(importer, "wrap", "a wrap mode, or one for u and one for v"),
        _ => Some([item; 2]),
    };
    let mut mode = |item: Item| {
        let name = item.string(importer, "wrap")?;
        choose(importer, item.at, "wrap", name, &WRAPS)
    };
    items.map_or([Wrap::Repeat; 2], |items| items.map(|item| mode(item).unwrap_or(Wrap::Repeat)))
}

/// The picture of a table: from the file `file`, or written out as `size` and `pixels`.
pub(super) fn picture(importer: &mut Importer, table: &mut Table, kind: ImageKind) -> Option<Arc<Image>> {
    let (file, size, pixels) = (table.get("file"), table.get("size"), table.get("pixels"));
    match (file, size, pixels) {
        (Some(file), None, None) => {
            let name = file.string(importer, "file")?;
            importer.image(file.at, name, kind, false)
        }
        (None, Some(size), Some(pixels)) => written_picture(importer, size, pixels).map(Arc::new),
        _ => {
            importer.error(table.at, format!("{} needs either `file`, or `size` and `pixels`", table.name), "");
            None
        }
    }
}

/// Row by row, the top row first.
fn written_picture(importer: &mut Importer, size: Item, pixels: Item) -> Option<Image> {
    let sides: [Item; 2] = size.exactly(importer, "size", "[width, height]")?;
    let [width, height] = sides.map(|side| side.integer(importer, "size", 1, MAX_SIDE));
    let (width, height) = (width? as u32, height? as u32);
    let list = pixels.list(importer, "pixels", "a list of colours")?;
    if list.len() as u64 != u64::from(width) * u64::from(height) {
        let message = format!("`pixels` has {} colours, but {width} x {height} are needed", list.len());
        importer.error(pixels.at, message, "");
        return None;
    }
    let mut texels = Vec::with_capacity(list.len());
    for item in list {
        texels.push(item.rgb(importer, "pixels", Bound::NotNegative)?);
    }
    Some(Image { width, height, texels: texels.into() })
}

/// From `uv = { flip_v, scale, rotate, translate }`, applied in that order.
fn uv_transform(importer: &mut Importer, table: &mut Table) -> UvTransform {
    let Some(mut uv) = table.table(importer, "uv") else { return UvTransform::IDENTITY };
    let mut m = DAffine3::IDENTITY;
    if uv.boolean(importer, "flip_v", false) {
        m = DAffine3::from_translation(DVec3::Y) * DAffine3::from_scale(DVec3::new(1.0, -1.0, 1.0));
    }
    let scale = uv.get("scale").and_then(|item| match item.value {
        DeValue::Array(_) => item.numbers(importer, "scale", Bound::Any),
        _ => item.number(importer, "scale", Bound::Any).map(|v| [v, v]),
    });
    if let Some([u, v]) = scale {
        m = DAffine3::from_scale(DVec3::new(u, v, 1.0)) * m;
    }
    if let Some(degrees) = uv.number(importer, "rotate", Bound::Any) {
        m = rotate(DVec3::Z, degrees).unwrap_or(DAffine3::IDENTITY) * m;
    }
    if let Some([u, v]) = uv.get("translate").and_then(|item| item.numbers(importer, "translate", Bound::Any)) {
        m = DAffine3::from_translation(DVec3::new(u, v, 0.0)) * m;
    }
    uv.finish(importer);
    let (x, y, t) = (m.matrix3.x_axis, m.matrix3.y_axis, m.translation);
    UvTransform([x.x, y.x, t.x, x.y, y.y, t.y].map(|v| v as f32))
}

/// An 8-bit sRGB sample made linear (IEC 61966-2-1).
pub(super) fn srgb_to_linear(v: u8) -> f32 {
    let v = f64::from(v) / 255.0;
    (if v <= 0.04045 { v / 12.92 } else { pow64((v + 0.055) / 1.055, 2.4) }) as f32
}
