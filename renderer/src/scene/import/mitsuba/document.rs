//! Mitsuba's XML as a flat list of objects with typed parameters: `$parameters` substituted, includes merged, names of version
//! 0.6 spelled as in version 3.

use super::guard;
use super::parameters::Parameters;
use super::value::{self, Value};
use super::xml::Attributes;
use crate::diagnostics::nearest;
use crate::scene::bundle::resolve;
use crate::scene::import::importer::{Importer, Place};
use std::collections::BTreeMap;

/// Deeper nesting of elements, includes or references is refused.
pub(super) const MAX_DEPTH: usize = 64;
/// More elements, over all included files, are refused.
const MAX_ELEMENTS: u32 = 4_000_000;
/// More parameters of one object are refused.
const MAX_PROPS: usize = 1000;
/// More included files are refused.
const MAX_INCLUDES: usize = 1000;

/// Elements that are objects.
const OBJECTS: [&str; 14] = [
    "scene",
    "integrator",
    "sensor",
    "film",
    "rfilter",
    "sampler",
    "bsdf",
    "texture",
    "emitter",
    "shape",
    "medium",
    "phase",
    "volume",
    "subsurface",
];
/// Elements that are something else.
const OTHERS: [&str; 17] = [
    "boolean",
    "integer",
    "float",
    "string",
    "point",
    "vector",
    "rgb",
    "srgb",
    "spectrum",
    "blackbody",
    "transform",
    "ref",
    "default",
    "include",
    "alias",
    "path",
    "animation",
];

/// Index of an object.
pub(super) type NodeId = usize;

/// An object: a plugin with parameters and nested objects.
#[derive(Debug)]
pub(super) struct Node {
    /// The element's name, one of [`OBJECTS`].
    pub tag: &'static str,
    /// The plugin.
    pub plugin: String,
    /// Its id, or empty.
    pub id: String,
    /// Where it stands.
    pub at: Place,
    /// Whether its file is of version 0.6 or older.
    pub legacy: bool,
    /// Its parameters.
    pub props: Vec<Prop>,
    /// Nested and referenced objects.
    pub children: Vec<Child>,
}

/// A parameter.
#[derive(Debug)]
pub(super) struct Prop {
    pub name: String,
    pub value: Value,
    pub at: Place,
}

/// A nested or referenced object.
#[derive(Debug)]
pub(super) struct Child {
    /// The name under which the parent knows it; may be empty.
    pub name: String,
    /// Where it is nested or referenced.
    pub at: Place,
    pub target: Target,
}

/// What a child is.
#[derive(Debug)]
pub(super) enum Target {
    Node(NodeId),
    Reference(String),
}

/// All objects of a scene; the first is the `<scene>` itself.
#[derive(Debug, Default)]
pub(super) struct Document {
    pub nodes: Vec<Node>,
    ids: BTreeMap<String, NodeId>,
}

impl Document {
    /// The object that `child` is; `None` when no object has the id.
    pub fn target(&self, child: &Child) -> Option<NodeId> {
        match &child.target {
            Target::Node(id) => Some(*id),
            Target::Reference(id) => self.ids.get(id).copied(),
        }
    }

    /// All ids, for did-you-mean.
    pub fn known_ids(&self) -> impl Iterator<Item = &str> {
        self.ids.keys().map(String::as_str)
    }
}

/// Reads the file `root` and all that it includes; faults are left in `importer`.
pub(super) fn read(importer: &mut Importer, root: &str) -> Document {
    let mut reader =
        Reader { importer, document: Document::default(), parameters: Parameters::default(), elements: 0, includes: 0 };
    reader.file(None, root, None, 0);
    reader.document
}

struct Reader<'i, 'a> {
    importer: &'i mut Importer<'a>,
    document: Document,
    parameters: Parameters,
    elements: u32,
    includes: usize,
}

/// The file an element stands in.
#[derive(Clone, Copy)]
struct FileContext<'p> {
    file: usize,
    path: &'p str,
    /// Names are spelled as in version 0.6 or older.
    legacy: bool,
}

