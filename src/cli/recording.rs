//! Frames of a recording, read as `replay` reads them.

use std::path::Path;

use anyhow::{Context, anyhow};

use super::settings::{Settings, usage};
use crate::{
    bag::{BagReader, Filter, RawMessage, ReadOptions, pictures},
    msg::{
        cdr,
        convert::{compressed, frame},
        sensor_msgs,
    },
    node::input::{self, ImageTopic},
    ros::{camera_params::CameraParams, node_params::ImageTransport},
    scanner::image::{Frame, Image},
};

/// Topic with the exact centre of the stripe in every image of a simulated recording.
pub(super) const TRUTH_TOPIC: &str = "/truth/centerline";

/// An open recording and the camera whose images are read.
pub(super) struct Recording {
    pub(super) bag: BagReader,
    pub(super) camera: CameraParams,
    pub(super) topic: ImageTopic,
}

/// Counts of reading a recording.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct Read {
    /// Frames measured.
    pub(super) frames: u64,
    /// Frames that could not be read or measured, and damaged ranges.
    pub(super) rejected: u64,
}

impl Recording {
    /// Opens a recording and chooses its image topic.
    ///
    /// # Errors
    /// No recording or no images; [`Usage`](crate::cli::Usage) if several topics match.
    pub(super) fn open(path: &Path, settings: &Settings) -> anyhow::Result<Self> {
        let largest = settings.cameras.iter().map(|camera| camera.max_frame_bytes).max();
        let options = ReadOptions::for_frames(largest.unwrap_or(0));
        let bags = [pictures::open(path, &options)?];
        let camera = settings.camera(&bags)?;
        let [bag] = bags;
        bag.notes().iter().for_each(|note| tracing::warn!("{note}"));
        let mut topics: Vec<_> = bag
            .topics()
            .iter()
            .map(|topic| (topic.name.clone(), topic.type_name.clone()))
            .collect();
        // A topic may appear twice, with different QoS.
        topics.dedup();
        let topic =
            input::choose(&topics, &settings.names, &camera.name, camera.chosen_transport())
                .map_err(|error| {
                    let text = format!("{}: {error}", path.display());
                    if error.is_usage() { usage(text) } else { anyhow!(text) }
                })?;
        for found in bag.topics().iter().filter(|found| found.name == topic.name) {
            found.require_cdr()?;
        }
        Ok(Self { bag, camera, topic })
    }

    /// Number of images; `None` if the recording has no index.
    pub(super) fn num_images(&self) -> Option<u64> {
        self.bag.message_counts()?.get(self.topic.name.as_str()).copied()
    }

    /// Calls `take` with the messages of the image topic and of `other`, in the order of time, until it returns
    /// [`Wanted::Nothing`].
    ///
    /// Counts and skips a frame that cannot be decoded or that `take` rejects, as in a replay.
    pub(super) fn read(
        &self,
        other: Option<&str>,
        mut take: impl FnMut(Message<'_>) -> anyhow::Result<Wanted>,
    ) -> Read {
        let filter = Filter::topics([self.topic.name.as_str()].into_iter().chain(other));
        let mut read = Read::default();
        let mut pixels = Vec::new();
        for message in self.bag.messages(&filter) {
            let taken = message.map_err(anyhow::Error::from).and_then(|message| {
                if message.topic.name != self.topic.name {
                    return take(Message::Other(&message));
                }
                let taken = take(Message::Frame(&self.decode(&message, &mut pixels)?))?;
                read.frames += 1;
                Ok(taken)
            });
            match taken {
                Ok(Wanted::More) => {}
                Ok(Wanted::Nothing) => break,
                Err(error) => {
                    read.rejected += 1;
                    // One warning is enough; the summary counts the rest.
                    if read.rejected == 1 {
                        tracing::warn!("frame skipped: {error:#}; further ones are only counted");
                    } else {
                        tracing::debug!("frame skipped: {error:#}");
                    }
                }
            }
        }
        read
    }

    fn decode<'a>(
        &self,
        message: &'a RawMessage,
        pixels: &'a mut Vec<u8>,
    ) -> anyhow::Result<Frame<'a>> {
        let limit = self.camera.max_frame_bytes;
        let at = || format!("frame at log time {} ns", message.log_time_ns);
        let (stamp, image): (_, Image<'a>) = match self.topic.transport {
            ImageTransport::Raw => {
                let message: sensor_msgs::Image<'a> =
                    cdr::decode(&message.data).with_context(at)?;
                (message.header.stamp, frame::image(&message, limit).with_context(at)?)
            }
            ImageTransport::Compressed => {
                let message: sensor_msgs::CompressedImage<'a> =
                    cdr::decode(&message.data).with_context(at)?;
                (message.header.stamp, compressed::image(&message, limit, pixels).with_context(at)?)
            }
        };
        Ok(Frame { stamp_ns: stamp.to_ns(), image })
    }
}

/// A message of a recording.
pub(super) enum Message<'a> {
    /// A decoded image.
    Frame(&'a Frame<'a>),
    /// A message of the other topic.
    Other(&'a RawMessage),
}

/// Decision of the caller after a message.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Wanted {
    /// Continue.
    More,
    /// Stop reading.
    Nothing,
}
