//! A worker whose pools are a bit off: those who replay its samples find out, and say so.

#![allow(clippy::unwrap_used, clippy::panic, reason = "test helpers")]

use bytes::Bytes;
use e2e::{Farm, room, until};
use proto::blob_service_client::BlobServiceClient;
use proto::connect::{Credentials, channel};
use proto::worker_service_client::WorkerServiceClient;
use renderer::job::document::PassDocument;
use renderer::job::{Stop, run_unit};
use renderer::scene::Scene;
use renderer::scene::bundle::{Digest, DiskSource};
use std::time::Duration;
use tokio::runtime::Runtime;
use tonic::codegen::InterceptedService;
use tonic::transport::Channel;
use uuid::Uuid;

const PATIENCE: Duration = Duration::from_secs(60);

/// Speaks the protocol and computes as a worker does, but rounds the targets of pools differently in the last bit.
struct Liar {
    runtime: Runtime,
    line: InterceptedService<Channel, Credentials>,
    scene: Scene,
    id: Uuid,
    sequence: u64,
}

impl Liar {
    fn new(farm: &Farm) -> Self {
        let runtime = tokio::runtime::Builder::new_multi_thread().worker_threads(1).enable_all().build().unwrap();
        let line = {
            let _context = runtime.enter();
            InterceptedService::new(channel(&farm.url).unwrap(), Credentials::new(None).unwrap())
        };
        let (source, root) = DiskSource::for_scene(&room()).unwrap();
        let (scene, _) = Scene::load(&source, &root).unwrap();
        Self { runtime, line, scene, id: Uuid::new_v4(), sequence: 0 }
    }

    /// A heartbeat that claims to hold nothing; what it is given it does before the next.
    fn synchronize(&mut self, state: proto::WorkerState) -> Vec<proto::Lease> {
        self.sequence += 1;
        let request = proto::SynchronizeRequest {
            protocol: proto::PROTOCOL,
            fingerprint: renderer::FINGERPRINT.into(),
            worker_id: Bytes::copy_from_slice(self.id.as_bytes()),
            name: "liar".into(),
            threads: 1,
            sequence: self.sequence,
            state: state.into(),
            held: Vec::new(),
        };
        let mut client = WorkerServiceClient::new(self.line.clone());
        self.runtime.block_on(client.synchronize(request)).unwrap().into_inner().grants
    }

    fn document(&self, lease: &proto::Lease) -> PassDocument {
        let mut client = BlobServiceClient::new(self.line.clone()).max_decoding_message_size(2 * proto::CHUNK);
        let request = proto::DownloadRequest { digest: lease.document.clone(), offset: 0 };
        let bytes = self.runtime.block_on(async {
            let mut parts = client.download(request).await.unwrap().into_inner();
            let mut bytes = Vec::new();
            while let Some(part) = parts.message().await.unwrap() {
                bytes.extend(part.data);
            }
            bytes
        });
        PassDocument::from_json(&bytes).unwrap()
    }

    /// The result of a unit, with targets that are a bit off where it is one of a pool.
    fn result(&self, document: &PassDocument, unit: u32) -> Vec<u8> {
        let unit = document.plan.unit(unit).unwrap();
        let mut result = run_unit(&self.scene, &document.settings, &document.plan, &unit, &Stop::new()).unwrap();
        for found in result.bootstrap.iter_mut().flat_map(|b| &mut b.found).filter(|_| unit.pass > 0) {
            found.target = f32::from_bits(found.target.to_bits() ^ 1);
        }
        result.encode()
    }

    fn deliver(&self, lease: &proto::Lease, unit: u32, data: Vec<u8>) {
        let head = proto::OutcomeHead {
            worker_id: Bytes::copy_from_slice(self.id.as_bytes()),
            job: lease.job.clone(),
            pass: lease.pass,
            unit,
            epoch: lease.epoch,
            seconds: 0.01,
            len: data.len() as u64,
            digest: Digest::of(&data).0.to_vec().into(),
            failure: String::new(),
            mismatch: None,
        };
        let mut at = data.chunks(proto::CHUNK).map(Bytes::copy_from_slice);
        let first = proto::OutcomePart { head: Some(head), data: at.next().unwrap() };
        let parts: Vec<_> =
            std::iter::once(first).chain(at.map(|data| proto::OutcomePart { head: None, data })).collect();
        let mut client = WorkerServiceClient::new(self.line.clone());
        let answer = self.runtime.block_on(client.deliver(tokio_stream::iter(parts))).unwrap().into_inner();
        assert_eq!(answer.verdicts, [i32::from(proto::Verdict::Accepted)], "unit {unit} of pass {}", lease.pass);
    }

    /// Does all units of the passes before the one named, and leaves.
    fn work_up_to(mut self, pass: u32) {
        loop {
            for lease in self.synchronize(proto::WorkerState::Ready) {
                if lease.pass >= pass {
                    self.synchronize(proto::WorkerState::Leaving);
                    return;
                }
                let document = self.document(&lease);
                let units = lease.units.unwrap();
                for unit in units.first..units.first + units.count {
                    self.deliver(&lease, unit, self.result(&document, unit));
                }
            }
        }
    }
}

#[test]
fn who_disagrees_with_a_pool_is_quarantined_and_two_who_do_end_the_job() {
    let mut farm = Farm::start();
    let job = farm.submit(&room(), &["--integrator", "mmlt", "--mpp", "16", "--size", "64x48", "--max-depth", "5"]);
    Liar::new(&farm).work_up_to(2);
    let shown = farm.show(&job);
    assert!(shown["pass"] == 2 && shown["state"] == "active", "{shown}");

    farm.start_worker("first", 1);
    let message = |farm: &Farm, name: &str| {
        farm.worker_if_known(name).map_or(String::new(), |w| w["message"].as_str().unwrap().to_string())
    };
    until("the first is quarantined", PATIENCE, || !message(&farm, "first").is_empty());
    let said = message(&farm, "first");
    for part in [&job.0, "of pass 2", "unit ", "sample ", "paths of ", "was ", "and is ", "This machine or build"] {
        assert!(said.contains(part), "{part:?} is not in: {said}");
    }
    assert_eq!(farm.worker("first")["state"], "quarantined");
    let shown = farm.show(&job);
    assert_eq!(shown["state"], "active", "one machine alone does not end the job: {shown}");
    assert!(shown["attention"].to_string().contains("sample "), "{shown}");

    farm.start_worker("second", 1);
    until("the job fails", PATIENCE, || farm.show(&job)["state"] == "failed");
    let shown = farm.show(&job);
    let said = shown["message"].as_str().unwrap();
    for part in ["workers first and second both disagree", "these are wrong", "submit the job again", "sample "] {
        assert!(said.contains(part), "{part:?} is not in: {said}");
    }
    // Expected and found differ in the last bit, and both are told in full.
    let values: Vec<f32> = said
        .split("was ")
        .skip(1)
        .take(1)
        .flat_map(|rest| {
            let (expected, rest) = rest.split_once(' ').unwrap();
            let found = rest.split_once("and is ").unwrap().1.split_once(' ').unwrap().0;
            [expected.parse().unwrap(), found.parse().unwrap()]
        })
        .collect();
    assert_eq!(values[0].to_bits() ^ values[1].to_bits(), 1, "{said}");
    // It was no fault of theirs.
    assert_eq!((message(&farm, "first"), message(&farm, "second")), (String::new(), String::new()));
}
