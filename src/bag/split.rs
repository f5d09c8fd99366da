//! A bag split into several files, as in rosbag2. Each file is self-contained and can be opened alone.

use std::fs::{self, File};
use std::io;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use super::metadata::{self, Recorded};
use super::{
    Attachment, Compression, MetadataRecord, RecordError, Recorder, Times, Topic, TopicId,
};

/// Overhead of a message in the file, bytes: the record's header and the index entry.
const MESSAGE_OVERHEAD_BYTES: u64 = 31 + 16;

/// Index of a chunk in the summary of its file, and the overhead of the chunk itself, bytes without the topics.
const CHUNK_OVERHEAD_BYTES: u64 = 256;
/// Bytes per topic in the index of a chunk: the offset of its messages, and their index's head.
const CHUNK_TOPIC_BYTES: u64 = 32;
/// Entry of a file in `metadata.yaml`, bytes without the topics.
const FILE_ENTRY_BYTES: u64 = 512;
/// Rest of the end of a bag, bytes: statistics, and blocks of the disk that are not full.
const CLOSING_BYTES: u64 = 64 << 10;

/// Limits at which a file of the bag is closed and the next one started; `None` for no limit.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct SplitLimits {
    /// Size of a file, bytes, without its description and index. A message longer than this gets a file of its own.
    pub(crate) bytes: Option<u64>,
    /// Time from the first message of a file to its last, nanoseconds.
    pub(crate) duration_ns: Option<u64>,
}

/// Summary of the written bag.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct SplitSummary {
    /// The directory.
    pub(crate) directory: PathBuf,
    /// Number of files of the bag.
    pub(crate) files: usize,
    /// Number of messages of all topics, including repeated ones.
    pub(crate) messages: u64,
    /// Size of all files, bytes.
    pub(crate) bytes: u64,
}

/// A bag being written to `NAME/NAME_0.mcap`, `NAME/NAME_1.mcap` and so on. `metadata.yaml` is written at the end.
///
/// Each file begins with the description of the bag and the last message of each latched (transient local) topic. The
/// repeated message has the log time of the file's first message and keeps its publish time and sequence number.
pub(crate) struct SplitRecorder {
    directory: PathBuf,
    compression: Compression,
    limits: SplitLimits,
    topics: Vec<Topic>,
    head: Head,
    /// Last message by topic; `None` if the topic is not latched or has no message yet.
    latched: Vec<Option<(Times, Arc<[u8]>)>>,
    is_latched: Vec<bool>,
    current: Option<OpenFile>,
    closed: Vec<Recorded>,
    closed_bytes: u64,
}

/// Description at the start of every file.
#[derive(Default)]
struct Head {
    record: Option<MetadataRecord>,
    attachment: Option<Attachment>,
}

struct OpenFile {
    recorder: Recorder,
    ids: Vec<TopicId>,
    /// Handle of the same file, for syncing it to the disk.
    file: File,
    /// Size of the description and the repeated messages, bytes.
    head_bytes: u64,
    /// Upper limit of the bytes of messages in the open chunk, which are not in the file yet.
    pending_bytes: u64,
    written_bytes: u64,
    /// Upper limit of the number of chunks.
    num_chunks: u64,
    first_log_ns: Option<i64>,
}

impl SplitRecorder {
    /// Creates the directory and its first file. Messages refer to a topic by its index in `topics`.
    ///
    /// # Errors
    /// The directory exists already; writing fails.
    pub(crate) fn create(
        directory: &Path,
        compression: Compression,
        limits: SplitLimits,
        topics: Vec<Topic>,
    ) -> Result<Self, RecordError> {
        let no_name = || RecordError::NoName(directory.into());
        directory.file_name().and_then(|name| name.to_str()).ok_or_else(no_name)?;
        make_new(directory)?;
        let is_latched: Vec<_> = topics.iter().map(Topic::is_latched).collect();
        let mut bag = Self {
            directory: directory.into(),
            compression,
            limits,
            latched: vec![None; topics.len()],
            is_latched,
            topics,
            head: Head::default(),
            current: None,
            closed: Vec::new(),
            closed_bytes: 0,
        };
        bag.open_next()?;
        Ok(bag)
    }

    /// The directory.
    pub(crate) fn directory(&self) -> &Path {
        &self.directory
    }

    /// Upper limit of the bytes that a new file and the end of the bag add to the disk, besides further messages.
    pub(crate) fn closing_bytes(&self) -> u64 {
        let num_topics = self.topics.len() as u64;
        let open = self.current.as_ref().map_or(0, |open| {
            // The summary repeats the topics, which are in the head.
            open.num_chunks * (CHUNK_OVERHEAD_BYTES + num_topics * CHUNK_TOPIC_BYTES)
                + 2 * open.head_bytes
        });
        CLOSING_BYTES + open + (1 + self.closed.len() as u64) * FILE_ENTRY_BYTES
    }

