//! The recording of a report: which of its topics belong together, and what it says of itself.

use std::{collections::BTreeMap, path::PathBuf};

use super::Notes;
use crate::{
    bag::{BagError, BagReader, Filter, RawMessage, ReadOptions},
    cli::results::{RECORD_LIMIT_BYTES, ResultsArgs},
    msg::{
        laser_profiler_msgs::Centerline,
        schema::Message as _,
        sensor_msgs::{CompressedImage, Image, PointCloud2},
    },
};

/// Where a simulated recording keeps its truth: no result.
const TRUTH: &str = "/truth/";

/// An open recording.
pub(in crate::cli) struct Source {
    pub(in crate::cli) path: PathBuf,
    pub(in crate::cli) bag: BagReader,
    /// What the names of the camera's results begin with, as in `/laser_profiler/`; none without results.
    pub(in crate::cli) prefix: Option<String>,
    /// The program's own record: version, parameters, input; empty without.
    pub(in crate::cli) record: BTreeMap<String, String>,
    /// Text of the calibration, where there is one.
    pub(in crate::cli) calibration: Option<String>,
}

impl Source {
    /// Opens a recording and says what is missing in it.
    ///
    /// # Errors
    /// No recording there.
    pub(in crate::cli) fn open(args: &ResultsArgs, notes: &mut Notes) -> anyhow::Result<Self> {
        let options =
            ReadOptions { record_limit_bytes: RECORD_LIMIT_BYTES, ..ReadOptions::default() };
        let bag = BagReader::open(&args.bag, &options)?;
        for note in bag.notes() {
            notes.tell(note);
        }
        let prefix = choose(&bag, args.topic.as_deref(), notes);
        let mut record = BTreeMap::new();
        for found in bag.metadata() {
            match found {
                Ok(found) if found.name == "laser_profiler" => record = found.entries,
                Ok(_) => {}
                Err(error) => tell(notes, &error),
            }
        }
        let mut calibration = None;
        for file in bag.attachments() {
            match file {
                Ok(file) if file.name == "calibration.yaml" => {
                    calibration = Some(String::from_utf8_lossy(&file.data).into_owned());
                }
                Ok(_) => {}
                Err(error) => tell(notes, &error),
            }
        }
        if record.is_empty() {
            notes.tell("the recording says nothing of parameters and version: it is not a result of this program, or its beginning is missing");
        }
        Ok(Self { path: args.bag.clone(), bag, prefix, record, calibration })
    }

    /// The full name of a result, where the recording has that topic.
    pub(in crate::cli) fn topic(&self, name: &str) -> Option<String> {
        let name = format!("{}{name}", self.prefix.as_ref()?);
        self.bag.topics().iter().any(|topic| topic.name == name).then_some(name)
    }

    /// How many messages a topic has, as far as the recording knows.
    pub(in crate::cli) fn num_messages(&self, topic: &str) -> Option<u64> {
        self.bag.message_counts()?.get(topic).copied()
    }

    /// Hands on the messages of topics; what cannot be read is told and passed over.
    pub(in crate::cli) fn read(
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
                        notes.lose(format!("{}: {error:#}", message.topic.name));
                    }
                    messages.recycle(message.data);
                }
                Err(error) => tell(notes, &error),
            }
        }
    }

    /// Topics with images that the program did not publish.
    pub(super) fn image_topics(&self) -> Vec<String> {
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

/// Tells of an error: as a loss where messages are missing because of it.
pub(in crate::cli) fn tell(notes: &mut Notes, error: &BagError) {
    if error.is_loss() { notes.lose(error.to_string()) } else { notes.tell(error.to_string()) }
}

/// What the results' names begin with: by the named cloud, else by the centrelines, else by the clouds.
fn choose(bag: &BagReader, cloud: Option<&str>, notes: &mut Notes) -> Option<String> {
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
        notes.tell("the recording has no centrelines: neither stripe nor its quality can be shown");
        prefixes = with(PointCloud2::TYPE.name, "points");
    }
    if prefixes.len() > 1 {
        notes.tell(format!(
            "several cameras: {} is shown, --topic {}points shows the next",
            prefixes[0], prefixes[1]
        ));
    }
    prefixes.into_iter().next()
}
