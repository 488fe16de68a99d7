//! Delivers outcomes. They are kept until the coordinator has acknowledged them, across cuts and restarts.

use crate::board::{Board, Outcome};
use crate::{Line, convert};
use proto::Verdict;
use proto::worker_service_client::WorkerServiceClient;
use std::sync::Arc;
use std::time::Duration;
use tonic::{Code, Status};
use uuid::Uuid;

const FIRST_WAIT: Duration = Duration::from_millis(100);
const LONGEST_WAIT: Duration = Duration::from_secs(3);
/// A call that takes longer is given up and made again: 32 MiB over a slow line, and a slow disk.
const PATIENCE: Duration = Duration::from_secs(300);

/// Delivers for ever.
pub async fn deliver(board: Arc<Board>, worker: Uuid, line: Line) {
    let mut wait = FIRST_WAIT;
    loop {
        let batch = board.take_batch();
        if batch.is_empty() {
            board.outcomes.notified().await;
            continue;
        }
        match send(worker, &line, &batch).await {
            Ok(verdicts) => {
                report(&batch, &verdicts);
                board.sent(batch, false);
                wait = FIRST_WAIT;
            }
            Err(status) if matches!(status.code(), Code::InvalidArgument | Code::OutOfRange) => {
                // Sending the same again can't help; the units' leases run out, and somebody renders them again.
                tracing::error!("the coordinator can't read results: {}", status.message());
                board.sent(batch, false);
            }
            Err(status) => {
                tracing::debug!("results could not be delivered, trying again: {}", status.message());
                board.sent(batch, true);
                tokio::time::sleep(wait).await;
                wait = (wait * 2).min(LONGEST_WAIT);
            }
        }
    }
}

async fn send(worker: Uuid, line: &Line, batch: &[Outcome]) -> Result<Vec<i32>, Status> {
    let parts: Vec<proto::OutcomePart> = batch.iter().flat_map(|o| convert::parts(worker, o)).collect();
    let mut client = WorkerServiceClient::new(line.clone());
    let call = client.deliver(tokio_stream::iter(parts));
    let answer = tokio::time::timeout(PATIENCE, call)
        .await
        .map_err(|_| Status::deadline_exceeded("delivering takes too long"))??
        .into_inner();
    if answer.verdicts.len() != batch.len() {
        return Err(Status::internal("the coordinator acknowledges another number of results than were sent"));
    }
    Ok(answer.verdicts)
}

fn report(batch: &[Outcome], verdicts: &[i32]) {
    for (o, verdict) in batch.iter().zip(verdicts) {
        match Verdict::try_from(*verdict) {
            Ok(Verdict::Refused) => tracing::error!(pass = o.pass, unit = o.unit, "a result was refused"),
            Ok(Verdict::Mismatch) => {
                tracing::error!(pass = o.pass, unit = o.unit, "a result differs from that of another worker");
            }
            _ => {}
        }
    }
}
