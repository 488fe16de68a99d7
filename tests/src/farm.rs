//! A farm of processes on loopback.

use crate::binary::command;
use crate::until;
use serde_json::Value;
use std::ffi::OsStr;
use std::fs::File;
use std::net::TcpListener;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, ExitStatus, Output, Stdio};
use std::time::Duration;
use tempfile::TempDir;

/// A submitted job.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Job(pub String);

/// A coordinator and workers, killed at the end of the test.
pub struct Farm {
    folder: TempDir,
    /// The coordinator's data folder.
    pub data: PathBuf,
    /// The coordinator's address.
    pub url: String,
    /// Further arguments of the coordinator.
    pub coordinator_args: Vec<String>,
    coordinator: Option<Child>,
    workers: Vec<(String, Child)>,
}

/// A port that nobody listens on.
pub fn free_port() -> u16 {
    let listener = TcpListener::bind("127.0.0.1:0").expect("a free port");
    listener.local_addr().expect("its address").port()
}

impl Farm {
    /// A coordinator without workers.
    pub fn start() -> Self {
        let mut farm = Self::stopped();
        farm.start_coordinator();
        farm
    }

    /// A farm whose coordinator is not started yet.
    pub fn stopped() -> Self {
        let folder = TempDir::new().expect("a folder");
        let url = format!("http://127.0.0.1:{}", free_port());
        let data = folder.path().join("data");
        Self { folder, data, url, coordinator_args: Vec::new(), coordinator: None, workers: Vec::new() }
    }

