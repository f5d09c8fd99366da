//! Some frames of a recording, spread over it.

use std::path::Path;

use super::{ambient::AmbientCaptureError, only_topic};
use crate::{
    bag::Filter,
    msg::{
        cdr,
        convert::{compressed, frame},
        sensor_msgs::{CompressedImage, Image},
    },
    ros::node_params::ImageTransport,
    scanner::image::{self, OwnedImage},
};

/// Frames of a recording.
pub(crate) struct Sampled {
    /// Topic of the images.
    pub(crate) topic: String,
    /// Number of frames in the recording.
    pub(crate) num_frames: usize,
    /// Some of them, in the order of the recording, all of the size and format of the first.
    pub(crate) pictures: Vec<OwnedImage>,
    /// Frames of another size or format, or that cannot be read or decoded, among those looked at.
    pub(crate) num_unusable: usize,
}

/// Reads up to `count` frames of the recording's only image topic, spread over it.
///
/// # Errors
/// The recording cannot be opened, does not have exactly one image topic, or has no usable frame.
pub(crate) fn frames(
    bag: &Path,
    count: usize,
    max_frame_bytes: u64,
) -> Result<Sampled, AmbientCaptureError> {
    let (reader, topic) = only_topic::open(bag, max_frame_bytes)?;
    let filter = || Filter::topics([&topic.name[..]]);
    let num_frames = reader.messages(&filter()).count();
    let mut sampled =
        Sampled { topic: topic.name.clone(), num_frames, pictures: Vec::new(), num_unusable: 0 };
    let count = count.clamp(1, num_frames.max(1));
    let mut wanted = (0..count).map(|i| (2 * i + 1) * num_frames / (2 * count)).peekable();
    let mut pixels = Vec::new();
    for (number, message) in reader.messages(&filter()).enumerate() {
        if wanted.next_if_eq(&number).is_none() {
            continue;
        }
        let decoded = message.ok().and_then(|message| {
            decode(&message.data, topic.transport, max_frame_bytes, &mut pixels)
        });
        match decoded {
            Some(picture)
                if sampled.pictures.first().is_none_or(|first| alike(first, &picture)) =>
            {
                sampled.pictures.push(picture);
            }
            _ => sampled.num_unusable += 1,
        }
    }
    if sampled.pictures.is_empty() { Err(AmbientCaptureError::NoFrames) } else { Ok(sampled) }
}

fn alike(first: &OwnedImage, other: &OwnedImage) -> bool {
    let (first, other) = (first.view(), other.view());
    let size = |view: &image::Image<'_>| (view.width(), view.height(), view.format());
    size(&first) == size(&other)
}

fn decode(
    data: &[u8],
    transport: ImageTransport,
    max_frame_bytes: u64,
    pixels: &mut Vec<u8>,
) -> Option<OwnedImage> {
    Some(match transport {
        ImageTransport::Raw => {
            let message: Image<'_> = cdr::decode(data).ok()?;
            OwnedImage::from(&frame::image(&message, max_frame_bytes).ok()?)
        }
        ImageTransport::Compressed => {
            let message: CompressedImage<'_> = cdr::decode(data).ok()?;
            OwnedImage::from(&compressed::image(&message, max_frame_bytes, pixels).ok()?)
        }
    })
}
