//! Stand-ins in a build without the feature `calibrate`.

use std::io::Write;

use super::args::{AxisArgs, CameraArgs, PlaneArgs};
use crate::{cli::Outcome, ros::arguments::RosArguments};

pub(super) fn camera(
    _: &CameraArgs,
    ros: RosArguments,
    _: &mut dyn Write,
) -> anyhow::Result<Outcome> {
    without("camera", ros)
}

pub(super) fn plane(
    _: &PlaneArgs,
    ros: RosArguments,
    _: &mut dyn Write,
) -> anyhow::Result<Outcome> {
    without("plane", ros)
}

pub(super) fn axis(_: &AxisArgs, ros: RosArguments, _: &mut dyn Write) -> anyhow::Result<Outcome> {
    without("axis", ros)
}

fn without(what: &str, ros: RosArguments) -> anyhow::Result<Outcome> {
    drop(ros);
    anyhow::bail!(
        "this program was built without `calibrate {what}`: build it with \
         `cargo build --release --features calibrate`"
    )
}
