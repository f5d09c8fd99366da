//! Recovers the readable part of a damaged bag into a new bag.

use std::io;
use std::path::{Path, PathBuf};

use serde::Serialize;
use thiserror::Error;

use super::record::{OWN_RECORD, RecordSummary};
use super::{
    BagError, BagReader, Compression, Filter, ReadOptions, RecordError, RecordOptions, Recorder,
    Times, place,
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

/// A range of the input that was skipped.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub(crate) struct DamagedRange {
    /// The file.
    pub(crate) file: PathBuf,
    /// Start, bytes from the start of the file.
    pub(crate) offset: u64,
    /// End (exclusive), bytes from the start of the file.
    pub(crate) end: u64,
    /// Description of the damage.
    pub(crate) what: String,
}

impl DamagedRange {
    /// Returns the damaged range that an error reports; `None` for any other error.
    pub(super) fn of(error: &BagError) -> Option<Self> {
        let BagError::Damaged { path, offset, end, what } = error else { return None };
        Some(Self { file: path.clone(), offset: *offset, end: *end, what: what.clone() })
    }
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
    /// Further notes for the user.
    pub(crate) notes: Vec<String>,
}

/// Copies all readable topics, messages, metadata and attachments of `input` into a new bag `output`. The input is
/// scanned without its index. A damaged chunk is skipped; after other damage, the scan searches for the next chunk.
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
    let mut damaged = Vec::new();
    let mut notes = bag.notes().to_vec();
    let mut report = |error: BagError| match DamagedRange::of(&error) {
        Some(range) => damaged.push(range),
        None => notes.push(error.to_string()),
    };
    for topic in bag.topics() {
        recorder.add_topic(topic)?;
    }
    let (mut num_attachments, mut num_metadata) = (0, 0);
    for record in bag.metadata() {
        match record {
            Ok(record) if record.name == OWN_RECORD => {}
            Ok(record) => {
                recorder.metadata(&record)?;
                num_metadata += 1;
            }
            Err(error) => report(error),
        }
    }
    for attachment in bag.attachments() {
        match attachment {
            Ok(attachment) => {
                recorder.attach(&attachment)?;
                num_attachments += 1;
            }
            Err(error) => report(error),
        }
    }
    copy_messages(&bag, &mut recorder, &mut report)?;
    Ok(Recovery { output: recorder.finish()?, num_attachments, num_metadata, damaged, notes })
}

fn copy_messages(
    bag: &BagReader,
    recorder: &mut Recorder,
    report: &mut impl FnMut(BagError),
) -> Result<(), RecoverError> {
    let mut messages = bag.messages(&Filter::all());
    while let Some(item) = messages.next() {
        match item {
            Ok(message) => {
                let topic = recorder.add_topic(&message.topic)?;
                let times = Times {
                    log_ns: message.log_time_ns,
                    publish_ns: message.publish_time_ns,
                    sequence: message.sequence,
                };
                recorder.write(topic, times, &message.data)?;
                messages.recycle(message.data);
            }
            Err(error @ BagError::Io { .. }) => return Err(error.into()),
            Err(error) => report(error),
        }
    }
    Ok(())
}

fn compression_of(bag: &BagReader) -> Compression {
    let has = |name| {
        bag.layouts()
            .any(|(_, layout)| layout.compressions.iter().any(|compression| compression == name))
    };
    if has("zstd") {
        Compression::Zstd
    } else if has("lz4") {
        Compression::Lz4
    } else {
        Compression::None
    }
}
