//! The database: tables, opening, and reading everything back.

use super::StoreError;
use crate::ids::JobId;
use crate::job::{JobSpec, JobState, Progress};
use renderer::film::Counters;
use renderer::job::RenderSettings;
use renderer::scene::bundle::Digest;
use rusqlite::{Connection, OpenFlags, OptionalExtension, Row, TransactionBehavior, params};
use std::path::Path;
use std::time::Duration;

/// Version of the tables and of the plans and results that belong to them; a folder of another version is refused.
const VERSION: u32 = 2;

const TABLES: &str = "
CREATE TABLE meta (key TEXT PRIMARY KEY, value INTEGER NOT NULL) WITHOUT ROWID;
CREATE TABLE jobs (
    number INTEGER PRIMARY KEY,
    id BLOB NOT NULL UNIQUE,
    name TEXT NOT NULL,
    priority INTEGER NOT NULL,
    manifest BLOB NOT NULL,
    scene BLOB NOT NULL,
    settings TEXT NOT NULL,
    lights INTEGER NOT NULL,
    payload BLOB NOT NULL,
    submitted_ms INTEGER NOT NULL,
    state TEXT NOT NULL,
    message TEXT NOT NULL,
    elapsed_ms INTEGER NOT NULL,
    progress TEXT NOT NULL,
    checkpoint INTEGER
);
CREATE TABLE passes (
    job BLOB NOT NULL, pass INTEGER NOT NULL, time_up INTEGER NOT NULL,
    PRIMARY KEY (job, pass)
) WITHOUT ROWID;
CREATE TABLE results (
    job BLOB NOT NULL, pass INTEGER NOT NULL, unit INTEGER NOT NULL,
    segment INTEGER NOT NULL, place INTEGER NOT NULL, len INTEGER NOT NULL, digest BLOB NOT NULL, worker BLOB NOT NULL,
    PRIMARY KEY (job, pass, unit)
) WITHOUT ROWID;
";

/// Where a result lies.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct StoredResult {
    /// The unit.
    pub unit: u32,
    /// The job's segment.
    pub segment: u32,
    /// First byte.
    pub place: u64,
    /// Number of bytes.
    pub len: u64,
    /// Of the bytes.
    pub digest: Digest,
}

/// A job as it was stored.
#[derive(Clone, Debug)]
pub struct StoredJob {
    /// Its id.
    pub id: JobId,
    /// What never changes.
    pub spec: JobSpec,
    /// Where it was.
    pub state: JobState,
    /// Why.
    pub message: String,
    /// Time for which it was active.
    pub elapsed: Duration,
    /// What was merged when it ended.
    pub progress: Progress,
    /// The latest checkpoint of its merge.
    pub checkpoint: Option<u32>,
}

/// What the folder holds.
#[derive(Clone, Debug)]
pub struct Restored {
    /// Counts the starts on this folder, this one included.
    pub generation: u32,
    /// All jobs, oldest first.
    pub jobs: Vec<StoredJob>,
}

/// Opens the database for writing, making its tables in a new folder.
pub fn open(folder: &Path) -> Result<Connection, StoreError> {
    let mut db = Connection::open(folder.join("farm.sqlite"))?;
    db.busy_timeout(Duration::from_secs(10))?;
    db.pragma_update(None, "journal_mode", "WAL")?;
    db.pragma_update(None, "synchronous", "FULL")?;
    let version: u32 = db.pragma_query_value(None, "user_version", |r| r.get(0))?;
    if version == 0 {
        let tx = db.transaction_with_behavior(TransactionBehavior::Immediate)?;
        tx.execute_batch(TABLES)?;
        tx.pragma_update(None, "user_version", VERSION)?;
        tx.commit()?;
        crate::files::sync_folder(folder)?;
    } else if version != VERSION {
        return Err(StoreError::Fault(format!(
            "it was written by another version of lightfarm (tables of version {version}, this one has {VERSION}); \
             finish its jobs with that version, or give another --data"
        )));
    }
    Ok(db)
}

/// Opens the database for reading beside the writer.
pub fn open_reader(folder: &Path) -> Result<Connection, StoreError> {
    let db = Connection::open_with_flags(folder.join("farm.sqlite"), OpenFlags::SQLITE_OPEN_READ_ONLY)?;
    db.busy_timeout(Duration::from_secs(10))?;
    Ok(db)
}

