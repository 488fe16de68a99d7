//! Images, samplers and KHR_texture_transform.

use super::Importer;
use super::buffers::{fetch, lookup};
use super::report::{Checked, Fault};
use crate::math::sin_cos;
use crate::scene::import::image::{ImageKind, ImageLimits, decode_image_within};
use crate::spectrum::Rgb;
use crate::texture::{Filter, Image, Texture, TextureId, UvTransform, Wrap};
use gltf::json;
use gltf::json::texture::{MagFilter, MinFilter, WrappingMode};
use gltf::json::validation::Checked as Valid;
use serde_json::Value;
use std::sync::Arc;

/// A use of a texture by a material.
#[derive(Clone, Copy, Debug)]
pub(super) struct TextureUse {
    /// Into `textures`.
    index: usize,
    /// Which `TEXCOORD_n`.
    pub set: u32,
    transform: UvTransform,
}

/// What makes a texture of the scene: uses that agree in it share one.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(super) struct TextureKey {
    index: usize,
    kind: ImageKind,
    transform: [u32; 6],
}

impl TextureUse {
    /// From an ordinary texture reference.
    pub(super) fn of(info: &json::texture::Info, place: &str) -> Checked<Self> {
        let own = Self { index: info.index.value(), set: info.tex_coord, transform: UvTransform::IDENTITY };
        match info.extensions.as_ref().and_then(|e| e.texture_transform.as_ref()) {
            Some(t) => own.transformed(t, place),
            None => Ok(own),
        }
    }

    /// From a normal texture's reference, whose extensions are untyped.
    pub(super) fn of_normal(info: &json::material::NormalTexture, place: &str) -> Checked<Self> {
        let own = Self { index: info.index.value(), set: info.tex_coord, transform: UvTransform::IDENTITY };
        match info.extensions.as_ref().and_then(|e| e.others.get("KHR_texture_transform")) {
            Some(value) => own.transformed(&parse_transform(value, place)?, place),
            None => Ok(own),
        }
    }

    /// KHR_texture_transform. The matrix is the one that the extension's test model and all renderers agree on: scale, then a rotation
    /// that turns u towards -v, then the offset. (The listing in its text reads as the opposite rotation.)
    fn transformed(mut self, t: &json::extensions::texture::TextureTransform, place: &str) -> Checked<Self> {
        let (s, c) = sin_cos(t.rotation.0);
        let ([ox, oy], [sx, sy]) = (t.offset.0, t.scale.0);
        let m = [c * sx, s * sy, ox, -s * sx, c * sy, oy];
        if m.iter().any(|v| !v.is_finite()) {
            return Err(Fault::new(format!("{place}.extensions.KHR_texture_transform"), "its numbers must be finite"));
        }
        self.transform = UvTransform(m);
        self.set = t.tex_coord.unwrap_or(self.set);
        Ok(self)
    }
}

fn parse_transform(value: &Value, place: &str) -> Checked<json::extensions::texture::TextureTransform> {
    serde_json::from_value(value.clone())
        .map_err(|e| Fault::new(format!("{place}.extensions.KHR_texture_transform"), e.to_string()))
}

impl Importer<'_> {
    /// The scene's texture for a use of one.
    pub(super) fn texture(&mut self, using: &TextureUse, kind: ImageKind, place: &str) -> Checked<TextureId> {
        let key = TextureKey { index: using.index, kind, transform: using.transform.0.map(f32::to_bits) };
        if let Some(id) = self.texture_ids.get(&key) {
            return Ok(*id);
        }
        let json = lookup(&self.root.textures, using.index, place, "textures")?;
        let own = format!("textures[{}]", using.index);
        if json.source.value() == u32::MAX as usize {
            let others = json.extensions.as_ref().map(|e| e.others.keys().cloned().collect::<Vec<_>>().join(", "));
            let others = others.filter(|o| !o.is_empty()).map_or(String::new(), |o| format!(" (only {o})"));
            return Err(Fault::new(own, format!("it has no PNG or JPEG image as its source{others}")));
        }
        let image = self.image(json.source.value(), kind, &own)?;
        let sampler = json.sampler.map(|s| lookup(&self.root.samplers, s.value(), &own, "samplers")).transpose()?;
        let (wrap, filter) = sampler.map_or(([Wrap::Repeat; 2], Filter::Linear), read_sampler);
        let id =
            TextureId(u32::try_from(self.scene.textures.len()).map_err(|_| Fault::new(place, "too many textures"))?);
        self.scene.textures.push(Texture::Image { image, wrap, filter, uv: using.transform, scale: Rgb::ONE });
        self.texture_ids.insert(key, id);
        Ok(id)
    }

    fn image(&mut self, index: usize, kind: ImageKind, place: &str) -> Checked<Arc<Image>> {
        if let Some(image) = self.images.get(&(index, kind)) {
            return image.clone();
        }
        let image = self.decode(index, kind, place);
        self.images.insert((index, kind), image.clone());
        image
    }

    fn decode(&mut self, index: usize, kind: ImageKind, place: &str) -> Checked<Arc<Image>> {
        let json = lookup(&self.root.images, index, place, "images")?;
        let own = format!("images[{index}]");
        let (bytes, name) = match (&json.uri, json.buffer_view) {
            (_, Some(view)) => {
                let place = format!("{own}.bufferView");
                (Arc::from(self.buffers.view(view.value(), &place)?.bytes), place)
            }
            (Some(uri), None) => {
                let name = if uri.starts_with("data:") { "data URI".to_string() } else { uri.clone() };
                (fetch(self.files, self.file, uri, &format!("{own}.uri"))?, name)
            }
            (None, None) => return Err(Fault::new(own, "it has neither uri nor bufferView")),
        };
        let limits = ImageLimits::default();
        let limits = ImageLimits { bytes: limits.bytes.min(self.image_bytes_left), ..limits };
        let decoded = decode_image_within(&bytes, &name, kind, &limits).map_err(|e| Fault::new(&own, e))?;
        self.image_bytes_left = self.image_bytes_left.saturating_sub(decoded.image.texels.bytes() as u64);
        if let Some(note) = decoded.note {
            self.report.warn(Fault::new(own, note));
        }
        Ok(Arc::new(decoded.image))
    }
}

fn read_sampler(json: &json::texture::Sampler) -> ([Wrap; 2], Filter) {
    let wrap = |w: Valid<WrappingMode>| match w {
        Valid::Valid(WrappingMode::ClampToEdge) => Wrap::Clamp,
        Valid::Valid(WrappingMode::MirroredRepeat) => Wrap::Mirror,
        _ => Wrap::Repeat,
    };
    // Where only the minifying filter is given, it decides.
    let nearest = match (json.mag_filter, json.min_filter) {
        (Some(mag), _) => matches!(mag, Valid::Valid(MagFilter::Nearest)),
        (None, Some(min)) => matches!(min, Valid::Valid(MinFilter::Nearest | MinFilter::NearestMipmapNearest)),
        (None, None) => false,
    };
    ([wrap(json.wrap_s), wrap(json.wrap_t)], if nearest { Filter::Nearest } else { Filter::Linear })
}
