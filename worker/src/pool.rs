//! The compute threads.

use crate::board::{Board, Failure, Task};
use renderer::job::{UnitError, run_unit};
use std::io;
use std::sync::Arc;
use std::thread::JoinHandle;
use std::time::Instant;

/// Starts the threads; they end with the board.
pub fn start(board: &Arc<Board>, count: usize) -> io::Result<Vec<JoinHandle<()>>> {
    let one = |n: usize| {
        let board = board.clone();
        std::thread::Builder::new().name(format!("render-{n}")).spawn(move || {
            while let Some(task) = board.next_task() {
                work(&board, &task);
            }
        })
    };
    (0..count.max(1)).map(one).collect()
}

fn work(board: &Board, task: &Task) {
    let began = Instant::now();
    let d = &task.context.document;
    let result = match run_unit(&task.context.scene, &d.settings, &d.plan, &task.unit, &task.stop) {
        Ok(result) => Some(Ok(result.encode().into())),
        Err(UnitError::Stopped) => None,
        Err(e) => {
            tracing::error!("{e}");
            let message = e.to_string();
            let mismatch = if let UnitError::Mismatch { source, .. } = e { Some(source) } else { None };
            Some(Err(Failure { message, mismatch }))
        }
    };
    board.finished(task, began.elapsed().as_secs_f64(), result);
}
