//! Live view in a build with the feature `foxglove`.

use std::{net::SocketAddr, time::Duration};

use anyhow::anyhow;

use super::{ReplayViewArgs, ViewArgs};
use crate::{
    cli::{
        Outcome, Usage,
        live_run::{classified, measure},
    },
    node::{
        live::{LiveNode, LiveRequest, session::CameraSummary},
        replay::ReplayRequest,
        rosout::RosoutSlot,
        stop::Stop,
        view::{
            Address, Images, ViewRequest,
            live::{LiveView, LiveViewError},
            replay::{AtEnd, ReplayView, ReplayViewError},
        },
    },
};

/// Period of checking for the end of a view.
const WATCH_PERIOD: Duration = Duration::from_millis(100);

/// Shows a recording until `stop` is raised, or until its end with `at_end`. Calls `write` to write the results
/// meanwhile.
///
/// # Errors
/// [`Usage`] for wrong usage; otherwise an error of reading, serving or writing.
pub(in crate::cli) fn replay(
    ReplayViewArgs { view, view_exit }: &ReplayViewArgs,
    request: ReplayRequest,
    stop: &Stop,
    write: &mut dyn FnMut() -> anyhow::Result<Outcome>,
) -> anyhow::Result<Outcome> {
    let classified = |error: ReplayViewError| {
        if error.is_usage() { Usage(error.to_string()).into() } else { anyhow!(error) }
    };
    let at_end = if *view_exit { AtEnd::Exit } else { AtEnd::Stay };
    let shown = ReplayView::start(request, self::request(view)?, at_end, stop.clone());
    let shown = shown.map_err(classified)?;
    announce(shown.address());
    let written = write();
    while written.is_ok() && !shown.is_finished() && !stop.wait(WATCH_PERIOD) {}
    stop.raise();
    log_num_messages(shown.join().map_err(classified)?);
    written
}

/// Runs a node with a live view until `stop` is raised.
///
/// # Errors
/// [`Usage`] for wrong usage; otherwise an error of the middleware, a file or the system.
pub(in crate::cli) fn live(
    view: &ViewArgs,
    request: &LiveRequest,
    rosout: RosoutSlot,
    stop: &Stop,
) -> anyhow::Result<Vec<CameraSummary>> {
    let view_error = |error: LiveViewError| {
        if error.is_usage() { Usage(error.to_string()).into() } else { anyhow!(error) }
    };
    let shown = LiveView::start(request, self::request(view)?).map_err(view_error)?;
    announce(shown.address());
    let variable = |name: &str| std::env::var(name).ok();
    let node =
        LiveNode::start_through(request, rosout, &variable, &|transport| shown.through(transport));
    let node = node.map_err(classified)?;
    shown.set_parameters_of(node.parameters());
    let summaries = measure(node, stop).map_err(classified)?;
    log_num_messages(shown.num_sent());
    Ok(summaries)
}

fn announce(address: SocketAddr) {
    tracing::info!("live view at ws://{address}: in Foxglove, Open connection, Foxglove WebSocket");
}

fn log_num_messages(num_sent: u64) {
    tracing::info!("sent {num_sent} messages to viewers");
}

fn request(view: &ViewArgs) -> anyhow::Result<ViewRequest> {
    let usage = |message: String| Usage(message);
    let text = view.view.as_deref().unwrap_or(super::DEFAULT_ADDRESS);
    let address = Address::parse(text).map_err(|error| usage(error.to_string()))?;
    let images = Images::from_name(&view.view_image)
        .ok_or_else(|| usage(format!("--view-image: one of {}", Images::NAMES.join(", "))))?;
    Ok(ViewRequest { address, images })
}