    /// Changes the limits, from the next message on.
    pub(crate) const fn set_limits(&mut self, limits: SplitLimits) {
        self.limits = limits;
    }

    /// Bytes written to all files so far, without the open chunk.
    pub(crate) fn written_bytes(&self) -> u64 {
        let open = self.current.as_ref().map_or(0, |open| open.recorder.written_bytes());
        self.closed_bytes + open
    }

    /// Stores the description of the following messages in this file and every later file of the bag. Earlier
    /// descriptions stay in the file: of several records or attachments of the same name in a file, the last one is
    /// valid.
    ///
    /// # Errors
    /// The record's name is `rosbag2`; a time is before the epoch; writing fails.
    pub(crate) fn describe(
        &mut self,
        record: MetadataRecord,
        attachment: Option<Attachment>,
    ) -> Result<(), RecordError> {
        self.head = Head { record: Some(record), attachment };
        let Some(open) = &mut self.current else { return Ok(()) };
        self.head.write(&mut open.recorder)?;
        if open.first_log_ns.is_none() {
            open.head_bytes = open.recorder.written_bytes();
        }
        Ok(())
    }

    /// Stores named key-value pairs in the open file only.
    ///
    /// # Errors
    /// The name is `rosbag2`; writing fails.
    pub(crate) fn metadata(&mut self, record: &MetadataRecord) -> Result<(), RecordError> {
        self.open()?.recorder.metadata(record)
    }

    /// Sets the last message of a latched topic that was sent before the bag began, so that the first file repeats it.
    /// A message of another topic is ignored.
    pub(crate) fn set_latched(&mut self, topic: usize, times: Times, data: &Arc<[u8]>) {
        if self.is_latched.get(topic) == Some(&true) {
            self.latched[topic] = Some((times, Arc::clone(data)));
        }
    }

    /// Appends a message. If a limit is reached, starts the next file first.
    ///
    /// # Errors
    /// A time is before the epoch, after which the recorder can continue; writing fails, after which it cannot.
    pub(crate) fn write(
        &mut self,
        topic: usize,
        times: Times,
        data: &Arc<[u8]>,
    ) -> Result<(), RecordError> {
        let Some(known) = self.topics.get(topic) else {
            let what = format!("topic {topic} of {}", self.topics.len());
            return Err(RecordError::Format { path: self.directory.clone(), what });
        };
        if times.log_ns < 0 || times.publish_ns < 0 {
            let (what, time_ns) = (known.name.clone(), times.log_ns.min(times.publish_ns));
            return Err(RecordError::NegativeTime { what, time_ns });
        }
        let limits = self.limits;
        if self.open()?.is_full(limits, times.log_ns, data.len() as u64) {
            self.close_file()?;
            self.open_next()?;
        }
        if self.open()?.first_log_ns.is_none() {
            self.repeat_latched(topic, times.log_ns)?;
        }
        self.open()?.write(topic, times, data)?;
        self.set_latched(topic, times, data);
        Ok(())
    }

    /// Passes everything to the operating system. All of it stays readable if this process dies.
    ///
    /// # Errors
    /// Writing fails.
    pub(crate) fn flush(&mut self) -> Result<(), RecordError> {
        self.open()?.flush()
    }

    /// Returns a handle of the open file, for a thread that syncs the flushed data to the disk.
    ///
    /// # Errors
    /// The process has too many open files.
    pub(crate) fn sync_handle(&self) -> Result<Option<File>, RecordError> {
        let Some(open) = &self.current else { return Ok(None) };
        let path = open.recorder.path();
        open.file.try_clone().map(Some).map_err(|source| RecordError::Io { path, source })
    }

    /// Writes the index of the open file and `metadata.yaml`. If writing fails, there is no `metadata.yaml`, because it
    /// would describe a complete bag. This crate's readers open such a bag by its files; readers that need
    /// `metadata.yaml` do not.
    ///
    /// # Errors
    /// Writing fails.
    pub(crate) fn finish(mut self) -> Result<SplitSummary, RecordError> {
        self.close_file()?;
        metadata::write(&self.directory, &self.closed)?;
        let counts = self.closed.iter().flat_map(|file| &file.topics).map(|(_, count)| count);
        Ok(SplitSummary {
            files: self.closed.len(),
            messages: counts.sum(),
            bytes: self.closed_bytes,
            directory: self.directory,
        })
    }

