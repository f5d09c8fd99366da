//! Iterator over pictures as messages.

use std::sync::Arc;

use super::sequence::{Entry, PictureSequence, load};
use crate::bag::{BagError, Filter, RawMessage, Topic};
use crate::msg::builtin_interfaces::Time;
use crate::msg::cdr::{self, CdrError};
use crate::msg::convert::picture_message;
use crate::msg::schema::Message;
use crate::msg::sensor_msgs::{Image, JointState};
use crate::msg::std_msgs::Header;

/// Name of the axis whose positions are stated.
const JOINT: &str = "axis";
/// Maximum number of recycled buffers.
const SPARE_BUFFERS: usize = 8;

/// The messages of a series: for each picture its position, if stated, and its image. An error takes the place of a
/// picture that cannot be used.
pub(in crate::bag) struct PictureMessages {
    sequence: Arc<PictureSequence>,
    filter: Filter,
    /// Index of the next picture.
    next: usize,
    /// True if the position of the next picture was returned.
    has_position_passed: bool,
    file: Vec<u8>,
    pixels: Vec<u8>,
    spare: Vec<Vec<u8>>,
}

impl PictureMessages {
    pub(in crate::bag) fn new(sequence: Arc<PictureSequence>, filter: Filter) -> Self {
        Self {
            sequence,
            filter,
            next: 0,
            has_position_passed: false,
            file: Vec::new(),
            pixels: Vec::new(),
            spare: Vec::new(),
        }
    }

    /// Takes back the buffer of a processed message.
    pub(in crate::bag) fn recycle(&mut self, buffer: Vec<u8>) {
        if self.spare.len() < SPARE_BUFFERS {
            self.spare.push(buffer);
        }
    }

    /// Returns the next message; `None` at the end.
    pub(in crate::bag) fn next(&mut self) -> Option<Result<RawMessage, BagError>> {
        let sequence = Arc::clone(&self.sequence);
        loop {
            let entry = sequence.entries.get(self.next)?;
            let is_wanted = entry.stamp_ns >= self.filter.start_time() as i64;
            if !std::mem::replace(&mut self.has_position_passed, true)
                && is_wanted
                && let (Some(topic), Some(position)) = (&sequence.joints, entry.position)
                && self.filter.takes(&topic.name)
            {
                return Some(self.position(entry, topic, position));
            }
            self.next += 1;
            self.has_position_passed = false;
            if is_wanted && self.filter.takes(&sequence.images.name) {
                return Some(self.image(entry));
            }
        }
    }

    fn position(
        &mut self,
        entry: &Entry,
        topic: &Arc<Topic>,
        position: f64,
    ) -> Result<RawMessage, BagError> {
        let state = JointState {
            header: header(entry),
            name: vec![JOINT.to_owned()],
            position: vec![position],
            ..JointState::default()
        };
        let mut data = self.spare.pop().unwrap_or_default();
        cdr::encode(&state, &mut data).map_err(|error| unusable(entry, error.to_string()))?;
        Ok(message(entry, topic, data))
    }

    fn image(&mut self, entry: &Entry) -> Result<RawMessage, BagError> {
        let mut data = self.spare.pop().unwrap_or_default();
        match self.encode(entry, &mut data) {
            Ok(()) => Ok(message(entry, &self.sequence.images, data)),
            Err(why) => {
                self.recycle(data);
                Err(unusable(entry, why))
            }
        }
    }

    /// Reads a picture and encodes its message.
    fn encode(&mut self, entry: &Entry, data: &mut Vec<u8>) -> Result<(), String> {
        let sequence = Arc::clone(&self.sequence);
        let limit_bytes = sequence.limit_bytes;
        let (kind, size_px) = load(entry, limit_bytes, &mut self.file)?;
        if size_px != sequence.size_px {
            let ([width, height], [columns, rows]) = (size_px, sequence.size_px);
            return Err(format!(
                "has {width} x {height} pixels, but the first picture of the series has {columns} x {rows}"
            ));
        }
        let message = picture_message::compressed(header(entry), kind, &self.file);
        let in_words = |error: CdrError| error.to_string();
        if sequence.images.type_name != Image::TYPE.name {
            return cdr::encode(&message, data).map_err(in_words);
        }
        let image = picture_message::raw(message, limit_bytes, &mut self.pixels)
            .map_err(|error| error.to_string())?;
        cdr::encode(&image, data).map_err(in_words)
    }
}

fn header(entry: &Entry) -> Header<'static> {
    Header { stamp: Time::from_ns(entry.stamp_ns), frame_id: super::FRAME_ID.into() }
}

fn message(entry: &Entry, topic: &Arc<Topic>, data: Vec<u8>) -> RawMessage {
    let &Entry { stamp_ns, sequence, .. } = entry;
    let topic = Arc::clone(topic);
    let name = entry.path.file_name().unwrap_or(entry.path.as_os_str());
    let file = Some(Arc::from(name.to_string_lossy()));
    RawMessage { topic, log_time_ns: stamp_ns, publish_time_ns: stamp_ns, sequence, data, file }
}

fn unusable(entry: &Entry, why: String) -> BagError {
    BagError::Picture { path: entry.path.clone(), why }
}
