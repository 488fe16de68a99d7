//! Materials.

use super::Builder;
use super::table::{Item, Table};
use crate::bsdf::{Distribution, Material, MaterialId, Roughness};
use crate::diagnostics::nearest;
use crate::scene::import::importer::Place;
use crate::scene::import::metals;
use crate::scene::import::number::Bound;
use crate::spectrum::Rgb;
use crate::texture::{FloatParam, RgbParam};
use toml::de::DeValue;

#[derive(Clone, Copy)]
enum Kind {
    Diffuse,
    Conductor,
    Dielectric,
    Gltf,
    TwoSided,
    NormalMap,
    Null,
}

const KINDS: [(&str, Kind); 7] = [
    ("diffuse", Kind::Diffuse),
    ("conductor", Kind::Conductor),
    ("dielectric", Kind::Dielectric),
    ("gltf", Kind::Gltf),
    ("two-sided", Kind::TwoSided),
    ("normal-map", Kind::NormalMap),
    ("null", Kind::Null),
];
/// Smallest and largest microfacet slope.
const ALPHA: Bound = Bound::Between(0.0, 4.0);
/// Smallest and largest index of refraction.
const INDEX: Bound = Bound::Between(0.1, 10.0);

/// A material on its way.
#[derive(Clone, Copy)]
pub(super) enum Entry<'t> {
    /// Not built yet.
    Waiting(Item<'t>),
    /// Being built: whoever asks for it is part of a circle.
    Open,
    /// Built; `None` after an error.
    Built(Option<MaterialId>),
}

impl<'t> Builder<'t, '_, '_> {
    /// Builds all materials, in the order of their names.
    pub(super) fn materials(&mut self, table: &Table<'t>) {
        self.materials.extend(table.all().map(|(name, _, item)| (name, Entry::Waiting(item))));
        for (name, at, _) in table.all() {
            self.material(at, name);
        }
    }

    /// The material called `name`, asked for at `at`.
    pub(super) fn material(&mut self, at: Place, name: &'t str) -> Option<MaterialId> {
        let item = match self.materials.get(name) {
            Some(Entry::Built(id)) => return *id,
            Some(Entry::Waiting(item)) => *item,
            Some(Entry::Open) => {
                self.importer.error(at, format!("the material {name:?} contains itself"), "");
                return None;
            }
            None => {
                let near = nearest(name, self.materials.keys().copied());
                let help =
                    near.map_or("materials are tables [materials.NAME]".into(), |n| format!("did you mean {n:?}?"));
                self.importer.error(at, format!("no material is called {name:?}"), help);
                return None;
            }
        };
        self.materials.insert(name, Entry::Open);
        let table = item.table(self.importer, &format!("the material {name:?}"));
        let built = table.and_then(|t| self.build_material(t));
        self.materials.insert(name, Entry::Built(built));
        built
    }

    fn build_material(&mut self, mut table: Table<'t>) -> Option<MaterialId> {
        let kind = table.kind(self.importer, &KINDS)?;
        let material = match kind {
            Kind::Diffuse => {
                Some(Material::Lambert { reflectance: self.rgb_param(&mut table, "reflectance", Bound::Unit, 0.5) })
            }
            Kind::Conductor => Some(self.conductor(&mut table)),
            Kind::Dielectric => Some(self.dielectric(&mut table)),
            Kind::Gltf => Some(self.metallic_roughness(&mut table)),
            Kind::TwoSided => self.two_sided(&mut table),
            Kind::NormalMap => self.normal_map(&mut table),
            Kind::Null => Some(Material::Null),
        };
        let one_sided = matches!(kind, Kind::Diffuse | Kind::Conductor);
        let both_sides = one_sided && table.boolean(self.importer, "two_sided", false);
        table.finish(self.importer);
        let id = self.importer.add_material(material?);
        Some(if both_sides { self.importer.add_material(Material::TwoSided { front: id, back: id }) } else { id })
    }

    fn conductor(&mut self, table: &mut Table<'t>) -> Material {
        let importer = &mut *self.importer;
        let mut indices = (Rgb::ZERO, Rgb::ONE);
        if let Some((name, at)) = table.string(importer, "metal") {
            match metals::metal(name) {
                Some(known) => indices = known,
                None => importer.error(at, format!("no metal is called {name:?}"), metals::help(name)),
            }
            if table.has("eta") || table.has("k") {
                importer.error(at, "both `metal` and `eta`, `k` are given", "leave one of them out");
            }
        }
        let eta = table.rgb(importer, "eta", Bound::NotNegative, indices.0);
        let k = table.rgb(importer, "k", Bound::NotNegative, indices.1);
        let reflectance = self.rgb_param(table, "reflectance", Bound::Unit, 1.0);
        Material::Conductor { eta, k, reflectance, roughness: self.roughness(table) }
    }

