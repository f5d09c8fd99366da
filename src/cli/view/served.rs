//! The view of a recording, from the command line.

use std::{net::SocketAddr, time::Duration};

use anyhow::anyhow;

use super::{ReplayViewArgs, ViewArgs};
use crate::{
    cli::{Outcome, Usage, run::told_apart},
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

/// How often a view that stays looks whether it is to end.
const WATCH_PERIOD: Duration = Duration::from_millis(100);

/// Shows a recording until `stop` is raised, or with `at_end` to its end; `write` writes the results meanwhile, where
/// that is wanted.
///
/// # Errors
/// [`Usage`] when the request cannot be followed, else whatever cannot be read, served or written.
pub(in crate::cli) fn replay(
    ReplayViewArgs { view, view_exit }: &ReplayViewArgs,
    request: ReplayRequest,
    stop: &Stop,
    write: &mut dyn FnMut() -> anyhow::Result<Outcome>,
) -> anyhow::Result<Outcome> {
    let told = |error: ReplayViewError| {
        if error.is_usage() { Usage(error.to_string()).into() } else { anyhow!(error) }
    };
    let at_end = if *view_exit { AtEnd::Exit } else { AtEnd::Stay };
    let shown = ReplayView::start(request, self::request(view)?, at_end, stop.clone());
    let shown = shown.map_err(told)?;
    announce(shown.address());
    let written = write();
    while written.is_ok() && !shown.is_finished() && !stop.wait(WATCH_PERIOD) {}
    stop.raise();
    tell_messages(shown.join().map_err(told)?);
    written
}

/// Runs a node that viewers look at, until `stop` is raised.
///
/// # Errors
/// [`Usage`] when the request cannot be followed, else whatever the middleware, a file or the machine refuses.
pub(in crate::cli) fn live(
    view: &ViewArgs,
    request: &LiveRequest,
    rosout: RosoutSlot,
    stop: &Stop,
) -> anyhow::Result<Vec<CameraSummary>> {
    let told = |error: LiveViewError| {
        if error.is_usage() { Usage(error.to_string()).into() } else { anyhow!(error) }
    };
    let shown = LiveView::start(request, self::request(view)?).map_err(told)?;
    announce(shown.address());
    let variable = |name: &str| std::env::var(name).ok();
    let node =
        LiveNode::start_through(request, rosout, &variable, &|transport| shown.through(transport));
    let node = node.map_err(told_apart)?;
    shown.set_parameters_of(node.parameters());
    let summaries = node.run(stop);
    tell_messages(shown.num_sent());
    Ok(summaries)
}

fn announce(address: SocketAddr) {
    tracing::info!(
        "the view is at ws://{address}: in Foxglove, Open connection, Foxglove WebSocket"
    );
}

fn tell_messages(num_sent: u64) {
    tracing::info!("the view gave viewers {num_sent} messages");
}

fn request(view: &ViewArgs) -> anyhow::Result<ViewRequest> {
    let usage = |message: String| Usage(message);
    let text = view.view.as_deref().unwrap_or(super::DEFAULT_ADDRESS);
    let address = Address::parse(text).map_err(|error| usage(error.to_string()))?;
    let images = Images::from_name(&view.view_image)
        .ok_or_else(|| usage(format!("--view-image: one of {}", Images::NAMES.join(", "))))?;
    Ok(ViewRequest { address, images })
}
