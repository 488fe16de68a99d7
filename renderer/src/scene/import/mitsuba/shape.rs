//! Mitsuba's shapes, groups and instances.

use super::Builder;
use super::document::NodeId;
use super::medium::Sides;
use super::reader::Reader;
use crate::math::DAffine3;
use crate::scene::desc::{ShapeDesc, ShapeKind};
use crate::scene::import::importer::{Place, short_name};
use crate::scene::import::mesh_file::{MeshOptions, Normals};
use crate::scene::import::number::Bound;
use crate::scene::import::transform::is_similarity;
use std::rc::Rc;

/// The shapes that can be rendered.
const SHAPES: [&str; 8] = ["rectangle", "cube", "sphere", "disk", "obj", "ply", "shapegroup", "instance"];
/// Parameters that change nothing here.
const HARMLESS: [&str; 4] = ["silhouette_sampling_weight", "collapse", "srgb", "shape_index"];

/// The shapes of a `shapegroup`, in the group's space.
pub(super) type Group = Rc<[ShapeDesc]>;

impl Builder<'_, '_, '_> {
    /// Places the shape `id` of the scene.
    pub(super) fn shape(&mut self, id: NodeId) {
        match self.document.nodes[id].plugin.as_str() {
            // A group is seen only where it is instanced; building it now reports what is wrong with it.
            "shapegroup" => drop(self.group(id)),
            "instance" => self.instance(id),
            _ => {
                let at = self.document.nodes[id].at;
                if let Some(shape) = self.single(id) {
                    self.importer.add_shape(at, shape);
                }
            }
        }
    }

    /// A shape that is neither group nor instance.
    fn single(&mut self, id: NodeId) -> Option<ShapeDesc> {
        let node = &self.document.nodes[id];
        if !SHAPES.contains(&node.plugin.as_str()) {
            self.unsupported(node.at, id, &SHAPES);
            return None;
        }
        let name = self.shape_name(id);
        let mut reader = self.reader(id);
        let mut to_world = reader.transform(self.importer, "to_world");
        let mut flip_normals = reader.boolean(self.importer, "flip_normals").unwrap_or(false);
        let kind = match node.plugin.as_str() {
            "rectangle" => Some(ShapeKind::Rectangle),
            "cube" => Some(ShapeKind::Cube),
            "disk" => Some(ShapeKind::Disk),
            "sphere" => self.sphere(&mut reader, &mut to_world),
            plugin => self.mesh(&mut reader, plugin == "obj", to_world, &mut flip_normals),
        };
        let emission = self.emission(&mut reader);
        let Sides { interior, any } = self.sides(&mut reader);
        let material = self.shape_material(&mut reader, emission.is_some(), any);
        reader.finish(self.importer, self.document, &HARMLESS);
        Some(ShapeDesc {
            name,
            kind: kind?,
            to_world,
            flip_normals,
            material: material?,
            emission,
            interior,
            priority: 0,
        })
    }

    /// The id, or the kind and a count.
    fn shape_name(&mut self, id: NodeId) -> String {
        let node = &self.document.nodes[id];
        if !node.id.is_empty() {
            return short_name(&node.id);
        }
        let count = self.shape_names.entry(node.plugin.clone()).or_default();
        *count += 1;
        format!("{} {count}", node.plugin)
    }

    fn shape_material(
        &mut self,
        reader: &mut Reader,
        emits: bool,
        bounds_medium: bool,
    ) -> Option<crate::bsdf::MaterialId> {
        let materials = reader.children(self.document, "bsdf");
        if let Some((child, _)) = materials.get(1) {
            self.importer.error(child.at, "a shape can have one BSDF only", "");
        }
        match materials.first() {
            Some((_, id)) => self.material(*id),
            // Version 0.6 takes a shape between two media for a border of equal indices, unless it says otherwise.
            None if bounds_medium && !emits && reader.node.legacy => {
                Some(self.importer.add_material(crate::bsdf::Material::Null))
            }
            None => Some(self.default_material(emits)),
        }
    }

    /// `center` and `radius` come before `to_world`.
    fn sphere(&mut self, reader: &mut Reader, to_world: &mut DAffine3) -> Option<ShapeKind> {
        let centre = reader.vector(self.importer, "center").unwrap_or_default();
        let radius = reader.float_or(self.importer, "radius", Bound::Positive, 1.0);
        *to_world = *to_world * DAffine3::from_translation(centre) * DAffine3::from_scale(glam::DVec3::splat(radius));
        let at = reader.node.at;
        if !is_similarity(&to_world.matrix3) {
            self.importer.error(
                at,
                "a sphere can be scaled only the same along all axes",
                "use a mesh for an ellipsoid",
            );
            return None;
        }
        self.importer.check_placement(at, *to_world).then_some(ShapeKind::Sphere)
    }

    /// OBJ flips v, PLY does not. Without vertex normals Mitsuba computes smooth ones in world space, unless `face_normals`.
    fn mesh(
        &mut self,
        reader: &mut Reader,
        obj: bool,
        to_world: DAffine3,
        flip_normals: &mut bool,
    ) -> Option<ShapeKind> {
        let importer = &mut *self.importer;
        let file = reader.string(importer, "filename");
        let flat = reader.boolean(importer, "face_normals").unwrap_or(false);
        let flip_v = reader.boolean(importer, "flip_tex_coords").unwrap_or(obj);
        if let Some(prop) = reader.get("max_smooth_angle") {
            importer.warn(prop.at, "`max_smooth_angle` is ignored", "");
        }
        let Some((name, at)) = file else {
            importer.error(reader.node.at, format!("`{}` needs a `filename`", reader.node.plugin), "");
            return None;
        };
        // Mitsuba turns a flat mesh inside out where its own transform mirrors; here mirroring keeps the outside outside.
        if flat && to_world.matrix3.determinant() < 0.0 {
            *flip_normals = !*flip_normals;
        }
        let normals = if flat { Normals::Flat } else { Normals::smooth(to_world.matrix3) };
        importer.mesh(at, name, MeshOptions { flip_v, normals }).map(ShapeKind::Mesh)
    }

    fn group(&mut self, id: NodeId) -> Option<Group> {
        if let Some(known) = self.groups.get(&id) {
            return known.clone();
        }
        let mut reader = self.reader(id);
        let mut shapes = Vec::new();
        let mut whole = true;
        for (child, shape) in reader.children(self.document, "shape") {
            if matches!(self.document.nodes[shape].plugin.as_str(), "shapegroup" | "instance") {
                self.importer.error(child.at, "a group inside a group is not supported", "");
                whole = false;
                continue;
            }
            match self.single(shape) {
                Some(desc) if desc.emission.is_some() => {
                    self.importer.error(
                        child.at,
                        "a shape that emits can't be instanced",
                        "place it in the scene itself",
                    );
                    whole = false;
                }
                Some(desc) => shapes.push(desc),
                None => whole = false,
            }
        }
        reader.finish(self.importer, self.document, &["to_world"]);
        let group = whole.then(|| Rc::from(shapes));
        self.groups.insert(id, group.clone());
        group
    }

    fn instance(&mut self, id: NodeId) {
        let name = self.shape_name(id);
        let mut reader = self.reader(id);
        let to_world = reader.transform(self.importer, "to_world");
        let groups = reader.children(self.document, "shape");
        let at: Place = reader.node.at;
        match groups.as_slice() {
            [(_, group)] if self.document.nodes[*group].plugin == "shapegroup" => {
                for shape in self.group(*group).iter().flat_map(|g| g.iter()) {
                    if self.importer.is_full() {
                        break;
                    }
                    let name = format!("{name}/{}", shape.name);
                    let placed = ShapeDesc { name, to_world: to_world * shape.to_world, ..shape.clone() };
                    self.importer.add_shape(at, placed);
                }
            }
            _ => self.importer.error(at, "an instance needs one reference to a `shapegroup`", ""),
        }
        reader.finish(self.importer, self.document, &[]);
    }
}