    fn dielectric(&mut self, table: &mut Table<'t>) -> Material {
        let inside = table.number_or(self.importer, "ior", INDEX, 1.5);
        let outside = table.number_or(self.importer, "exterior_ior", INDEX, 1.0);
        let reflectance = self.rgb_param(table, "reflectance", Bound::Unit, 1.0);
        let transmittance = self.rgb_param(table, "transmittance", Bound::Unit, 1.0);
        let roughness = self.roughness(table);
        Material::Dielectric { eta: (inside / outside) as f32, reflectance, transmittance, roughness }
    }

    /// `alpha = a` or `alpha = [along u, along v]`; without it the surface is smooth.
    fn roughness(&mut self, table: &mut Table<'t>) -> Option<Roughness> {
        let distributions = [("ggx", Distribution::Ggx), ("beckmann", Distribution::Beckmann)];
        let distribution = table.choice(self.importer, "distribution", &distributions);
        let item = table.get("alpha")?;
        let (alpha_u, alpha_v) = if let DeValue::Array(_) = item.value {
            let [u, v] = item.exactly(self.importer, "alpha", "a number, or one along u and one along v")?;
            (self.float_param("alpha", u, ALPHA), self.float_param("alpha", v, ALPHA))
        } else {
            let both = self.float_param("alpha", item, ALPHA);
            (both, both)
        };
        Some(Roughness { distribution, alpha_u: alpha_u?, alpha_v: alpha_v? })
    }

    fn metallic_roughness(&mut self, table: &mut Table<'t>) -> Material {
        let mut unit = |key, default| {
            let item = table.get(key);
            item.and_then(|item| self.float_param(key, item, Bound::Unit)).unwrap_or(FloatParam::Const(default))
        };
        let (metallic, roughness) = (unit("metallic", 1.0), unit("roughness", 1.0));
        let transmission = unit("transmission", 0.0);
        let base_color: RgbParam = self.rgb_param(table, "base_color", Bound::Unit, 1.0);
        let ior = table.number_or(self.importer, "ior", Bound::Between(1.0, 10.0), 1.5) as f32;
        let thin = table.boolean(self.importer, "thin", true);
        Material::Gltf { base_color, metallic, roughness, ior, transmission, thin }
    }

    /// The materials `front` and `back` (the same as `front` by default).
    fn two_sided(&mut self, table: &mut Table<'t>) -> Option<Material> {
        let front = self.inner(table, "front");
        let back = if table.get("back").is_some() { self.inner(table, "back") } else { front };
        Some(Material::TwoSided { front: front?, back: back? })
    }

    fn normal_map(&mut self, table: &mut Table<'t>) -> Option<Material> {
        let inner = self.inner(table, "material");
        let texture = self.required_texture(table, "texture");
        let scale = table.number_or(self.importer, "scale", Bound::Any, 1.0) as f32;
        if let Some(Material::NormalMap { .. }) = inner.map(|id| self.importer.scene.materials[id.0 as usize]) {
            self.importer.error(table.at, "a normal map inside a normal map is not supported", "");
            return None;
        }
        Some(Material::NormalMap { inner: inner?, texture: texture?, scale, mirrors_with_uv: true })
    }

    /// The material that `key` names.
    fn inner(&mut self, table: &mut Table<'t>, key: &'static str) -> Option<MaterialId> {
        let item = table.require(self.importer, key, "the name of a material")?;
        let name = item.string(self.importer, key)?;
        let id = self.material(item.at, name)?;
        if self.importer.scene.materials[id.0 as usize] == Material::Null {
            self.importer.error(item.at, "a surface that is not there (null) can't be part of another material", "");
            return None;
        }
        Some(id)
    }

    /// The material of shapes that name none: two-sided grey.
    pub(super) fn default_material(&mut self) -> MaterialId {
        if let Some(id) = self.grey {
            return id;
        }
        let reflectance = RgbParam::Const(Rgb::splat(0.5));
        let front = self.importer.add_material(Material::Lambert { reflectance });
        let id = self.importer.add_material(Material::TwoSided { front, back: front });
        self.grey = Some(id);
        id
    }
}
