//! The one thread that writes. Requests that wait together are made durable together: results to their segments, then one sync,
//! then one transaction that lists them.

use super::schema::{Restored, progress_to_json};
use super::segment::{Segment, folder};
use super::{Appended, Change, NewResult, Request, StoreError, StoredResult};
use crate::ids::JobId;
use crate::job::JobState;
use renderer::scene::bundle::Digest;
use rusqlite::{Connection, OptionalExtension, Transaction, TransactionBehavior, params};
use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};
use std::sync::mpsc::Receiver;
use tokio::sync::oneshot;

/// Requests, and bytes of results, that go into one transaction at most.
const BATCH: usize = 512;
const BATCH_BYTES: usize = 64 << 20;
/// A segment of this length gets no more results: checkpoints free whole segments.
const FULL_SEGMENT: u64 = 64 << 20;

type Reply<T> = oneshot::Sender<Result<T, StoreError>>;

pub struct Writer {
    db: Connection,
    segments: Segments,
    ended: BTreeSet<JobId>,
}

/// The segments that results are appended to.
struct Segments {
    folder: PathBuf,
    open: BTreeMap<(JobId, u32), Segment>,
}

/// Answers that wait for the transaction.
#[derive(Default)]
struct Answers {
    appended: Vec<(Appended, Reply<Appended>)>,
    changed: Vec<Reply<()>>,
    touched: BTreeSet<(JobId, u32)>,
    ended: Vec<JobId>,
    checkpoints: Vec<(JobId, u32)>,
}

impl Writer {
    pub fn new(db: Connection, folder: PathBuf, restored: &Restored) -> Self {
        let ended = restored.jobs.iter().filter(|j| j.state.ended()).map(|j| j.id).collect();
        Self { db, segments: Segments { folder, open: BTreeMap::new() }, ended }
    }

    pub fn run(mut self, inbox: &Receiver<Request>) {
        // What an interrupted ending left behind.
        self.ended.iter().for_each(|job| remove_files(&self.segments.folder, *job, |_| true));
        while let Ok(first) = inbox.recv() {
            let (mut batch, mut bytes, mut open) = (Vec::new(), 0, true);
            let mut next = Some(first);
            while let Some(request) = next.take() {
                match request {
                    Request::Close => open = false,
                    request => {
                        if let Request::Append(r, _) = &request {
                            bytes += r.bytes.len();
                        }
                        batch.push(request);
                    }
                }
                if open && batch.len() < BATCH && bytes < BATCH_BYTES {
                    next = inbox.try_recv().ok();
                }
            }
            self.write(batch);
            if !open {
                return;
            }
        }
    }

    fn write(&mut self, batch: Vec<Request>) {
        let mut answers = Answers::default();
        let outcome = self.transact(batch, &mut answers);
        for key in &answers.touched {
            if let Some(segment) = self.segments.open.get_mut(key) {
                if outcome.is_ok() { segment.commit() } else { segment.roll_back() }
            }
        }
        match outcome {
            Ok(()) => {
                for job in answers.ended {
                    self.ended.insert(job);
                    self.segments.open.retain(|(j, _), _| *j != job);
                    remove_files(&self.segments.folder, job, |_| true);
                }
                for (job, checkpoint) in answers.checkpoints {
                    self.free(job, checkpoint);
                }
                answers.appended.into_iter().for_each(|(a, reply)| drop(reply.send(Ok(a))));
                answers.changed.into_iter().for_each(|reply| drop(reply.send(Ok(()))));
            }
            Err(e) => {
                tracing::error!("{e}");
                answers.appended.into_iter().for_each(|(_, reply)| drop(reply.send(Err(e.clone()))));
                answers.changed.into_iter().for_each(|reply| drop(reply.send(Err(e.clone()))));
            }
        }
    }

    /// Removes what a checkpoint has made useless: earlier ones, and segments of which no result is listed.
    fn free(&mut self, job: JobId, checkpoint: u32) {
        let first = "SELECT min(segment) FROM results WHERE job = ?1";
        let Ok(first) = self.db.query_row(first, params![job.0.as_bytes()], |r| r.get::<_, Option<u32>>(0)) else {
            return;
        };
        let newest = self.segments.open.keys().filter(|(j, _)| *j == job).map(|(_, n)| *n).max();
        let keep = first.into_iter().chain(newest).min().unwrap_or(u32::MAX);
        self.segments.open.retain(|(j, n), _| *j != job || *n >= keep);
        remove_files(&self.segments.folder, job, |file| match file {
            JobFile::Segment(n) => n < keep,
            JobFile::Checkpoint(n) => n != checkpoint,
        });
    }

