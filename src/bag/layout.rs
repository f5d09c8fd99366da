//! Positions of the messages, attachments and metadata in a file, from its index or from a scan of the file.

use std::collections::BTreeMap;

use super::channels::Channels;
use super::error::Fault;
use super::format::{RecordSpan, Source};
use super::metadata::BagInformation;
use super::record::OWN_RECORD;
use super::summary::Summary;
use super::{BagError, ReadOptions, content, scan, summary};

/// Layout of one file.
#[derive(Clone, Debug, Default)]
pub(super) struct Layout {
    pub(super) channels: Channels,
    /// Parts in order of time, ties in order of position.
    pub(super) parts: Vec<Part>,
    pub(super) attachments: Vec<RecordSpan>,
    pub(super) metadata: Vec<RecordSpan>,
    /// Number of messages per channel; `None` if unknown.
    pub(super) counts: Option<BTreeMap<u16, u64>>,
    /// Number of messages per channel as stated by the file; `None` if it states none.
    pub(super) stated_counts: Option<BTreeMap<u16, u64>>,
    /// True if the layout comes from the file's index; false if it comes from a scan.
    pub(super) is_indexed: bool,
    /// Names of the compressions of the chunks, sorted.
    pub(super) compressions: Vec<String>,
    /// Profile in the header; `ros2` in ROS 2.
    pub(super) profile: String,
    /// Notes for the user.
    pub(super) notes: Vec<String>,
    /// Size of the records of types that are not of MCAP, bytes; 0 if the index was used.
    pub(super) unknown_bytes: u64,
    /// True if the file is compressed as a whole.
    pub(super) is_packed: bool,
    /// True if the messages are compressed one by one.
    pub(super) has_packed_messages: bool,
    /// The reason why the file is not read; `None` if it is.
    pub(super) lost: Option<String>,
}

/// A range of the file that holds messages, or is damaged.
#[derive(Clone, Debug)]
pub(super) struct Part {
    pub(super) kind: PartKind,
    /// Start, bytes from the start of the file.
    pub(super) offset: u64,
    /// End, bytes from the start of the file.
    pub(super) end: u64,
    /// Time of the earliest message, nanoseconds since the epoch.
    pub(super) start_time: u64,
    /// Time of the latest message, nanoseconds since the epoch.
    pub(super) end_time: u64,
    /// Channels in a chunk and the offsets of their message indexes; empty if unknown.
    pub(super) message_indexes: Vec<(u16, u64)>,
}

#[derive(Clone, Debug)]
pub(super) enum PartKind {
    Chunk,
    /// Consecutive message records outside chunks.
    Loose,
    /// An unreadable range, with a description of the damage.
    Damage(String),
}

impl Layout {
    /// Returns the layout of a file that is not read, with the reason.
    pub(super) fn lost(why: String) -> Self {
        let part = Part {
            kind: PartKind::Damage(why.clone()),
            offset: 0,
            end: 0,
            start_time: 0,
            end_time: 0,
            message_indexes: Vec::new(),
        };
        Self {
            parts: vec![part],
            counts: Some(BTreeMap::new()),
            lost: Some(why),
            ..Self::default()
        }
    }

    /// Returns the layout of an MCAP file. The index is used if it is valid and the options allow it.
    pub(super) fn of(source: &mut Source, options: &ReadOptions) -> Result<Self, BagError> {
        let summary = match summary::read(source) {
            Ok(summary) => Ok(summary),
            Err(Fault::Malformed(why)) => Err(why),
            Err(Fault::Io(error)) => return Err(error),
        };
        let known = summary.as_ref().ok();
        let seed = known.map(|summary| summary.channels.clone()).unwrap_or_default();
        let statistics = known.and_then(|summary| summary.statistics.as_ref());
        let stated_counts = statistics.map(|statistics| statistics.channel_message_counts.clone());
        let mut layout = match summary.and_then(Self::by_index) {
            Ok(layout) if options.use_index => layout,
            Ok(_) => scan::scan(source, seed)?,
            Err(why) => {
                let mut layout = scan::scan(source, seed)?;
                layout.notes.insert(
                    0,
                    format!("{}: {why}; the whole file was read", source.path.display()),
                );
                layout
            }
        };
        if let Some(fault) = &source.fault {
            layout.notes.push(format!(
                "{}: the compressed file ends early ({fault}); its content is read up to there",
                source.path.display()
            ));
        }
        layout.is_packed = source.is_packed;
        layout.has_packed_messages = layout.states_packed_messages(source)?;
        layout.profile = scan::profile(source)?;
        layout.stated_counts = stated_counts;
        Ok(layout)
    }

    /// True if a description by rosbag2 inside the file says that the messages are compressed one by one.
    fn states_packed_messages(&self, source: &mut Source) -> Result<bool, BagError> {
        for span in &self.metadata {
            if source.check_length(span, span.end.saturating_sub(span.offset)).is_err() {
                continue;
            }
            let record = content::metadata(&source.body(span)?).ok();
            let own = record.filter(|record| record.name == OWN_RECORD);
            let text = own.and_then(|mut record| record.entries.remove("serialized_metadata"));
            let description = text.and_then(|text| BagInformation::of_yaml(&text));
            if description.is_some_and(|description| description.has_packed_messages()) {
                return Ok(true);
            }
        }
        Ok(false)
    }

    fn by_index(summary: Summary) -> Result<Self, String> {
        let message_count =
            summary.statistics.as_ref().map_or(u64::MAX, |found| found.message_count);
        if summary.chunks.is_empty() && message_count > 0 {
            return Err("the file has no chunk index".into());
        }
        let mut layout = Self {
            channels: summary.channels,
            attachments: summary.attachments,
            metadata: summary.metadata,
            is_indexed: true,
            ..Self::default()
        };
        for chunk in summary.chunks {
            layout.parts.push(Part {
                kind: PartKind::Chunk,
                offset: chunk.span.offset,
                end: chunk.span.end,
                start_time: chunk.start_time,
                end_time: chunk.end_time,
                message_indexes: chunk.message_indexes.into_iter().collect(),
            });
            if !layout.compressions.contains(&chunk.compression) {
                layout.compressions.push(chunk.compression);
            }
        }
        if let Some(statistics) = summary.statistics {
            layout.counts = Some(statistics.channel_message_counts);
        }
        layout.sort();
        Ok(layout)
    }

    /// Sorts the parts by time.
    pub(super) fn sort(&mut self) {
        self.parts.sort_by_key(|part| (part.start_time, part.offset));
        self.compressions.sort();
        self.compressions.dedup();
    }
}
