//! The thread that folds stored results into images, in the order of the units. What it decides at the end of a pass is stored before
//! it counts, so that a restart decides alike.

use crate::hub::Hub;
use crate::ids::JobId;
use crate::job::{JobSpec, JobState, Progress};
use crate::merging::{Merging, Step};
use crate::store::{Change, StoreError, StoredResult, wait};
use renderer::film::MergedImage;
use renderer::job::{Choice, UnitResult, document::PassDocument};
use std::collections::BTreeMap;
use std::sync::mpsc::{Receiver, Sender};
use std::sync::{Arc, Weak};
use tokio::sync::oneshot;

/// Units folded for one job before the others have their turn.
const TURN: usize = 16;
/// More damaged results than this are a fault of the disk that rendering again does not mend.
const MAX_DAMAGED: u32 = 100;

/// An image that is not complete.
#[derive(Debug)]
pub struct Snapshot {
    /// The image.
    pub image: MergedImage,
    /// What it was made of.
    pub spec: Arc<JobSpec>,
    /// What `auto` chose.
    pub choice: Option<Choice>,
    /// How far it is.
    pub progress: Progress,
}

enum Request {
    Start(JobId, Arc<JobSpec>, Option<u32>),
    Stored(JobId, u32, StoredResult, Option<Box<UnitResult>>),
    Snapshot(JobId, oneshot::Sender<Snapshot>),
    Nudge(JobId),
    Written(JobId, Progress, Result<(), StoreError>),
    Forget(JobId),
}

/// Handle to the merging thread.
#[derive(Clone, Debug)]
pub struct MergeQueue {
    requests: Sender<Request>,
}

/// The thread's inbox, until it is started.
pub struct MergeInbox(Receiver<Request>);

impl std::fmt::Debug for Request {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str("Request")
    }
}

impl MergeQueue {
    /// A queue and its other end.
    pub fn new() -> (Self, MergeInbox) {
        let (requests, inbox) = std::sync::mpsc::channel();
        (Self { requests }, MergeInbox(inbox))
    }

    /// A job is there: new, or from before a restart, perhaps with a checkpoint.
    pub fn start(&self, job: JobId, spec: Arc<JobSpec>, checkpoint: Option<u32>) {
        self.send(Request::Start(job, spec, checkpoint));
    }

    /// A result is stored; `decoded` saves reading it again.
    pub fn stored(&self, job: JobId, pass: u32, at: StoredResult, decoded: Option<Box<UnitResult>>) {
        self.send(Request::Stored(job, pass, at, decoded));
    }

    /// The image so far; `None` for a job that is not being merged.
    pub async fn snapshot(&self, job: JobId) -> Option<Snapshot> {
        let (reply, receipt) = oneshot::channel();
        self.send(Request::Snapshot(job, reply));
        receipt.await.ok()
    }

    /// What failed may work now.
    pub fn nudge(&self, job: JobId) {
        self.send(Request::Nudge(job));
    }

    /// A job is over.
    pub fn forget(&self, job: JobId) {
        self.send(Request::Forget(job));
    }

    fn send(&self, request: Request) {
        // A thread that is gone is one that the coordinator ended.
        let _ = self.requests.send(request);
    }
}

impl MergeInbox {
    /// Starts the thread; it ends with the hub.
    pub fn start(self, hub: &Arc<Hub>) -> std::io::Result<()> {
        let hub = Arc::downgrade(hub);
        let run = move || Merge { hub, jobs: BTreeMap::new() }.run(&self.0);
        std::thread::Builder::new().name("merge".into()).spawn(run).map(drop)
    }
}

struct Merge {
    hub: Weak<Hub>,
    jobs: BTreeMap<JobId, Merging>,
}

impl Merge {
    fn run(mut self, inbox: &Receiver<Request>) {
        loop {
            let busy = self.jobs.values().any(Merging::ready);
            let first = if busy { inbox.try_recv().ok() } else { inbox.recv().ok() };
            if first.is_none() && !busy {
                return;
            }
            let Some(hub) = self.hub.upgrade() else { return };
            for request in first.into_iter().chain(inbox.try_iter()) {
                self.handle(&hub, request);
            }
            let ready: Vec<JobId> = self.jobs.iter().filter(|(_, m)| m.ready()).map(|(id, _)| *id).collect();
            ready.into_iter().for_each(|id| self.turn(&hub, id));
        }
    }

    fn handle(&mut self, hub: &Arc<Hub>, request: Request) {
        match request {
            Request::Start(id, spec, checkpoint) => self.start(hub, id, spec, checkpoint),
            Request::Stored(id, pass, at, decoded) => {
                if let Some(m) = self.jobs.get_mut(&id) {
                    m.stored(pass, at, decoded);
                }
            }
            Request::Snapshot(id, reply) => {
                if let Some(m) = self.jobs.get(&id) {
                    let _ = reply.send(m.snapshot());
                }
            }
            Request::Nudge(id) => {
                if let Some(m) = self.jobs.get_mut(&id) {
                    m.stuck = false;
                }
                if self.jobs.get(&id).is_some_and(|m| !m.begun) {
                    self.begin_pass(hub, id);
                }
            }
            Request::Written(id, progress, outcome) => self.written(hub, id, progress, outcome),
            Request::Forget(id) => drop(self.jobs.remove(&id)),
        }
    }

    fn start(&mut self, hub: &Arc<Hub>, id: JobId, spec: Arc<JobSpec>, checkpoint: Option<u32>) {
        let merging = match checkpoint {
            Some(number) => Merging::restore(id, spec, &hub.store, number),
            None => Ok(Merging::new(id, spec)),
        };
        match merging {
            Ok(merging) => {
                self.jobs.insert(id, merging);
                self.begin_pass(hub, id);
            }
            Err(e) => hub.pause_for(id, &e),
        }
    }

