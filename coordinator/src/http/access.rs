//! Who may look: the token as bearer, as the password of basic authentication, or in the address.

use crate::grpc::Token;
use axum::http::{HeaderMap, Uri, header};

/// Checks requests.
pub struct Access {
    token: Option<Token>,
}

impl Access {
    /// With the token that requests need, if any.
    pub fn new(token: Option<Token>) -> Self {
        Self { token }
    }

    /// Whether a request may pass.
    pub fn admits(&self, headers: &HeaderMap, uri: &Uri) -> bool {
        let Some(token) = &self.token else { return true };
        let given = headers.get(header::AUTHORIZATION).and_then(|v| v.to_str().ok());
        let bearer = given.and_then(|v| v.strip_prefix("Bearer ")).map(|t| t.as_bytes().to_vec());
        let basic = given.and_then(|v| v.strip_prefix("Basic ")).and_then(password);
        let query = uri.query().and_then(in_query);
        [bearer, basic, query].into_iter().flatten().any(|guess| token.admits(&guess))
    }
}

/// The password of `user:password` in base64.
fn password(encoded: &str) -> Option<Vec<u8>> {
    let decoded = base64(encoded.trim())?;
    let colon = decoded.iter().position(|b| *b == b':')?;
    Some(decoded[colon + 1..].to_vec())
}

/// Standard base64 (RFC 4648).
fn base64(text: &str) -> Option<Vec<u8>> {
    let digit = |b: u8| match b {
        b'A'..=b'Z' => Some(b - b'A'),
        b'a'..=b'z' => Some(b - b'a' + 26),
        b'0'..=b'9' => Some(b - b'0' + 52),
        b'+' => Some(62),
        b'/' => Some(63),
        _ => None,
    };
    let (mut out, mut bits, mut count) = (Vec::new(), 0u32, 0);
    for b in text.trim_end_matches('=').bytes() {
        bits = bits << 6 | u32::from(digit(b)?);
        count += 6;
        if count >= 8 {
            count -= 8;
            out.push((bits >> count) as u8);
            bits &= (1 << count) - 1;
        }
    }
    Some(out)
}

/// `token=...` of a query, with %-escapes resolved.
fn in_query(query: &str) -> Option<Vec<u8>> {
    let raw = query.split('&').find_map(|pair| pair.strip_prefix("token="))?;
    let mut out = Vec::new();
    let mut bytes = raw.bytes();
    while let Some(b) = bytes.next() {
        match b {
            b'%' => {
                let hex = [bytes.next()?, bytes.next()?];
                out.push(u8::from_str_radix(std::str::from_utf8(&hex).ok()?, 16).ok()?);
            }
            b'+' => out.push(b' '),
            b => out.push(b),
        }
    }
    Some(out)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_token_passes_in_each_of_its_forms() {
        let access = Access::new(Some(Token::new("se cret:1")));
        let admits = |authorization: Option<&str>, uri: &str| {
            let mut headers = HeaderMap::new();
            if let Some(a) = authorization {
                headers.insert(header::AUTHORIZATION, a.parse().unwrap());
            }
            access.admits(&headers, &uri.parse().unwrap())
        };
        assert!(admits(Some("Bearer se cret:1"), "/"));
        assert!(admits(Some("Basic dXNlcjpzZSBjcmV0OjE="), "/"));
        assert!(admits(None, "/?x=1&token=se%20cret%3A1"));
        for (authorization, uri) in [
            (None, "/"),
            (Some("Bearer secret"), "/"),
            (Some("Basic !!!"), "/"),
            (Some("Basic dXNlcg=="), "/?token="),
            (None, "/?token=%"),
            (None, "/?token=%zz"),
            (Some("Basic dXNlcjpuZWlu"), "/?token=se+cre"),
        ] {
            assert!(!admits(authorization, uri), "{authorization:?} {uri}");
        }
        assert!(Access::new(None).admits(&HeaderMap::new(), &"/".parse().unwrap()));
    }
}
