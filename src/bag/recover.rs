//! Recovers the readable part of a damaged bag into a new bag.

use std::collections::{BTreeMap, BTreeSet};
use std::io;
use std::path::Path;
use std::sync::Arc;

use sha2::{Digest, Sha256};
use thiserror::Error;

use super::damaged::DamagedRange;
use super::layout::Layout;
use super::record::{OWN_RECORD, RecordSummary};
use super::{
    BagError, BagReader, Compression, Filter, ReadOptions, RecordError, RecordOptions, Recorder,
    Times, Topic, TopicId, place, qos,
};

/// Error of recovering a bag.
#[derive(Debug, Error)]
pub(crate) enum RecoverError {
    /// The input cannot be read at all.
    #[error(transparent)]
    Read(#[from] BagError),
    /// The output cannot be written.
    #[error(transparent)]
    Write(#[from] RecordError),
    /// The output would replace the input.
    #[error("{0}; choose another output")]
    SamePlace(io::Error),
}

/// Options for recovering a bag.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct RecoverOptions {
    /// Compression of the new bag; `None` for that of the input.
    pub(crate) compression: Option<Compression>,
    /// True to replace an existing bag.
    pub(crate) force: bool,
}

/// Report of what was recovered and what was lost.
#[derive(Debug)]
pub(crate) struct Recovery {
    /// The new bag.
    pub(crate) output: RecordSummary,
    /// Number of attachments in the new bag.
    pub(crate) num_attachments: u64,
    /// Number of metadata records in the new bag, without the recorder's own.
    pub(crate) num_metadata: u64,
    /// Skipped ranges, whose messages are lost.
    pub(crate) damaged: Vec<DamagedRange>,
    /// Whatever else is not in the new bag.
    pub(crate) left_out: Vec<String>,
    /// Further notes for the user.
    pub(crate) notes: Vec<String>,
}

impl Recovery {
    /// True if the new bag holds everything that the input held.
    pub(crate) const fn is_complete(&self) -> bool {
        self.damaged.is_empty() && self.left_out.is_empty()
    }
}

/// Copies all readable topics, messages, metadata and attachments of `input` into a new bag `output`. The input is
/// scanned without its index. A damaged chunk is skipped; after other damage, the scan searches for the next chunk.
/// Compressed files and messages are decompressed, and the new chunks compressed instead.
///
/// # Errors
/// The input is not a bag or cannot be read, the output contains the input or cannot be written.
pub(crate) fn recover(
    input: &Path,
    output: &Path,
    options: RecoverOptions,
) -> Result<Recovery, RecoverError> {
    let bag = BagReader::open(input, &ReadOptions { use_index: false, ..ReadOptions::default() })?;
    place::refuse_same(input, output).map_err(RecoverError::SamePlace)?;
    let compression = options.compression.unwrap_or_else(|| compression_of(&bag));
    let record_options = RecordOptions { compression, force: options.force };
    let mut recorder = Recorder::create(output, record_options)?;
    let mut losses = Losses { notes: bag.notes().to_vec(), ..Losses::default() };
    for (path, layout) in bag.layouts().filter(|(_, layout)| layout.unknown_bytes > 0) {
        let (path, bytes) = (path.display(), layout.unknown_bytes);
        losses.left_out.push(format!("{path}: {bytes} bytes of record types that are not of MCAP"));
    }
    copy_topics(&bag, &mut recorder, &mut losses)?;
    let num_metadata = copy_metadata(&bag, &mut recorder, &mut losses)?;
    let num_attachments = copy_attachments(&bag, &mut recorder, &mut losses)?;
    copy_messages(&bag, &mut recorder, &mut losses)?;
    let output = recorder.finish()?;
    losses.compare(&bag, output.messages);
    let Losses { damaged, left_out, notes, .. } = losses;
    Ok(Recovery { output, num_attachments, num_metadata, damaged, left_out, notes })
}

/// Content that is not in the new bag.
#[derive(Default)]
struct Losses {
    damaged: Vec<DamagedRange>,
    left_out: Vec<String>,
    notes: Vec<String>,
    /// Messages that the new bag cannot hold, by reason.
    refused: BTreeMap<String, u64>,
}

impl Losses {
    fn add(&mut self, error: &BagError) {
        match DamagedRange::of(error) {
            Some(range) => self.damaged.push(range),
            None if error.is_loss() => self.left_out.push(error.to_string()),
            None => self.notes.push(error.to_string()),
        }
    }

    /// Returns the number of a topic; `None` for a second topic of the same name but another type, which a bag cannot
    /// hold. Then `num_messages` more are left out.
    fn topic(
        &mut self,
        added: Result<TopicId, RecordError>,
        num_messages: u64,
    ) -> Result<Option<TopicId>, RecordError> {
        match added {
            Ok(id) => Ok(Some(id)),
            Err(error @ RecordError::TopicConflict { .. }) => {
                *self.refused.entry(error.to_string()).or_default() += num_messages;
                Ok(None)
            }
            Err(error) => Err(error),
        }
    }