    /// Folds some units of a job; at the end of a pass goes on to the next.
    fn turn(&mut self, hub: &Arc<Hub>, id: JobId) {
        let Some(m) = self.jobs.get_mut(&id) else { return };
        for _ in 0..TURN {
            match m.step(&hub.store) {
                Step::Folded => {}
                Step::Waits => break,
                Step::Damaged(unit, e) => {
                    tracing::error!(job = %id, "{e}; unit {unit} is rendered again");
                    self.render_again(hub, id, unit, &e);
                    break;
                }
                Step::PassComplete => {
                    self.end_pass(hub, id);
                    break;
                }
            }
        }
        if let Some(m) = self.jobs.get_mut(&id) {
            if let Err(e) = m.save_if_due(&hub.store, hub.checkpoint_bytes) {
                m.stuck = true;
                hub.pause_for(id, &e);
            }
            hub.with(|farm, now| farm.note_progress(id, m.progress(), now));
        }
    }

    /// A stored result is of no use: its unit is opened again.
    fn render_again(&mut self, hub: &Arc<Hub>, id: JobId, unit: u32, why: &StoreError) {
        let Some(m) = self.jobs.get_mut(&id) else { return };
        m.damaged += 1;
        if m.damaged > MAX_DAMAGED {
            m.stuck = true;
            hub.pause_for(
                id,
                &StoreError::Fault(format!("{} stored results were damaged; the last: {why}", m.damaged)),
            );
            return;
        }
        match wait(hub.store.change(Change::Forget(id, m.pass(), vec![unit]))) {
            Ok(()) => self.begin_pass(hub, id),
            Err(e) => {
                m.stuck = true;
                hub.pause_for(id, &e);
            }
        }
    }

    /// Decides how the job goes on, as it was decided before if it was.
    fn end_pass(&mut self, hub: &Arc<Hub>, id: JobId) {
        let Some(m) = self.jobs.get_mut(&id) else { return };
        let decided = hub.store.pass_end(id, m.pass()).and_then(|decided| match decided {
            Some(time_up) => Ok(time_up),
            None => {
                let elapsed = hub.with(|farm, now| farm.job(id).map(|j| j.clock.elapsed(now)));
                let budget = m.spec.settings.budget.time_s;
                let time_up = budget.zip(elapsed).is_some_and(|(t, e)| e.as_secs_f64() >= t);
                wait(hub.store.change(Change::PassEnd(id, m.pass(), time_up))).map(|()| time_up)
            }
        });
        match decided {
            Ok(time_up) if m.advance(time_up) => self.begin_pass(hub, id),
            Ok(_) => self.finish(hub, id),
            Err(e) => {
                m.stuck = true;
                hub.pause_for(id, &e);
            }
        }
    }

    /// Publishes the plan of a pass, with those of its units that are stored already.
    fn begin_pass(&mut self, hub: &Arc<Hub>, id: JobId) {
        let Some(m) = self.jobs.get_mut(&id) else { return };
        let began = m.load(&hub.store).and_then(|done| {
            // A pass that ended before the restart is only folded again.
            let over = done.len() == m.plan().unit_count() && hub.store.pass_end(id, m.pass())?.is_some();
            if over {
                return Ok(());
            }
            let document = PassDocument::new(m.spec.manifest, m.spec.settings.clone(), m.plan().clone());
            let json = document.to_json().map_err(StoreError::Fault)?;
            let digest = hub.blobs.put(&json)?;
            let plan = Arc::new(m.plan().clone());
            hub.with(|farm, now| farm.begin_pass(id, plan, digest, done, now));
            Ok(())
        });
        m.begun = began.is_ok();
        if let Err(e) = began {
            m.stuck = true;
            hub.pause_for(id, &e);
        }
    }

    /// Writes the image, on a thread of its own: other jobs go on.
    fn finish(&mut self, hub: &Arc<Hub>, id: JobId) {
        let Some(m) = self.jobs.get_mut(&id) else { return };
        m.finishing = true;
        let (snapshot, store, queue) = (m.snapshot(), hub.store.clone(), hub.merge.clone());
        let write = move || {
            let progress = snapshot.progress.clone();
            let outcome =
                crate::image::exr_of(&snapshot).map_err(StoreError::Fault).and_then(|exr| store.write_image(id, &exr));
            queue.send(Request::Written(id, progress, outcome));
        };
        if let Err(e) = std::thread::Builder::new().name("image".into()).spawn(write) {
            self.finish_failed(hub, id, &e.into());
        }
    }

    fn finish_failed(&mut self, hub: &Arc<Hub>, id: JobId, e: &StoreError) {
        if let Some(m) = self.jobs.get_mut(&id) {
            (m.finishing, m.stuck) = (false, true);
        }
        hub.pause_for(id, e);
    }

    fn written(&mut self, hub: &Arc<Hub>, id: JobId, progress: Progress, outcome: Result<(), StoreError>) {
        if !self.jobs.contains_key(&id) {
            return;
        }
        let elapsed = hub.with(|farm, now| {
            farm.note_progress(id, progress.clone(), now);
            farm.job(id).map(|j| j.clock.elapsed(now)).unwrap_or_default()
        });
        let done = Change::State { job: id, state: JobState::Done, message: String::new(), elapsed, progress };
        match outcome.and_then(|()| wait(hub.store.change(done))) {
            Ok(()) => {
                tracing::info!(job = %id, seconds = elapsed.as_secs_f64(), "done");
                hub.with(|farm, now| farm.end(id, JobState::Done, "", now));
                self.jobs.remove(&id);
            }
            Err(e) => self.finish_failed(hub, id, &e),
        }
    }
}
