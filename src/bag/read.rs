//! A bag that is open for reading.

use std::collections::BTreeMap;
use std::ops::RangeInclusive;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use super::channels::Known;
use super::error::Fault;
use super::find::{self, FoundFile, State};
use super::format::{RecordSpan, Source};
use super::layout::{Layout, PartKind};
use super::open::Opener;
use super::pictures::Series;
use super::{Attachment, BagError, Filter, Messages, MetadataRecord, Topic, content, import};

/// Room in a record beside the largest image, for its header and the other messages of its chunk, bytes.
const RECORD_MARGIN_BYTES: u64 = 16 << 20;

/// Limit on the size of the schemas and topics of all files of a bag, bytes. Topics that files have in common count once.
const MAX_CHANNEL_BYTES: usize = 512 << 20;

/// Options for reading a bag.
#[derive(Clone, Copy, Debug)]
pub struct ReadOptions {
    /// Limit on the size of a record or chunk (compressed or not) that is loaded into memory, bytes. Longer ones count
    /// as damage. The default allows a message of 64 MiB and the rest of its chunk.
    pub(crate) record_limit_bytes: usize,
    /// Limit on the size of a picture file and of its pixels, bytes: `max_frame_bytes` of parameters and options.
    pub(crate) max_frame_bytes: u64,
    /// True to use a valid index; false to scan the whole file.
    pub(crate) use_index: bool,
}

impl ReadOptions {
    /// Options for images of up to `max_frame_bytes`.
    pub(crate) fn for_frames(max_frame_bytes: u64) -> Self {
        let limit_bytes = max_frame_bytes.saturating_add(RECORD_MARGIN_BYTES);
        let record_limit_bytes = usize::try_from(limit_bytes).unwrap_or(usize::MAX);
        Self { record_limit_bytes, max_frame_bytes, use_index: true }
    }
}

impl Default for ReadOptions {
    fn default() -> Self {
        Self::for_frames(64 << 20)
    }
}

/// A rosbag2 directory or a bare `.mcap`, also compressed as a whole (`.mcap.zstd`).
///
/// A file with a valid index is read through it; any other is scanned once when it is opened.
#[derive(Debug)]
pub struct BagReader {
    /// The path by which it was opened.
    path: PathBuf,
    /// Its name for users.
    name: String,
    /// Pictures or a video instead of files.
    series: Option<Series>,
    files: Vec<(PathBuf, Arc<Layout>)>,
    topics: Vec<Arc<Topic>>,
    notes: Vec<String>,
    stated_messages: Option<u64>,
    opener: Arc<Opener>,
}

impl BagReader {
    /// Opens a bag. A file that is missing or cannot be read costs only its own messages: it is read as damage.
    ///
    /// # Errors
    /// There is no bag, or nothing in it can be read.
    pub fn open(path: &Path, options: &ReadOptions) -> Result<Self, BagError> {
        let mut found = find::find(path)?;
        let opener = Arc::new(Opener::new(options.record_limit_bytes));
        let is_bare = found.files.len() == 1 && found.files.iter().all(|file| file.path == path);
        let mut files = Vec::new();
        let mut known = Known::default();
        let mut room_bytes = MAX_CHANNEL_BYTES;
        let mut notes = std::mem::take(&mut found.notes);
        for file in found.files {
            let FoundFile { path, lost, state } = file;
            let mut layout = match lost {
                Some(why) => Layout::lost(why),
                None => match opener.open(&path).and_then(|mut it| Layout::of(&mut it, options)) {
                    Err(error) if is_bare => return Err(error),
                    Err(BagError::Io { source, .. }) => Layout::lost(source.to_string()),
                    Err(error) => Layout::lost(error.to_string()),
                    Ok(layout) => layout,
                },
            };
            layout.has_packed_messages |= found.has_packed_messages;
            notes.extend(layout.notes.iter().cloned());
            if layout.lost.is_none() && layout.profile != "ros2" {
                notes.push(format!(
                    "{}: the profile is {:?}, not \"ros2\"",
                    path.display(),
                    layout.profile
                ));
            }
            match room_bytes.checked_sub(layout.channels.new_bytes(&known)) {
                Some(rest) => {
                    room_bytes = rest;
                    layout.channels.share(&mut known);
                }
                None => {
                    layout = Layout::lost(format!(
                        "with it, the topics and schemas of the files take more than {MAX_CHANNEL_BYTES} bytes"
                    ));
                }
            }
            files.push((path, layout, state));
        }
        if found.is_order_unknown {
            sort_by_time(&mut files);
        }
        compare(path, &mut files, found.stated_messages, &mut notes);
        let files = files.into_iter().map(|(path, layout, _)| (path, Arc::new(layout))).collect();
        Ok(Self {
            path: path.into(),
            name: path.file_name().unwrap_or(path.as_os_str()).to_string_lossy().into_owned(),
            series: None,
            files,
            topics: known.topics.into_iter().collect(),
            notes,
            stated_messages: found.stated_messages,
            opener,
        })
    }

