//! What clients call.

use super::blobs::send_file;
use crate::convert;
use crate::hub::{ControlError, Hub};
use crate::ids::JobId;
use crate::job::JobState;
use crate::store::StoreError;
use crate::submit;
use proto::job_service_server::JobService;
use renderer::scene::bundle::Digest;
use std::sync::Arc;
use std::time::Duration;
use tokio::sync::mpsc;
use tokio::time::Instant;
use tokio_stream::wrappers::ReceiverStream;
use tonic::{Request, Response, Status};

/// Jobs in one list.
const MAX_LIST: u32 = 1000;
/// How often a watched job is looked at, and how often it is shown though nothing changed.
const LOOK: Duration = Duration::from_millis(200);
const SHOW: Duration = Duration::from_secs(2);

/// The service.
pub struct Jobs(pub Arc<Hub>);

type Reply<T> = Result<Response<T>, Status>;

/// A control error as a status.
pub fn control_status(e: ControlError) -> Status {
    match e {
        ControlError::Ended(_) => Status::invalid_argument(e.to_string()),
        ControlError::Store(e) => store_status(&e),
    }
}

pub fn store_status(e: &StoreError) -> Status {
    match e {
        StoreError::Full(_) => Status::resource_exhausted(e.to_string()),
        _ => Status::internal(e.to_string()),
    }
}

impl Jobs {
    /// The job that a reference means.
    fn find(&self, r: &proto::JobRef) -> Result<JobId, Status> {
        let wanted: String = r.id.chars().filter(|c| *c != '-').map(|c| c.to_ascii_lowercase()).take(33).collect();
        if wanted.len() < 4 || !wanted.chars().all(|c| c.is_ascii_hexdigit()) {
            return Err(Status::invalid_argument(format!(
                "{:?} is not the id of a job; `lightfarm jobs` lists them, and four digits are the least",
                convert::name(&r.id)
            )));
        }
        let fits = |id: &&JobId| id.0.simple().to_string().starts_with(&wanted);
        let found: Vec<JobId> = self.0.with(|farm, _| farm.jobs().keys().filter(fits).take(2).copied().collect());
        match found.as_slice() {
            [id] => Ok(*id),
            [] => Err(Status::not_found(format!("there is no job {}", convert::name(&r.id)))),
            _ => Err(Status::invalid_argument(format!(
                "several jobs begin with {}; give more digits",
                convert::name(&r.id)
            ))),
        }
    }

    fn status(&self, id: JobId) -> Result<proto::JobStatus, Status> {
        status_of(&self.0, id).ok_or_else(|| Status::not_found("the job is gone"))
    }

    async fn set(&self, r: Request<proto::JobRef>, state: JobState, message: &str) -> Reply<proto::JobStatus> {
        let id = self.find(r.get_ref())?;
        self.0.set_state(id, state, message).await.map_err(control_status)?;
        tracing::info!(job = %id, "{}", state.name());
        self.status(id).map(Response::new)
    }
}

fn status_of(hub: &Hub, id: JobId) -> Option<proto::JobStatus> {
    hub.with(|farm, now| farm.job(id).map(|j| convert::status(farm, j, now)))
}

#[tonic::async_trait]
impl JobService for Jobs {
    async fn submit(&self, request: Request<proto::SubmitRequest>) -> Reply<proto::SubmitResponse> {
        let existed = submit::submit(&self.0, request.into_inner()).await?;
        Ok(Response::new(proto::SubmitResponse { existed }))
    }

    async fn list(&self, request: Request<proto::ListRequest>) -> Reply<proto::ListResponse> {
        let limit = match request.into_inner().limit {
            0 => 200,
            n => n.min(MAX_LIST),
        };
        let (mut jobs, total) = self.0.with(|farm, now| {
            let mut all: Vec<_> = farm.jobs().values().collect();
            all.sort_by_key(|j| std::cmp::Reverse(j.order));
            let jobs: Vec<_> = all.iter().take(limit as usize).map(|j| convert::status(farm, j, now)).collect();
            (jobs, all.len() as u32)
        });
        // Messages are for `show`; a list of many must stay below the limit of a message.
        jobs.iter_mut().for_each(|j| j.message = convert::text(&j.message, 256));
        Ok(Response::new(proto::ListResponse { jobs, total }))
    }

