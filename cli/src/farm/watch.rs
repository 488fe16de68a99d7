//! Following a job to its end.

use super::view::state_line;
use super::{Farm, failure, persist};
use crate::exit::Failure;
use crate::output::Console;
use indicatif::{ProgressBar, ProgressStyle};
use proto::{JobState, JobStatus};
use std::io::IsTerminal;
use std::time::{Duration, Instant};
use tonic::Code;

/// Time between plain lines on standard error.
const LINE_INTERVAL: Duration = Duration::from_secs(5);
/// How often the stop flag is looked at.
const LOOK: Duration = Duration::from_millis(100);

/// Shows a job until it has ended; a coordinator that restarts is waited for. `stopped` ends the watching, not the job.
pub fn watch(farm: &Farm, id: &str, console: &Console, stopped: impl Fn() -> bool) -> Result<JobStatus, Failure> {
    let mut shown = Shown::new(console);
    let follow = async {
        loop {
            let mut stream = persist(|| {
                let (mut jobs, id) = (farm.jobs(), id.to_string());
                async move { jobs.watch(proto::JobRef { id }).await }
            })
            .await?
            .into_inner();
            loop {
                match stream.message().await {
                    Ok(Some(status)) => {
                        shown.show(&status);
                        if matches!(status.state(), JobState::Done | JobState::Failed | JobState::Cancelled) {
                            return Ok(status);
                        }
                    }
                    Ok(None) => break,
                    // The connection was cut: try to go on.
                    Err(s)
                        if matches!(s.code(), Code::Unavailable | Code::Unknown | Code::Cancelled | Code::Internal) =>
                    {
                        break;
                    }
                    Err(s) => return Err(s),
                }
            }
        }
    };
    let interrupted = async {
        while !stopped() {
            tokio::time::sleep(LOOK).await;
        }
    };
    let ended = farm.block_on(async {
        tokio::select! {
            ended = follow => Some(ended),
            () = interrupted => None,
        }
    });
    shown.finish();
    match ended {
        Some(ended) => ended.map_err(|s| failure(&s)),
        None => Err(Failure::Interrupted),
    }
}

/// What a job's end means.
pub fn verdict(status: &JobStatus) -> Result<(), Failure> {
    let says = |what: &str| match status.message.as_str() {
        "" => format!("error: job {} {what}", status.id),
        message => format!("error: job {} {what}: {message}", status.id),
    };
    match status.state() {
        JobState::Failed => Err(Failure::Input(says("failed"))),
        JobState::Cancelled => Err(Failure::Input(says("was cancelled"))),
        _ => Ok(()),
    }
}

/// Shows statuses: a bar on a terminal, a line now and then elsewhere, JSON lines for scripts.
struct Shown {
    console: Console,
    bar: Option<ProgressBar>,
    last: Option<(Instant, i32, String)>,
}

impl Shown {
    fn new(console: &Console) -> Self {
        let bar = (std::io::stderr().is_terminal() && !console.json).then(|| {
            let bar = ProgressBar::new(10_000);
            // The template is fixed and valid; the default style serves otherwise.
            if let Ok(style) = ProgressStyle::with_template("{bar:32} {msg}") {
                bar.set_style(style.progress_chars("=> "));
            }
            bar
        });
        Self { console: *console, bar, last: None }
    }

    fn show(&mut self, s: &JobStatus) {
        if self.console.json {
            let mut value = proto::json::job(s);
            value["event"] = "status".into();
            return self.console.event(&value);
        }
        if let Some(bar) = &self.bar {
            bar.set_position((s.fraction * 10_000.0) as u64);
            return bar.set_message(state_line(s));
        }
        // A new state or message is shown at once.
        let due = self.last.as_ref().is_none_or(|(at, state, message)| {
            at.elapsed() >= LINE_INTERVAL || *state != s.state || *message != s.message
        });
        if due {
            self.last = Some((Instant::now(), s.state, s.message.clone()));
            self.console.note(state_line(s));
        }
    }

    fn finish(&self) {
        if let Some(bar) = &self.bar {
            bar.finish_and_clear();
        }
    }
}
