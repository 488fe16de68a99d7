//! Accessors: typed arrays in buffer views. Read through own code and not the crate's readers, which panic on damaged files.

use super::buffers::{Buffers, lookup};
use super::report::{Checked, Fault};
use gltf::json::Root;
use gltf::json::accessor::{Accessor as Json, ComponentType, Type, sparse};
use gltf::json::validation::Checked as Valid;

/// An accessor without bytes of its own (all zero but for its sparse elements) may not be longer than this.
const MOST_WITHOUT_BYTES: u64 = 1 << 24;

/// What a use of an accessor demands of it.
pub(super) struct Expect {
    /// Shape of an element.
    pub shape: Type,
    /// Allowed component types.
    pub components: &'static [ComponentType],
}

use ComponentType::{F32, I8, I16, U8, U16, U32};

/// Vertex positions, with KHR_mesh_quantization.
pub(super) const POSITION: Expect = Expect { shape: Type::Vec3, components: &[F32, I8, U8, I16, U16] };
/// Vertex normals, with KHR_mesh_quantization.
pub(super) const NORMAL: Expect = Expect { shape: Type::Vec3, components: &[F32, I8, I16] };
/// Texture coordinates, with KHR_mesh_quantization.
pub(super) const TEXCOORD: Expect = Expect { shape: Type::Vec2, components: &[F32, U8, U16, I8, I16] };
/// Corner indices.
pub(super) const INDICES: Expect = Expect { shape: Type::Scalar, components: &[U8, U16, U32] };
/// Translations and scales of EXT_mesh_gpu_instancing.
pub(super) const INSTANCE_VECTOR: Expect = Expect { shape: Type::Vec3, components: &[F32] };
/// Rotations of EXT_mesh_gpu_instancing.
pub(super) const INSTANCE_ROTATION: Expect = Expect { shape: Type::Vec4, components: &[F32, I8, I16] };

/// Equally spaced elements, known to lie within their bytes.
#[derive(Clone, Copy)]
struct Array<'a> {
    bytes: &'a [u8],
    stride: usize,
}

/// Elements that differ from the array's.
struct Sparse<'a> {
    /// Strictly increasing.
    indices: Vec<u32>,
    values: Array<'a>,
}

/// A checked accessor: elements `0..count` can be read without fail.
pub(super) struct Accessor<'a> {
    /// Number of elements.
    pub count: usize,
    base: Option<Array<'a>>,
    sparse: Option<Sparse<'a>>,
    component: ComponentType,
    normalized: bool,
}

impl<'a> Accessor<'a> {
    /// Opens accessor `index`, named in `place`.
    pub(super) fn open(
        root: &Root,
        buffers: &'a Buffers<'_>,
        index: usize,
        place: &str,
        expect: &Expect,
    ) -> Checked<Self> {
        let json = lookup(&root.accessors, index, place, "accessors")?;
        let own = format!("accessors[{index}]");
        let component = component_type(json, &own, place, expect)?;
        let count = json.count.0;
        let size = component.size() * expect.shape.multiplicity();
        let base = match json.buffer_view {
            Some(view) => {
                let view = buffers.view(view.value(), &format!("{own}.bufferView"))?;
                let stride = view.stride.unwrap_or(size);
                Some(array(view.bytes, json.byte_offset.unwrap_or_default().0, stride, size, count, &own)?)
            }
            None if count > MOST_WITHOUT_BYTES => {
                return Err(Fault::new(
                    format!("{own}.count"),
                    format!("{count} elements without a bufferView are too many"),
                ));
            }
            None => None,
        };
        let sparse = json.sparse.as_ref().map(|s| open_sparse(buffers, s, size, count, &own)).transpose()?;
        Ok(Self { count: count as usize, base, sparse, component, normalized: json.normalized })
    }

    /// Component `c` of element `i < count`, as it is stored: its bytes, or `None` for a zero.
    fn component(&self, i: usize, c: usize) -> Option<&'a [u8]> {
        let size = self.component.size();
        let replaced = self.sparse.as_ref().and_then(|s| {
            let at = s.indices.binary_search(&u32::try_from(i).ok()?).ok()?;
            Some((s.values, at))
        });
        let (array, i) = replaced.or(self.base.map(|b| (b, i)))?;
        let at = i * array.stride + c * size;
        array.bytes.get(at..at + size)
    }

    /// Element `i < count` as numbers; normalised integers become [0, 1] or [-1, 1] (glTF 2.0, 3.11).
    pub(super) fn floats<const N: usize>(&self, i: usize) -> [f32; N] {
        std::array::from_fn(|c| {
            let Some(bytes) = self.component(i, c) else { return 0.0 };
            let (value, top) = match (self.component, bytes) {
                (F32, &[a, b, c, d]) => return f32::from_le_bytes([a, b, c, d]),
                (U32, &[a, b, c, d]) => return u32::from_le_bytes([a, b, c, d]) as f32,
                (U16, &[a, b]) => (f32::from(u16::from_le_bytes([a, b])), 65_535.0),
                (I16, &[a, b]) => (f32::from(i16::from_le_bytes([a, b])), 32_767.0),
                (U8, &[a]) => (f32::from(a), 255.0),
                (_, &[a]) => (f32::from(a as i8), 127.0),
                _ => (0.0, 1.0),
            };
            if self.normalized { (value / top).max(-1.0) } else { value }
        })
    }

    /// Element `i < count` of an index accessor.
    pub(super) fn index(&self, i: usize) -> u32 {
        match self.component(i, 0) {
            Some(&[a, b, c, d]) => u32::from_le_bytes([a, b, c, d]),
            Some(&[a, b]) => u16::from_le_bytes([a, b]).into(),
            Some(&[a]) => a.into(),
            _ => 0,
        }
    }
}