    async fn show(&self, request: Request<proto::JobRef>) -> Reply<proto::JobDetail> {
        let id = self.find(request.get_ref())?;
        let detail = self.0.with(|farm, now| farm.job(id).map(|j| convert::detail(farm, j, now)));
        let mut detail = detail.ok_or_else(|| Status::not_found("the job is gone"))?;
        detail.stored_bytes = self.0.store.stored_bytes(id);
        Ok(Response::new(detail))
    }

    type WatchStream = ReceiverStream<Result<proto::JobStatus, Status>>;

    async fn watch(&self, request: Request<proto::JobRef>) -> Reply<Self::WatchStream> {
        let id = self.find(request.get_ref())?;
        let (sender, stream) = mpsc::channel(4);
        let hub = self.0.clone();
        tokio::spawn(async move {
            let mut shown: Option<(proto::JobStatus, Instant)> = None;
            while let Some(status) = status_of(&hub, id) {
                let ended = matches!(
                    status.state(),
                    proto::JobState::Done | proto::JobState::Failed | proto::JobState::Cancelled
                );
                // Time goes on without anything having changed.
                let same =
                    |old: &proto::JobStatus| proto::JobStatus { seconds: status.seconds, ..old.clone() } == status;
                let due = shown.as_ref().is_none_or(|(old, at)| !same(old) || at.elapsed() >= SHOW);
                if due && sender.send(Ok(status.clone())).await.is_err() || ended {
                    return;
                }
                if due {
                    shown = Some((status, Instant::now()));
                }
                tokio::select! { () = sender.closed() => return, () = tokio::time::sleep(LOOK) => {} }
            }
        });
        Ok(Response::new(ReceiverStream::new(stream)))
    }

    type FetchStream = ReceiverStream<Result<proto::FetchPart, Status>>;

    async fn fetch(&self, request: Request<proto::JobRef>) -> Reply<Self::FetchStream> {
        let id = self.find(request.get_ref())?;
        let snapshot = self.0.snapshot(id).await;
        let status = self.status(id)?;
        let path = self.0.store.image_path(id);
        let work = move || match snapshot {
            Some(s) if s.progress.counters.samples > 0 => crate::image::exr_of(&s).map(|exr| (exr, false)),
            Some(_) => Err("nothing of this job is finished yet".to_string()),
            None => match std::fs::read(&path) {
                Ok(exr) => Ok((exr, true)),
                Err(_) => Err("this job ended without an image".to_string()),
            },
        };
        let image = tokio::task::spawn_blocking(work).await.map_err(|e| Status::internal(e.to_string()))?;
        let (exr, complete) = image.map_err(Status::not_found)?;
        let (sender, stream) = mpsc::channel(4);
        tokio::task::spawn_blocking(move || {
            let digest = Digest::of(&exr).0.to_vec().into();
            let len = exr.len() as u64;
            let mut head = Some(proto::FetchHead { status: Some(status), complete, len, digest });
            send_file(len, exr.as_slice(), |_, data| {
                sender.blocking_send(Ok(proto::FetchPart { head: head.take(), data })).is_ok()
            });
        });
        Ok(Response::new(ReceiverStream::new(stream)))
    }

    async fn pause(&self, request: Request<proto::JobRef>) -> Reply<proto::JobStatus> {
        self.set(request, JobState::Paused, "paused by a user").await
    }

    async fn resume(&self, request: Request<proto::JobRef>) -> Reply<proto::JobStatus> {
        self.set(request, JobState::Active, "").await
    }

    async fn cancel(&self, request: Request<proto::JobRef>) -> Reply<proto::JobStatus> {
        self.set(request, JobState::Cancelled, "cancelled by a user").await
    }

    async fn workers(&self, _: Request<proto::WorkersRequest>) -> Reply<proto::WorkersResponse> {
        let workers = self.0.with(|farm, now| convert::workers(farm, now));
        Ok(Response::new(proto::WorkersResponse { workers }))
    }
}
