//! Pictures or a video: what a reader of recordings needs of either.

use std::collections::BTreeMap;
use std::ops::RangeInclusive;
use std::sync::Arc;

use super::messages::PictureMessages;
use super::sequence::PictureSequence;
use super::video::{Video, VideoMessages};
use crate::bag::{BagError, Filter, RawMessage, Topic};

/// A series of images outside a bag.
#[derive(Clone, Debug)]
pub(in crate::bag) enum Series {
    /// Picture files.
    Pictures(Arc<PictureSequence>),
    /// A video.
    Video(Arc<Video>),
}

impl Series {
    /// Topics, sorted by name.
    pub(in crate::bag) fn topics(&self) -> Vec<Arc<Topic>> {
        match self {
            Self::Pictures(pictures) => pictures.topics(),
            Self::Video(video) => vec![Arc::clone(video.images())],
        }
    }

    /// Number of messages by topic name.
    pub(in crate::bag) fn counts(&self) -> BTreeMap<&str, u64> {
        match self {
            Self::Pictures(pictures) => pictures.counts(),
            Self::Video(video) => [(video.images().name.as_str(), video.num_frames())].into(),
        }
    }

    /// Number of images.
    pub(in crate::bag) fn num_images(&self) -> u64 {
        match self {
            Self::Pictures(pictures) => pictures.num_pictures(),
            Self::Video(video) => video.num_frames(),
        }
    }

    /// Size of all files, bytes.
    pub(in crate::bag) fn num_bytes(&self) -> u64 {
        match self {
            Self::Pictures(pictures) => pictures.num_bytes(),
            Self::Video(video) => video.num_bytes(),
        }
    }

    /// True for the topic of the images.
    pub(in crate::bag) fn is_image(&self, topic: &Topic) -> bool {
        match self {
            Self::Pictures(pictures) => pictures.is_image(topic),
            Self::Video(video) => video.images().name == topic.name,
        }
    }

    /// Times of the first and last image, nanoseconds.
    pub(in crate::bag) fn time_range_ns(&self) -> Option<RangeInclusive<i64>> {
        match self {
            Self::Pictures(pictures) => pictures.time_range_ns(),
            Self::Video(video) => video.time_range_ns(),
        }
    }

    /// True if nothing states the time between two images.
    pub(in crate::bag) fn has_assumed_stamps(&self) -> bool {
        matches!(self, Self::Pictures(pictures) if pictures.has_assumed_stamps())
    }

    /// Returns an iterator over the messages.
    pub(in crate::bag) fn messages(&self, filter: Filter) -> SeriesMessages {
        match self {
            Self::Pictures(pictures) => {
                SeriesMessages::Pictures(PictureMessages::new(Arc::clone(pictures), filter))
            }
            Self::Video(video) => {
                SeriesMessages::Video(Box::new(VideoMessages::new(Arc::clone(video), filter)))
            }
        }
    }
}

/// Iterator over the messages of a series.
pub(in crate::bag) enum SeriesMessages {
    /// Of picture files.
    Pictures(PictureMessages),
    /// Of a video.
    Video(Box<VideoMessages>),
}

impl SeriesMessages {
    /// Takes back the buffer of a processed message.
    pub(in crate::bag) fn recycle(&mut self, buffer: Vec<u8>) {
        match self {
            Self::Pictures(pictures) => pictures.recycle(buffer),
            Self::Video(video) => video.recycle(buffer),
        }
    }
}

impl Iterator for SeriesMessages {
    type Item = Result<RawMessage, BagError>;

    fn next(&mut self) -> Option<Self::Item> {
        match self {
            Self::Pictures(pictures) => pictures.next(),
            Self::Video(video) => video.next(),
        }
    }
}
