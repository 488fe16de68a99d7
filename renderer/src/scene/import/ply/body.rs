//! The numbers of a PLY file's body, one after the other.

use super::header::{Kind, Property};
use crate::scene::import::mesh_file::MeshFileError;

/// A stream of numbers.
pub(super) trait Body {
    /// The next number.
    fn number(&mut self, kind: Kind) -> Result<f64, MeshFileError>;
    /// Bytes not read yet.
    fn remaining(&self) -> usize;
    /// The fewest bytes that a number takes.
    fn least_value(&self, kind: Kind) -> usize;
    /// A fault at the place reached.
    fn error(&self, message: &str) -> MeshFileError;

    /// The fewest bytes that a property takes.
    fn least_size(&self, property: &Property) -> usize {
        self.least_value(property.list.unwrap_or(property.kind))
    }
}

/// Numbers as text.
pub(super) struct Ascii<'b> {
    bytes: &'b [u8],
    at: usize,
    line: usize,
}

impl<'b> Ascii<'b> {
    /// The body starts at byte `at`, after `lines` lines.
    pub fn new(bytes: &'b [u8], at: usize, lines: usize) -> Self {
        Self { bytes, at, line: lines + 1 }
    }
}

impl Body for Ascii<'_> {
    fn number(&mut self, kind: Kind) -> Result<f64, MeshFileError> {
        while let Some(b) = self.bytes.get(self.at).filter(|b| b.is_ascii_whitespace()) {
            self.line += usize::from(*b == b'\n');
            self.at += 1;
        }
        let rest = &self.bytes[self.at..];
        let length = rest.iter().position(u8::is_ascii_whitespace).unwrap_or(rest.len());
        let word = &rest[..length];
        if word.is_empty() {
            return Err(self.error("the file ends before its last number"));
        }
        self.at += length;
        let value = std::str::from_utf8(word).ok().and_then(|w| w.parse::<f64>().ok()).filter(|v| v.is_finite());
        value.ok_or_else(|| {
            let shown = String::from_utf8_lossy(&word[..length.min(40)]).into_owned();
            self.error(&format!("{shown:?} is not a finite number ({kind:?} expected)"))
        })
    }

    fn remaining(&self) -> usize {
        // The last number needs no separator.
        self.bytes.len() - self.at + 1
    }

    fn least_value(&self, _: Kind) -> usize {
        2
    }

    fn error(&self, message: &str) -> MeshFileError {
        MeshFileError::line(self.line, message)
    }
}

macro_rules! binary {
    ($(#[$doc:meta])* $name:ident, $from:ident) => {
        $(#[$doc])*
        pub(super) struct $name<'b> {
            bytes: &'b [u8],
            at: usize,
        }

        impl<'b> $name<'b> {
            /// The body starts at byte `at`.
            pub fn new(bytes: &'b [u8], at: usize) -> Self {
                Self { bytes, at }
            }

            #[inline]
            fn take<const N: usize>(&mut self) -> Result<[u8; N], MeshFileError> {
                let Some(value) = self.bytes[self.at..].first_chunk::<N>() else {
                    return Err(self.error("the file ends before its last number"));
                };
                self.at += N;
                Ok(*value)
            }
        }

        impl Body for $name<'_> {
            #[inline]
            fn number(&mut self, kind: Kind) -> Result<f64, MeshFileError> {
                Ok(match kind {
                    Kind::I8 => f64::from(i8::$from(self.take()?)),
                    Kind::U8 => f64::from(u8::$from(self.take()?)),
                    Kind::I16 => f64::from(i16::$from(self.take()?)),
                    Kind::U16 => f64::from(u16::$from(self.take()?)),
                    Kind::I32 => f64::from(i32::$from(self.take()?)),
                    Kind::U32 => f64::from(u32::$from(self.take()?)),
                    Kind::F32 => f64::from(f32::$from(self.take()?)),
                    Kind::F64 => f64::$from(self.take()?),
                })
            }

            fn remaining(&self) -> usize {
                self.bytes.len() - self.at
            }

            fn least_value(&self, kind: Kind) -> usize {
                kind.size()
            }

            fn error(&self, message: &str) -> MeshFileError {
                MeshFileError::byte(self.at, message)
            }
        }
    };
}

binary! {
    /// Least significant byte first.
    Little, from_le_bytes
}
binary! {
    /// Most significant byte first.
    Big, from_be_bytes
}
