//! Whether two files hold the same bits.

use renderer::film::exr::Picture;
use serde::Serialize;

/// Where two pictures differ.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Difference {
    /// Values with other bits; `None` when sizes or channel names differ already.
    pub values: Option<usize>,
    /// The first of them, or what differs.
    pub first: String,
}

/// Compares sizes, channel names and every bit of every value (NaN equals the same NaN). Metadata is not compared.
pub fn compare(a: &Picture, b: &Picture) -> Option<Difference> {
    if (a.width, a.height) != (b.width, b.height) {
        let first = format!("{} x {} and {} x {} pixels", a.width, a.height, b.width, b.height);
        return Some(Difference { values: None, first });
    }
    let names = |p: &Picture| p.channels.iter().map(|(n, _)| n.clone()).collect::<Vec<_>>().join(", ");
    if names(a) != names(b) {
        return Some(Difference { values: None, first: format!("channels {} and {}", names(a), names(b)) });
    }
    let (mut values, mut first) = (0, None);
    for ((name, x), (_, y)) in a.channels.iter().zip(&b.channels) {
        for (i, (x, y)) in x.iter().zip(y).enumerate().filter(|(_, (x, y))| x.to_bits() != y.to_bits()) {
            values += 1;
            let (column, row) = (i as u32 % a.width, i as u32 / a.width);
            first.get_or_insert_with(|| format!("{name} at column {column}, row {row}: {x:e} and {y:e}"));
        }
    }
    first.map(|first| Difference { values: Some(values), first })
}
