//! All topics of one camera in a results bag.

use std::path::{Path, PathBuf};

use super::{Notes, Provenance, ScanSelection, read_options};
use crate::{
    bag::{BagError, BagReader, Filter, RawMessage},
    msg::{
        laser_profiler_msgs::Centerline,
        schema::Message as _,
        sensor_msgs::{CompressedImage, Image, PointCloud2},
    },
};

/// Prefix of the topics with the ground truth of a simulated recording, which are not results.
const TRUTH: &str = "/truth/";

/// An open results bag: one camera's topics, version, parameters and calibration.
pub(crate) struct ResultsRecording {
    path: PathBuf,
    pub(super) bag: BagReader,
    /// Prefix of the camera's topics, such as `/laser_profiler/`; `None` without results.
    prefix: Option<String>,
    provenance: Provenance,
}

impl ResultsRecording {
    /// Opens a results bag and notes missing contents. Of several cameras, chooses the one whose point clouds are on the
    /// selected topic, or the first.
    ///
    /// # Errors
    /// The bag is missing or cannot be read.
    pub(crate) fn open(selection: &ScanSelection, notes: &mut Notes) -> anyhow::Result<Self> {
        let bag = BagReader::open(&selection.bag, &read_options())?;
        bag.notes().iter().for_each(|note| notes.add(note));
        let prefix = choose_prefix(&bag, selection.topic.as_deref(), notes);
        let provenance = Provenance::read(&bag, |error| add_error(notes, error));
        if provenance.record.is_empty() {
            notes.add("the recording states neither parameters nor version: it is not a result of this program, or its beginning is missing");
        }
        Ok(Self { path: selection.bag.clone(), bag, prefix, provenance })
    }

    /// Path of the bag.
    #[must_use]
    pub(crate) fn path(&self) -> &Path {
        &self.path
    }

    /// Version, parameters and calibration.
    #[must_use]
    pub(crate) const fn provenance(&self) -> &Provenance {
        &self.provenance
    }

    /// The bag, for topics and messages of any kind.
    #[must_use]
    pub(crate) const fn bag(&self) -> &BagReader {
        &self.bag
    }

    /// Returns the full name of a topic of the camera, such as `centerline`; `None` if the bag does not have it.
    #[must_use]
    pub(crate) fn topic(&self, name: &str) -> Option<String> {
        let name = format!("{}{name}", self.prefix.as_ref()?);
        self.bag.topics().iter().any(|topic| topic.name == name).then_some(name)
    }

    /// Returns the number of messages on a topic; `None` if the bag has no index.
    #[must_use]
    pub(crate) fn num_messages(&self, topic: &str) -> Option<u64> {
        self.bag.message_counts()?.get(topic).copied()
    }

    /// Calls `take` with every message on the topics. Notes and skips messages that cannot be read or that `take` rejects.
    pub(crate) fn for_each_message(
        &self,
        topics: &[&String],
        notes: &mut Notes,
        mut take: impl FnMut(&RawMessage) -> anyhow::Result<()>,
    ) {
        let mut messages = self.bag.messages(&Filter::topics(topics.iter().copied()));
        while let Some(message) = messages.next() {
            match message {
                Ok(message) => {
                    if let Err(error) = take(&message) {
                        notes.add_loss(format!("{}: {error:#}", message.topic.name));
                    }
                    messages.recycle(message.data);
                }
                Err(error) => add_error(notes, &error),
            }
        }
    }

    /// Returns the topics with images that are not results.
    #[must_use]
    pub(crate) fn image_topics(&self) -> Vec<String> {
        let own = |name: &str| self.prefix.as_ref().is_some_and(|prefix| name.starts_with(prefix));
        let kinds = [Image::TYPE.name, CompressedImage::TYPE.name];
        let topics = self.bag.topics().iter();
        let topics = topics.filter(|topic| kinds.contains(&topic.type_name.as_str()));
        let mut names: Vec<_> =
            topics.filter(|topic| !own(&topic.name)).map(|topic| topic.name.clone()).collect();
        names.dedup();
        names
    }
}

/// Notes an error; as a loss if it costs messages.
pub(crate) fn add_error(notes: &mut Notes, error: &BagError) {
    if error.is_loss() { notes.add_loss(error.to_string()) } else { notes.add(error.to_string()) }
}

/// Returns the prefix of a camera's topics: from the named cloud, otherwise from the centrelines or the clouds.
fn choose_prefix(bag: &BagReader, cloud: Option<&str>, notes: &mut Notes) -> Option<String> {
    if let Some(prefix) = cloud.and_then(|cloud| cloud.strip_suffix("points")) {
        return Some(prefix.to_owned());
    }
    let with = |kind: &str, ending: &str| {
        let topics = bag.topics().iter().filter(|topic| topic.type_name == kind);
        let names = topics.filter(|topic| !topic.name.starts_with(TRUTH));
        let mut prefixes: Vec<String> =
            names.filter_map(|topic| Some(topic.name.strip_suffix(ending)?.to_owned())).collect();
        prefixes.dedup();
        prefixes
    };
    let mut prefixes = with(Centerline::TYPE.name, "centerline");
    if prefixes.is_empty() {
        notes.add("the recording has no centrelines: neither stripe nor its quality can be shown");
        prefixes = with(PointCloud2::TYPE.name, "points");
    }
    if prefixes.len() > 1 {
        notes.add(format!(
            "several cameras: {} is shown, --topic {}points shows the next",
            prefixes[0], prefixes[1]
        ));
    }
    prefixes.into_iter().next()
}
