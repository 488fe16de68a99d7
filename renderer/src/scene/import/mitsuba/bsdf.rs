//! Mitsuba's BSDFs.

use super::Builder;
use super::document::{MAX_DEPTH, NodeId};
use super::ior;
use super::reader::Reader;
use crate::bsdf::{Distribution, Material, MaterialId, Roughness};
use crate::scene::import::metals;
use crate::scene::import::number::Bound;
use crate::spectrum::Rgb;
use crate::texture::FloatParam;

/// The BSDFs that can be rendered.
const BSDFS: [&str; 8] =
    ["diffuse", "twosided", "conductor", "roughconductor", "dielectric", "roughdielectric", "normalmap", "null"];
/// Parameters that change nothing here.
const HARMLESS: [&str; 2] = ["sample_visible", "nonlinear"];
/// Mitsuba's smallest roughness.
const MIN_ALPHA: f32 = 1e-4;

impl Builder<'_, '_, '_> {
    /// The material `id`; `None` after an error.
    pub(super) fn material(&mut self, id: NodeId) -> Option<MaterialId> {
        if let Some(known) = self.materials.get(&id) {
            return *known;
        }
        let at = self.document.nodes[id].at;
        if self.open.contains(&id) || self.open.len() >= MAX_DEPTH {
            self.importer.error(at, "this BSDF contains itself, or nests too deep", "");
            return None;
        }
        self.open.push(id);
        let material = self.build_material(id);
        self.open.pop();
        let material = material.map(|m| self.importer.add_material(m));
        self.materials.insert(id, material);
        material
    }

    fn build_material(&mut self, id: NodeId) -> Option<Material> {
        let node = &self.document.nodes[id];
        let mut reader = match node.plugin.as_str() {
            known if BSDFS.contains(&known) => self.reader(id),
            _ => {
                self.unsupported(node.at, id, &BSDFS);
                return None;
            }
        };
        let material = match node.plugin.as_str() {
            "diffuse" => {
                Some(Material::Lambert { reflectance: self.rgb_param(&mut reader, "reflectance", Bound::Unit, 0.5) })
            }
            "twosided" => self.two_sided(&mut reader),
            "conductor" => Some(self.conductor(&mut reader, false)),
            "roughconductor" => Some(self.conductor(&mut reader, true)),
            "dielectric" => Some(self.dielectric(&mut reader, false)),
            "roughdielectric" => Some(self.dielectric(&mut reader, true)),
            "null" => Some(Material::Null),
            _ => self.normal_map(&mut reader),
        };
        reader.finish(self.importer, self.document, &HARMLESS);
        material
    }

    /// The materials nested in `reader`'s.
    fn nested(&mut self, reader: &mut Reader, most: usize) -> Option<Vec<MaterialId>> {
        let children = reader.children(self.document, "bsdf");
        if children.is_empty() || children.len() > most {
            let at = reader.node.at;
            let plugin = &reader.node.plugin;
            let expected = if most == 1 { "one BSDF" } else { "one or two BSDFs" };
            self.importer.error(at, format!("`{plugin}` needs {expected} inside, found {}", children.len()), "");
            return None;
        }
        let built: Vec<_> = children.into_iter().map(|(_, id)| self.material(id)).collect();
        built.into_iter().collect()
    }

    fn two_sided(&mut self, reader: &mut Reader) -> Option<Material> {
        reader.boolean(self.importer, "allow_transmission");
        let sides = self.nested(reader, 2)?;
        for side in &sides {
            if self.transmits(*side) {
                let help = "use the inner BSDF by itself: it has both sides already";
                self.importer.error(reader.node.at, "a BSDF that transmits light can't be made two-sided", help);
                return None;
            }
        }
        let front = self.front_of(sides[0]);
        let back = self.front_of(*sides.last().unwrap_or(&sides[0]));
        Some(Material::TwoSided { front, back })
    }

    /// What `material` shows when seen from its front: each side of a two-sided BSDF sees the front of the BSDF nested there.
    fn front_of(&self, material: MaterialId) -> MaterialId {
        match self.importer.scene.materials[material.0 as usize] {
            Material::TwoSided { front, .. } => front,
            _ => material,
        }
    }

    fn transmits(&self, material: MaterialId) -> bool {
        match self.importer.scene.materials[material.0 as usize] {
            Material::Dielectric { .. } | Material::Null => true,
            Material::NormalMap { inner, .. } => self.transmits(inner),
            _ => false,
        }
    }

    fn conductor(&mut self, reader: &mut Reader, rough: bool) -> Material {
        let importer = &mut *self.importer;
        // Without anything given it is a mirror, in version 0.6 copper.
        let own = reader.has("eta") || reader.has("k");
        let copper = metals::metal("Cu").filter(|_| reader.node.legacy && !own);
        let mut indices = copper.unwrap_or((Rgb::ZERO, Rgb::ONE));
        if let Some((name, at)) = reader.string(importer, "material") {
            match metals::metal(name) {
                Some(known) => indices = known,
                None => importer.error(at, format!("no conductor is called {name:?}"), metals::help(name)),
            }
            if name != "none" && own {
                importer.error(at, "both `material` and `eta`, `k` are given", "leave one of them out");
            }
        }
        for name in ["eta", "k"] {
            if let Some((child, _)) = reader.named_child(name) {
                importer.error(child.at, format!("a texture for `{name}` is not supported"), "give it an <rgb>");
            }
        }
        let eta = reader.rgb(importer, "eta", Bound::NotNegative).unwrap_or(indices.0);
        let k = reader.rgb(importer, "k", Bound::NotNegative).unwrap_or(indices.1);
        // Version 0.6 gives the index of the outside; both indices are relative to it.
        let outside = 1.0 / ior::index(importer, reader, "ext_eta", 1.0) as f32;
        Material::Conductor {
            eta: eta * outside,
            k: k * outside,
            reflectance: self.rgb_param(reader, "specular_reflectance", Bound::Unit, 1.0),
            roughness: rough.then(|| self.roughness(reader)),
        }
    }

    fn dielectric(&mut self, reader: &mut Reader, rough: bool) -> Material {
        let inside = ior::index(self.importer, reader, "int_ior", 1.5046);
        let outside = ior::index(self.importer, reader, "ext_ior", 1.000_277);
        Material::Dielectric {
            eta: (inside / outside) as f32,
            reflectance: self.rgb_param(reader, "specular_reflectance", Bound::Unit, 1.0),
            transmittance: self.rgb_param(reader, "specular_transmittance", Bound::Unit, 1.0),
            roughness: rough.then(|| self.roughness(reader)),
        }
    }

    /// `alpha`, or `alpha_u` and `alpha_v`; Beckmann by default.
    fn roughness(&mut self, reader: &mut Reader) -> Roughness {
        let distributions = [("beckmann", Distribution::Beckmann), ("ggx", Distribution::Ggx)];
        let distribution = reader.choice(self.importer, "distribution", &distributions);
        let (two, one) = (reader.has("alpha_u") || reader.has("alpha_v"), reader.has("alpha"));
        if two && (one || !(reader.has("alpha_u") && reader.has("alpha_v"))) {
            self.importer.error(reader.node.at, "give either `alpha`, or both `alpha_u` and `alpha_v`", "");
        }
        let mut alpha = |name| match self.float_param(reader, name, Bound::NotNegative, 0.1) {
            FloatParam::Const(v) => FloatParam::Const(v.max(MIN_ALPHA)),
            textured => textured,
        };
        let both = alpha("alpha");
        let [alpha_u, alpha_v] = if two { [alpha("alpha_u"), alpha("alpha_v")] } else { [both, both] };
        Roughness { distribution, alpha_u, alpha_v }
    }

    fn normal_map(&mut self, reader: &mut Reader) -> Option<Material> {
        for name in ["flip_invalid_normals", "use_shadowing_function"] {
            reader.boolean(self.importer, name);
        }
        let Some((_, texture)) = reader.named_child("normalmap") else {
            self.importer.error(reader.node.at, "`normalmap` needs a texture called `normalmap`", "");
            return None;
        };
        let texture = self.texture(texture, false);
        let inner = *self.nested(reader, 1)?.first()?;
        let wrong = match self.importer.scene.materials[inner.0 as usize] {
            Material::NormalMap { .. } => Some("a normal map inside a normal map is not supported"),
            Material::Null => Some("a surface that is not there (null) has no normals to bend"),
            _ => None,
        };
        if let Some(message) = wrong {
            self.importer.error(reader.node.at, message, "");
            return None;
        }
        Some(Material::NormalMap { inner, texture: texture?, scale: 1.0, mirrors_with_uv: false })
    }

    /// The material of a shape that has none: diffuse, black when it emits.
    pub(super) fn default_material(&mut self, emits: bool) -> MaterialId {
        if let Some(known) = self.defaults[usize::from(emits)] {
            return known;
        }
        let reflectance = crate::texture::RgbParam::Const(Rgb::splat(if emits { 0.0 } else { 0.5 }));
        let id = self.importer.add_material(Material::Lambert { reflectance });
        self.defaults[usize::from(emits)] = Some(id);
        id
    }
}