    fn open(&mut self) -> Result<&mut OpenFile, RecordError> {
        self.current.as_mut().ok_or_else(|| RecordError::Stopped(self.directory.clone()))
    }

    fn close_file(&mut self) -> Result<(), RecordError> {
        let Some(open) = self.current.take() else { return Ok(()) };
        let (recorded, bytes) = open.recorder.finish_file()?;
        self.closed.push(recorded);
        self.closed_bytes += bytes;
        Ok(())
    }

    fn open_next(&mut self) -> Result<(), RecordError> {
        let name = self.directory.file_name().unwrap_or_default().to_string_lossy();
        let file_name = format!("{name}_{}.mcap", self.closed.len());
        let path = self.directory.join(&file_name);
        let io_error = |source| RecordError::Io { path: path.clone(), source };
        let file = File::create_new(&path).map_err(io_error)?;
        let output = Box::new(file.try_clone().map_err(io_error)?);
        let mut recorder = Recorder::on(output, &self.directory, file_name, self.compression)?;
        let ids = self
            .topics
            .iter()
            .map(|topic| recorder.add_topic(topic))
            .collect::<Result<Vec<_>, _>>()?;
        self.head.write(&mut recorder)?;
        recorder.flush()?;
        let written_bytes = recorder.written_bytes();
        self.current = Some(OpenFile {
            recorder,
            ids,
            file,
            head_bytes: written_bytes,
            pending_bytes: 0,
            written_bytes,
            num_chunks: 1,
            first_log_ns: None,
        });
        Ok(())
    }

    /// Writes the last messages of all latched topics but `except`, whose own message follows.
    fn repeat_latched(&mut self, except: usize, log_ns: i64) -> Result<(), RecordError> {
        let Some(open) = &mut self.current else { return Ok(()) };
        for (topic, latched) in self.latched.iter().enumerate() {
            let Some((times, data)) = latched.as_ref().filter(|_| topic != except) else {
                continue;
            };
            open.write(topic, Times { log_ns, ..*times }, data)?;
        }
        open.flush()?;
        // Repeated messages do not count toward the limit, otherwise they could fill every file.
        open.head_bytes = open.written_bytes;
        Ok(())
    }
}

impl Head {
    fn write(&self, recorder: &mut Recorder) -> Result<(), RecordError> {
        self.record.iter().try_for_each(|record| recorder.metadata(record))?;
        self.attachment.iter().try_for_each(|attachment| recorder.attach(attachment))
    }
}

impl OpenFile {
    fn is_full(&self, limits: SplitLimits, log_ns: i64, data_bytes: u64) -> bool {
        let Some(first_log_ns) = self.first_log_ns else { return false };
        let length = self.recorder.written_bytes() - self.head_bytes + self.pending_bytes;
        let is_long =
            limits.bytes.is_some_and(|limit| length + data_bytes + MESSAGE_OVERHEAD_BYTES > limit);
        // A clock that is set back starts a new file, too.
        let age_ns = log_ns.abs_diff(first_log_ns);
        is_long || limits.duration_ns.is_some_and(|limit_ns| age_ns >= limit_ns)
    }

    fn write(&mut self, topic: usize, times: Times, data: &[u8]) -> Result<(), RecordError> {
        self.recorder.write(self.ids[topic], times, data)?;
        self.first_log_ns.get_or_insert(times.log_ns);
        let message_bytes = data.len() as u64 + MESSAGE_OVERHEAD_BYTES;
        let written_bytes = self.recorder.written_bytes();
        if written_bytes == self.written_bytes {
            self.pending_bytes += message_bytes;
        } else {
            self.num_chunks += 1;
            // A chunk was closed, with or without this message; assume without.
            self.written_bytes = written_bytes;
            self.pending_bytes = message_bytes;
        }
        Ok(())
    }

    fn flush(&mut self) -> Result<(), RecordError> {
        self.recorder.flush()?;
        let written_bytes = self.recorder.written_bytes();
        self.num_chunks += u64::from(written_bytes > self.written_bytes);
        self.written_bytes = written_bytes;
        self.pending_bytes = 0;
        Ok(())
    }
}

fn make_new(directory: &Path) -> Result<(), RecordError> {
    let io_error = |source| RecordError::Io { path: directory.into(), source };
    if let Some(parent) = directory.parent() {
        fs::create_dir_all(parent).map_err(io_error)?;
    }
    fs::create_dir(directory).map_err(|source| match source.kind() {
        io::ErrorKind::AlreadyExists => RecordError::Exists(directory.into()),
        _ => io_error(source),
    })
}
