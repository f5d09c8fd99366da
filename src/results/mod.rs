//! Results of a recording: from the bag that `replay` or the node wrote to surfaces, parameters and calibration.
//!
//! - `Results`: the point clouds of one scan, profile by profile or as a [`Surface`](crate::metrology::surface::Surface)
//! - `ResultsRecording`: all topics of one camera; reports what is missing instead of failing
//! - `Provenance`: version, parameters and calibration that the bag carries
//! - `calibration_share`: the law that adds the calibration's uncertainty to that of a measurement
//! - `Results::check_surface`: the condition of every tool for areas
//! - `outline`, `pairs`, `reasons`: extent of a scan, two results frame by frame, why they differ

mod cloud;
mod selection;
mod notes;
mod provenance;
mod recording;
mod scan;
mod positions;
mod no_surface;
mod outline;
mod calibration_share;
mod outside;
mod figure;
mod pairs;
mod reasons;

pub(crate) use calibration_share::calibration_share;
pub(crate) use figure::Figure;
pub(crate) use notes::Notes;
pub(crate) use outline::{Outline, Placing, color_scale_m};
pub(crate) use outside::num_outside_calibration;
pub(crate) use pairs::{FramePair, for_each_pair};
pub(crate) use provenance::Provenance;
pub(crate) use reasons::{Reason, different_inputs, reasons};
pub(crate) use recording::ResultsRecording;
pub(crate) use recording::add_error;
pub(crate) use scan::{ANY_HEIGHT_M, ReadCounts, Results, Scanned};
pub(crate) use selection::{ScanSelection, SelectionError};

use crate::{
    bag::{RawMessage, ReadOptions},
    msg::{
        laser_profiler_msgs::Profile,
        recorded_profile::{self, ProfileError, StatedDefinition},
    },
};

/// Largest record of a results bag, bytes: a message can contain a slice of 2^26 points.
const RECORD_LIMIT_BYTES: usize = (1 << 30) + (16 << 20);

fn read_options() -> ReadOptions {
    ReadOptions { record_limit_bytes: RECORD_LIMIT_BYTES, ..ReadOptions::default() }
}

/// Reads a profile as the definition of its topic says, also from older versions.
///
/// # Errors
/// Another definition of profiles, by name; bytes that are no profile.
pub(crate) fn recorded_profile(message: &RawMessage) -> Result<Profile<'_>, ProfileError> {
    let topic = &message.topic;
    let is_text = topic.schema_encoding == "ros2msg";
    let text = std::str::from_utf8(&topic.schema).ok().filter(|_| is_text).unwrap_or_default();
    recorded_profile::decode(StatedDefinition { hash: &topic.type_hash, text }, &message.data)
}