    /// All of a batch or nothing. Requests that fail by themselves are answered at once.
    fn transact(&mut self, batch: Vec<Request>, answers: &mut Answers) -> Result<(), StoreError> {
        let mut batch = batch.into_iter();
        let tx = match self.db.transaction_with_behavior(TransactionBehavior::Immediate) {
            Ok(tx) => tx,
            Err(e) => {
                batch.for_each(|r| answers.postpone(r));
                return Err(e.into());
            }
        };
        let mut outcome = Ok(());
        for request in batch.by_ref() {
            let done = match request {
                Request::Append(result, reply) => {
                    let ended = self.ended.contains(&result.job) || answers.ended.contains(&result.job);
                    match self.segments.append(&tx, ended, &result) {
                        Ok(appended) => {
                            if let Appended::New(at) = appended {
                                answers.touched.insert((result.job, at.segment));
                            }
                            answers.appended.push((appended, reply));
                            Ok(())
                        }
                        Err(StoreError::Ended) => {
                            let _ = reply.send(Err(StoreError::Ended));
                            Ok(())
                        }
                        Err(e) => {
                            // What was written of it has to be cut off.
                            answers.touched.extend(self.segments.current(result.job).map(|n| (result.job, n)));
                            answers.appended.push((Appended::Existing(result.digest), reply));
                            Err(e)
                        }
                    }
                }
                Request::Find(job, pass, unit, reply) => {
                    let _ = reply.send(find(&tx, job, pass, unit));
                    Ok(())
                }
                Request::Change(change, reply) => {
                    answers.changed.push(reply);
                    if let Change::State { job, state, .. } = &change
                        && state.ended()
                    {
                        answers.ended.push(*job);
                    }
                    if let Change::Checkpoint(job, number, ..) = &change {
                        answers.checkpoints.push((*job, *number));
                    }
                    apply(&tx, &change)
                }
                Request::Close => Ok(()),
            };
            if let Err(e) = done {
                outcome = Err(e);
                break;
            }
        }
        batch.for_each(|r| answers.postpone(r));
        outcome?;
        for key in &answers.touched {
            if let Some(segment) = self.segments.open.get(key) {
                segment.sync()?;
            }
        }
        tx.commit()?;
        Ok(())
    }
}

impl Answers {
    /// Takes only the sender of a request that was not tried, so that it learns why.
    fn postpone(&mut self, request: Request) {
        match request {
            Request::Append(result, reply) => self.appended.push((Appended::Existing(result.digest), reply)),
            Request::Change(_, reply) => self.changed.push(reply),
            Request::Find(.., reply) => drop(reply.send(Err(StoreError::Fault("a write before it failed".into())))),
            Request::Close => {}
        }
    }
}

impl Segments {
    /// The segment to which a job's results go now.
    fn current(&self, job: JobId) -> Option<u32> {
        self.open.range((job, 0)..=(job, u32::MAX)).next_back().map(|((_, n), _)| *n)
    }

    /// Writes a result, unless its unit has one.
    fn append(&mut self, tx: &Transaction<'_>, ended: bool, r: &NewResult) -> Result<Appended, StoreError> {
        if ended {
            return Err(StoreError::Ended);
        }
        if let Some(digest) = find(tx, r.job, r.pass, r.unit)? {
            return Ok(Appended::Existing(digest));
        }
        let number = self.writable(tx, r.job)?;
        let Some(segment) = self.open.get_mut(&(r.job, number)) else { return Err(StoreError::Ended) };
        let place = segment.append(&r.bytes)?;
        let len = r.bytes.len() as u64;
        tx.prepare_cached("INSERT INTO results VALUES (?1, ?2, ?3, ?4, ?5, ?6, ?7, ?8)")?.execute(params![
            r.job.0.as_bytes(),
            r.pass,
            r.unit,
            number,
            place as i64,
            len as i64,
            r.digest.0,
            r.worker.0.as_bytes()
        ])?;
        Ok(Appended::New(StoredResult { unit: r.unit, segment: number, place, len, digest: r.digest }))
    }

