//! Fetching a job's image.

use super::{Farm, failure, persist};
use crate::exit::Failure;
use crate::options::OutputArgs;
use crate::save;
use proto::{FetchHead, JobStatus};
use renderer::film::{exr, png};
use renderer::scene::bundle::Digest;
use std::path::{Path, PathBuf};
use tonic::Status;

/// The largest image that is taken, in bytes.
const MAX_IMAGE: u64 = 64 << 30;

/// An image that came.
pub struct Fetched {
    /// What it was made of.
    pub status: JobStatus,
    /// Whether it is the final one.
    pub complete: bool,
    /// The EXR file.
    pub exr: Vec<u8>,
}

/// Fetches a job's image.
pub fn fetch(farm: &Farm, id: &str) -> Result<Fetched, Failure> {
    let work = persist(|| {
        let (mut jobs, id) = (farm.jobs(), id.to_string());
        async move {
            let mut stream = jobs.fetch(proto::JobRef { id }).await?.into_inner();
            let (mut head, mut exr): (Option<FetchHead>, Vec<u8>) = (None, Vec::new());
            while let Some(part) = stream.message().await? {
                head = head.or(part.head);
                exr.extend_from_slice(&part.data);
                if exr.len() as u64 > head.as_ref().map_or(0, |h| h.len).min(MAX_IMAGE) {
                    return Err(Status::data_loss("the image is longer than announced"));
                }
            }
            let head = head.ok_or_else(|| Status::unavailable("the coordinator sent nothing"))?;
            if head.len != exr.len() as u64 || head.digest.as_ref() != Digest::of(&exr).0 {
                return Err(Status::unavailable("the image did not come through whole"));
            }
            Ok((head, exr))
        }
    });
    let (head, exr) = farm.block_on(work).map_err(|s| failure(&s))?;
    Ok(Fetched { status: head.status.unwrap_or_default(), complete: head.complete, exr })
}

/// Writes an image as EXR and PNG; returns their places, and why one of them is not where it was asked for.
pub fn write(image: &Fetched, output: &OutputArgs) -> Result<(PathBuf, PathBuf, Option<Failure>), Failure> {
    let (exr_path, png_path) = output.paths(Path::new(&image.status.name))?;
    let (exr_path, exr_failure) = save::keep(&exr_path, &image.exr)?;
    let fault = |what: String| Failure::Machine(format!("error: the image that came can't be read: {what}"));
    let picture = exr::decode(&image.exr).map_err(|e| fault(e.to_string()))?;
    let pixels = picture.triple(["R", "G", "B"]).ok_or_else(|| fault("it has no R, G and B".into()))?;
    let bytes = png::encode_pixels(picture.width, picture.height, &pixels, output.exposure).map_err(fault)?;
    let (png_path, png_failure) = save::keep(&png_path, &bytes)?;
    Ok((exr_path, png_path, exr_failure.or(png_failure)))
}
