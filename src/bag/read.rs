//! A bag that is open for reading.

use std::collections::{BTreeMap, BTreeSet};
use std::ops::RangeInclusive;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use super::error::Fault;
use super::format::{RecordSpan, Source};
use super::layout::{Layout, PartKind};
use super::pictures::Series;
use super::{
    Attachment, BagError, Filter, Messages, MetadataRecord, Topic, content, import, place,
};

/// Options for reading a bag.
#[derive(Clone, Copy, Debug)]
pub struct ReadOptions {
    /// Limit on the size of a record or chunk (compressed or not) that is loaded into memory, bytes. Longer ones count
    /// as damage. The default allows a message of 64 MiB and the rest of its chunk.
    pub(crate) record_limit_bytes: usize,
    /// True to use a valid index; false to scan the whole file.
    pub(crate) use_index: bool,
}

impl Default for ReadOptions {
    fn default() -> Self {
        Self { record_limit_bytes: 80 << 20, use_index: true }
    }
}

/// A rosbag2 directory or a bare `.mcap`.
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
    options: ReadOptions,
}

impl BagReader {
    /// Opens a bag.
    ///
    /// # Errors
    /// There is no bag, a file is not MCAP, the storage is not supported, a path leaves the directory, a listed file is
    /// missing.
    pub fn open(path: &Path, options: &ReadOptions) -> Result<Self, BagError> {
        let opened = path;
        let place::Files { paths, mut notes } = place::find(path)?;
        let mut files = Vec::new();
        let mut topics = BTreeSet::new();
        for path in paths {
            let mut source = Source::open(&path, options.record_limit_bytes)?;
            let layout = Layout::of(&mut source, options)?;
            notes.extend(layout.notes.iter().cloned());
            if layout.profile != "ros2" {
                notes.push(format!(
                    "{}: the profile is {:?}, not \"ros2\"",
                    path.display(),
                    layout.profile
                ));
            }
            topics.extend(layout.channels.iter().map(|(_, topic)| Arc::clone(topic)));
            files.push((path, Arc::new(layout)));
        }
        Ok(Self {
            path: opened.into(),
            name: opened.file_name().unwrap_or(opened.as_os_str()).to_string_lossy().into_owned(),
            series: None,
            files,
            topics: topics.into_iter().collect(),
            notes,
            options: *options,
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
        Self { path, name, series: Some(series), files: Vec::new(), topics, notes, options }
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
        if let Some(series) = &self.series {
            return Messages::of_series(series, filter.clone(), self.options);
        }
        Messages::new(self.files.iter().cloned(), filter.clone(), self.options)
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
                let mut source = Source::open(path, self.options.record_limit_bytes)?;
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

    pub(super) fn layouts(&self) -> impl Iterator<Item = (&Path, &Layout)> {
        self.files.iter().map(|(path, layout)| (path.as_path(), layout.as_ref()))
    }

    pub(super) fn options(&self) -> &ReadOptions {
        &self.options
    }
}
