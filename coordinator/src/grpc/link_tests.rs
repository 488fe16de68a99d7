//! A worker that dies, whether a call of it waits or not.

use crate::registry::WorkerState;
use crate::{Config, Coordinator};
use proto::connect::Credentials;
use proto::worker_service_client::WorkerServiceClient;
use std::time::{Duration, Instant};

#[tokio::test]
async fn a_worker_that_dies_between_two_calls_is_lost_at_once() {
    let folder = tempfile::tempdir().unwrap();
    let config = Config::new("127.0.0.1:0".parse().unwrap(), folder.path().to_path_buf());
    let coordinator = Coordinator::bind(&config).await.unwrap();
    let (hub, address) = (coordinator.hub.clone(), coordinator.address().unwrap());
    let (end, ended) = tokio::sync::oneshot::channel::<()>();
    let served = tokio::spawn(coordinator.serve(async move { drop(ended.await) }));
    let call = |sequence: u64| proto::SynchronizeRequest {
        protocol: proto::PROTOCOL,
        fingerprint: renderer::FINGERPRINT.into(),
        worker_id: uuid::Uuid::from_u128(1).as_bytes().to_vec().into(),
        name: "mortal".into(),
        threads: 1,
        sequence,
        state: proto::WorkerState::Ready.into(),
        held: Vec::new(),
    };
    let state = || hub.with(|farm, _| farm.workers().values().next().map(|w| w.state));
    let client = || {
        let line = proto::connect::channel(&format!("http://{address}")).unwrap();
        WorkerServiceClient::with_interceptor(line, Credentials::new(None).unwrap())
    };

    // It calls twice, over two connections; the end of the first says nothing.
    let mut first = client();
    first.synchronize(call(1)).await.unwrap();
    let mut second = client();
    second.synchronize(call(2)).await.unwrap();
    drop(first);
    tokio::time::sleep(Duration::from_millis(300)).await;
    assert_eq!(state(), Some(WorkerState::Ready));

    // Both calls were answered, so none waits when the second connection ends.
    let died = Instant::now();
    drop(second);
    while state() != Some(WorkerState::Lost) {
        assert!(died.elapsed() < config.tuning.lease / 2, "only the lease's end would tell");
        tokio::time::sleep(Duration::from_millis(10)).await;
    }
    end.send(()).unwrap();
    served.await.unwrap().unwrap();
}
