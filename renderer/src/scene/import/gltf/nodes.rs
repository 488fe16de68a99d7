//! The node hierarchy: placed meshes, instances, cameras and lights.

use super::Importer;
use super::accessor::{self, Accessor, Expect};
use super::buffers::lookup;
use super::report::{Checked, Fault, shorten};
use crate::geometry::{Mesh, MeshId};
use crate::math::{DAffine3, DMat3, DMat4, DVec3, Transform, Vec3};
use crate::scene::desc::{ShapeDesc, ShapeKind};
use glam::{DQuat, DVec4};
use gltf::json;

/// More placed primitives than this are refused: a few bytes of JSON can ask for any number.
const MOST_PLACED: usize = 1 << 21;
/// Coordinates beyond this would overflow f32 when squared.
const FARTHEST: f64 = 1e18;

impl Importer<'_> {
    /// Walks the scene from its roots in the order of the file.
    pub(super) fn nodes(&mut self) -> Checked<()> {
        let roots = self.roots()?;
        let mut reached = vec![false; self.root.nodes.len()];
        let mut stack: Vec<(usize, DAffine3, String)> =
            roots.into_iter().rev().map(|(node, place)| (node, DAffine3::IDENTITY, place)).collect();
        while let Some((index, parent, place)) = stack.pop() {
            let Some(node) = self.report.check(lookup(&self.root.nodes, index, &place, "nodes")) else { continue };
            if std::mem::replace(&mut reached[index], true) {
                let message = format!("nodes[{index}] is reached a second time; the nodes must form a tree");
                self.report.fault(Fault::new(place, message).help("remove the cycle or the second parent"));
                continue;
            }
            if hidden(node) {
                continue;
            }
            let own = format!("nodes[{index}]");
            let Some(to_world) = self.report.check(local(node, &own).and_then(|l| finite(parent * l, &own))) else {
                continue;
            };
            self.content(index, node, to_world);
            if self.placed > MOST_PLACED {
                return Err(Fault::new(own, format!("more than {MOST_PLACED} objects are placed")));
            }
            let children = node.children.as_deref().unwrap_or_default().iter().enumerate().rev();
            stack.extend(children.map(|(i, child)| (child.value(), to_world, format!("{own}.children[{i}]"))));
        }
        Ok(())
    }

    /// The default scene's roots, the first scene's where none is named, and all nodes without parent where there is no scene.
    fn roots(&mut self) -> Checked<Vec<(usize, String)>> {
        let scenes = &self.root.scenes;
        if scenes.is_empty() && self.root.scene.is_none() {
            self.report.warn(Fault::new("scenes", "there is no scene; every node without a parent is shown"));
            let mut parent = vec![false; self.root.nodes.len()];
            for child in self.root.nodes.iter().filter_map(|n| n.children.as_ref()).flatten() {
                if let Some(p) = parent.get_mut(child.value()) {
                    *p = true;
                }
            }
            return Ok((0..parent.len()).filter(|i| !parent[*i]).map(|i| (i, format!("nodes[{i}]"))).collect());
        }
        let index = self.root.scene.map_or(0, |s| s.value());
        let scene = lookup(scenes, index, "scene", "scenes")?;
        if scenes.len() > 1 {
            let message = format!("of {} scenes only scenes[{index}] is shown", scenes.len());
            self.report.warn(Fault::new("scenes", message));
        }
        let nodes = scene.nodes.iter().enumerate();
        Ok(nodes.map(|(i, n)| (n.value(), format!("scenes[{index}].nodes[{i}]"))).collect())
    }

    fn content(&mut self, index: usize, node: &json::Node, to_world: DAffine3) {
        let own = format!("nodes[{index}]");
        if let Some(camera) = node.camera {
            let result = self.camera(camera.value(), to_world, &format!("{own}.camera"));
            self.report.check(result);
        }
        if let Some(light) = node.extensions.as_ref().and_then(|e| e.khr_lights_punctual.as_ref()) {
            let result = self.light(light.light.value(), to_world, &format!("{own}.extensions.KHR_lights_punctual"));
            self.report.check(result);
        }
        if let Some(mesh) = node.mesh {
            if node.skin.is_some() {
                self.report.sum("skins are not supported; the mesh is shown as stored, at its node", "", &own);
            }
            let result = self.placed_mesh(node, mesh.value(), to_world, &own);
            self.report.check(result);
        }
    }

    /// Places every primitive of a mesh, once or once per instance.
    fn placed_mesh(&mut self, node: &json::Node, mesh: usize, to_world: DAffine3, own: &str) -> Checked<()> {
        let json = lookup(&self.root.meshes, mesh, &format!("{own}.mesh"), "meshes")?;
        let name =
            node.name.as_ref().or(json.name.as_ref()).filter(|n| !n.is_empty()).map_or(own.into(), |n| shorten(n));
        let instancing = node.extensions.as_ref().and_then(|e| e.others.get("EXT_mesh_gpu_instancing"));
        let primitives = json.primitives.len();
        let places = match instancing {
            Some(extension) => self.instances(extension, to_world, own)?,
            None => vec![to_world],
        };
        self.placed = self.placed.saturating_add(places.len().saturating_mul(primitives.max(1)));
        if self.placed > MOST_PLACED {
            return Ok(());
        }
        let many = primitives > 1;
        for (i, primitive) in json.primitives.iter().enumerate() {
            let place = format!("meshes[{mesh}].primitives[{i}]");
            let surface = self.surface(primitive.material.map(|m| m.value()), &format!("{place}.material"))?;
            let made = self.primitive(mesh, i, surface.uv_set);
            let Some(Some(id)) = self.report.check(made) else { continue };
            let name = if many { format!("{name}/{i}") } else { name.clone() };
            let shape = |name: String, to_world| ShapeDesc {
                name,
                kind: ShapeKind::Mesh(id),
                to_world,
                flip_normals: false,
                material: surface.material,
                emission: surface.emission,
                interior: surface.interior,
                priority: 0,
            };
            for (k, to_world) in places.iter().enumerate() {
                let name = if instancing.is_some() { format!("{name}#{k}") } else { name.clone() };
                self.place(shape(name, *to_world), id, own)?;
            }
        }
        Ok(())
    }

    /// EXT_mesh_gpu_instancing: translation, rotation and scale per instance, applied before the node's own transform.
    fn instances(&mut self, extension: &serde_json::Value, to_world: DAffine3, own: &str) -> Checked<Vec<DAffine3>> {
        let place = format!("{own}.extensions.EXT_mesh_gpu_instancing.attributes");
        let attributes = extension.get("attributes").and_then(|a| a.as_object());
        let attributes = attributes.ok_or_else(|| Fault::new(&place, "expected an object"))?;
        let open = |name: &str, expect: &Expect| -> Checked<Option<Accessor<'_>>> {
            let Some(value) = attributes.get(name) else { return Ok(None) };
            let place = format!("{place}.{name}");
            let index = value.as_u64().and_then(|i| usize::try_from(i).ok());
            let index = index.ok_or_else(|| Fault::new(&place, "expected the index of an accessor"))?;
            Accessor::open(self.root, self.buffers, index, &place, expect).map(Some)
        };
        let translation = open("TRANSLATION", &accessor::INSTANCE_VECTOR)?;
        let rotation = open("ROTATION", &accessor::INSTANCE_ROTATION)?;
        let scale = open("SCALE", &accessor::INSTANCE_VECTOR)?;
        let mut counts = [&translation, &rotation, &scale].into_iter().flatten().map(|a| a.count);
        let count = counts.next().unwrap_or(0);
        if counts.any(|c| c != count) {
            return Err(Fault::new(place, "TRANSLATION, ROTATION and SCALE must have the same count"));
        }
        if count > MOST_PLACED - self.placed {
            self.placed = usize::MAX;
            return Ok(Vec::new());
        }
        let one = |i: usize| {
            let translation = translation.as_ref().map_or([0.0; 3], |a| a.floats(i));
            let rotation = rotation.as_ref().map_or([0.0, 0.0, 0.0, 1.0], |a| a.floats(i));
            let scale = scale.as_ref().map_or([1.0; 3], |a| a.floats(i));
            finite(to_world * compose(translation, rotation, scale, &place)?, &place)
        };
        let numbered = |i: usize| one(i).map_err(|e| Fault::new(format!("{} (instance {i})", e.place), e.message));
        (0..count).map(numbered).collect()
    }

    /// Adds a placed mesh. Where its transform can't be inverted (flattened meshes are common) it is applied to a copy of the mesh.
    fn place(&mut self, mut shape: ShapeDesc, mesh: MeshId, own: &str) -> Checked<()> {
        if Transform::new(shape.to_world).is_none() {
            let Some(baked) = self.bake(mesh, shape.to_world, own)? else {
                self.report.sum("the mesh is scaled to nothing and is left out", "", own);
                return Ok(());
            };
            shape.kind = ShapeKind::Mesh(self.add_mesh(baked)?);
            shape.to_world = DAffine3::IDENTITY;
        }
        let ShapeKind::Mesh(mesh) = shape.kind else { return Ok(()) };
        let (low, high) = self.mesh_bounds(mesh);
        for i in 0..8 {
            let pick = |bit: usize, axis: usize| if i >> bit & 1 == 1 { high[axis] } else { low[axis] };
            let corner = shape.to_world.transform_point3(DVec3::new(pick(0, 0), pick(1, 1), pick(2, 2)));
            if !(corner.abs().max_element() <= FARTHEST) {
                return Err(Fault::new(own, format!("it reaches {corner}; coordinates must stay below {FARTHEST:e}")));
            }
            self.bounds.0 = self.bounds.0.min(corner);
            self.bounds.1 = self.bounds.1.max(corner);
        }
        self.scene.shapes.push(shape);
        Ok(())
    }

    fn bake(&mut self, mesh: MeshId, to_world: DAffine3, own: &str) -> Checked<Option<Mesh>> {
        let source = &self.scene.meshes[mesh.0 as usize];
        let (vertices, triangles, uvs) = (source.positions.len(), source.triangles.len(), !source.uvs.is_empty());
        self.charge_mesh(vertices, false, uvs, triangles, own)?;
        let source = &self.scene.meshes[mesh.0 as usize];
        let map = |p: &Vec3| to_world.transform_point3(p.as_dvec3()).as_vec3();
        let positions: Vec<Vec3> = source.positions.iter().map(map).collect();
        let has_area = |t: &[u32; 3]| {
            let [a, b, c] = t.map(|i| positions[i as usize].as_dvec3());
            (b - a).cross(c - a).length_squared() > 0.0
        };
        if !source.triangles.iter().any(has_area) {
            return Ok(None);
        }
        let baked =
            Mesh { positions, normals: Vec::new(), uvs: source.uvs.clone(), triangles: source.triangles.clone() };
        baked.validate().map_err(|e| Fault::new(own, e.to_string()))?;
        Ok(Some(baked))
    }

    /// Corners of the box around a mesh in its own space.
    fn mesh_bounds(&mut self, mesh: MeshId) -> (DVec3, DVec3) {
        let meshes = &self.scene.meshes;
        *self.mesh_boxes.entry(mesh).or_insert_with(|| {
            let positions = meshes[mesh.0 as usize].positions.iter();
            let start = (Vec3::INFINITY, Vec3::NEG_INFINITY);
            let (low, high) = positions.fold(start, |(low, high), p| (low.min(*p), high.max(*p)));
            (low.as_dvec3(), high.as_dvec3())
        })
    }
}

