//! Writes a bag: one MCAP file in a rosbag2 directory, readable by `ros2 bag`, Foxglove and Rerun.
//!
//! The same calls give the same bytes: there is no clock, random number or hash map order.

use std::collections::BTreeMap;
use std::fs::{self, File};
use std::io;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};
use std::{mem, slice};

use mcap::McapError;
use mcap::records::MessageHeader;
use mcap::write::NoSeek;

use super::channels::{QOS_KEY, TYPE_HASH_KEY};
use super::metadata::{self, BagInformation, Recorded};
use super::sink::Sink;
use super::{Attachment, MetadataRecord, RecordError, Topic, place, qos};

/// Uncompressed bytes after which a chunk is closed.
const CHUNK_BYTES: u64 = 1 << 20;
/// Maximum number of topics in a file: the mcap crate numbers channels in 16 bits from 1, and needs one spare number.
const MAX_TOPICS: usize = 65_534;
/// Name of the metadata record that rosbag2 reads.
pub(super) const OWN_RECORD: &str = "rosbag2";
const IDENTITY: &str = concat!("laser_profiler ", env!("CARGO_PKG_VERSION"));

/// Compression of chunks.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default)]
pub enum Compression {
    /// None: for images, because disks write faster than processors compress.
    None,
    /// LZ4.
    Lz4,
    /// Zstandard, level 1: for results.
    #[default]
    Zstd,
}

/// Options for writing a bag.
#[derive(Clone, Copy, Debug, Default)]
pub struct RecordOptions {
    /// Compression of the chunks.
    pub compression: Compression,
    /// True to replace an existing bag. Files that do not belong to the bag are kept.
    pub force: bool,
}

/// Identifier of a topic within a recorder.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct TopicId(usize);

/// Times and sequence number of a message.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Times {
    /// Time of reception, nanoseconds since the epoch.
    pub log_ns: i64,
    /// Time of publication, nanoseconds since the epoch.
    pub publish_ns: i64,
    /// Sequence number within the topic, so that gaps are visible; 0 without numbering.
    pub sequence: u32,
}

/// Summary of the written bag.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct RecordSummary {
    /// The directory.
    pub(crate) directory: PathBuf,
    /// The MCAP file in it.
    pub(crate) file: PathBuf,
    /// Topics in the order of addition, with their numbers of messages.
    pub(crate) topics: Vec<(String, u64)>,
    /// Number of messages of all topics.
    pub(crate) messages: u64,
    /// Size of the file, bytes.
    pub(crate) bytes: u64,
}

/// A bag being written.
pub struct Recorder {
    writer: mcap::Writer<NoSeek<Sink>>,
    directory: PathBuf,
    file_name: String,
    topics: Vec<(Topic, u64)>,
    /// Further entries of the metadata of the topics' channels, by index.
    further: BTreeMap<usize, BTreeMap<String, String>>,
    /// Indices into `topics`, by name.
    places: BTreeMap<String, usize>,
    /// Channels of the topics already written to the file, which are the first of `topics`.
    channels: Vec<u16>,
    /// True if a chunk must be closed as soon as it has a message.
    is_head_closed: bool,
    bounds_ns: Option<(i64, i64)>,
    written_bytes: Arc<AtomicU64>,
    has_failed: bool,
}

impl Recorder {
    /// Creates `directory` and in it `<name>_0.mcap`, where `<name>` is the directory's last component.
    ///
    /// # Errors
    /// The output exists (without `force`), is not a bag (with `force`), or cannot be written.
    pub fn create(directory: &Path, options: RecordOptions) -> Result<Self, RecordError> {
        let no_name = || RecordError::NoName(directory.into());
        let name = directory.file_name().and_then(|name| name.to_str()).ok_or_else(no_name)?;
        make_room(directory, name, options)?;
        let file_name = format!("{name}_0.mcap");
        let path = directory.join(&file_name);
        let io_error = |source| RecordError::Io { path: path.clone(), source };
        let file = File::create_new(&path).map_err(io_error)?;
        Self::on(Box::new(file), directory, file_name, options.compression)
    }

    pub(super) fn on(
        output: Box<dyn io::Write + Send>,
        directory: &Path,
        file_name: String,
        compression: Compression,
    ) -> Result<Self, RecordError> {
        let written_bytes = Arc::new(AtomicU64::new(0));
        let compression = match compression {
            Compression::None => None,
            Compression::Lz4 => Some(mcap::Compression::Lz4),
            Compression::Zstd => Some(mcap::Compression::Zstd),
        };
        let options = mcap::WriteOptions::new()
            .profile("ros2")
            .library(IDENTITY)
            .chunk_size(Some(CHUNK_BYTES))
            .compression(compression)
            .compression_level(u32::from(compression.is_some()))
            .compression_threads(0)
            .disable_seeking(true);
        let sink = NoSeek::new(Sink::new(output, Arc::clone(&written_bytes)));
        let path = directory.join(&file_name);
        let writer = options.create(sink).map_err(|error| fault(&path, error))?;
        Ok(Self {
            writer,
            directory: directory.into(),
            file_name,
            topics: Vec::new(),
            further: BTreeMap::new(),
            places: BTreeMap::new(),
            channels: Vec::new(),
            is_head_closed: false,
            bounds_ns: None,
            written_bytes,
            has_failed: false,
        })
    }

