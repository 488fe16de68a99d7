//! The control loop: heartbeat, report and request for work in one call, for ever.

use crate::board::Board;
use crate::{Line, Options, WorkerError, convert};
use proto::connect::{Credentials, channel};
use proto::worker_service_client::WorkerServiceClient;
use renderer::job::Stop;
use std::time::{Duration, Instant};
use tonic::codegen::InterceptedService;
use tonic::{Code, Status};
use uuid::Uuid;

/// A call that takes longer is given up; the coordinator holds it back for two seconds at most.
const PATIENCE: Duration = Duration::from_secs(10);
/// Waits between attempts to reach the coordinator.
const FIRST_WAIT: Duration = Duration::from_millis(200);
const LONGEST_WAIT: Duration = Duration::from_secs(5);
/// Draining, the coordinator is given so long to take the last results.
const LAST_CHANCE: Duration = Duration::from_secs(20);
/// How often a lost coordinator is mentioned.
const COMPLAIN: Duration = Duration::from_secs(60);
/// How often the drain flag is looked at.
const LOOK: Duration = Duration::from_millis(50);

/// Keeps in touch until drained, or refused.
pub async fn keep(
    options: &Options,
    id: Uuid,
    board: &Board,
    credentials: Credentials,
    drain: &Stop,
) -> Result<(), WorkerError> {
    let line = InterceptedService::new(channel(&options.coordinator)?, credentials);
    let mut session = Session { options, id, line, sequence: 0, lost: None, wait: FIRST_WAIT };
    let drained = async {
        while !drain.stopped() {
            tokio::time::sleep(LOOK).await;
        }
    };
    tokio::select! {
        refused = session.serve(board) => return refused,
        () = drained => {}
    }
    tracing::info!("draining: finishing what runs");
    board.drain();
    session.wind_down(board).await
}

struct Session<'a> {
    options: &'a Options,
    id: Uuid,
    line: Line,
    sequence: u64,
    /// Since when the coordinator is lost, and when that was last mentioned.
    lost: Option<(Instant, Instant)>,
    wait: Duration,
}

impl Session<'_> {
    async fn serve(&mut self, board: &Board) -> Result<(), WorkerError> {
        loop {
            match self.call(board, proto::WorkerState::Ready).await {
                Ok(again) => tokio::time::sleep(again).await,
                Err(status) => self.failed(status).await?,
            }
        }
    }

    /// Finishes what runs, has it delivered, and says goodbye.
    async fn wind_down(&mut self, board: &Board) -> Result<(), WorkerError> {
        let mut idle_since = None;
        loop {
            let undelivered = board.undelivered();
            if undelivered == Some(0) {
                break;
            }
            if let Some(n) = undelivered {
                let since = *idle_since.get_or_insert_with(Instant::now);
                if since.elapsed() > LAST_CHANCE {
                    return Err(WorkerError::Undelivered(n));
                }
            }
            // The coordinator holds calls back, but the end should be noticed at once.
            let call = self.call(board, proto::WorkerState::Draining);
            let called = tokio::select! {
                called = call => Some(called),
                () = settled(board) => None,
            };
            if let Some(Err(status)) = called {
                self.failed(status).await?;
            }
        }
        // Whether it hears the goodbye or not: there is nothing left to lose.
        if let Err(status) = self.call(board, proto::WorkerState::Leaving).await {
            tracing::warn!("left without a goodbye: {}", status.message());
        }
        tracing::info!("drained");
        Ok(())
    }

    async fn call(&mut self, board: &Board, state: proto::WorkerState) -> Result<Duration, Status> {
        self.sequence += 1;
        let request = proto::SynchronizeRequest {
            protocol: proto::PROTOCOL,
            fingerprint: renderer::FINGERPRINT.into(),
            worker_id: convert::id(self.id),
            name: self.options.name.clone(),
            threads: self.options.threads as u32,
            sequence: self.sequence,
            state: state.into(),
            held: board.held().iter().map(convert::held).collect(),
        };
        // A task of its own: should this call be overtaken by a later one, it is not cut off, which would look like a lost worker.
        let mut client = WorkerServiceClient::new(self.line.clone());
        let call = tokio::spawn(async move { tokio::time::timeout(PATIENCE, client.synchronize(request)).await });
        let answer = call
            .await
            .map_err(|e| Status::internal(e.to_string()))?
            .map_err(|_| Status::deadline_exceeded("the coordinator does not answer"))??
            .into_inner();
        if let Some((since, _)) = self.lost.take() {
            tracing::info!("the coordinator is back after {:.1} s", since.elapsed().as_secs_f64());
        }
        self.wait = FIRST_WAIT;
        if !answer.notice.is_empty() {
            tracing::warn!("{}", answer.notice);
        }
        let revocations: Vec<_> = answer.revocations.iter().filter_map(convert::revocation).collect();
        board.revoke(&revocations);
        board.grant(answer.grants.iter().filter_map(convert::grant).collect());
        Ok(Duration::from_millis(u64::from(answer.call_again_ms.min(10_000))))
    }

    /// Waits before the next attempt; fails when another attempt can't help.
    async fn failed(&mut self, status: Status) -> Result<(), WorkerError> {
        match status.code() {
            Code::FailedPrecondition | Code::Unauthenticated | Code::InvalidArgument | Code::Unimplemented => {
                return Err(WorkerError::Refused(status.message().to_string()));
            }
            // Our own later call overtook this one.
            Code::Aborted => return Ok(()),
            _ => {}
        }
        let now = Instant::now();
        let complain = self.lost.is_none_or(|(_, said)| now - said > COMPLAIN);
        if complain {
            let since = self.lost.map_or(0.0, |(since, _)| (now - since).as_secs_f64());
            tracing::warn!("the coordinator is lost for {since:.0} s, trying again: {}", status.message());
        }
        let (since, said) = self.lost.unwrap_or((now, now));
        self.lost = Some((since, if complain { now } else { said }));
        tokio::time::sleep(self.wait).await;
        self.wait = (self.wait * 2).min(LONGEST_WAIT);
        Ok(())
    }
}

/// Waits until no unit runs and everything is delivered.
async fn settled(board: &Board) {
    while board.undelivered() != Some(0) {
        tokio::time::sleep(LOOK).await;
    }
}
