//! Live view in a build without the feature `foxglove`: always an error.

use super::{ReplayViewArgs, ViewArgs};
use crate::{
    cli::{Outcome, Usage},
    node::{
        live::{LiveRequest, session::CameraSummary},
        replay::ReplayRequest,
        rosout::RosoutSlot,
        stop::Stop,
    },
};

/// # Errors
/// [`Usage`], which states how to build the live view.
pub(in crate::cli) fn replay(
    _view: &ReplayViewArgs,
    _request: ReplayRequest,
    _stop: &Stop,
    _write: &mut dyn FnMut() -> anyhow::Result<Outcome>,
) -> anyhow::Result<Outcome> {
    Err(refusal())
}

/// # Errors
/// [`Usage`], which states how to build the live view.
pub(in crate::cli) fn live(
    _view: &ViewArgs,
    _request: &LiveRequest,
    _rosout: RosoutSlot,
    _stop: &Stop,
) -> anyhow::Result<Vec<CameraSummary>> {
    Err(refusal())
}

fn refusal() -> anyhow::Error {
    let message = "--view: this program was built without the live view: build it with \
                   cargo build --release --features foxglove";
    Usage(message.to_owned()).into()
}