    /// A series of images, with its path and its name.
    pub(super) fn of_series(
        (path, name): (PathBuf, String),
        series: Series,
        notes: Vec<String>,
        options: ReadOptions,
    ) -> Self {
        let topics = series.topics();
        let opener = Arc::new(Opener::new(options.record_limit_bytes));
        let (files, stated_messages) = (Vec::new(), None);
        Self { path, name, series: Some(series), files, topics, notes, stated_messages, opener }
    }

    /// The path by which it was opened; of single pictures, that of the first.
    pub(crate) fn path(&self) -> &Path {
        &self.path
    }

    /// Its name for users: the last component of its path; of single pictures, the first and last name.
    pub(crate) fn name(&self) -> &str {
        &self.name
    }

    /// True if it is a series of pictures or a video.
    pub(crate) const fn is_pictures(&self) -> bool {
        self.series.is_some()
    }

    /// True if the time between two images is unknown, because they are, or were, pictures without stamps and without a
    /// frame rate.
    pub(crate) fn has_assumed_stamps(&self) -> bool {
        match &self.series {
            Some(series) => series.has_assumed_stamps(),
            None => import::has_assumed_stamps(self).unwrap_or(false),
        }
    }

    /// True if the images are, or were, pictures.
    pub(crate) fn is_of_pictures(&self) -> bool {
        self.is_pictures() || import::has_assumed_stamps(self).is_some()
    }

    /// True for the topic of the images of a series of pictures.
    pub(super) fn is_image(&self, topic: &Topic) -> bool {
        self.series.as_ref().is_some_and(|series| series.is_image(topic))
    }

    /// Number of images of a series; `None` for a recording.
    pub(crate) fn num_pictures(&self) -> Option<u64> {
        self.series.as_ref().map(Series::num_images)
    }

    /// Size of the pictures or the video, bytes; 0 for a recording.
    pub(super) fn series_bytes(&self) -> u64 {
        self.series.as_ref().map_or(0, Series::num_bytes)
    }

    /// Topics of all files, sorted by name. Two entries of the same name differ in type or quality of service.
    pub fn topics(&self) -> &[Arc<Topic>] {
        &self.topics
    }

    /// Notes for the user about irregularities found when the bag was opened.
    pub fn notes(&self) -> &[String] {
        &self.notes
    }

    /// Paths of the files, in order.
    pub fn paths(&self) -> impl Iterator<Item = &Path> {
        self.files.iter().map(|(path, _)| path.as_path())
    }

    /// True if every file is read through its index.
    pub fn is_indexed(&self) -> bool {
        self.files.iter().all(|(_, layout)| layout.is_indexed)
    }

    /// Number of messages by topic name; `None` if a file states none.
    pub(crate) fn message_counts(&self) -> Option<BTreeMap<&str, u64>> {
        let mut counts = self.series.as_ref().map_or_else(BTreeMap::new, |series| series.counts());
        for (_, layout) in &self.files {
            let by_channel = layout.counts.as_ref()?;
            for (channel, topic) in layout.channels.iter() {
                let count: &mut u64 = counts.entry(topic.name.as_str()).or_default();
                // A file may state any number.
                *count = count.saturating_add(by_channel.get(&channel).copied().unwrap_or(0));
            }
        }
        Some(counts)
    }

    /// Times of the first and last message, nanoseconds since the epoch; `None` without messages. An index is trusted.
    pub(crate) fn time_range_ns(&self) -> Option<RangeInclusive<i64>> {
        if let Some(series) = &self.series {
            return series.time_range_ns();
        }
        let parts = self.files.iter().flat_map(|(_, layout)| &layout.parts);
        let ends = parts
            // A chunk without messages states 0 for both times.
            .filter(|part| !matches!(part.kind, PartKind::Damage(_)) && part.end_time > 0)
            .map(|part| (part.start_time, part.end_time));
        let (start, end) =
            ends.reduce(|(first, last), (start, end)| (first.min(start), last.max(end)))?;
        Some(i64::try_from(start).ok()?..=i64::try_from(end).ok()?)
    }