fn component_type(json: &Json, own: &str, place: &str, expect: &Expect) -> Checked<ComponentType> {
    let Valid::Valid(shape) = json.type_ else {
        return Err(Fault::new(format!("{own}.type"), format!("not a type of glTF; expected {:?}", expect.shape)));
    };
    if shape != expect.shape {
        return Err(Fault::new(format!("{own}.type"), format!("{place} needs {:?}, this is {shape:?}", expect.shape)));
    }
    let component = match json.component_type {
        Valid::Valid(c) if expect.components.contains(&c.0) => c.0,
        Valid::Valid(c) => {
            let message = format!("{place} needs one of {:?}, this is {:?}", expect.components, c.0);
            return Err(Fault::new(format!("{own}.componentType"), message));
        }
        Valid::Invalid => {
            let message = format!("not a component type of glTF; expected one of {:?}", expect.components);
            return Err(Fault::new(format!("{own}.componentType"), message));
        }
    };
    Ok(component)
}

/// Checks that `count` elements of `size` bytes, `stride` apart from `offset` on, lie within `bytes`.
fn array<'a>(bytes: &'a [u8], offset: u64, stride: usize, size: usize, count: u64, own: &str) -> Checked<Array<'a>> {
    if stride < size {
        return Err(Fault::new(own, format!("elements of {size} bytes can't be {stride} bytes apart (byteStride)")));
    }
    let span = match count.checked_sub(1) {
        Some(steps) => steps.checked_mul(stride as u64).and_then(|s| s.checked_add(size as u64)),
        None => Some(0),
    };
    let inside = span.and_then(|s| s.checked_add(offset)).is_some_and(|end| end <= bytes.len() as u64);
    let rest = usize::try_from(offset).ok().and_then(|o| bytes.get(o..)).filter(|_| inside);
    let bytes = rest.ok_or_else(|| {
        let have = bytes.len();
        let message = format!(
            "{count} elements of {size} bytes, {stride} apart from byte {offset} on, do not fit the view ({have} bytes)"
        );
        Fault::new(own, message)
    })?;
    Ok(Array { bytes, stride })
}

fn open_sparse<'a>(
    buffers: &'a Buffers<'_>,
    json: &sparse::Sparse,
    size: usize,
    count: u64,
    own: &str,
) -> Checked<Sparse<'a>> {
    let place = format!("{own}.sparse");
    let number = json.count.0;
    if number > count {
        return Err(Fault::new(
            format!("{place}.count"),
            format!("{number} elements differ, but there are only {count}"),
        ));
    }
    let at = format!("{place}.indices");
    let Valid::Valid(kind) = json.indices.component_type else {
        return Err(Fault::new(format!("{at}.componentType"), "expected 5121, 5123 or 5125 (unsigned integers)"));
    };
    let width = kind.0.size();
    let view = buffers.view(json.indices.buffer_view.value(), &format!("{at}.bufferView"))?;
    let array_of_indices = array(view.bytes, json.indices.byte_offset.0, width, width, number, &at)?;
    let reader = Accessor {
        count: number as usize,
        base: Some(array_of_indices),
        sparse: None,
        component: kind.0,
        normalized: false,
    };
    let indices: Vec<u32> = (0..reader.count).map(|i| reader.index(i)).collect();
    let rising = indices.windows(2).all(|w| w[0] < w[1]);
    if !rising || indices.last().is_some_and(|last| u64::from(*last) >= count) {
        return Err(Fault::new(at, format!("indices must rise strictly and stay below {count}")));
    }
    let at = format!("{place}.values");
    let view = buffers.view(json.values.buffer_view.value(), &format!("{at}.bufferView"))?;
    let values = array(view.bytes, json.values.byte_offset.0, size, size, number, &at)?;
    Ok(Sparse { indices, values })
}
