//! Uploading a scene: only what the coordinator lacks, and from where an earlier upload was cut.

use super::{Farm, Line, failure, persist};
use crate::exit::Failure;
use bytes::Bytes;
use proto::blob_service_client::BlobServiceClient;
use renderer::scene::bundle::{Digest, Manifest};
use std::collections::BTreeMap;
use std::sync::Arc;
use tonic::{Code, Status};

/// Digests in one question.
const QUESTION: usize = 4096;
/// How often an upload that others disturb is tried again.
const ATTEMPTS: usize = 20;
const WAIT: std::time::Duration = std::time::Duration::from_millis(500);

/// What was sent.
#[derive(Clone, Copy, Debug, Default)]
pub struct Sent {
    /// Files that the coordinator lacked.
    pub files: usize,
    /// Their bytes.
    pub bytes: u64,
}

/// Uploads a scene's files and its manifest; returns the manifest's digest.
pub fn upload(
    farm: &Farm,
    manifest: &Manifest,
    mut blobs: BTreeMap<Digest, Arc<[u8]>>,
) -> Result<(Digest, Sent), Failure> {
    let json = serde_json::to_vec(manifest).map_err(|e| Failure::Input(format!("error: the scene's manifest: {e}")))?;
    let digest = Digest::of(&json);
    blobs.insert(digest, json.into());
    let mut sent = Sent::default();
    let work = async {
        let digests: Vec<Digest> = blobs.keys().copied().collect();
        for some in digests.chunks(QUESTION) {
            for (digest, have) in missing(&farm.line(), some).await? {
                let Some(bytes) = blobs.get(&digest) else { continue };
                send(&farm.line(), digest, Bytes::from_owner(bytes.clone()), have).await?;
                sent.files += 1;
                sent.bytes += bytes.len() as u64 - have.min(bytes.len() as u64);
            }
        }
        Ok(())
    };
    farm.block_on(work).map_err(|s: Status| failure(&s))?;
    Ok((digest, sent))
}

/// What the coordinator lacks, with the bytes that it has of it.
async fn missing(line: &Line, digests: &[Digest]) -> Result<Vec<(Digest, u64)>, Status> {
    let asked: Vec<Bytes> = digests.iter().map(|d| Bytes::copy_from_slice(&d.0)).collect();
    let answer = persist(|| {
        let (mut client, digests) = (BlobServiceClient::new(line.clone()), asked.clone());
        async move { client.find_missing(proto::FindMissingRequest { digests }).await }
    })
    .await?;
    let one = |m: &proto::MissingBlob| Some((Digest(m.digest.as_ref().try_into().ok()?), m.have));
    Ok(answer.into_inner().missing.iter().filter_map(one).collect())
}

/// Sends one blob, from byte `have` on.
async fn send(line: &Line, digest: Digest, bytes: Bytes, mut have: u64) -> Result<(), Status> {
    let mut last = Status::internal("not tried");
    for _ in 0..ATTEMPTS {
        let parts = parts(digest, bytes.clone(), have);
        match BlobServiceClient::new(line.clone()).upload(tokio_stream::iter(parts)).await {
            Ok(_) => return Ok(()),
            // Cut, or another client is at it: ask again how far it is.
            Err(s) if matches!(s.code(), Code::Unavailable | Code::Aborted | Code::OutOfRange | Code::Unknown) => {
                last = s
            }
            // What was there was not a part of this blob; it is removed now.
            Err(s) if s.code() == Code::DataLoss && have > 0 => last = s,
            Err(s) => return Err(s),
        }
        tokio::time::sleep(WAIT).await;
        match missing(line, &[digest]).await?.first() {
            Some((_, now)) => have = *now,
            None => return Ok(()),
        }
    }
    Err(last)
}

fn parts(digest: Digest, bytes: Bytes, have: u64) -> impl Iterator<Item = proto::UploadPart> {
    let start = usize::try_from(have).unwrap_or(usize::MAX).min(bytes.len());
    let len = bytes.len() as u64;
    let first =
        proto::UploadPart { digest: Bytes::copy_from_slice(&digest.0), len, offset: start as u64, data: Bytes::new() };
    let rest = (start..bytes.len()).step_by(proto::CHUNK).map(move |at| {
        let data = bytes.slice(at..bytes.len().min(at + proto::CHUNK));
        proto::UploadPart { data, ..Default::default() }
    });
    std::iter::once(first).chain(rest)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn parts_are_small_and_complete() {
        let bytes: Vec<u8> = (0..700_000u32).map(|n| n as u8).collect();
        let digest = Digest::of(&bytes);
        for have in [0, 1, 300_000, 700_000] {
            let parts: Vec<_> = parts(digest, bytes.clone().into(), have).collect();
            assert_eq!((parts[0].offset, parts[0].len), (have, 700_000));
            assert!(parts.iter().all(|p| p.data.len() <= 512 << 10));
            let sent: Vec<u8> = parts.iter().flat_map(|p| p.data.to_vec()).collect();
            assert_eq!(sent, bytes[have as usize..]);
        }
    }
}