    /// Returns an iterator over the messages. It borrows nothing and may move to another thread.
    pub fn messages(&self, filter: &Filter) -> Messages {
        let opener = Arc::clone(&self.opener);
        let messages = Messages::new(self.files.iter().cloned(), filter.clone(), opener);
        match &self.series {
            Some(series) => messages.with_series(series.messages(filter.clone())),
            None => messages,
        }
    }

    /// Returns an iterator over the attachments. Each may be damaged independently.
    pub(crate) fn attachments(&self) -> impl Iterator<Item = Result<Attachment, BagError>> {
        self.records(|layout| &layout.attachments, content::attachment)
    }

    /// Returns an iterator over the metadata records. Each may be damaged independently.
    pub(crate) fn metadata(&self) -> impl Iterator<Item = Result<MetadataRecord, BagError>> {
        self.records(|layout| &layout.metadata, content::metadata)
    }

    fn records<T>(
        &self,
        spans: fn(&Layout) -> &[RecordSpan],
        parse: fn(&[u8]) -> Result<T, String>,
    ) -> impl Iterator<Item = Result<T, BagError>> {
        self.files.iter().flat_map(move |(path, layout)| {
            spans(layout).iter().map(move |span| {
                let mut source = self.open_file(path)?;
                match source.record_at(span.offset) {
                    Ok(Some(found)) if found == *span => {
                        parse(&source.body(span)?).map_err(|what| source.damaged(span, what))
                    }
                    Err(Fault::Io(error)) => Err(error),
                    _ => {
                        Err(source
                            .damaged(span, "the index lists a record that does not exist".into()))
                    }
                }
            })
        })
    }

    /// Number of messages that `metadata.yaml` states; `None` if it states none.
    pub(super) const fn stated_messages(&self) -> Option<u64> {
        self.stated_messages
    }

    pub(super) fn layouts(&self) -> impl Iterator<Item = (&Path, &Layout)> {
        self.files.iter().map(|(path, layout)| (path.as_path(), layout.as_ref()))
    }

    /// Opens a file of the bag.
    pub(super) fn open_file(&self, path: &Path) -> Result<Source, BagError> {
        self.opener.open(path)
    }
}

type File = (PathBuf, Layout, State);

/// Sorts files by their first message; one without messages keeps its place behind the one before it.
fn sort_by_time(files: &mut Vec<File>) {
    let mut last = 0;
    let mut keyed: Vec<_> = std::mem::take(files)
        .into_iter()
        .map(|file| {
            let times = file.1.parts.iter().filter(|part| part.end_time > 0);
            last = times.map(|part| part.start_time).min().unwrap_or(last);
            (last, file)
        })
        .collect();
    keyed.sort_by_key(|(time, _)| *time);
    files.extend(keyed.into_iter().map(|(_, file)| file));
}

/// Compares the files with the number of messages that `metadata.yaml` states. Missing files whose messages are all in
/// unlisted ones were only renamed.
fn compare(
    directory: &Path,
    files: &mut Vec<File>,
    stated_count: Option<u64>,
    notes: &mut Vec<String>,
) {
    let Some(stated_count) = stated_count else { return };
    let count = |(_, layout, _): &File| {
        let counts = layout.counts.iter().flat_map(BTreeMap::values);
        counts.fold(0_u64, |sum, count| sum.saturating_add(*count))
    };
    let found_count = files.iter().map(count).fold(0_u64, u64::saturating_add);
    let num = |wanted| files.iter().filter(|(_, _, state)| *state == wanted).count();
    let num_missing = num(State::Missing);
    if num_missing > 0 && num_missing <= num(State::Unlisted) && found_count >= stated_count {
        let missing = files.iter().filter(|(_, _, state)| *state == State::Missing);
        for (path, _, _) in missing {
            notes.push(format!("{}: missing, but no message is: renamed?", path.display()));
        }
        files.retain(|(_, _, state)| *state != State::Missing);
    }
    if found_count != stated_count {
        notes.push(format!(
            "{}: metadata.yaml states {stated_count} messages, the files hold {found_count}",
            directory.display()
        ));
    }
}
