//! The header of a PLY file.

use crate::scene::import::mesh_file::MeshFileError;

/// Longer headers are refused.
const MAX_HEADER: usize = 1 << 20;
/// More elements, or properties of one, are refused.
const MAX_ITEMS: usize = 1000;

/// How the body is written.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Encoding {
    Ascii,
    Little,
    Big,
}

/// Type of a number.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Kind {
    I8,
    U8,
    I16,
    U16,
    I32,
    U32,
    F32,
    F64,
}

impl Kind {
    fn of(name: &str) -> Option<Self> {
        Some(match name {
            "char" | "int8" => Self::I8,
            "uchar" | "uint8" => Self::U8,
            "short" | "int16" => Self::I16,
            "ushort" | "uint16" => Self::U16,
            "int" | "int32" => Self::I32,
            "uint" | "uint32" => Self::U32,
            "float" | "float32" => Self::F32,
            "double" | "float64" => Self::F64,
            _ => return None,
        })
    }

    /// In bytes.
    pub fn size(self) -> usize {
        match self {
            Self::I8 | Self::U8 => 1,
            Self::I16 | Self::U16 => 2,
            Self::I32 | Self::U32 | Self::F32 => 4,
            Self::F64 => 8,
        }
    }
}

/// A property of an element: a number, or a list of numbers with a count before it.
#[derive(Clone, Debug)]
pub(super) struct Property {
    pub name: String,
    pub kind: Kind,
    /// Type of the count.
    pub list: Option<Kind>,
}

impl Property {
    /// Whether it is the single number `name`.
    pub fn is_scalar(&self, name: &str) -> bool {
        self.list.is_none() && self.name == name
    }
}

/// A kind of record and how many there are.
#[derive(Clone, Debug)]
pub(super) struct Element {
    pub name: String,
    pub count: usize,
    pub properties: Vec<Property>,
}

/// What comes before the body.
#[derive(Debug)]
pub(super) struct Header {
    pub encoding: Encoding,
    pub elements: Vec<Element>,
    /// Where the body starts.
    pub end: usize,
    /// Lines before the body.
    pub lines: usize,
}

/// Reads the header.
pub(super) fn parse(bytes: &[u8]) -> Result<Header, MeshFileError> {
    let mut encoding = None;
    let mut elements: Vec<Element> = Vec::new();
    let mut end = 0;
    for line in 1.. {
        let rest = &bytes[end..bytes.len().min(MAX_HEADER)];
        let Some(length) = rest.iter().position(|&b| b == b'\n') else {
            return Err(MeshFileError::line(line, "the header has no end: expected a line `end_header`"));
        };
        end += length + 1;
        let text = String::from_utf8_lossy(&rest[..length]);
        let words: Vec<&str> = text.split_ascii_whitespace().collect();
        match (line, words.as_slice()) {
            (1, ["ply"]) => {}
            (1, _) => return Err(MeshFileError::line(1, "this is not a PLY file: its first line must be `ply`")),
            (_, ["end_header"]) => {
                let encoding = encoding
                    .ok_or_else(|| MeshFileError::line(line, "the header has no line `format` before `end_header`"))?;
                return Ok(Header { encoding, elements, end, lines: line });
            }
            (_, ["format", name, _]) => encoding = Some(format(name).map_err(|e| MeshFileError::line(line, e))?),
            (_, [] | ["comment" | "obj_info", ..]) => {}
            _ => declaration(&words, &mut elements).map_err(|e| MeshFileError::line(line, e))?,
        }
    }
    Err(MeshFileError::line(1, "the header has no end"))
}

fn format(name: &str) -> Result<Encoding, String> {
    match name {
        "ascii" => Ok(Encoding::Ascii),
        "binary_little_endian" => Ok(Encoding::Little),
        "binary_big_endian" => Ok(Encoding::Big),
        _ => Err(format!("unknown format {name:?}: expected ascii, binary_little_endian or binary_big_endian")),
    }
}

fn declaration(words: &[&str], elements: &mut Vec<Element>) -> Result<(), String> {
    let kind =
        |name: &str| Kind::of(name).ok_or_else(|| format!("unknown type {name:?}: expected float, int, uchar, ..."));
    let property = match *words {
        ["element", name, count] => {
            let count = count.parse().map_err(|_| format!("{count:?} is not a number of elements"))?;
            if elements.len() >= MAX_ITEMS {
                return Err(format!("more than {MAX_ITEMS} elements"));
            }
            elements.push(Element { name: name.to_string(), count, properties: Vec::new() });
            return Ok(());
        }
        ["property", "list", counts, values, name] => {
            Property { name: name.to_string(), kind: kind(values)?, list: Some(kind(counts)?) }
        }
        ["property", values, name] => Property { name: name.to_string(), kind: kind(values)?, list: None },
        _ => return Err(format!("the header line {:?} is not understood", words.join(" "))),
    };
    let element = elements.last_mut().ok_or("a property before the first element")?;
    if element.properties.len() >= MAX_ITEMS {
        return Err(format!("more than {MAX_ITEMS} properties of one element"));
    }
    element.properties.push(property);
    Ok(())
}
