//! The only image topic of a recording, for verbs that take no parameters of a node.

use std::path::Path;

use thiserror::Error;

use super::input::{self, ImageTopic, InputError};
use crate::{
    bag::{BagError, BagReader, ReadOptions, pictures},
    ros::names::{NameError, NodeNames},
};

/// The reason that there is no such topic.
#[derive(Debug, Error)]
pub(crate) enum OnlyTopicError {
    /// The recording cannot be read.
    #[error(transparent)]
    Bag(#[from] BagError),
    /// The recording has no image topic, or several.
    #[error(transparent)]
    Input(#[from] InputError),
    /// The node's name is invalid.
    #[error(transparent)]
    Name(#[from] NameError),
}

/// Opens a recording, pictures or a video with frames of up to `max_frame_bytes`, and finds its image topic.
///
/// # Errors
/// The recording cannot be read, or does not have exactly one image topic.
pub(super) fn open(
    recording: &Path,
    max_frame_bytes: u64,
) -> Result<(BagReader, ImageTopic), OnlyTopicError> {
    let reader = pictures::open(recording, &ReadOptions::for_frames(max_frame_bytes))?;
    let topics: Vec<_> =
        reader.topics().iter().map(|topic| (topic.name.clone(), topic.type_name.clone())).collect();
    let names = NodeNames::new("laser_profiler", &[])?;
    let topic = input::choose(&topics, &names, "", None)?;
    Ok((reader, topic))
}
