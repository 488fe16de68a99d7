//! What workers call.

use super::deliver;
use super::link::Link;
use crate::convert;
use crate::hub::Hub;
use crate::ids::WorkerId;
use crate::job::JobState;
use crate::sync::Poll;
use proto::worker_service_server::WorkerService;
use std::sync::Arc;
use std::time::Duration;
use tokio::time::Instant;
use tonic::{Request, Response, Status, Streaming};

/// How long a call is held back when there is nothing to say. Well below the time after which a lease runs out.
const HOLD: Duration = Duration::from_secs(2);

/// The service.
pub struct Workers(pub Arc<Hub>);

/// Notices when a waiting call is dropped: its connection was cut, or a proxy on the way says so of the one behind it.
struct Watch<'a> {
    hub: &'a Hub,
    worker: WorkerId,
    sequence: u64,
    answered: bool,
}

impl Drop for Watch<'_> {
    fn drop(&mut self) {
        if !self.answered {
            self.hub.with(|farm, now| farm.disconnected(self.worker, self.sequence, now));
        }
    }
}

#[tonic::async_trait]
impl WorkerService for Workers {
    async fn synchronize(
        &self,
        request: Request<proto::SynchronizeRequest>,
    ) -> Result<Response<proto::SynchronizeResponse>, Status> {
        let link = request.extensions().get::<Link>().cloned();
        let address = link.as_ref().and_then(|l| l.address).map_or_else(String::new, |a| a.to_string());
        let request = request.into_inner();
        self.check_version(&request)?;
        let report = convert::report(&request, address)?;
        let (worker, sequence) = (report.worker, report.sequence);
        let leaves = report.state == crate::registry::WorkerState::Left;
        let overtaken = || Status::aborted("a later call of this worker overtook this one");
        if !self.0.with(|farm, now| farm.report(report, now)) {
            return Err(overtaken());
        }
        if let Some(link) = link {
            link.note(worker, sequence);
        }
        if leaves {
            return Ok(Response::new(Default::default()));
        }
        let notify = self.0.notify_of(worker);
        let mut watch = Watch { hub: &self.0, worker, sequence, answered: false };
        let deadline = Instant::now() + HOLD;
        loop {
            let last = Instant::now() >= deadline;
            match self.0.with(|farm, now| farm.poll(worker, sequence, last, now)) {
                Poll::Reply(reply) => {
                    watch.answered = true;
                    return Ok(Response::new(convert::reply(reply)));
                }
                Poll::Superseded => {
                    watch.answered = true;
                    return Err(overtaken());
                }
                Poll::Wait => drop(tokio::time::timeout_at(deadline, notify.notified()).await),
            }
        }
    }

    async fn deliver(
        &self,
        request: Request<Streaming<proto::OutcomePart>>,
    ) -> Result<Response<proto::DeliverResponse>, Status> {
        let verdicts = deliver::receive(&self.0, request.into_inner()).await?;
        Ok(Response::new(proto::DeliverResponse { verdicts: verdicts.into_iter().map(Into::into).collect() }))
    }

    async fn report_fault(
        &self,
        request: Request<proto::FaultReport>,
    ) -> Result<Response<proto::FaultResponse>, Status> {
        let fault = request.into_inner();
        let (worker, job) = (convert::worker_id(&fault.worker_id)?, convert::job_id(&fault.job)?);
        let message = convert::message(&fault.message);
        let name = self.0.with(|farm, _| farm.workers().get(&worker).map(|w| w.name.clone()));
        let name = name.ok_or_else(|| Status::not_found("this worker is not known here"))?;
        match fault.kind() {
            proto::FaultKind::Scene => {
                tracing::error!(job = %job, worker = name, "the scene does not load: {message}");
                let why = format!("the scene does not load on worker {name}:\n{message}");
                self.0.set_state(job, JobState::Failed, &why).await.map_err(super::jobs::control_status)?;
            }
            proto::FaultKind::Machine => {
                tracing::warn!(job = %job, worker = name, "a worker has trouble of its own: {message}");
                self.0.with(|farm, now| farm.machine_fault(job, worker, &message, now));
            }
            proto::FaultKind::Unspecified => return Err(Status::invalid_argument("the fault has no kind")),
        }
        Ok(Response::new(proto::FaultResponse {}))
    }
}

impl Workers {
    /// Who computes other bits must not take part.
    fn check_version(&self, r: &proto::SynchronizeRequest) -> Result<(), Status> {
        let ours = (proto::PROTOCOL, self.0.fingerprint.as_str());
        let theirs = (r.protocol, r.fingerprint.as_str());
        if ours == theirs {
            return Ok(());
        }
        Err(Status::failed_precondition(format!(
            "the coordinator is {} (protocol {}), the worker {} (protocol {}); use the same version of lightfarm on both sides",
            ours.1,
            ours.0,
            convert::name(theirs.1),
            theirs.0
        )))
    }
}
