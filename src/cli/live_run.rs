//! A live node with its status line, with and without a view.

use anyhow::anyhow;

use super::{Usage, status_line::StatusShow};
use crate::node::{
    live::{LiveNode, error::LiveError, session::CameraSummary},
    stop::Stop,
};

/// Runs a node until `stop` is raised and shows its status.
///
/// # Errors
/// The system cannot create a thread, or a thread of the node panicked.
pub(super) fn measure(node: LiveNode, stop: &Stop) -> Result<Vec<CameraSummary>, LiveError> {
    let _status = StatusShow::start(node.watcher())?;
    node.run(stop)
}

/// Returns [`Usage`] for an error of the request, otherwise the error itself.
pub(super) fn classified(error: LiveError) -> anyhow::Error {
    if error.is_usage() { Usage(error.to_string()).into() } else { anyhow!(error) }
}