    /// A segment with room; after a start, the last one of the job, cut to what is listed.
    fn writable(&mut self, tx: &Transaction<'_>, job: JobId) -> Result<u32, StoreError> {
        let number = match self.current(job) {
            Some(n) if self.open.get(&(job, n)).is_some_and(|s| s.len() < FULL_SEGMENT) => return Ok(n),
            Some(n) => n + 1,
            None => super::segment::numbers(&self.folder, job).into_iter().max().unwrap_or(0),
        };
        let committed: i64 = tx.query_row(
            "SELECT coalesce(max(place + len), 0) FROM results WHERE job = ?1 AND segment = ?2",
            params![job.0.as_bytes(), number],
            |row| row.get(0),
        )?;
        self.open.insert((job, number), Segment::open(&self.folder, job, number, committed as u64)?);
        Ok(number)
    }
}

fn find(tx: &Transaction<'_>, job: JobId, pass: u32, unit: u32) -> Result<Option<Digest>, StoreError> {
    let mut one = tx.prepare_cached("SELECT digest FROM results WHERE job = ?1 AND pass = ?2 AND unit = ?3")?;
    Ok(one.query_row(params![job.0.as_bytes(), pass, unit], |r| Ok(Digest(r.get(0)?))).optional()?)
}

fn apply(tx: &Transaction<'_>, change: &Change) -> Result<(), StoreError> {
    match change {
        Change::Add(id, s) => {
            tx.execute(
                "INSERT INTO jobs (id, name, priority, manifest, scene, settings, lights, payload, submitted_ms, state, \
                 message, elapsed_ms, progress) VALUES (?1, ?2, ?3, ?4, ?5, ?6, ?7, ?8, ?9, ?10, '', 0, '')",
                params![
                    id.0.as_bytes(),
                    s.name,
                    s.priority,
                    s.manifest.0,
                    s.scene.0,
                    s.settings_json,
                    s.lights,
                    s.payload.0,
                    s.submitted_ms as i64,
                    JobState::Active.name()
                ],
            )?;
        }
        Change::State { job, state, message, elapsed, progress } => {
            tx.execute(
                "UPDATE jobs SET state = ?2, message = ?3, elapsed_ms = ?4, progress = ?5 WHERE id = ?1",
                params![
                    job.0.as_bytes(),
                    state.name(),
                    message,
                    elapsed.as_millis() as i64,
                    progress_to_json(progress)
                ],
            )?;
            if state.ended() {
                tx.execute("DELETE FROM results WHERE job = ?1", params![job.0.as_bytes()])?;
                tx.execute("DELETE FROM passes WHERE job = ?1", params![job.0.as_bytes()])?;
            }
        }
        Change::Elapsed(job, elapsed) => {
            let ms = elapsed.as_millis() as i64;
            tx.execute("UPDATE jobs SET elapsed_ms = ?2 WHERE id = ?1", params![job.0.as_bytes(), ms])?;
        }
        Change::Checkpoint(job, number, pass, next) => {
            let id = job.0.as_bytes();
            tx.execute("UPDATE jobs SET checkpoint = ?2 WHERE id = ?1", params![id, number])?;
            let folded = "DELETE FROM results WHERE job = ?1 AND (pass < ?2 OR (pass = ?2 AND unit < ?3))";
            tx.execute(folded, params![id, pass, next])?;
            tx.execute("DELETE FROM passes WHERE job = ?1 AND pass < ?2", params![id, pass])?;
        }
        Change::Forget(job, pass, units) => {
            let mut delete = tx.prepare_cached("DELETE FROM results WHERE job = ?1 AND pass = ?2 AND unit = ?3")?;
            for unit in units {
                delete.execute(params![job.0.as_bytes(), pass, unit])?;
            }
        }
        Change::PassEnd(job, pass, time_up) => {
            tx.execute("INSERT INTO passes VALUES (?1, ?2, ?3)", params![job.0.as_bytes(), pass, time_up])?;
        }
    }
    Ok(())
}

/// A file that serves an unfinished job.
enum JobFile {
    Segment(u32),
    Checkpoint(u32),
}

/// Removes files of a job; its image stays in any case.
fn remove_files(data: &Path, job: JobId, which: impl Fn(JobFile) -> bool) {
    for file in std::fs::read_dir(folder(data, job)).into_iter().flatten().flatten() {
        let name = file.file_name();
        let number = |suffix: &str| name.to_str()?.strip_suffix(suffix)?.parse().ok();
        let kind = number(".results").map(JobFile::Segment).or(number(".merge").map(JobFile::Checkpoint));
        if kind.is_some_and(&which)
            && let Err(e) = std::fs::remove_file(file.path())
        {
            tracing::warn!("{} can't be removed: {e}", file.path().display());
        }
    }
}