    /// A path in the farm's own folder.
    pub fn path(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    fn spawn(&self, log: &str, args: &[&OsStr]) -> Child {
        let log = File::options().create(true).append(true).open(self.path(log)).expect("a log");
        let mut command = command();
        command.args(args).stdin(Stdio::null()).stdout(Stdio::null()).stderr(log);
        command.env("RUST_LOG", "info,worker=debug").spawn().expect("lightfarm starts")
    }

    /// Starts the coordinator, or starts it again.
    pub fn start_coordinator(&mut self) {
        assert!(self.coordinator.is_none(), "there is one already");
        let listen = self.url.trim_start_matches("http://").to_string();
        let data = self.data.as_os_str().to_owned();
        let mut args: Vec<&OsStr> = ["coordinator", "--listen", &listen, "--data"].map(OsStr::new).to_vec();
        args.push(&data);
        args.extend(self.coordinator_args.iter().map(OsStr::new));
        self.coordinator = Some(self.spawn("coordinator.log", &args));
        let address: std::net::SocketAddr = listen.parse().expect("an address");
        until("the coordinator listens", Duration::from_secs(10), || std::net::TcpStream::connect(address).is_ok());
    }

    /// Kills the coordinator (SIGKILL).
    pub fn kill_coordinator(&mut self) {
        let mut child = self.coordinator.take().expect("a coordinator");
        assert!(child.try_wait().expect("its state").is_none(), "the coordinator had ended by itself");
        child.kill().and_then(|()| child.wait()).expect("it dies");
    }

    /// Starts a worker.
    pub fn start_worker(&mut self, name: &str, threads: u32) {
        let (threads, cache) = (threads.to_string(), self.path(&format!("cache-{name}")).into_os_string());
        let args = ["worker", "--coordinator", &self.url, "--name", name, "--threads", &threads, "--cache"];
        let mut args: Vec<&OsStr> = args.map(OsStr::new).to_vec();
        args.push(&cache);
        let child = self.spawn(&format!("worker-{name}.log"), &args);
        self.workers.push((name.to_string(), child));
    }

    fn take_worker(&mut self, name: &str) -> Child {
        let at = self.workers.iter().position(|(n, _)| n == name).expect("such a worker");
        let mut child = self.workers.remove(at).1;
        assert!(child.try_wait().expect("its state").is_none(), "worker {name} had ended by itself");
        child
    }

    /// Kills a worker (SIGKILL).
    pub fn kill_worker(&mut self, name: &str) {
        let mut child = self.take_worker(name);
        child.kill().and_then(|()| child.wait()).expect("it dies");
    }

    /// Lets a worker run for a moment only; then it is stopped (SIGSTOP) and holds what it holds, until [`Farm::resume_worker`].
    pub fn step_worker(&self, name: &str, moment: Duration) {
        self.resume_worker(name);
        std::thread::sleep(moment);
        self.signal_worker(name, "STOP");
    }

    /// Lets a stopped worker go on (SIGCONT).
    pub fn resume_worker(&self, name: &str) {
        self.signal_worker(name, "CONT");
    }

    fn signal_worker(&self, name: &str, which: &str) {
        let (_, child) = self.workers.iter().find(|(n, _)| n == name).expect("such a worker");
        signal(child, which);
    }

    /// Asks a worker to end (SIGTERM) and waits for it.
    pub fn drain_worker(&mut self, name: &str, patience: Duration) -> ExitStatus {
        let mut child = self.take_worker(name);
        signal(&child, "TERM");
        let mut status = None;
        until("the worker has drained", patience, || {
            status = child.try_wait().expect("its state");
            status.is_some()
        });
        status.expect("until waits for it")
    }

    /// Runs a farm command and returns what it prints as JSON.
    pub fn json(&self, args: &[&str]) -> Value {
        let output = self.run(args);
        let shown = String::from_utf8_lossy(&output.stderr).into_owned();
        assert!(output.status.success(), "{args:?}: {:?}: {shown}", output.status);
        let text = String::from_utf8(output.stdout).expect("text");
        let last = text.lines().last().unwrap_or_else(|| panic!("{args:?} printed nothing"));
        serde_json::from_str(last).expect("JSON")
    }

    /// Runs a farm command.
    pub fn run(&self, args: &[&str]) -> Output {
        command().args(args).args(["--json", "--coordinator", &self.url]).output().expect("lightfarm runs")
    }

    /// Submits a scene.
    pub fn submit(&self, scene: &Path, options: &[&str]) -> Job {
        let scene = scene.to_str().expect("a plain path");
        let value = self.json(&[&["submit", scene], options].concat());
        Job(value["id"].as_str().expect("an id").to_string())
    }

    /// All about a job.
    pub fn show(&self, job: &Job) -> Value {
        self.json(&["show", &job.0])
    }

    /// How much of a job is merged.
    pub fn fraction(&self, job: &Job) -> f64 {
        self.show(job)["fraction"].as_f64().expect("a number")
    }

    /// A worker's record.
    pub fn worker(&self, name: &str) -> Value {
        self.worker_if_known(name).unwrap_or_else(|| panic!("the coordinator does not know worker {name}"))
    }

    /// A worker's record, once it has called.
    pub fn worker_if_known(&self, name: &str) -> Option<Value> {
        let all = self.json(&["workers"]);
        all["workers"].as_array().expect("a list").iter().find(|w| w["name"] == name).cloned()
    }

    /// Waits for a job to be done.
    pub fn wait(&self, job: &Job, patience: Duration) {
        until("the job is done", patience, || match self.show(job)["state"].as_str() {
            Some("done") => true,
            Some("active" | "restoring") => false,
            other => panic!("the job is {other:?}: {}", self.show(job)),
        });
    }

    /// Fetches a job's image and says where it is.
    pub fn fetch(&self, job: &Job, name: &str) -> PathBuf {
        let path = self.path(name);
        let value = self.json(&["fetch", &job.0, "-o", path.to_str().expect("a plain path")]);
        assert_eq!(value["event"], "fetched");
        path
    }
}

/// Sends a signal.
fn signal(child: &Child, name: &str) {
    let status = Command::new("kill").args([format!("-{name}"), child.id().to_string()]).status().expect("kill runs");
    assert!(status.success(), "the process is not there");
}

impl Drop for Farm {
    fn drop(&mut self) {
        for child in self.workers.iter_mut().map(|(_, c)| c).chain(self.coordinator.as_mut()) {
            let _ = child.kill();
            let _ = child.wait();
        }
        if std::thread::panicking() {
            for file in std::fs::read_dir(self.folder.path()).into_iter().flatten().flatten() {
                if file.path().extension() == Some(OsStr::new("log")) {
                    let text = std::fs::read_to_string(file.path()).unwrap_or_default();
                    let tail: Vec<&str> = text.lines().rev().take(40).collect();
                    eprintln!("--- {}", file.path().display());
                    tail.iter().rev().for_each(|line| eprintln!("{line}"));
                }
            }
        }
    }
}