    /// Adds the refused messages, and those that `metadata.yaml` states beyond the recovered ones.
    fn compare(&mut self, bag: &BagReader, num_recovered: u64) {
        for (why, count) in &self.refused {
            self.left_out.push(format!("{count} messages: {why}"));
        }
        let stated = bag.stated_messages().filter(|stated| *stated > num_recovered);
        if let Some(stated) = stated.filter(|_| self.damaged.is_empty() && self.left_out.is_empty())
        {
            self.left_out.push(format!(
                "{} messages that metadata.yaml states are in none of the files",
                stated - num_recovered
            ));
        }
    }
}

/// Adds all topics with the metadata of their channels, and notes what is not written as it was.
fn copy_topics(
    bag: &BagReader,
    recorder: &mut Recorder,
    losses: &mut Losses,
) -> Result<(), RecoverError> {
    // The files of a split bag repeat them.
    let (mut notes, mut left_out) = (BTreeSet::new(), BTreeSet::new());
    for topic in merged(bag.topics(), &mut left_out) {
        losses.topic(recorder.add_topic(&topic), 0)?;
        let profiles = qos::parse(&topic.qos).filter(|profiles| !profiles.is_empty());
        if profiles.is_some_and(|profiles| qos::to_yaml(&profiles) != topic.qos) {
            notes.insert(format!(
                "{}: its quality of service is written as names, as version 9 of rosbag2 does, not as numbers",
                topic.name
            ));
        }
    }
    for (_, Layout { channels, .. }) in bag.layouts() {
        for (channel, topic) in channels.iter() {
            let Some(id) = losses.topic(recorder.add_topic(topic), 0)? else { continue };
            let Topic { name, type_name, .. } = topic.as_ref();
            for (key, text) in channels.further(channel) {
                if !recorder.annotate(id, key, text) {
                    left_out.insert(format!("{name}: another {key:?} of its channel: {text:?}"));
                }
            }
            if let Some(rewrite) = channels.rewrite(channel) {
                let origin = rewrite.origin();
                notes.insert(format!("{name}: messages of {origin} are rewritten as {type_name}"));
            }
        }
    }
    losses.notes.extend(notes);
    losses.left_out.extend(left_out);
    Ok(())
}

/// Topics that differ only in their quality of service or type hash as one that has all of it.
fn merged(topics: &[Arc<Topic>], left_out: &mut BTreeSet<String>) -> Vec<Topic> {
    let mut merged = Vec::<Topic>::new();
    for topic in topics {
        let is_same = |known: &&mut Topic| {
            let (type_hash, qos) = (known.type_hash.clone(), known.qos.clone());
            Topic { type_hash, qos, ..Topic::clone(topic) } == **known
        };
        let Some(known) = merged.last_mut().filter(is_same) else {
            merged.push(Topic::clone(topic));
            continue;
        };
        if known.type_hash.is_empty() {
            known.type_hash.clone_from(&topic.type_hash);
        } else if !topic.type_hash.is_empty() && topic.type_hash != known.type_hash {
            left_out.insert(format!("{}: another type hash: {}", topic.name, topic.type_hash));
        }
        match qos::joined(&known.qos, &topic.qos) {
            Some(qos) => known.qos = qos,
            None => drop(left_out.insert(format!("{}: another quality of service", topic.name))),
        }
    }
    merged
}

fn copy_metadata(
    bag: &BagReader,
    recorder: &mut Recorder,
    losses: &mut Losses,
) -> Result<u64, RecoverError> {
    let (mut count, mut last) = (0, BTreeMap::new());
    for record in bag.metadata() {
        match record {
            // The recorder writes its own.
            Ok(record) if record.name == OWN_RECORD => {}
            // The files of a split bag repeat it.
            Ok(record) if last.get(&record.name) == Some(&record.entries) => {}
            Ok(record) => {
                recorder.metadata(&record)?;
                count += 1;
                last.insert(record.name, record.entries);
            }
            Err(error) => losses.add(&error),
        }
    }
    Ok(count)
}

fn copy_attachments(
    bag: &BagReader,
    recorder: &mut Recorder,
    losses: &mut Losses,
) -> Result<u64, RecoverError> {
    let (mut count, mut last) = (0, BTreeMap::new());
    for attachment in bag.attachments() {
        match attachment {
            Ok(attachment) => {
                let hash = Sha256::digest(&attachment.data);
                // The files of a split bag repeat it.
                if last.get(&attachment.name) != Some(&hash) {
                    recorder.attach(&attachment)?;
                    count += 1;
                    last.insert(attachment.name, hash);
                }
            }
            Err(error) => losses.add(&error),
        }
    }
    Ok(count)
}

fn copy_messages(
    bag: &BagReader,
    recorder: &mut Recorder,
    losses: &mut Losses,
) -> Result<(), RecoverError> {
    let mut messages = bag.messages(&Filter::all());
    while let Some(item) = messages.next() {
        match item {
            Ok(message) => {
                if let Some(topic) = losses.topic(recorder.add_topic(&message.topic), 1)? {
                    let times = Times {
                        log_ns: message.log_time_ns,
                        publish_ns: message.publish_time_ns,
                        sequence: message.sequence,
                    };
                    recorder.write(topic, times, &message.data)?;
                }
                messages.recycle(message.data);
            }
            Err(error) => losses.add(&error),
        }
    }
    Ok(())
}

fn compression_of(bag: &BagReader) -> Compression {
    let has = |name| {
        bag.layouts()
            .any(|(_, layout)| layout.compressions.iter().any(|compression| compression == name))
    };
    let is_packed = bag.layouts().any(|(_, layout)| layout.is_packed || layout.has_packed_messages);
    if is_packed || has("zstd") {
        Compression::Zstd
    } else if has("lz4") {
        Compression::Lz4
    } else {
        Compression::None
    }
}
