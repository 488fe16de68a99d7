//! SIGINT and SIGTERM: the first asks to stop and save, the second exits at once.

use renderer::job::Stop;
use std::io;
use tokio::signal::unix::{SignalKind, signal};

/// Stops `stop` at the first SIGINT or SIGTERM and ends the process at the second.
pub fn stop_on_interrupt(stop: &'static Stop) -> io::Result<()> {
    let runtime = tokio::runtime::Builder::new_current_thread().enable_io().build()?;
    // The handlers are in place when this function returns.
    let (mut interrupt, mut terminate) = {
        let _context = runtime.enter();
        (signal(SignalKind::interrupt())?, signal(SignalKind::terminate())?)
    };
    std::thread::Builder::new().name("signals".into()).spawn(move || {
        runtime.block_on(async {
            loop {
                tokio::select! { _ = interrupt.recv() => {}, _ = terminate.recv() => {} }
                if stop.stopped() {
                    std::process::exit(130);
                }
                stop.stop();
            }
        });
    })?;
    Ok(())
}
