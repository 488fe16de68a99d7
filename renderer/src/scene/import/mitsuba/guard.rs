//! What is refused before the XML parser sees it: it takes time and memory of the square of the attributes of an element and of the
//! name spaces around it.

/// More attributes of one element are refused.
const MAX_ATTRIBUTES: usize = 32;

/// Looks through the tags of `text`; an error has the byte where its tag starts.
pub(super) fn check(text: &[u8]) -> Result<(), (usize, String)> {
    let mut at = 0;
    while let Some(start) = find(text, at, b"<") {
        let rest = &text[start..];
        // Comments and character data hold no tags.
        let skipped =
            [(&b"<!--"[..], &b"-->"[..]), (b"<![CDATA[", b"]]>")].into_iter().find(|(open, _)| rest.starts_with(open));
        if let Some((open, close)) = skipped {
            let Some(end) = find(text, start + open.len(), close) else { return Ok(()) };
            at = end + close.len();
            continue;
        }
        let (length, attributes, name_space) = tag(rest);
        if attributes > MAX_ATTRIBUTES {
            return Err((start, format!("an element has more than {MAX_ATTRIBUTES} attributes")));
        }
        if name_space {
            return Err((start, "XML name spaces are not supported".into()));
        }
        at = start + length;
    }
    Ok(())
}

fn find(text: &[u8], from: usize, what: &[u8]) -> Option<usize> {
    text.get(from..)?.windows(what.len()).position(|w| w == what).map(|i| from + i)
}

/// Length of the tag at the start of `text`, number of its attributes, whether one declares a name space.
fn tag(text: &[u8]) -> (usize, usize, bool) {
    let (mut quote, mut attributes, mut name_space) = (None, 0, false);
    for (i, &b) in text.iter().enumerate() {
        match (quote, b) {
            (Some(q), _) if q == b => quote = None,
            (Some(_), _) => {}
            (None, b'"' | b'\'') => quote = Some(b),
            (None, b'=') => attributes += 1,
            (None, b'>') => return (i + 1, attributes, name_space),
            (None, b'x') => name_space |= text[i..].starts_with(b"xmlns"),
            _ => {}
        }
    }
    (text.len(), attributes, name_space)
}
