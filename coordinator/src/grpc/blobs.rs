//! Blobs in and out, in chunks.

use crate::blobs::UploadError;
use crate::convert;
use crate::hub::Hub;
use bytes::BytesMut;
use proto::blob_service_server::BlobService;
use renderer::scene::bundle::Digest;
use std::io::{Read, Seek, SeekFrom};
use std::sync::Arc;
use std::time::Duration;
use tokio::sync::mpsc;
use tokio::time::timeout;
use tokio_stream::wrappers::ReceiverStream;
use tonic::{Request, Response, Status, Streaming};

/// Digests in one question.
const MAX_DIGESTS: usize = 16384;
/// Chunks read ahead of the network.
const AHEAD: usize = 4;
/// A sender that is silent for so long is cut off; what came stays.
const PATIENCE: Duration = Duration::from_secs(30);

/// The service.
pub struct BlobStore(pub Arc<Hub>);

fn upload_status(e: UploadError) -> Status {
    match e {
        UploadError::Busy(_) => Status::aborted(e.to_string()),
        UploadError::TooLarge(_) => Status::invalid_argument(e.to_string()),
        UploadError::Offset { .. } => Status::out_of_range(e.to_string()),
        UploadError::Content(_) => Status::data_loss(e.to_string()),
        UploadError::Io(e) => disk_status(&e),
    }
}

fn disk_status(e: &std::io::Error) -> Status {
    let full = matches!(e.kind(), std::io::ErrorKind::StorageFull | std::io::ErrorKind::QuotaExceeded);
    if full {
        Status::resource_exhausted(format!("the disk of the coordinator is full: {e}"))
    } else {
        Status::internal(format!("the coordinator's disk: {e}"))
    }
}

#[tonic::async_trait]
impl BlobService for BlobStore {
    async fn find_missing(
        &self,
        request: Request<proto::FindMissingRequest>,
    ) -> Result<Response<proto::FindMissingResponse>, Status> {
        let digests = request.into_inner().digests;
        if digests.len() > MAX_DIGESTS {
            return Err(Status::invalid_argument(format!("at most {MAX_DIGESTS} digests in one question")));
        }
        let digests = digests.iter().map(|d| convert::digest(d)).collect::<Result<Vec<Digest>, _>>()?;
        let blobs = self.0.blobs.clone();
        let work = move || {
            let missing = digests.into_iter().filter(|d| blobs.len_of(*d).is_none());
            missing.map(|d| proto::MissingBlob { digest: d.0.to_vec().into(), have: blobs.part_len(d) }).collect()
        };
        let missing = tokio::task::spawn_blocking(work).await.map_err(|e| Status::internal(e.to_string()))?;
        Ok(Response::new(proto::FindMissingResponse { missing }))
    }

    async fn upload(
        &self,
        request: Request<Streaming<proto::UploadPart>>,
    ) -> Result<Response<proto::UploadResponse>, Status> {
        let mut parts = request.into_inner();
        let late = |_| Status::deadline_exceeded("nothing came for too long");
        let first = timeout(PATIENCE, parts.message()).await.map_err(late)??;
        let first = first.ok_or_else(|| Status::invalid_argument("an upload without a first part"))?;
        let digest = convert::digest(&first.digest)?;
        if self.0.blobs.len_of(digest).is_some() {
            return Ok(Response::new(proto::UploadResponse {}));
        }
        // The disk has a thread of its own; the channel between holds back the network when it is slow.
        let (chunks, mut inbox) = mpsc::channel::<bytes::Bytes>(AHEAD);
        let (blobs, len, offset) = (self.0.blobs.clone(), first.len, first.offset);
        let writer = tokio::task::spawn_blocking(move || {
            let mut upload = blobs.upload(digest, len, offset)?;
            while let Some(chunk) = inbox.blocking_recv() {
                // An empty chunk ends it; without one the connection was cut and the part stays.
                if chunk.is_empty() {
                    return upload.finish();
                }
                upload.write(&chunk)?;
            }
            Ok(())
        });
        let cut = pump(first.data, &mut parts, chunks).await;
        writer.await.map_err(|e| Status::internal(e.to_string()))?.map_err(upload_status)?;
        cut?;
        Ok(Response::new(proto::UploadResponse {}))
    }

    type DownloadStream = ReceiverStream<Result<proto::DownloadPart, Status>>;

    async fn download(
        &self,
        request: Request<proto::DownloadRequest>,
    ) -> Result<Response<Self::DownloadStream>, Status> {
        let request = request.into_inner();
        let digest = convert::digest(&request.digest)?;
        let blobs = self.0.blobs.clone();
        let (chunks, stream) = mpsc::channel(AHEAD);
        tokio::task::spawn_blocking(move || {
            let opened = blobs.open_blob(digest).and_then(|f| Ok((f.metadata()?.len(), f)));
            let (len, mut file) = match opened {
                Ok(opened) => opened,
                Err(_) => {
                    return drop(chunks.blocking_send(Err(Status::not_found(format!("there is no blob {digest}")))));
                }
            };
            if let Err(e) = file.seek(SeekFrom::Start(request.offset.min(len))) {
                return drop(chunks.blocking_send(Err(disk_status(&e))));
            }
            send_file(len, file, |len, data| chunks.blocking_send(Ok(proto::DownloadPart { len, data })).is_ok());
        });
        Ok(Response::new(ReceiverStream::new(stream)))
    }
}

/// Passes the parts of an upload on to the disk.
async fn pump(
    first: bytes::Bytes,
    parts: &mut Streaming<proto::UploadPart>,
    chunks: mpsc::Sender<bytes::Bytes>,
) -> Result<(), Status> {
    let mut data = first;
    loop {
        // A writer that is gone has an error of its own to tell.
        if !data.is_empty() && chunks.send(data).await.is_err() {
            return Ok(());
        }
        let late = |_| Status::deadline_exceeded("nothing came for too long");
        match timeout(PATIENCE, parts.message()).await.map_err(late)?? {
            Some(part) => data = part.data,
            None => {
                let _ = chunks.send(bytes::Bytes::new()).await;
                return Ok(());
            }
        }
    }
}

/// Reads a file in chunks until `send` refuses one; the length goes with the first, which may be empty.
pub fn send_file(len: u64, mut file: impl Read, mut send: impl FnMut(u64, bytes::Bytes) -> bool) {
    let mut head = len;
    loop {
        let mut data = BytesMut::zeroed(proto::CHUNK);
        let mut filled = 0;
        while filled < data.len() {
            match file.read(&mut data[filled..]) {
                Ok(0) => break,
                Ok(n) => filled += n,
                // The receiver sees that bytes are missing.
                Err(_) => return,
            }
        }
        data.truncate(filled);
        let ended = filled < proto::CHUNK;
        if !send(std::mem::take(&mut head), data.freeze()) || ended {
            return;
        }
    }
}
