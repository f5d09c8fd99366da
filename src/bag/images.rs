//! Describes the images of a topic by its first message, and their rate by the stamps.

use serde::Serialize;

use crate::msg::{
    cdr::{self, CdrError},
    convert::{
        compressed::{self, Kind},
        frame,
    },
    schema::Message,
    sensor_msgs::{CompressedImage, Image},
};

use super::statistics::{Statistics, rate_hz};
use super::{BagReader, Filter, RawMessage, Topic};

/// The images of a topic. The field names are those of `info --json`.
#[derive(Debug, Serialize)]
pub(crate) struct ImageInfo {
    /// Encoding; of compressed images, the codec and the pixels, such as `jpeg rgb8`.
    pub(crate) encoding: String,
    /// Columns; `None` if unknown.
    pub(crate) width: Option<u32>,
    /// Rows; `None` if unknown.
    pub(crate) height: Option<u32>,
    /// Rate by the stamps of the first and the last image, hertz; `None` if they do not advance or are assumed.
    pub(crate) stamp_rate_hz: Option<f64>,
    /// The reason why the first image cannot be measured; `None` if it can.
    pub(crate) problem: Option<String>,
}

/// Describes the images of a topic; `None` if it has none, or none that can be decoded.
pub(super) fn describe(
    bag: &BagReader,
    topic: &Topic,
    statistics: &Statistics,
) -> Option<ImageInfo> {
    let describe = describer(topic)?;
    let filter = Filter::topics([topic.name.as_str()]);
    let of_topic = |message: &RawMessage| *message.topic == *topic;
    let mut messages = bag.messages(&filter).flatten().filter(of_topic);
    let (first_ns, info) = messages.find_map(|message| describe(&message).ok())?;
    drop(messages);
    let (_, last_ns) = statistics.bounds_ns?;
    let late = bag.messages(&filter.from(last_ns)).flatten().filter(of_topic);
    let last_ns = late.filter_map(|message| describe(&message).ok()).last()?.0;
    Some(ImageInfo { stamp_rate_hz: rate_hz(statistics.count, first_ns, last_ns), ..info })
}

/// Returns the stamp of an image, nanoseconds since the epoch, and its description.
type Describe = fn(&RawMessage) -> Result<(i64, ImageInfo), CdrError>;

fn describer(topic: &Topic) -> Option<Describe> {
    topic.require_cdr().ok()?;
    if topic.type_name == Image::TYPE.name {
        Some(raw)
    } else if topic.type_name == CompressedImage::TYPE.name {
        Some(packed)
    } else {
        None
    }
}

fn raw(message: &RawMessage) -> Result<(i64, ImageInfo), CdrError> {
    let message: Image<'_> = cdr::decode(&message.data)?;
    let problem = frame::image(&message, u64::MAX).err();
    let info = ImageInfo {
        encoding: message.encoding.clone().into_owned(),
        width: Some(message.width),
        height: Some(message.height),
        stamp_rate_hz: None,
        problem: problem.map(|problem| problem.to_string()),
    };
    Ok((message.header.stamp.to_ns(), info))
}

fn packed(message: &RawMessage) -> Result<(i64, ImageInfo), CdrError> {
    let message: CompressedImage<'_> = cdr::decode(&message.data)?;
    let stamp_ns = message.header.stamp.to_ns();
    let info = match compressed::kind(&message) {
        Ok(Kind { width, height, encoding }) => ImageInfo {
            encoding,
            width: Some(width),
            height: Some(height),
            stamp_rate_hz: None,
            problem: None,
        },
        Err(problem) => ImageInfo {
            encoding: message.format.into_owned(),
            width: None,
            height: None,
            stamp_rate_hz: None,
            problem: Some(problem.to_string()),
        },
    };
    Ok((stamp_ns, info))
}