    /// Path of the file that is being written.
    pub(crate) fn path(&self) -> PathBuf {
        self.directory.join(&self.file_name)
    }

    /// Bytes written to the file so far, without the open chunk.
    pub fn written_bytes(&self) -> u64 {
        self.written_bytes.load(Ordering::Relaxed)
    }

    /// Adds a topic; adding it again returns the same identifier. The topic is written together with the next message.
    /// If the chunk was closed in between, both get a chunk of their own: some readers reject a chunk without messages,
    /// and damage to other messages must not destroy the topics.
    ///
    /// # Errors
    /// The name already has another type; there are too many topics.
    pub fn add_topic(&mut self, topic: &Topic) -> Result<TopicId, RecordError> {
        if let Some(&at) = self.places.get(&topic.name) {
            let known = &self.topics[at].0;
            let is_alike = known.type_name == topic.type_name && known.schema == topic.schema;
            if is_alike && known.message_encoding == topic.message_encoding {
                return Ok(TopicId(at));
            }
            let in_words = |topic: &Topic| {
                let encoding = Some(&topic.message_encoding).filter(|_| is_alike);
                let encoding = encoding.map_or_else(String::new, |name| format!(" in {name}"));
                format!("{}{encoding}", topic.type_name)
            };
            return Err(RecordError::TopicConflict {
                topic: topic.name.clone(),
                recorded: in_words(known),
                refused: in_words(topic),
            });
        }
        if self.topics.len() == MAX_TOPICS {
            let what = format!("{}: more than {MAX_TOPICS} topics", topic.name);
            return Err(RecordError::Format { path: self.path(), what });
        }
        self.places.insert(topic.name.clone(), self.topics.len());
        self.topics.push((topic.clone(), 0));
        Ok(TopicId(self.topics.len() - 1))
    }

    /// Adds an entry to the metadata of a topic's channel, before the first message. Returns false and changes nothing if
    /// the key has another text.
    pub(super) fn annotate(&mut self, topic: TopicId, key: &str, text: &str) -> bool {
        let entries = self.further.entry(topic.0).or_default();
        entries.entry(key.to_owned()).or_insert_with(|| text.to_owned()) == text
    }

    fn close_head(&mut self) {
        self.is_head_closed |= self.channels.len() < self.topics.len();
    }

    /// Writes the schemas and channels of the topics that are not in the file yet.
    fn announce(&mut self) -> Result<(), RecordError> {
        while let Some((topic, _)) = self.topics.get(self.channels.len()) {
            let topic = topic.clone();
            let further = self.further.remove(&self.channels.len()).unwrap_or_default();
            let channel = self.write_with(|writer| add_channel(writer, &topic, further))?;
            self.channels.push(channel);
        }
        Ok(())
    }

    /// Appends a message.
    ///
    /// # Errors
    /// A time is before the epoch; writing fails.
    pub fn write(&mut self, topic: TopicId, times: Times, data: &[u8]) -> Result<(), RecordError> {
        self.announce()?;
        let (Some(&channel_id), Some((known, _))) =
            (self.channels.get(topic.0), self.topics.get(topic.0))
        else {
            return Err(RecordError::Format {
                path: self.path(),
                what: "a topic of another recorder".into(),
            });
        };
        let header = MessageHeader {
            channel_id,
            sequence: times.sequence,
            log_time: since_epoch(&known.name, times.log_ns)?,
            publish_time: since_epoch(&known.name, times.publish_ns)?,
        };
        self.write_with(|writer| writer.write_to_known_channel(&header, data))?;
        if mem::take(&mut self.is_head_closed) {
            self.write_with(mcap::Writer::flush)?;
        }
        self.topics[topic.0].1 += 1;
        let (first, last) = self.bounds_ns.unwrap_or((times.log_ns, times.log_ns));
        self.bounds_ns = Some((first.min(times.log_ns), last.max(times.log_ns)));
        Ok(())
    }

    /// Stores a file inside the recording. Closes the open chunk.
    ///
    /// # Errors
    /// A time is before the epoch; writing fails.
    pub fn attach(&mut self, attachment: &Attachment) -> Result<(), RecordError> {
        let attachment = mcap::Attachment {
            log_time: since_epoch(&attachment.name, attachment.log_time_ns)?,
            create_time: since_epoch(&attachment.name, attachment.create_time_ns)?,
            name: attachment.name.clone(),
            media_type: attachment.media_type.clone(),
            data: attachment.data.as_slice().into(),
        };
        self.close_head();
        self.write_with(|writer| writer.attach(&attachment))
    }

