//! Describes the contents of a bag, for users and scripts.

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};
use std::sync::Arc;

use mcap::records::op;
use serde::Serialize;
use sha2::{Digest, Sha256};

use super::damaged::DamagedRange;
use super::error::Fault;
use super::format::{PREFIX_BYTES, Source, u64_at};
use super::images::{self, ImageInfo};
use super::layout::{Layout, PartKind};
use super::pictures::ASSUMED_RATE_HZ;
use super::record::OWN_RECORD;
use super::statistics::Statistics;
use super::unpack::size_bytes;
use super::{BagError, BagReader, Filter, Topic};

/// Part of a bag that is read to describe it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Depth {
    /// The index, or all messages if the index is unusable.
    Index,
    /// All messages.
    Messages,
}

/// Report of `info`. The field names are those of `info --json`.
#[derive(Debug, Serialize)]
pub(crate) struct BagInfo {
    /// The bag.
    pub(crate) path: PathBuf,
    /// Its files in their order.
    pub(crate) files: Vec<FileInfo>,
    /// Size of all files, pictures included, bytes.
    pub(crate) bytes: u64,
    /// Time of the first message, nanoseconds since the epoch.
    pub(crate) start_ns: Option<i64>,
    /// Time of the last message, nanoseconds since the epoch.
    pub(crate) end_ns: Option<i64>,
    /// Time from the first to the last message, seconds.
    pub(crate) duration_s: f64,
    /// True if the images are, or were, pictures without stamps: then all times are those of an assumed rate.
    pub(crate) stamps_assumed: bool,
    /// Number of messages.
    pub(crate) messages: u64,
    /// Topics by name.
    pub(crate) topics: Vec<TopicInfo>,
    /// Attachments of the recording.
    pub(crate) attachments: Vec<AttachmentInfo>,
    /// Metadata records by name, without rosbag2's own.
    pub(crate) metadata: BTreeMap<String, BTreeMap<String, String>>,
    /// True if all messages were read and their checksums verified; false if the index was trusted.
    pub(crate) verified: bool,
    /// Damaged ranges. Without verification, damage inside chunks stays unnoticed.
    pub(crate) damaged: Vec<DamagedRange>,
    /// Further notes for the user.
    pub(crate) notes: Vec<String>,
}

/// One file of a bag.
#[derive(Debug, Serialize)]
pub(crate) struct FileInfo {
    /// Path of the file.
    pub(crate) path: PathBuf,
    /// Size of the file, bytes.
    pub(crate) bytes: u64,
    /// True if the file has a valid index.
    pub(crate) indexed: bool,
    /// Compressions of the chunks, `none`, `lz4`, `zstd`; beyond that `zstd messages` and `zstd file`.
    pub(crate) compression: Vec<String>,
}

/// One topic.
#[derive(Debug, Serialize)]
pub(crate) struct TopicInfo {
    /// Name of the topic.
    pub(crate) name: String,
    /// Type, for example `sensor_msgs/msg/Image`.
    #[serde(rename = "type")]
    pub(crate) type_name: String,
    /// Encoding of the messages; `cdr` in ROS 2.
    pub(crate) encoding: String,
    /// Type hash (`RIHS01_…`), or empty.
    pub(crate) type_hash: String,
    /// Number of messages.
    pub(crate) messages: u64,
    /// Message rate, hertz; `None` for fewer than two messages and for assumed stamps, as are the gap and its time.
    pub(crate) rate_hz: Option<f64>,
    /// Longest time between two consecutive messages, seconds.
    pub(crate) largest_gap_s: Option<f64>,
    /// Time of the message before the longest gap, nanoseconds since the epoch.
    pub(crate) largest_gap_at_ns: Option<i64>,
    /// Sequence numbers that the writer skipped; `None` unless verified.
    pub(crate) skipped: Option<u64>,
    /// Size of all messages, bytes; `None` unless verified.
    pub(crate) bytes: Option<u64>,
    /// The images; `None` if the topic has none that can be decoded.
    pub(crate) image: Option<ImageInfo>,
}

impl TopicInfo {
    /// Removes what follows from the times of the messages.
    fn forget_times(&mut self) {
        (self.rate_hz, self.largest_gap_s, self.largest_gap_at_ns) = (None, None, None);
        if let Some(image) = &mut self.image {
            image.stamp_rate_hz = None;
        }
    }
}

