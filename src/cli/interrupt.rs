//! SIGINT and SIGTERM: the first signal stops the run cleanly, the second one immediately.

use std::{
    future::poll_fn,
    io, process,
    task::Poll,
    thread,
    time::{Duration, Instant},
};

use tokio::{
    runtime::Builder,
    signal::unix::{SignalKind, signal},
};

use crate::node::stop::Stop;

/// Exit code of a process that SIGINT ended, as shells report it.
const EXIT_INTERRUPTED: i32 = 130;

/// Signals within this time count as one: launch files and `timeout` signal a process and its group.
const SAME_REQUEST: Duration = Duration::from_secs(1);

/// Raises `stop` at the first signal, from a thread of its own.
///
/// # Errors
/// The system refuses a thread or a signal handler.
pub(super) fn raise_on_signal(stop: Stop) -> io::Result<()> {
    let runtime = Builder::new_current_thread().enable_all().build()?;
    let (mut interrupt, mut terminate) = {
        // Installed before the thread starts, so that a signal in between does not end the process.
        let _context = runtime.enter();
        (signal(SignalKind::interrupt())?, signal(SignalKind::terminate())?)
    };
    let wait = move || {
        let mut next = || {
            runtime.block_on(poll_fn(|context| {
                let came = interrupt.poll_recv(context).is_ready()
                    || terminate.poll_recv(context).is_ready();
                if came { Poll::Ready(()) } else { Poll::Pending }
            }));
        };
        next();
        tracing::warn!("interrupted: closing the files; interrupt again to stop immediately");
        let first = Instant::now();
        stop.raise();
        while first.elapsed() < SAME_REQUEST {
            next();
        }
        process::exit(EXIT_INTERRUPTED);
    };
    thread::Builder::new().name("signals".to_owned()).spawn(wait).map(drop)
}