/// KHR_node_visibility: whether the node and all below it are not to be seen.
fn hidden(node: &json::Node) -> bool {
    let extension = node.extensions.as_ref().and_then(|e| e.others.get("KHR_node_visibility"));
    extension.and_then(|e| e.get("visible")).is_some_and(|v| v == &serde_json::Value::Bool(false))
}

/// A node's own transform: its matrix, or translation * rotation * scale.
fn local(node: &json::Node, own: &str) -> Checked<DAffine3> {
    let Some(matrix) = node.matrix else {
        let rotation = node.rotation.map_or([0.0, 0.0, 0.0, 1.0], |r| r.0);
        return compose(node.translation.unwrap_or([0.0; 3]), rotation, node.scale.unwrap_or([1.0; 3]), own);
    };
    let m = DMat4::from_cols_array(&matrix.map(f64::from));
    if !m.row(3).abs_diff_eq(DVec4::W, 1e-6) {
        return Err(Fault::new(format!("{own}.matrix"), "its last row must be 0, 0, 0, 1 (elements 3, 7, 11 and 15)"));
    }
    Ok(DAffine3 { matrix3: DMat3::from_mat4(m), translation: m.w_axis.truncate() })
}

fn compose(translation: [f32; 3], rotation: [f32; 4], scale: [f32; 3], own: &str) -> Checked<DAffine3> {
    let rotation = DQuat::from_array(rotation.map(f64::from));
    let length = rotation.length();
    if !(length > 1e-6 && length.is_finite()) {
        return Err(Fault::new(format!("{own}.rotation"), "it must be a quaternion of length 1 (x, y, z, w)"));
    }
    let vector = |v: [f32; 3]| DVec3::from_array(v.map(f64::from));
    Ok(DAffine3::from_scale_rotation_translation(vector(scale), rotation / length, vector(translation)))
}

/// Refuses transforms with infinite numbers.
fn finite(transform: DAffine3, own: &str) -> Checked<DAffine3> {
    let far = transform.translation.abs().max_element();
    if transform.is_finite() && far <= FARTHEST {
        return Ok(transform);
    }
    Err(Fault::new(own, format!("its transform leads to numbers beyond {FARTHEST:e}")))
}