/// Counts this start and reads all jobs.
pub fn restore(db: &mut Connection) -> Result<Restored, StoreError> {
    let tx = db.transaction_with_behavior(TransactionBehavior::Immediate)?;
    tx.execute(
        "INSERT INTO meta VALUES ('generation', 1) ON CONFLICT (key) DO UPDATE SET value = value + 1",
        params![],
    )?;
    let generation = tx.query_row("SELECT value FROM meta WHERE key = 'generation'", [], |r| r.get(0))?;
    let mut jobs = Vec::new();
    {
        let mut all = tx.prepare(
            "SELECT id, name, priority, manifest, scene, settings, lights, payload, submitted_ms, state, message, \
             elapsed_ms, progress, checkpoint FROM jobs ORDER BY number",
        )?;
        let mut rows = all.query([])?;
        while let Some(row) = rows.next()? {
            jobs.push(job_of(row)?);
        }
    }
    tx.commit()?;
    Ok(Restored { generation, jobs })
}

fn job_of(row: &Row<'_>) -> Result<StoredJob, StoreError> {
    let bad = |what: &str| StoreError::Fault(format!("the database is damaged: a job's {what}"));
    let digest = |i: usize| -> Result<Digest, StoreError> { Ok(Digest(row.get(i)?)) };
    let settings_json: String = row.get(5)?;
    let settings: RenderSettings = serde_json::from_str(&settings_json).map_err(|_| bad("settings"))?;
    let id: Vec<u8> = row.get(0)?;
    let state: String = row.get(9)?;
    let elapsed: i64 = row.get(11)?;
    let progress: String = row.get(12)?;
    Ok(StoredJob {
        id: JobId::from_slice(&id).ok_or_else(|| bad("id"))?,
        spec: JobSpec {
            name: row.get(1)?,
            priority: row.get(2)?,
            manifest: digest(3)?,
            scene: digest(4)?,
            settings,
            settings_json,
            lights: row.get(6)?,
            payload: digest(7)?,
            submitted_ms: row.get::<_, i64>(8)? as u64,
        },
        state: JobState::restored(&state).ok_or_else(|| bad("state"))?,
        message: row.get(10)?,
        elapsed: Duration::from_millis(elapsed as u64),
        progress: progress_from_json(&progress),
        checkpoint: row.get(13)?,
    })
}

/// The stored results of a pass, in the order of the units.
pub fn results(db: &Connection, job: JobId, pass: u32) -> Result<Vec<StoredResult>, StoreError> {
    let mut all =
        db.prepare("SELECT unit, segment, place, len, digest FROM results WHERE job = ?1 AND pass = ?2 ORDER BY unit")?;
    let rows = all.query_map(params![job.0.as_bytes(), pass], |r| {
        Ok(StoredResult {
            unit: r.get(0)?,
            segment: r.get(1)?,
            place: r.get::<_, i64>(2)? as u64,
            len: r.get::<_, i64>(3)? as u64,
            digest: Digest(r.get(4)?),
        })
    })?;
    Ok(rows.collect::<Result<_, _>>()?)
}

/// What was decided at the end of a pass.
pub fn pass_end(db: &Connection, job: JobId, pass: u32) -> Result<Option<bool>, StoreError> {
    let mut one = db.prepare("SELECT time_up FROM passes WHERE job = ?1 AND pass = ?2")?;
    Ok(one.query_row(params![job.0.as_bytes(), pass], |r| r.get(0)).optional()?)
}

/// Progress as text.
pub fn progress_to_json(p: &Progress) -> String {
    let c = &p.counters;
    serde_json::json!({
        "fraction": p.fraction, "spp": p.done_spp, "samples": c.samples, "rays": c.rays,
        "non_finite": c.non_finite, "negative": c.negative, "error": p.error,
        "choice": p.choice.as_ref().map(|c| (c.0.name(), &c.1)),
    })
    .to_string()
}

/// Progress from text; it is only shown, so what can't be read is zero.
fn progress_from_json(text: &str) -> Progress {
    let v: serde_json::Value = serde_json::from_str(text).unwrap_or_default();
    let count = |key: &str| v[key].as_u64().unwrap_or(0);
    Progress {
        folded: 0,
        fraction: v["fraction"].as_f64().unwrap_or(0.0),
        done_spp: count("spp") as u32,
        counters: Counters {
            samples: count("samples"),
            rays: count("rays"),
            non_finite: count("non_finite"),
            negative: count("negative"),
        },
        error: v["error"][0].as_f64().zip(v["error"][1].as_f64()),
        choice: v["choice"][0].as_str().and_then(|n| n.parse().ok()).zip(v["choice"][1].as_str().map(String::from)),
    }
}
