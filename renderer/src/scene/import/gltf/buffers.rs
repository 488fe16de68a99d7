//! Files, data URIs, buffers and buffer views, with every offset and length checked.

use super::document::Document;
use super::report::{Checked, Fault};
use crate::scene::bundle::{FileSource, resolve};
use base64::Engine;
use base64::alphabet::STANDARD;
use base64::engine::{DecodePaddingMode, GeneralPurpose, GeneralPurposeConfig};
use gltf::json;
use percent_encoding::percent_decode_str;
use std::sync::Arc;

/// Base64 with or without padding: exporters differ.
const BASE64: GeneralPurpose = GeneralPurpose::new(
    &STANDARD,
    GeneralPurposeConfig::new()
        .with_decode_padding_mode(DecodePaddingMode::Indifferent)
        .with_decode_allow_trailing_bits(true),
);

/// What `uri` names: the content of a data URI or of a file beside `file`.
pub(super) fn fetch(files: &dyn FileSource, file: &str, uri: &str, place: &str) -> Checked<Arc<[u8]>> {
    if let Some(data) = uri.strip_prefix("data:") {
        return data_uri(data).map(Arc::from).map_err(|e| Fault::new(place, format!("a damaged data URI: {e}")));
    }
    let path = relative_path(uri)
        .map_err(|e| Fault::new(place, format!("{uri:?} {e}; expected a relative path or a data URI")))?;
    let fault = |e: std::io::Error| {
        Fault::new(place, format!("can't read {path:?}: {e}"))
            .help(format!("put the file beside {file:?}, or mend the URI"))
    };
    match files.read(&resolve(file, &path)) {
        // A name with a percent sign that is not an escape.
        Err(e) if e.kind() == std::io::ErrorKind::NotFound && path != uri => {
            files.read(&resolve(file, uri)).map_err(|_| fault(e))
        }
        result => result.map_err(fault),
    }
}

fn data_uri(data: &str) -> Result<Vec<u8>, String> {
    let (header, body) = data.split_once(',').ok_or("it has no comma")?;
    if header.ends_with(";base64") {
        return BASE64.decode(body).map_err(|e| e.to_string());
    }
    Ok(percent_decode_str(body).collect())
}

fn relative_path(uri: &str) -> Result<String, &'static str> {
    let scheme = uri.split(['/', '?', '#']).next().unwrap_or("").contains(':');
    if scheme {
        return Err("names another place than the file's own folder");
    }
    if uri.starts_with(['/', '\\']) {
        return Err("is an absolute path");
    }
    let path = percent_decode_str(uri).decode_utf8().map_err(|_| "is not UTF-8 when unescaped")?;
    match path.as_ref() {
        "" => Err("is empty"),
        p if p.contains('\0') => Err("holds a zero byte"),
        p => Ok(p.to_string()),
    }
}

/// The bytes of a buffer view.
#[derive(Clone, Copy, Debug)]
pub(super) struct View<'a> {
    /// Its bytes.
    pub bytes: &'a [u8],
    /// Bytes from one element to the next, where the view says.
    pub stride: Option<usize>,
}

/// All buffers of a file.
pub(super) struct Buffers<'a> {
    views: &'a [json::buffer::View],
    data: Vec<Checked<Arc<[u8]>>>,
}

impl<'a> Buffers<'a> {
    /// Reads every buffer; one that can't be read is a fault only where it is used.
    pub(super) fn read(document: &'a Document, files: &dyn FileSource, file: &str) -> Self {
        let buffers = document.root.buffers.iter().enumerate();
        let data = buffers.map(|(i, buffer)| read_buffer(document, files, file, i, buffer)).collect();
        Self { views: &document.root.buffer_views, data }
    }

    /// How many bytes there are in all.
    pub(super) fn total(&self) -> u64 {
        self.data.iter().flatten().map(|d| d.len() as u64).sum()
    }

    /// The view `index`, named in `place`.
    pub(super) fn view(&self, index: usize, place: &str) -> Checked<View<'_>> {
        let view = lookup(self.views, index, place, "bufferViews")?;
        let place = format!("bufferViews[{index}]");
        let buffer = view.buffer.value();
        let data = lookup(&self.data, buffer, &place, "buffers")?.as_ref().map_err(Clone::clone)?;
        let (offset, length) = (view.byte_offset.unwrap_or_default().0, view.byte_length.0);
        let end = offset.checked_add(length).filter(|end| *end <= data.len() as u64);
        let range = end.map(|end| offset as usize..end as usize);
        let bytes = range.and_then(|r| data.get(r)).ok_or_else(|| {
            let have = data.len();
            Fault::new(
                &place,
                format!("bytes {offset} + {length} reach past the end of buffers[{buffer}] ({have} bytes)"),
            )
        })?;
        Ok(View { bytes, stride: view.byte_stride.map(|s| s.0) })
    }
}

fn read_buffer(
    document: &Document,
    files: &dyn FileSource,
    file: &str,
    index: usize,
    buffer: &json::Buffer,
) -> Checked<Arc<[u8]>> {
    let place = format!("buffers[{index}]");
    let data = match (&buffer.uri, &document.bin) {
        (Some(uri), _) => fetch(files, file, uri, &format!("{place}.uri"))?,
        (None, Some(bin)) if index == 0 => bin.clone(),
        (None, _) => {
            return Err(Fault::new(place, "it has no uri, and is not the first buffer of a .glb with a BIN chunk"));
        }
    };
    let length = buffer.byte_length.0;
    if length > data.len() as u64 {
        return Err(Fault::new(
            format!("{place}.byteLength"),
            format!("{length} bytes are promised, but only {} are there", data.len()),
        ));
    }
    // Bytes beyond the length (the padding of a .glb's chunk) are no part of the buffer.
    Ok(if length < data.len() as u64 { Arc::from(&data[..length as usize]) } else { data })
}

/// `list[index]`, or a fault in `place` that names the list.
pub(super) fn lookup<'a, T>(list: &'a [T], index: usize, place: &str, name: &str) -> Checked<&'a T> {
    list.get(index).ok_or_else(|| {
        let count = list.len();
        Fault::new(place, format!("it names {name}[{index}], but there are only {count} of them"))
    })
}
