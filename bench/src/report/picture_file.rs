//! Pictures of other renderers: OpenEXR and PFM.

use serde::Deserialize;
use std::path::Path;

/// How a picture is stored.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Format {
    /// OpenEXR.
    Exr,
    /// Portable float map, three channels.
    Pfm,
}

impl Format {
    /// How its files' names end.
    pub fn extension(self) -> &'static str {
        match self {
            Self::Exr => "exr",
            Self::Pfm => "pfm",
        }
    }
}

/// Width and height.
type Size = (u32, u32);

/// Linear Rec.709, row by row from the top; the picture must have the size asked for.
pub fn read(path: &Path, format: Format, size: Size) -> Result<Vec<[f32; 3]>, String> {
    let fail = |e: String| format!("{}: {e}", path.display());
    let (found, pixels) = match format {
        Format::Exr => {
            let picture = compare::pair::read(path)?;
            ((picture.width, picture.height), compare::pair::colours(&picture).map_err(fail)?)
        }
        Format::Pfm => {
            let bytes = std::fs::read(path).map_err(|e| fail(e.to_string()))?;
            pfm(&bytes).map_err(fail)?
        }
    };
    if found != size {
        return Err(fail(format!("it has {} x {} pixels, not {} x {}", found.0, found.1, size.0, size.1)));
    }
    Ok(pixels)
}

/// `PF`, width, height, scale (negative: little-endian), one white space, then rows from the bottom up.
fn pfm(bytes: &[u8]) -> Result<(Size, Vec<[f32; 3]>), String> {
    let mut at = 0;
    let mut word = || {
        let rest = &bytes[at..];
        let start = rest.iter().position(|b| !b.is_ascii_whitespace())?;
        let length = rest[start..].iter().position(u8::is_ascii_whitespace)?;
        at += start + length + 1;
        std::str::from_utf8(&rest[start..start + length]).ok()
    };
    let header = (|| {
        let magic = word()?;
        let (width, height): (u32, u32) = (word()?.parse().ok()?, word()?.parse().ok()?);
        Some((magic, width, height, word()?.parse::<f32>().ok()?))
    })();
    let (magic, width, height, scale) = header.ok_or("its header is not that of a PFM")?;
    if magic != "PF" {
        return Err(format!("it starts with {magic:?}; a PFM of three channels starts with \"PF\""));
    }
    let expected = 12 * u64::from(width) * u64::from(height);
    let body = &bytes[at.min(bytes.len())..];
    if width == 0 || height == 0 || body.len() as u64 != expected {
        return Err(format!("{width} x {height} pixels take {expected} bytes, but {} follow the header", body.len()));
    }
    let float = |b: &[u8]| {
        let four = [b[0], b[1], b[2], b[3]];
        if scale < 0.0 { f32::from_le_bytes(four) } else { f32::from_be_bytes(four) }
    };
    let rows = body.chunks_exact(12 * width as usize).rev();
    let pixel = |p: &[u8]| [float(&p[0..4]), float(&p[4..8]), float(&p[8..12])];
    Ok(((width, height), rows.flat_map(|row| row.chunks_exact(12).map(pixel)).collect()))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rows_of_a_pfm_go_up() {
        let mut bytes = b"PF\n1 2\n-1.0\n".to_vec();
        bytes.extend([1.0f32, 2.0, 3.0, 4.0, 5.0, 6.0].iter().flat_map(|v| v.to_le_bytes()));
        assert_eq!(pfm(&bytes).unwrap(), ((1, 2), vec![[4.0, 5.0, 6.0], [1.0, 2.0, 3.0]]));
        let mut big = b"PF 1 1 1.0 ".to_vec();
        big.extend([1.0f32, 2.0, 3.0].iter().flat_map(|v| v.to_be_bytes()));
        assert_eq!(pfm(&big).unwrap(), ((1, 1), vec![[1.0, 2.0, 3.0]]));
    }

    #[test]
    fn broken_files_are_refused() {
        for bytes in [
            &b""[..],
            b"PF",
            b"Pf 1 1 -1.0 abcd",
            b"PF 2 1 -1.0 abcdabcdabcd",
            b"PF 0 0 -1.0 ",
            b"PF 99999999 99999999 1 ",
        ] {
            assert!(pfm(bytes).is_err(), "{bytes:?}");
        }
    }
}