impl Reader<'_, '_> {
    fn file(&mut self, from: Option<Place>, path: &str, parent: Option<NodeId>, depth: usize) {
        let Some((file, bytes)) = self.importer.read_text(from, path) else { return };
        let text = String::from_utf8_lossy(&bytes);
        if let Err((offset, message)) = guard::check(&bytes) {
            return self.importer.error(Place { file, offset }, message, "");
        }
        let options = roxmltree::ParsingOptions { nodes_limit: MAX_ELEMENTS, ..Default::default() };
        let xml = match roxmltree::Document::parse_with_options(&text, options) {
            Ok(xml) => xml,
            Err(e) => {
                let place = format!("line {}, column {}", e.pos().row, e.pos().col);
                self.importer.file_error(path, &place, &format!("this is not well-formed XML: {e}"));
                return;
            }
        };
        let root = xml.root_element();
        let legacy = self.is_legacy(Place { file, offset: root.range().start }, root.attribute("version"));
        let context = FileContext { file, path, legacy };
        match parent {
            // An included scene's objects join the one that includes it.
            Some(parent) if root.has_tag_name("scene") => self.children(root, context, parent, depth),
            Some(parent) => self.element(root, context, parent, depth),
            None if root.has_tag_name("scene") => {
                let at = Place { file, offset: root.range().start };
                self.push(Node {
                    tag: "scene",
                    plugin: String::new(),
                    id: String::new(),
                    at,
                    legacy,
                    props: vec![],
                    children: vec![],
                });
                self.children(root, context, 0, depth);
            }
            None => {
                let at = Place { file, offset: root.range().start };
                let name = root.tag_name().name();
                self.importer.error(at, format!("the outermost element is <{name}>, expected <scene>"), "");
            }
        }
    }

    fn is_legacy(&mut self, at: Place, version: Option<&str>) -> bool {
        let major = version.and_then(|v| v.split('.').next()).and_then(|v| v.trim().parse::<u32>().ok());
        if major.is_none() {
            let help = "write version=\"3.0.0\", or \"0.6.0\" for the names of Mitsuba 0.6";
            self.importer.warn(
                at,
                "the outermost element has no version like \"3.0.0\": that of Mitsuba 3 is taken",
                help,
            );
        }
        major.is_some_and(|m| m < 2)
    }

    fn push(&mut self, node: Node) -> NodeId {
        self.document.nodes.push(node);
        self.document.nodes.len() - 1
    }

    fn children(&mut self, xml: roxmltree::Node, context: FileContext, parent: NodeId, depth: usize) {
        for child in xml.children().filter(roxmltree::Node::is_element) {
            self.element(child, context, parent, depth + 1);
        }
    }

    fn element(&mut self, xml: roxmltree::Node, context: FileContext, parent: NodeId, depth: usize) {
        let at = Place { file: context.file, offset: xml.range().start };
        self.elements += 1;
        if depth > MAX_DEPTH || self.elements > MAX_ELEMENTS {
            if depth == MAX_DEPTH + 1 || self.elements == MAX_ELEMENTS + 1 {
                let what = format!("elements nest deeper than {MAX_DEPTH}, or there are more than {MAX_ELEMENTS}");
                self.importer.error(at, what, "");
            }
            return;
        }
        let tag = xml.tag_name().name();
        let Some(attributes) = self.attributes(xml, at) else { return };
        let object = OBJECTS.iter().find(|&&o| o == tag && tag != "scene");
        // `<spectrum type="...">` is a plugin.
        let object = object.copied().or((tag == "spectrum" && attributes.get("type").is_some()).then_some("texture"));
        if let Some(tag) = object {
            return self.object(xml, tag, &attributes, context, parent, depth);
        }
        match tag {
            "default" => self.default(&attributes),
            "include" => self.include(&attributes, context, parent, depth),
            "alias" => self.alias(&attributes),
            "ref" => self.reference(&attributes, context, parent),
            _ if OTHERS.contains(&tag) => self.parameter(xml, tag, &attributes, context, parent),
            _ => {
                let known = OBJECTS.iter().chain(&OTHERS).copied();
                let help = nearest(tag, known).map_or(String::new(), |n| format!("did you mean <{n}>?"));
                self.importer.error(at, format!("the element <{tag}> is not supported here"), help);
            }
        }
    }

    /// The attributes with parameters substituted.
    fn attributes<'x>(&mut self, xml: roxmltree::Node<'x, '_>, at: Place) -> Option<Attributes<'x>> {
        let mut attributes = Attributes::new(xml.tag_name().name(), at);
        for a in xml.attributes() {
            match self.parameters.substitute(a.value()) {
                Ok(value) => attributes.push(a.name(), value),
                Err(message) => {
                    self.importer.error(at, message, "");
                    return None;
                }
            }
        }
        Some(attributes)
    }

