//! How both sides set up a connection: windows, keep-alive, host names, metadata.

use crate::{PROTOCOL, dns};
use hyper_util::rt::TokioIo;
use std::fmt;
use std::io;
use std::time::Duration;
use tokio::net::TcpStream;
use tonic::Status;
use tonic::codegen::http::Uri;
use tonic::metadata::{Ascii, MetadataValue};
use tonic::service::Interceptor;
use tonic::transport::{Channel, Endpoint};

/// HTTP/2 flow-control window of one stream, in bytes; the default 64 KiB would tie throughput to the round trip.
pub const STREAM_WINDOW: u32 = 4 << 20;
/// Window of a connection.
pub const CONNECTION_WINDOW: u32 = 16 << 20;
/// Pings on a connection; without them a half-open one never ends.
pub const KEEP_ALIVE: Duration = Duration::from_secs(5);
/// A ping unanswered for so long ends the connection.
pub const KEEP_ALIVE_TIMEOUT: Duration = Duration::from_secs(10);
/// Metadata key of the protocol's version.
pub const PROTOCOL_KEY: &str = "lightfarm-protocol";

/// A coordinator's address that can't be used.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{url:?} is not the address of a coordinator: {what}; write http://HOST:PORT")]
pub struct AddressError {
    url: String,
    what: String,
}

/// A channel that connects when first used, and again after it was cut. Must be called inside a tokio runtime.
pub fn channel(url: &str) -> Result<Channel, AddressError> {
    let fail = |what: &str| AddressError { url: url.to_string(), what: what.to_string() };
    let full = if url.contains("://") { url.to_string() } else { format!("http://{url}") };
    let uri: Uri = full.trim_end_matches('/').parse().map_err(|e| fail(&format!("{e}")))?;
    if uri.scheme_str() != Some("http") {
        return Err(fail("only http:// is spoken"));
    }
    if uri.host().is_none_or(str::is_empty) || uri.port_u16().is_none() {
        return Err(fail("it has no host or no port"));
    }
    if uri.path() != "/" || uri.query().is_some() {
        return Err(fail("nothing may follow the port"));
    }
    let endpoint = Endpoint::from(uri)
        .connect_timeout(Duration::from_secs(5))
        .tcp_nodelay(true)
        .initial_stream_window_size(STREAM_WINDOW)
        .initial_connection_window_size(CONNECTION_WINDOW)
        .http2_keep_alive_interval(KEEP_ALIVE)
        .keep_alive_timeout(KEEP_ALIVE_TIMEOUT)
        .keep_alive_while_idle(true);
    Ok(endpoint.connect_with_connector_lazy(tower::service_fn(open)))
}

async fn open(uri: Uri) -> io::Result<TokioIo<TcpStream>> {
    let host = uri.host().unwrap_or_default();
    let mut last = io::Error::new(io::ErrorKind::NotFound, format!("no host is called {host:?}"));
    for address in dns::resolve(host, uri.port_u16().unwrap_or_default()).await? {
        match TcpStream::connect(address).await {
            Ok(stream) => {
                stream.set_nodelay(true)?;
                return Ok(TokioIo::new(stream));
            }
            Err(e) => last = io::Error::new(e.kind(), format!("{address}: {e}")),
        }
    }
    Err(last)
}

/// What a caller writes into the metadata of every call: the protocol's version and, if there is one, the token.
#[derive(Clone)]
pub struct Credentials {
    bearer: Option<MetadataValue<Ascii>>,
}

/// A token that can't be sent.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error("the token has characters that can't be sent; use letters, digits and punctuation")]
pub struct TokenError;

impl Credentials {
    /// With the token, if any.
    pub fn new(token: Option<&str>) -> Result<Self, TokenError> {
        let value = |t: &str| MetadataValue::try_from(format!("Bearer {t}")).map_err(|_| TokenError);
        let mut bearer = token.map(value).transpose()?;
        if let Some(v) = &mut bearer {
            v.set_sensitive(true);
        }
        Ok(Self { bearer })
    }
}

impl fmt::Debug for Credentials {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "Credentials {{ token: {} }}", if self.bearer.is_some() { "set" } else { "none" })
    }
}

impl Interceptor for Credentials {
    fn call(&mut self, mut request: tonic::Request<()>) -> Result<tonic::Request<()>, Status> {
        request.metadata_mut().insert(PROTOCOL_KEY, MetadataValue::from(PROTOCOL));
        if let Some(bearer) = &self.bearer {
            request.metadata_mut().insert("authorization", bearer.clone());
        }
        Ok(request)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[tokio::test]
    async fn addresses_are_checked_before_use() {
        for good in ["http://127.0.0.1:50051", "localhost:1", "http://coordinator:50051/", "http://[::1]:3"] {
            assert!(channel(good).is_ok(), "{good}");
        }
        for bad in ["", "http://", "host", "https://host:1", "http://host:1/path", "http://:1", "http://a b:1"] {
            let message = channel(bad).expect_err(bad).to_string();
            assert!(message.contains("http://HOST:PORT"), "{message}");
        }
    }

    #[test]
    fn the_token_is_not_shown() {
        let credentials = Credentials::new(Some("secret")).unwrap();
        assert!(!format!("{credentials:?}").contains("secret"));
        assert!(Credentials::new(Some("a\nb")).is_err());
    }
}
