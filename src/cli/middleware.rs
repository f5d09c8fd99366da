//! `laser_profiler middleware`: the process that `run` starts for DDS or Zenoh.

use std::{fs::File, io, os::fd::AsFd, panic, process};

use anyhow::Context;
use tokio::{
    runtime::Builder,
    signal::unix::{SignalKind, signal},
};
use tracing_subscriber::filter::Targets;

use super::{Outcome, Usage, logging};
use crate::ros::{
    middleware,
    process::host::{self, Events},
};

/// Exit code after a panic, as the standard library's.
const PANICKED: i32 = 101;

/// Runs the middleware of a node. Internal: `laser_profiler run` starts it.
#[derive(Debug, clap::Args)]
pub(super) struct MiddlewareArgs {
    /// Levels of the log by target, as tracing writes them.
    #[arg(long)]
    log: String,
}

/// Serves the node at the other end of standard input and output until it closes them.
///
/// # Errors
/// [`Usage`] if there is no such node; otherwise an error of the system.
pub(super) fn run(args: &MiddlewareArgs) -> anyhow::Result<Outcome> {
    let targets: Targets =
        args.log.parse().map_err(|error| Usage(format!("--log {}: {error}", args.log)))?;
    let events = Events::default();
    logging::start_in_middleware(targets, events.clone());
    end_on_panic();
    host::end_with_node().context("cannot watch the node")?;
    let _signals = ignore_signals().context("cannot wait for signals")?;
    // Unbuffered: frames are written whole.
    let input = File::from(io::stdin().as_fd().try_clone_to_owned()?);
    let output = File::from(io::stdout().as_fd().try_clone_to_owned()?);
    host::run(io::BufReader::new(input), output, &events, middleware::join)?;
    Ok(Outcome::Done)
}

/// Ends the process when any thread panics: a middleware that lost a thread only seems to work.
fn end_on_panic() {
    let report = panic::take_hook();
    panic::set_hook(Box::new(move |info| {
        report(info);
        process::exit(PANICKED);
    }));
}

/// Leaves SIGINT and SIGTERM to the node, which closes this process's standard input once it no longer needs it. The
/// result must be kept.
fn ignore_signals() -> io::Result<impl Sized> {
    let runtime = Builder::new_current_thread().enable_all().build()?;
    let context = runtime.enter();
    let ignored = [SignalKind::interrupt(), SignalKind::terminate(), SignalKind::hangup()];
    let signals = ignored.map(signal).into_iter().collect::<Result<Vec<_>, _>>()?;
    drop(context);
    Ok((signals, runtime))
}