    fn object(
        &mut self,
        xml: roxmltree::Node,
        tag: &'static str,
        attributes: &Attributes,
        context: FileContext,
        parent: NodeId,
        depth: usize,
    ) {
        let at = attributes.at;
        attributes.check(self.importer, &["type", "id", "name"]);
        let Some(plugin) = attributes.require(self.importer, "type") else { return };
        let (plugin, id) = (plugin.to_string(), attributes.get("id").unwrap_or("").to_string());
        let node = self.push(Node {
            tag,
            plugin,
            id: id.clone(),
            at,
            legacy: context.legacy,
            props: vec![],
            children: vec![],
        });
        if !id.is_empty() && self.document.ids.insert(id.clone(), node).is_some() {
            self.importer.error(at, format!("the id {id:?} is given twice"), "");
        }
        let name = value::modern_name(attributes.get("name").unwrap_or(""), context.legacy);
        self.document.nodes[parent].children.push(Child { name, at, target: Target::Node(node) });
        self.children(xml, context, node, depth);
    }

    fn default(&mut self, attributes: &Attributes) {
        attributes.check(self.importer, &["name", "value"]);
        let name = attributes.require(self.importer, "name");
        let value = attributes.require(self.importer, "value");
        let (Some(name), Some(value)) = (name, value) else { return };
        if let Err(message) = self.parameters.set_default(name, value) {
            self.importer.error(attributes.at, message, "");
        }
    }

    fn include(&mut self, attributes: &Attributes, context: FileContext, parent: NodeId, depth: usize) {
        attributes.check(self.importer, &["filename", "name"]);
        if let Some(name) = attributes.require(self.importer, "filename") {
            let path = resolve(context.path, name);
            self.includes += 1;
            // The depth ends a file that includes itself, the count one that does so twice.
            if self.includes <= MAX_INCLUDES {
                self.file(Some(attributes.at), &path, Some(parent), depth + 1);
            } else if self.includes == MAX_INCLUDES + 1 {
                self.importer.error(attributes.at, format!("more than {MAX_INCLUDES} files are included"), "");
            }
        }
    }

    fn alias(&mut self, attributes: &Attributes) {
        attributes.check(self.importer, &["id", "as"]);
        let (id, new) = (attributes.require(self.importer, "id"), attributes.require(self.importer, "as"));
        let (Some(id), Some(new)) = (id, new) else { return };
        match self.document.ids.get(id) {
            Some(&node) => {
                self.document.ids.insert(new.to_string(), node);
            }
            None => {
                self.importer.error(attributes.at, format!("no object with the id {id:?} comes before its alias"), "")
            }
        }
    }

    fn reference(&mut self, attributes: &Attributes, context: FileContext, parent: NodeId) {
        attributes.check(self.importer, &["id", "name"]);
        let Some(id) = attributes.require(self.importer, "id") else { return };
        let name = value::modern_name(attributes.get("name").unwrap_or(""), context.legacy);
        let target = Target::Reference(id.to_string());
        self.document.nodes[parent].children.push(Child { name, at: attributes.at, target });
    }

    fn parameter(
        &mut self,
        xml: roxmltree::Node,
        tag: &str,
        attributes: &Attributes,
        context: FileContext,
        parent: NodeId,
    ) {
        let at = attributes.at;
        let Some(name) = attributes.require(self.importer, "name") else { return };
        let name = value::modern_name(name, context.legacy);
        let value = if tag == "transform" {
            attributes.check(self.importer, &["name"]);
            self.transform(xml, context)
        } else {
            for child in xml.children().filter(roxmltree::Node::is_element) {
                let at = Place { file: context.file, offset: child.range().start };
                self.importer.warn(at, format!("elements inside <{tag}> are ignored"), "");
            }
            value::parse(self.importer, tag, attributes, context.legacy)
        };
        let Some(value) = value else { return };
        let props = &mut self.document.nodes[parent].props;
        if props.len() >= MAX_PROPS {
            self.importer.error(at, format!("an object has more than {MAX_PROPS} parameters"), "");
        } else if props.iter().any(|p| p.name == name) {
            self.importer.error(at, format!("the parameter `{name}` is given twice"), "");
        } else {
            props.push(Prop { name, value, at });
        }
    }

    fn transform(&mut self, xml: roxmltree::Node, context: FileContext) -> Option<Value> {
        let mut steps = Vec::new();
        for child in xml.children().filter(roxmltree::Node::is_element) {
            let at = Place { file: context.file, offset: child.range().start };
            steps.push(self.attributes(child, at)?);
        }
        super::transform::compose(self.importer, &steps).map(Value::Transform)
    }
}
