//! Computes the mean of a recording's frames. With the laser off, it is the scene without laser.

use std::path::Path;

use thiserror::Error;

use super::only_topic::{self, OnlyTopicError};
use crate::{
    bag::{BagError, Filter},
    msg::{
        cdr,
        convert::{
            compressed,
            frame::{self, FrameRejected},
        },
        sensor_msgs::{CompressedImage, Image},
    },
    ros::node_params::ImageTransport,
    scanner::{
        channel::{AnyPlane, Decoder, SearchedRegion},
        image,
        params::Channel,
    },
};

/// The reason that no mean can be computed.
#[derive(Debug, Error)]
pub(crate) enum AmbientCaptureError {
    /// The recording cannot be read.
    #[error(transparent)]
    Bag(#[from] BagError),
    /// The recording cannot be opened, or has no image topic, or several.
    #[error(transparent)]
    Topic(#[from] OnlyTopicError),
    /// An image message cannot be decoded.
    #[error("message {number}: {source}")]
    Message {
        /// Its number, from 0.
        number: usize,
        /// The decoding error.
        source: cdr::CdrError,
    },
    /// An image cannot be used.
    #[error("frame {number}: {source}")]
    Frame {
        /// Its number, from 0.
        number: usize,
        /// The reason.
        source: FrameRejected,
    },
    /// The frames differ in size or bit depth.
    #[error("frame {number} is {found}, but the first one is {expected}: all must be alike")]
    Mixed {
        /// Its number, from 0.
        number: usize,
        /// Size and depth.
        found: String,
        /// Size and depth of the first one.
        expected: String,
    },
    /// The recording contains no frames.
    #[error("the recording holds no frames")]
    NoFrames,
}

/// The mean of frames, one grey level per pixel.
#[derive(Debug, Default)]
pub(crate) struct Mean {
    /// Columns.
    pub(crate) width: usize,
    /// Rows.
    pub(crate) height: usize,
    /// Bits of a sample, 8 or 16.
    pub(crate) bits: u32,
    /// Number of frames.
    pub(crate) num_frames: u64,
    sums: Vec<u64>,
}

impl Mean {
    /// The grey levels in row-major order, rounded half up.
    pub(crate) fn levels(&self) -> impl Iterator<Item = u16> + '_ {
        let count = self.num_frames.max(1);
        self.sums.iter().map(move |sum| ((sum + count / 2) / count) as u16)
    }

    fn add(&mut self, number: usize, plane: &AnyPlane<'_>) -> Result<(), AmbientCaptureError> {
        let (width, height, bits) = match plane {
            AnyPlane::Eight(plane) => (plane.width(), plane.height(), 8),
            AnyPlane::Sixteen(plane) => (plane.width(), plane.height(), 16),
        };
        if self.num_frames == 0 {
            (self.width, self.height, self.bits) = (width, height, bits);
            self.sums.resize(width * height, 0);
        }
        let describe = |width, height, bits| format!("{width} x {height} pixels of {bits} bits");
        if (width, height, bits) != (self.width, self.height, self.bits) {
            let expected = describe(self.width, self.height, self.bits);
            return Err(AmbientCaptureError::Mixed {
                number,
                found: describe(width, height, bits),
                expected,
            });
        }
        for (y, sums) in self.sums.chunks_exact_mut(width).enumerate() {
            match plane {
                AnyPlane::Eight(plane) => add_row(sums, plane.row(y)),
                AnyPlane::Sixteen(plane) => add_row(sums, plane.row(y)),
            }
        }
        self.num_frames += 1;
        Ok(())
    }
}

fn add_row<S: Copy + Into<u64>>(sums: &mut [u64], row: &[S]) {
    for (sum, &sample) in sums.iter_mut().zip(row) {
        *sum += sample.into();
    }
}

/// Computes the mean of all images on the recording's only image topic.
///
/// # Errors
/// The recording cannot be read or does not have exactly one image topic, or an image cannot be used or differs from
/// the first one in size or depth.
pub(crate) fn mean(
    bag: &Path,
    channel: Channel,
    max_frame_bytes: u64,
    mut on_frame: impl FnMut(u64),
) -> Result<Mean, AmbientCaptureError> {
    let (reader, topic) = only_topic::open(bag, max_frame_bytes)?;
    let (mut mean, mut decoder, mut pixels) = (Mean::default(), Decoder::default(), Vec::new());
    for (number, message) in reader.messages(&Filter::topics([&topic.name[..]])).enumerate() {
        let data = message?.data;
        let no_message = |source| AmbientCaptureError::Message { number, source };
        let no_frame = |source| AmbientCaptureError::Frame { number, source };
        let image: image::Image<'_> = match topic.transport {
            ImageTransport::Raw => {
                let message: Image<'_> = cdr::decode(&data).map_err(no_message)?;
                frame::image(&message, max_frame_bytes).map_err(no_frame)?
            }
            ImageTransport::Compressed => {
                let message: CompressedImage<'_> = cdr::decode(&data).map_err(no_message)?;
                compressed::image(&message, max_frame_bytes, &mut pixels).map_err(no_frame)?
            }
        };
        mean.add(number, &decoder.decode(&image, channel, &SearchedRegion::whole(&image)))?;
        on_frame(mean.num_frames);
    }
    if mean.num_frames == 0 { Err(AmbientCaptureError::NoFrames) } else { Ok(mean) }
}
