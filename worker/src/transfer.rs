//! Fetching blobs.

use crate::Line;
use crate::cache::{Cache, Incoming};
use proto::blob_service_client::BlobServiceClient;
use renderer::scene::bundle::Digest;
use std::io;
use std::time::Duration;
use tonic::{Code, Status};

/// A stream that is silent for so long is cut.
const PATIENCE: Duration = Duration::from_secs(30);

/// Why a blob could not be had.
#[derive(Debug, thiserror::Error)]
pub enum FetchError {
    /// The network or the coordinator; later it may work.
    #[error("{0}")]
    Network(Status),
    /// The coordinator does not have it, or sends other bytes.
    #[error("{0}")]
    Blob(String),
    /// This machine's disk.
    #[error("the cache: {0}")]
    Disk(#[from] io::Error),
}

/// Brings a blob into the cache, unless it is there; goes on where an earlier attempt was cut.
pub async fn fetch(line: &Line, cache: &Cache, digest: Digest) -> Result<(), FetchError> {
    if cache.has(digest) {
        return Ok(());
    }
    let mut incoming = cache.receive(digest)?;
    loop {
        let before = incoming.len();
        match stream(line, &mut incoming, digest).await {
            Ok(()) => break,
            // As long as something comes, the line is worth another try.
            Err(FetchError::Network(_)) if incoming.len() > before => {}
            Err(e) => return Err(e),
        }
    }
    if !cache.keep(incoming)? {
        return Err(FetchError::Blob(format!("the bytes of blob {digest} are not those that it is named after")));
    }
    Ok(())
}

async fn stream(line: &Line, incoming: &mut Incoming, digest: Digest) -> Result<(), FetchError> {
    let fail = |s: Status| match s.code() {
        Code::NotFound => FetchError::Blob(s.message().to_string()),
        _ => FetchError::Network(s),
    };
    let late = || FetchError::Network(Status::deadline_exceeded("the coordinator does not send"));
    // Larger than a chunk by what a message adds.
    let mut client = BlobServiceClient::new(line.clone()).max_decoding_message_size(2 * proto::CHUNK);
    let offset = incoming.len();
    let request = proto::DownloadRequest { digest: digest.0.to_vec().into(), offset };
    let call = tokio::time::timeout(PATIENCE, client.download(request));
    let mut parts = call.await.map_err(|_| late())?.map_err(fail)?.into_inner();
    let mut len = None;
    loop {
        let part = tokio::time::timeout(PATIENCE, parts.message()).await.map_err(|_| late())?.map_err(fail)?;
        let Some(part) = part else { break };
        len.get_or_insert(part.len);
        incoming.write(&part.data)?;
    }
    match len {
        Some(len) if incoming.len() == len => Ok(()),
        Some(len) if incoming.len() > len => Err(FetchError::Blob(format!("blob {digest} is longer than announced"))),
        _ => Err(FetchError::Network(Status::data_loss("the stream ended early"))),
    }
}