    /// Stores named key-value pairs. Closes the open chunk. The name `rosbag2` is reserved for the recorder.
    ///
    /// # Errors
    /// The name is `rosbag2`; writing fails.
    pub fn metadata(&mut self, record: &MetadataRecord) -> Result<(), RecordError> {
        if record.name == OWN_RECORD {
            let what = format!("the name {OWN_RECORD:?} is reserved for the metadata of rosbag2");
            return Err(RecordError::Format { path: self.path(), what });
        }
        let record =
            mcap::records::Metadata { name: record.name.clone(), metadata: record.entries.clone() };
        self.close_head();
        self.write_with(|writer| writer.write_metadata(&record))
    }

    /// Closes the open chunk and passes everything to the operating system. All of it stays readable if this process
    /// dies.
    ///
    /// # Errors
    /// Writing fails.
    pub fn flush(&mut self) -> Result<(), RecordError> {
        self.close_head();
        self.write_with(mcap::Writer::flush)
    }

    /// Writes the index and `metadata.yaml`.
    ///
    /// # Errors
    /// Writing fails.
    pub fn finish(self) -> Result<RecordSummary, RecordError> {
        let (directory, file) = (self.directory.clone(), self.path());
        let (recorded, bytes) = self.finish_file()?;
        metadata::write(&directory, slice::from_ref(&recorded))?;
        let topics: Vec<_> =
            recorded.topics.into_iter().map(|(topic, count)| (topic.name, count)).collect();
        let messages = topics.iter().map(|(_, count)| count).sum();
        Ok(RecordSummary { directory, file, topics, messages, bytes })
    }

    /// Writes the index of this file. Returns a summary of its content and its size in bytes.
    pub(super) fn finish_file(mut self) -> Result<(Recorded, u64), RecordError> {
        self.announce()?;
        let path = self.path();
        let recorded = Recorded {
            file: self.file_name.clone(),
            bounds_ns: self.bounds_ns,
            topics: mem::take(&mut self.topics),
        };
        let serialized = BagInformation::of(slice::from_ref(&recorded))
            .to_yaml()
            .map_err(|error| RecordError::Format { path: path.clone(), what: error.to_string() })?;
        let entries = BTreeMap::from([("serialized_metadata".to_owned(), serialized)]);
        let own = mcap::records::Metadata { name: OWN_RECORD.into(), metadata: entries };
        self.write_with(|writer| {
            writer.write_metadata(&own)?;
            writer.finish()?;
            Ok(())
        })?;
        // `finish` does not flush, and the writer must not be used after it.
        let bytes = self.written_bytes();
        let flushed = io::Write::flush(self.writer.into_inner().get_mut());
        flushed.map_err(|source| RecordError::Io { path, source })?;
        Ok((recorded, bytes))
    }

    /// Runs `act` on the writer unless an earlier call has failed.
    fn write_with<T>(
        &mut self,
        act: impl FnOnce(&mut mcap::Writer<NoSeek<Sink>>) -> Result<T, McapError>,
    ) -> Result<T, RecordError> {
        if self.has_failed {
            return Err(RecordError::Stopped(self.path()));
        }
        act(&mut self.writer).map_err(|error| {
            self.has_failed = true;
            fault(&self.path(), error)
        })
    }
}

fn add_channel(
    writer: &mut mcap::Writer<NoSeek<Sink>>,
    topic: &Topic,
    mut metadata: BTreeMap<String, String>,
) -> Result<u16, McapError> {
    // Version 9 has words where older versions have numbers. Malformed text is kept.
    let words = qos::parse(&topic.qos).filter(|profiles| !profiles.is_empty());
    metadata.insert(
        QOS_KEY.into(),
        words.map_or_else(|| topic.qos.clone(), |profiles| qos::to_yaml(&profiles)),
    );
    metadata.insert(TYPE_HASH_KEY.into(), topic.type_hash.clone());
    let schema = if topic.type_name.is_empty() {
        0
    } else {
        writer.add_schema(&topic.type_name, &topic.schema_encoding, &topic.schema)?
    };
    writer.add_channel(schema, &topic.name, &topic.message_encoding, &metadata)
}

fn fault(path: &Path, error: McapError) -> RecordError {
    match error {
        McapError::Io(source) => RecordError::Io { path: path.into(), source },
        error => RecordError::Format { path: path.into(), what: error.to_string() },
    }
}

fn since_epoch(what: &str, time_ns: i64) -> Result<u64, RecordError> {
    u64::try_from(time_ns)
        .map_err(|_negative| RecordError::NegativeTime { what: what.into(), time_ns })
}

/// Creates the directory, or deletes the bag that is in it.
fn make_room(directory: &Path, name: &str, options: RecordOptions) -> Result<(), RecordError> {
    let io_error = |source| RecordError::Io { path: directory.into(), source };
    if fs::symlink_metadata(directory).is_err() {
        return fs::create_dir_all(directory).map_err(io_error);
    }
    if !options.force {
        return Err(RecordError::Exists(directory.into()));
    }
    if !directory.is_dir() {
        return Err(RecordError::NotABag(directory.into()));
    }
    let Some(files) = place::replaceable(directory, name).map_err(io_error)? else {
        return Err(RecordError::NotABag(directory.into()));
    };
    for path in files {
        fs::remove_file(&path).map_err(|source| RecordError::Io { path, source })?;
    }
    Ok(())
}