/// An attachment of the recording.
#[derive(Debug, Serialize)]
pub(crate) struct AttachmentInfo {
    /// File name.
    pub(crate) name: String,
    /// MIME type.
    pub(crate) media_type: String,
    /// Size, bytes.
    pub(crate) bytes: u64,
    /// SHA-256 of the content, hexadecimal.
    pub(crate) sha256: String,
}

/// Describes a bag.
///
/// # Errors
/// Reading fails; damage is no error, the report lists it.
pub(crate) fn describe(path: &Path, bag: &BagReader, depth: Depth) -> Result<BagInfo, BagError> {
    let mut problems = Problems { notes: bag.notes().to_vec(), ..Problems::default() };
    let has_index = depth == Depth::Index && !bag.is_pictures();
    let by_index = if has_index { by_index(bag)? } else { None };
    let read = if by_index.is_some() { Depth::Index } else { Depth::Messages };
    let statistics = match by_index {
        Some(statistics) => statistics,
        None => by_reading(bag, &mut problems)?,
    };
    let bounds = statistics.values().filter_map(|topic| topic.bounds_ns);
    let bounds_ns = bounds.reduce(|(first, last), (start, end)| (first.min(start), last.max(end)));
    let mut topics: Vec<_> =
        bag.topics().iter().map(|topic| topic_info(bag, topic, &statistics, read)).collect();
    let stamps_assumed = bag.has_assumed_stamps();
    if stamps_assumed {
        topics.iter_mut().for_each(TopicInfo::forget_times);
        problems.notes.push(format!(
            "{}: the pictures have no stamps, so their times are those of an assumed rate of {ASSUMED_RATE_HZ} Hz; \
             --frame-rate of `replay` and `import` states the rate",
            path.display()
        ));
    }
    let files: Vec<_> = bag.layouts().map(|(path, layout)| file_info(path, layout)).collect();
    let attachments = attachments(bag, &mut problems)?;
    let metadata = metadata(bag, &mut problems)?;
    Ok(BagInfo {
        path: path.into(),
        bytes: files.iter().map(|file| file.bytes).sum::<u64>() + bag.series_bytes(),
        files,
        start_ns: bounds_ns.map(|(first, _)| first),
        end_ns: bounds_ns.map(|(_, last)| last),
        duration_s: bounds_ns.map_or(0.0, |(first, last)| seconds(last.saturating_sub(first))),
        stamps_assumed,
        messages: statistics.values().map(|topic| topic.count).sum(),
        topics,
        attachments,
        metadata,
        verified: read == Depth::Messages,
        damaged: problems.damaged,
        notes: problems.notes,
    })
}

/// Problems met while reading.
#[derive(Default)]
struct Problems {
    damaged: Vec<DamagedRange>,
    notes: Vec<String>,
}

impl Problems {
    fn add(&mut self, error: BagError) -> Result<(), BagError> {
        match DamagedRange::of(&error) {
            Some(range) => self.damaged.push(range),
            None if error.is_loss() => return Err(error),
            None => self.notes.push(error.to_string()),
        }
        Ok(())
    }
}

type ByTopic = BTreeMap<Arc<Topic>, Statistics>;

fn by_reading(bag: &BagReader, problems: &mut Problems) -> Result<ByTopic, BagError> {
    let mut statistics = ByTopic::new();
    let mut messages = bag.messages(&Filter::all());
    while let Some(item) = messages.next() {
        match item {
            Ok(message) => {
                let topic = statistics.entry(Arc::clone(&message.topic)).or_default();
                topic.add_message(message.log_time_ns, message.sequence, message.data.len());
                messages.recycle(message.data);
            }
            Err(error) => problems.add(error)?,
        }
    }
    Ok(statistics)
}

/// Statistics from the message indexes, without opening a chunk; `None` if they are unusable.
fn by_index(bag: &BagReader) -> Result<Option<ByTopic>, BagError> {
    let mut statistics = ByTopic::new();
    for (path, layout) in bag.layouts() {
        if layout.lost.is_some() {
            return Ok(None);
        }
        let mut source = bag.open_file(path)?;
        let mut counts = BTreeMap::<u16, u64>::new();
        for part in &layout.parts {
            if !layout.is_indexed || !matches!(part.kind, PartKind::Chunk) {
                return Ok(None);
            }
            for &(channel, offset) in &part.message_indexes {
                let Some(times) = message_index(&mut source, channel, offset)? else {
                    return Ok(None);
                };
                let Some(topic) = layout.channels.get(channel) else { return Ok(None) };
                *counts.entry(channel).or_default() += times.len() as u64;
                let topic = statistics.entry(Arc::clone(topic)).or_default();
                for time_ns in times {
                    topic.add_time(time_ns);
                }
            }
        }
        let stated =
            layout.counts.clone().unwrap_or_default().into_iter().filter(|(_, count)| *count > 0);
        if counts != stated.collect() {
            return Ok(None);
        }
    }
    Ok(Some(statistics))
}

