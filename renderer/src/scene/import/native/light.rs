//! Lights that are not shapes.

use super::table::{Item, Table};
use super::{Builder, texture, transform};
use crate::math::DVec3;
use crate::scene::desc::{LightDesc, SpotFalloff};
use crate::scene::import::image::ImageKind;
use crate::scene::import::importer::Importer;
use crate::scene::import::number::Bound;
use crate::spectrum::Rgb;

#[derive(Clone, Copy)]
enum Kind {
    Point,
    Spot,
    Directional,
    Constant,
    Environment,
}

const KINDS: [(&str, Kind); 5] = [
    ("point", Kind::Point),
    ("spot", Kind::Spot),
    ("directional", Kind::Directional),
    ("constant", Kind::Constant),
    ("environment", Kind::Environment),
];

impl<'t> Builder<'t, '_, '_> {
    /// Adds the lights.
    pub(super) fn lights(&mut self, item: Item<'t>) {
        let Some(list) = item.list(self.importer, "lights", "tables [[lights]]") else { return };
        for (i, item) in list.into_iter().enumerate() {
            let table = item.table(self.importer, &format!("light {}", i + 1));
            let light = table.and_then(|t| light(self.importer, t));
            self.importer.scene.lights.extend(light);
        }
    }
}

fn light(importer: &mut Importer, mut table: Table) -> Option<LightDesc> {
    let light = match table.kind(importer, &KINDS)? {
        Kind::Point => {
            let position = table.required_vector(importer, "position");
            let intensity = power(importer, &mut table, "intensity");
            position.map(|position| LightDesc::Point { position, intensity })
        }
        Kind::Spot => spot(importer, &mut table),
        Kind::Directional => {
            let direction = direction(importer, &mut table, None);
            let irradiance = power(importer, &mut table, "irradiance");
            direction.map(|direction| LightDesc::Directional { direction, irradiance })
        }
        Kind::Constant => Some(LightDesc::Constant { radiance: power(importer, &mut table, "radiance") }),
        Kind::Environment => {
            let to_world = transform::of(importer, &mut table);
            let scale = table.rgb(importer, "scale", Bound::NotNegative, Rgb::ONE);
            let image = texture::picture(importer, &mut table, ImageKind::Srgb);
            image.map(|image| LightDesc::Environment { image, scale, to_world })
        }
    };
    table.finish(importer);
    light
}

fn power(importer: &mut Importer, table: &mut Table, key: &'static str) -> Rgb {
    table.rgb(importer, key, Bound::NotNegative, Rgb::ONE)
}

/// `direction`; or, for a light at a place, `to`, the point that it shines at.
fn direction(importer: &mut Importer, table: &mut Table, from: Option<DVec3>) -> Option<DVec3> {
    let direction = match from.filter(|_| table.has("to")) {
        Some(from) => table.vector(importer, "to")? - from,
        None => table.required_vector(importer, "direction")?,
    };
    if direction.try_normalize().is_none() {
        importer.error(table.at, format!("the direction of {} has no length", table.name), "");
        return None;
    }
    Some(direction)
}

fn spot(importer: &mut Importer, table: &mut Table) -> Option<LightDesc> {
    let position = table.required_vector(importer, "position");
    let direction = direction(importer, table, Some(position.unwrap_or_default()));
    let intensity = power(importer, table, "intensity");
    let cutoff = table.number_or(importer, "cutoff", Bound::Inside(0.0, 180.0), 30.0);
    let beam = table.number_or(importer, "beam", Bound::Between(0.0, cutoff), 0.75 * cutoff);
    let falloffs = [("linear-angle", SpotFalloff::LinearAngle), ("squared-cosine", SpotFalloff::SquaredCosine)];
    let falloff = table.choice(importer, "falloff", &falloffs);
    Some(LightDesc::Spot { position: position?, direction: direction?, intensity, beam, cutoff, falloff })
}
