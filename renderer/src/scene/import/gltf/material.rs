//! Metallic-roughness materials and their extensions.

use super::Importer;
use super::buffers::lookup;
use super::document::is_supported;
use super::report::{Checked, Fault, shorten};
use super::texture::TextureUse;
use crate::bsdf::{Material, MaterialId};
use crate::math::ln64;
use crate::medium::{MAX_SIGMA, Medium, MediumId, Phase};
use crate::scene::desc::Emission;
use crate::scene::import::image::ImageKind;
use crate::scene::import::medium;
use crate::spectrum::Rgb;
use crate::texture::{FloatParam, RgbParam, Texture, TextureId};
use gltf::json;
use gltf::json::material::AlphaMode;
use gltf::json::validation::Checked as Valid;

/// Emission beyond this could not be summed over a scene in f32.
const MOST_RADIANCE: f32 = 1e20;

/// A material as a primitive uses it.
#[derive(Clone, Copy, Debug)]
pub(super) struct Surface {
    /// How it scatters.
    pub material: MaterialId,
    /// What it emits.
    pub emission: Option<Emission>,
    /// What fills the body that it bounds.
    pub interior: Option<MediumId>,
    /// The set of texture coordinates that its textures want; `None` without textures.
    pub uv_set: Option<u32>,
}

/// The material being read.
struct Reading<'a> {
    json: &'a json::Material,
    /// `materials[3]`.
    place: String,
    uv_set: Option<u32>,
}