/// Sorted times of a message index record; `None` if there is no such record.
fn message_index(
    source: &mut Source,
    channel: u16,
    offset: u64,
) -> Result<Option<Vec<i64>>, BagError> {
    let span = match source.record_at(offset) {
        Ok(Some(span)) => span,
        Err(Fault::Io(error)) => return Err(error),
        Ok(None) | Err(Fault::Malformed(_)) => return Ok(None),
    };
    if span.opcode != op::MESSAGE_INDEX
        || source.check_length(&span, span.end - span.offset - PREFIX_BYTES).is_err()
    {
        return Ok(None);
    }
    let body = source.body(&span)?;
    let Some((head, entries)) = body.split_at_checked(6) else { return Ok(None) };
    if head[..2] != channel.to_le_bytes() || entries.len() % 16 != 0 {
        return Ok(None);
    }
    // A time beyond 2262 makes the index unusable and is reported when the messages are read.
    let times = entries.chunks_exact(16).map(|entry| i64::try_from(u64_at(entry, 0)).ok());
    let mut times: Option<Vec<_>> = times.collect();
    if let Some(times) = &mut times {
        times.sort_unstable();
    }
    Ok(times)
}

fn topic_info(bag: &BagReader, topic: &Topic, statistics: &ByTopic, read: Depth) -> TopicInfo {
    let found = statistics.get(topic).copied().unwrap_or_default();
    TopicInfo {
        name: topic.name.clone(),
        type_name: topic.type_name.clone(),
        encoding: topic.message_encoding.clone(),
        type_hash: topic.type_hash.clone(),
        messages: found.count,
        rate_hz: found.rate_hz(),
        largest_gap_s: found.largest_gap_ns.map(|(gap_ns, _)| seconds(gap_ns)),
        largest_gap_at_ns: found.largest_gap_ns.map(|(_, at_ns)| at_ns),
        skipped: (read == Depth::Messages).then_some(found.num_skipped),
        bytes: (read == Depth::Messages).then_some(found.bytes),
        image: images::describe(bag, topic, &found),
    }
}

fn file_info(path: &Path, layout: &Layout) -> FileInfo {
    let bytes = size_bytes(path);
    let name = |compression: &String| {
        if compression.is_empty() { "none".into() } else { compression.clone() }
    };
    let mut compression: Vec<_> = layout.compressions.iter().map(name).collect();
    compression.extend(layout.has_packed_messages.then(|| "zstd messages".into()));
    compression.extend(layout.is_packed.then(|| "zstd file".into()));
    FileInfo { path: path.into(), bytes, indexed: layout.is_indexed, compression }
}

fn attachments(bag: &BagReader, problems: &mut Problems) -> Result<Vec<AttachmentInfo>, BagError> {
    let (mut infos, mut seen) = (Vec::new(), BTreeSet::new());
    for attachment in bag.attachments() {
        match attachment {
            Ok(attachment) => {
                let info = AttachmentInfo {
                    sha256: hexadecimal(&Sha256::digest(&attachment.data)),
                    bytes: attachment.data.len() as u64,
                    name: attachment.name,
                    media_type: attachment.media_type,
                };
                // The files of a split bag repeat it.
                if seen.insert((info.name.clone(), info.sha256.clone())) {
                    infos.push(info);
                }
            }
            Err(error) => problems.add(error)?,
        }
    }
    Ok(infos)
}

fn metadata(
    bag: &BagReader,
    problems: &mut Problems,
) -> Result<BTreeMap<String, BTreeMap<String, String>>, BagError> {
    let mut records = BTreeMap::new();
    for record in bag.metadata() {
        match record {
            Ok(record) if record.name == OWN_RECORD => {}
            Ok(record) => drop(records.insert(record.name, record.entries)),
            Err(error) => problems.add(error)?,
        }
    }
    Ok(records)
}

fn seconds(time_ns: i64) -> f64 {
    time_ns as f64 / 1e9
}

fn hexadecimal(bytes: &[u8]) -> String {
    let digits = bytes.iter().flat_map(|byte| [byte >> 4, byte & 15]);
    digits.filter_map(|digit| char::from_digit(digit.into(), 16)).collect()
}
