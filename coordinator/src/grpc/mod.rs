//! The gRPC services: thin; they check, convert and pass on.

mod auth;
mod blobs;
mod deliver;
mod jobs;
mod link;
mod worker;

pub use auth::{Guard, Token};
pub use jobs::store_status;
pub use link::Linked;

use crate::hub::Hub;
use std::sync::Arc;
use tonic::codegen::InterceptedService;
use tonic::service::Routes;

/// All services, behind the guard.
pub fn routes(hub: &Arc<Hub>, guard: &Guard) -> Routes {
    use proto::blob_service_server::BlobServiceServer;
    use proto::job_service_server::JobServiceServer;
    use proto::worker_service_server::WorkerServiceServer;
    let workers = WorkerServiceServer::new(worker::Workers(hub.clone()));
    let blobs = BlobServiceServer::new(blobs::BlobStore(hub.clone()));
    let jobs = JobServiceServer::new(jobs::Jobs(hub.clone()));
    Routes::new(InterceptedService::new(workers, guard.clone()))
        .add_service(InterceptedService::new(blobs, guard.clone()))
        .add_service(InterceptedService::new(jobs, guard.clone()))
}
