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
            Address, Entrance, Images, TlsFiles, Token, ViewError, ViewRequest,
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
    let view = self::request(view)?;
    let shown = ReplayView::start(request, &view, at_end, stop.clone()).map_err(classified)?;
    announce(&view, shown.address());
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
    let view = self::request(view)?;
    let shown = LiveView::start(request, &view).map_err(view_error)?;
    // Before there is a node: the URL may hold a secret, which must not reach /rosout.
    announce(&view, shown.address());
    let node = LiveNode::start_through(request, rosout, &|transport| shown.through(transport));
    let node = node.map_err(classified)?;
    shown.set_parameters_of(node.parameters());
    let summaries = measure(node, stop).map_err(classified)?;
    log_num_messages(shown.num_sent());
    Ok(summaries)
}

fn announce(view: &ViewRequest, address: SocketAddr) {
    let url = view.entrance.url(address);
    tracing::info!("live view at {url}: in Foxglove, Open connection, Foxglove WebSocket");
}

fn log_num_messages(num_sent: u64) {
    tracing::info!("sent {num_sent} messages to viewers");
}

fn request(view: &ViewArgs) -> anyhow::Result<ViewRequest> {
    let entrance = entrance(view).map_err(|error| {
        if error.is_usage() { Usage(error.to_string()).into() } else { anyhow!(error) }
    })?;
    let images = Images::from_name(&view.view_image)
        .ok_or_else(|| Usage(format!("--view-image: one of {}", Images::NAMES.join(", "))))?;
    Ok(ViewRequest { entrance, images })
}

fn entrance(view: &ViewArgs) -> Result<Entrance, ViewError> {
    let address = Address::parse(view.view.as_deref().unwrap_or(super::DEFAULT_ADDRESS))?;
    let token = match view.view_token.as_deref() {
        None => None,
        Some("") => Some(Token::generate()?),
        Some(text) => Some(Token::new(text)?),
    };
    let tls = match (view.view_cert.clone(), view.view_key.clone()) {
        (None, None) => None,
        (Some(certificate), Some(key)) => Some(TlsFiles { certificate, key }),
        _ => return Err(ViewError::HalfCertificate),
    };
    Entrance::new(address, view.view_origin.clone(), token, tls)
}