impl Importer<'_> {
    /// The surface for `materials[index]`, or the default material of glTF.
    pub(super) fn surface(&mut self, index: Option<usize>, place: &str) -> Checked<Surface> {
        if let Some(surface) = self.surfaces.get(&index) {
            return Ok(*surface);
        }
        let default = json::Material::default();
        let (json, place) = match index {
            Some(i) => (lookup(&self.root.materials, i, place, "materials")?, format!("materials[{i}]")),
            None => (&default, "default material".to_string()),
        };
        let surface = self.read_surface(Reading { json, place, uv_set: None })?;
        self.surfaces.insert(index, surface);
        Ok(surface)
    }

    fn read_surface(&mut self, mut m: Reading<'_>) -> Checked<Surface> {
        self.note_material(&m);
        let json = m.json;
        let pbr = &json.pbr_metallic_roughness;
        let pbr_place = format!("{}.pbrMetallicRoughness", m.place);
        let [r, g, b, _] = pbr.base_color_factor.0;
        let factor = [r, g, b].map(|v| self.number(v, 0.0, 1.0, 1.0, &format!("{pbr_place}.baseColorFactor")));
        let texture = pbr.base_color_texture.as_ref();
        let base_color = self.colour(&mut m, texture, factor.into(), &format!("{pbr_place}.baseColorTexture"));
        let extensions = json.extensions.as_ref();
        if extensions.is_some_and(|e| e.unlit.is_some()) {
            let black = Material::Lambert { reflectance: RgbParam::Const(Rgb::ZERO) };
            let emission = Some(Emission { radiance: base_color, two_sided: json.double_sided });
            return Ok(Surface { material: self.add_material(black)?, emission, interior: None, uv_set: m.uv_set });
        }
        let metallic = self.number(pbr.metallic_factor.0, 0.0, 1.0, 1.0, &format!("{pbr_place}.metallicFactor"));
        let roughness = self.number(pbr.roughness_factor.0, 0.0, 1.0, 1.0, &format!("{pbr_place}.roughnessFactor"));
        let texture = pbr.metallic_roughness_texture.as_ref();
        let texture = self.raw(&mut m, texture, &format!("{pbr_place}.metallicRoughnessTexture"));
        let float = |channel, factor| match texture {
            Some(id) => FloatParam::Texture(id, channel, factor),
            None => FloatParam::Const(factor),
        };
        let (metallic, roughness) = (float(2, metallic), float(1, roughness));
        let (transmission, thin) = self.transmission(&mut m);
        let ior = self.ior(&m);
        let gltf = Material::Gltf { base_color, metallic, roughness, ior, transmission, thin };
        let inner = self.add_material(gltf)?;
        let material = self.normal_map(&mut m, inner)?;
        let emission = self.emission(&mut m);
        let opaque = thin || transmission == FloatParam::Const(0.0);
        let interior = if opaque { None } else { self.attenuation(&m) };
        Ok(Surface { material, emission, interior, uv_set: m.uv_set })
    }

    fn add_material(&mut self, material: Material) -> Checked<MaterialId> {
        let id =
            u32::try_from(self.scene.materials.len()).map_err(|_| Fault::new("materials", "there are too many"))?;
        self.scene.materials.push(material);
        Ok(MaterialId(id))
    }

    /// Warns of what the material has and the renderer lacks.
    fn note_material(&mut self, m: &Reading<'_>) {
        let name = m.json.name.as_ref().map_or(m.place.clone(), |n| format!("{} ({:?})", m.place, shorten(n)));
        if matches!(m.json.alpha_mode, Valid::Valid(AlphaMode::Mask | AlphaMode::Blend)) {
            self.report.sum("alphaMode is not supported; the material is rendered opaque", "", &name);
        }
        let Some(extensions) = &m.json.extensions else { return };
        let typed = extensions.specular.as_ref().map(|_| "KHR_materials_specular");
        for extension in extensions.others.keys().map(String::as_str).chain(typed) {
            if !is_supported(extension) {
                self.report.sum(format!("{} is not supported and is ignored", shorten(extension)), "", &name);
            }
        }
    }

    /// `value` when it is in range, else the nearest in range (`default` for an infinite one) with a warning.
    fn number(&mut self, value: f32, low: f32, high: f32, default: f32, place: &str) -> f32 {
        if value >= low && value <= high && value.is_finite() {
            return value;
        }
        let used = if value.is_finite() { value.clamp(low, high) } else { default };
        let range = if high.is_finite() { format!("from {low} to {high}") } else { format!("from {low} on") };
        self.report
            .warn(Fault::new(place, format!("{value} is out of range; expected a number {range}, {used} is used")));
        used
    }

    /// The texture of a use; faults are recorded, so that all of a material's are listed.
    fn used(
        &mut self,
        m: &mut Reading<'_>,
        using: Checked<TextureUse>,
        kind: ImageKind,
        place: &str,
    ) -> Option<TextureId> {
        let using = self.report.check(using)?;
        let set = *m.uv_set.get_or_insert(using.set);
        if set != using.set {
            let message = format!(
                "TEXCOORD_{} is wanted, but a material's textures share one set; TEXCOORD_{set} is used",
                using.set
            );
            self.report.warn(Fault::new(place, message));
        }
        let id = self.texture(&using, kind, place);
        self.report.check(id)
    }

    fn raw(&mut self, m: &mut Reading<'_>, info: Option<&json::texture::Info>, place: &str) -> Option<TextureId> {
        self.used(m, TextureUse::of(info?, place), ImageKind::Raw, place)
    }

    fn colour(
        &mut self,
        m: &mut Reading<'_>,
        info: Option<&json::texture::Info>,
        factor: Rgb,
        place: &str,
    ) -> RgbParam {
        let id = info.and_then(|info| self.used(m, TextureUse::of(info, place), ImageKind::Srgb, place));
        id.map_or(RgbParam::Const(factor), |id| RgbParam::Texture(id, factor))
    }

    /// KHR_materials_transmission; with a thickness in KHR_materials_volume the surface bounds a body and refracts.
    fn transmission(&mut self, m: &mut Reading<'_>) -> (FloatParam, bool) {
        let extensions = m.json.extensions.as_ref();
        let thin = !extensions.and_then(|e| e.volume.as_ref()).is_some_and(|v| v.thickness_factor.0 > 0.0);
        let Some(t) = extensions.and_then(|e| e.transmission.as_ref()) else { return (FloatParam::Const(0.0), thin) };
        let place = format!("{}.extensions.KHR_materials_transmission", m.place);
        let factor = self.number(t.transmission_factor.0, 0.0, 1.0, 0.0, &format!("{place}.transmissionFactor"));
        let texture = self.raw(m, t.transmission_texture.as_ref(), &format!("{place}.transmissionTexture"));
        (texture.map_or(FloatParam::Const(factor), |id| FloatParam::Texture(id, 0, factor)), thin)
    }

    /// KHR_materials_volume: white light becomes `attenuationColor` over `attenuationDistance`, by absorption alone.
    fn attenuation(&mut self, m: &Reading<'_>) -> Option<MediumId> {
        let volume = m.json.extensions.as_ref()?.volume.as_ref()?;
        let place = format!("{}.extensions.KHR_materials_volume", m.place);
        let distance = volume.attenuation_distance.0;
        if !(distance > 0.0) {
            let message = format!("{distance} is out of range; expected a number above 0, there is no attenuation");
            self.report.warn(Fault::new(format!("{place}.attenuationDistance"), message));
            return None;
        }
        let at = format!("{place}.attenuationColor");
        let colour = volume.attenuation_color.0.map(|v| self.number(v, 0.0, 1.0, 1.0, &at));
        // Black would be reached nowhere: it is taken for the least that can be told from it.
        let sigma = |c: f32| (-ln64(f64::from(c.max(f32::MIN_POSITIVE))) / f64::from(distance)) as f32;
        let sigma_t = Rgb::from(colour.map(|c| sigma(c).clamp(0.0, MAX_SIGMA)));
        if sigma_t.is_black() {
            return None;
        }
        Some(medium::push(&mut self.scene, Medium { sigma_t, albedo: Rgb::ZERO, phase: Phase::Isotropic }))
    }

    fn ior(&mut self, m: &Reading<'_>) -> f32 {
        let Some(ior) = m.json.extensions.as_ref().and_then(|e| e.ior.as_ref()) else { return 1.5 };
        let place = format!("{}.extensions.KHR_materials_ior.ior", m.place);
        if ior.ior.0 == 0.0 {
            // The extension's way to ask for a Fresnel term of one.
            self.report.warn(Fault::new(place, "0 (full reflection) is not supported; 1.5 is used"));
            return 1.5;
        }
        self.number(ior.ior.0, 1.0, f32::INFINITY, 1.5, &place)
    }

    fn normal_map(&mut self, m: &mut Reading<'_>, inner: MaterialId) -> Checked<MaterialId> {
        let Some(normal) = &m.json.normal_texture else { return Ok(inner) };
        let place = format!("{}.normalTexture", m.place);
        let scale = self.number(normal.scale, f32::MIN, f32::MAX, 1.0, &format!("{place}.scale"));
        match self.used(m, TextureUse::of_normal(normal, &place), ImageKind::Raw, &place) {
            Some(texture) => self.add_material(Material::NormalMap { inner, texture, scale, mirrors_with_uv: true }),
            None => Ok(inner),
        }
    }

    /// Whether every texel is black: exporters write such textures beside a factor of one.
    fn is_black(&self, id: TextureId) -> bool {
        let Texture::Image { image, .. } = &self.scene.textures[id.0 as usize] else { return false };
        image.texels.iter().all(|t| t.is_black())
    }

    /// Emissive factor, texture and KHR_materials_emissive_strength: a radiance in the scene's units.
    fn emission(&mut self, m: &mut Reading<'_>) -> Option<Emission> {
        let place = format!("{}.emissiveFactor", m.place);
        let factor = Rgb::from(m.json.emissive_factor.0.map(|v| self.number(v, 0.0, MOST_RADIANCE, 0.0, &place)));
        if factor.is_black() {
            return None;
        }
        let strength = m.json.extensions.as_ref().and_then(|e| e.emissive_strength.as_ref());
        let strength = strength.map_or(1.0, |s| {
            let place = format!("{}.extensions.KHR_materials_emissive_strength.emissiveStrength", m.place);
            self.number(s.emissive_strength.0, 0.0, MOST_RADIANCE, 1.0, &place)
        });
        let factor = (factor * strength).map(|v| v.min(MOST_RADIANCE));
        let texture = m.json.emissive_texture.as_ref();
        let radiance = self.colour(m, texture, factor, &format!("{}.emissiveTexture", m.place));
        let black = match radiance {
            RgbParam::Const(c) => c.is_black(),
            RgbParam::Texture(id, factor) => factor.is_black() || self.is_black(id),
        };
        (!black).then_some(Emission { radiance, two_sided: m.json.double_sided })
    }
}
