//! Shapes.

use super::table::{Item, Table};
use super::{Builder, mesh, transform};
use crate::diagnostics::nearest;
use crate::geometry::MeshId;
use crate::math::{DAffine3, DVec3};
use crate::scene::desc::{Emission, ShapeDesc, ShapeKind};
use crate::scene::import::importer::{Place, short_name};
use crate::scene::import::number::Bound;
use crate::scene::import::transform::is_similarity;

#[derive(Clone, Copy)]
enum Kind {
    Sphere,
    Rectangle,
    Cube,
    Disk,
    Mesh,
}

const KINDS: [(&str, Kind); 5] = [
    ("sphere", Kind::Sphere),
    ("rectangle", Kind::Rectangle),
    ("cube", Kind::Cube),
    ("disk", Kind::Disk),
    ("mesh", Kind::Mesh),
];

impl<'t> Builder<'t, '_, '_> {
    /// Places the shapes.
    pub(super) fn shapes(&mut self, item: Item<'t>) {
        let Some(list) = item.list(self.importer, "shapes", "tables [[shapes]]") else { return };
        for (i, item) in list.into_iter().enumerate() {
            let name = format!("shape {}", i + 1);
            if let Some(table) = item.table(self.importer, &name) {
                self.shape(table, name);
            }
        }
    }

    fn shape(&mut self, mut table: Table<'t>, default_name: String) {
        let at = table.at;
        let name = table.string(self.importer, "name").map_or(default_name, |(name, _)| short_name(name));
        let Some(kind) = table.kind(self.importer, &KINDS) else { return };
        let mut to_world = transform::of(self.importer, &mut table);
        let kind = match kind {
            Kind::Rectangle => Some(ShapeKind::Rectangle),
            Kind::Cube => Some(ShapeKind::Cube),
            Kind::Disk => Some(ShapeKind::Disk),
            Kind::Sphere => {
                let centre = table.vector(self.importer, "center").unwrap_or_default();
                let radius = table.number_or(self.importer, "radius", Bound::Positive, 1.0);
                let own = DAffine3::from_translation(centre) * DAffine3::from_scale(DVec3::splat(radius));
                to_world *= own;
                Some(ShapeKind::Sphere)
            }
            Kind::Mesh => self.mesh_of_shape(&mut table).map(ShapeKind::Mesh),
        };
        let material = match table.get("material") {
            Some(item) => item.string(self.importer, "material").and_then(|name| self.material(item.at, name)),
            None => Some(self.default_material()),
        };
        let radiance = self.rgb_param(&mut table, "emission", Bound::NotNegative, 0.0);
        let two_sided = table.boolean(self.importer, "emission_two_sided", false);
        let emission = table.has("emission").then_some(Emission { radiance, two_sided });
        let flip_normals = table.boolean(self.importer, "flip_normals", false);
        let interior = table.get("interior").and_then(|item| self.medium("interior", item));
        let priority = table.integer(self.importer, "priority", i64::from(i32::MIN), i64::from(i32::MAX)).unwrap_or(0);
        let places = self.instances(&mut table);
        table.finish(self.importer);
        if let (Some(kind), Some(material)) = (kind, material) {
            let priority = priority as i32;
            let shape = ShapeDesc { name, kind, to_world, flip_normals, material, emission, interior, priority };
            self.place(at, &shape, places.as_deref());
        }
    }

    /// A shape where its transform puts it, or once for each of `places`, which are applied after it.
    fn place(&mut self, at: Place, shape: &ShapeDesc, places: Option<&[DAffine3]>) {
        for (i, place) in places.unwrap_or(&[DAffine3::IDENTITY]).iter().enumerate() {
            let to_world = *place * shape.to_world;
            if shape.kind == ShapeKind::Sphere && !is_similarity(&to_world.matrix3) {
                let help = "use a mesh for an ellipsoid";
                self.importer.error(at, "a sphere can be scaled only the same along all axes", help);
                return;
            }
            if !self.importer.check_placement(at, to_world) {
                return;
            }
            let name =
                if places.is_some() { format!("{}, instance {}", shape.name, i + 1) } else { shape.name.clone() };
            self.importer.add_shape(at, ShapeDesc { name, to_world, ..shape.clone() });
        }
    }

    fn instances(&mut self, table: &mut Table<'t>) -> Option<Vec<DAffine3>> {
        let item = table.get("instances")?;
        let list = item.list(self.importer, "instances", "a list of transforms")?;
        Some(list.into_iter().map(|item| transform::read(self.importer, "instances", item)).collect())
    }

    /// `mesh = "name"`, or `file = "path"` for a mesh that is used only here.
    fn mesh_of_shape(&mut self, table: &mut Table<'t>) -> Option<MeshId> {
        if let Some((file, at)) = table.string(self.importer, "file") {
            return mesh::plain_file(self.importer, at, file);
        }
        let item = table.require(self.importer, "mesh", "the name of a mesh, or `file`")?;
        let name = item.string(self.importer, "mesh")?;
        if let Some(known) = self.meshes.get(name) {
            return *known;
        }
        let near = nearest(name, self.meshes.keys().copied());
        let help = near.map_or("meshes are tables [meshes.NAME]".into(), |n| format!("did you mean {n:?}?"));
        self.importer.error(item.at, format!("no mesh is called {name:?}"), help);
        None
    }
}
