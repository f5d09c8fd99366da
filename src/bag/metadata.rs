//! `metadata.yaml`, rosbag2's description of a bag (version 9).

use std::collections::BTreeMap;
use std::fs;
use std::io::Write;
use std::path::Path;

use serde::{Deserialize, Serialize, de::DeserializeOwned};

use super::{RecordError, Topic, qos};
use crate::msg::qos::QosProfile;

/// Maximum size of a `metadata.yaml`, bytes.
pub(super) const METADATA_LIMIT_BYTES: u64 = 16 << 20;

/// The whole file: a single key that holds the content.
#[derive(Debug, Serialize, Deserialize)]
pub(crate) struct MetadataFile {
    /// The content.
    pub(crate) rosbag2_bagfile_information: BagInformation,
}

/// Contents of a bag, in rosbag2's field order.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub(crate) struct BagInformation {
    pub(crate) version: u32,
    pub(crate) storage_identifier: String,
    #[serde(default)]
    pub(crate) duration: Nanoseconds,
    #[serde(default)]
    pub(crate) starting_time: SinceEpoch,
    #[serde(default)]
    pub(crate) message_count: u64,
    #[serde(default)]
    pub(crate) topics_with_message_count: Vec<TopicCount>,
    #[serde(default)]
    pub(crate) compression_format: String,
    #[serde(default)]
    pub(crate) compression_mode: String,
    pub(crate) relative_file_paths: Vec<String>,
    #[serde(default)]
    pub(crate) files: Vec<FileInformation>,
    #[serde(default)]
    pub(crate) custom_data: Option<BTreeMap<String, String>>,
    #[serde(default)]
    pub(crate) ros_distro: Option<String>,
}

/// A span of time.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub(crate) struct Nanoseconds {
    /// Its length.
    pub(crate) nanoseconds: i64,
}

/// A point in time.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub(crate) struct SinceEpoch {
    /// Nanoseconds since the epoch; `i64::MAX` for a bag without messages.
    pub(crate) nanoseconds_since_epoch: i64,
}

/// A topic and its number of messages.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub(crate) struct TopicCount {
    pub(crate) topic_metadata: TopicMetadata,
    pub(crate) message_count: u64,
}

/// A topic.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub(crate) struct TopicMetadata {
    pub(crate) name: String,
    #[serde(rename = "type")]
    pub(crate) type_name: String,
    pub(crate) serialization_format: String,
    #[serde(default)]
    pub(crate) offered_qos_profiles: OfferedQos,
    #[serde(default)]
    pub(crate) type_description_hash: String,
}

/// A list since version 9; before, a string that holds a list.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[serde(untagged)]
pub(crate) enum OfferedQos {
    /// Version 9.
    Profiles(Vec<QosProfile>),
    /// Before version 9; also any text that cannot be parsed.
    Text(String),
}

impl Default for OfferedQos {
    fn default() -> Self {
        Self::Profiles(Vec::new())
    }
}

/// One file of the bag.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub(crate) struct FileInformation {
    pub(crate) path: String,
    pub(crate) starting_time: SinceEpoch,
    pub(crate) duration: Nanoseconds,
    pub(crate) message_count: u64,
}

/// Summary of a file written by the recorder.
#[derive(Debug)]
pub(super) struct Recorded {
    /// File name.
    pub(super) file: String,
    /// Times of the earliest and the latest message, nanoseconds since the epoch.
    pub(super) bounds_ns: Option<(i64, i64)>,
    /// Topics in the order in which they were added, and their numbers of messages.
    pub(super) topics: Vec<(Topic, u64)>,
}

impl Recorded {
    fn information(&self) -> FileInformation {
        let (starting_time, duration) = span(self.bounds_ns);
        FileInformation {
            path: self.file.clone(),
            starting_time,
            duration,
            message_count: self.topics.iter().map(|(_, count)| count).sum(),
        }
    }
}

/// Start and length of the span between two times.
fn span(bounds_ns: Option<(i64, i64)>) -> (SinceEpoch, Nanoseconds) {
    let (start, length) =
        bounds_ns.map_or((i64::MAX, 0), |(first, last)| (first, last.saturating_sub(first)));
    (SinceEpoch { nanoseconds_since_epoch: start }, Nanoseconds { nanoseconds: length })
}

/// Writes `metadata.yaml` atomically.
pub(super) fn write(directory: &Path, files: &[Recorded]) -> Result<(), RecordError> {
    let path = directory.join("metadata.yaml");
    let text = BagInformation::of(files)
        .into_file()
        .map_err(|error| RecordError::Format { path: path.clone(), what: error.to_string() })?;
    let unfinished = path.with_extension("yaml.unfinished");
    let write = || {
        // It may be a link to elsewhere.
        if fs::symlink_metadata(&unfinished).is_ok() {
            fs::remove_file(&unfinished)?;
        }
        fs::File::create_new(&unfinished)?.write_all(text.as_bytes())?;
        fs::rename(&unfinished, &path)
    };
    write().map_err(|source| RecordError::Io { path: path.clone(), source })
}

/// Reads a YAML text of rosbag2, which has no references. Each could repeat a text of megabytes.
pub(super) fn from_yaml<T: DeserializeOwned>(text: &str) -> Result<T, serde_saphyr::Error> {
    let options = serde_saphyr::options! { budget: serde_saphyr::budget! { max_aliases: 0 } };
    serde_saphyr::from_str_with_options(text, options)
}

impl BagInformation {
    /// Returns the description of a bag with these files.
    pub(super) fn of(files: &[Recorded]) -> Self {
        let bounds_ns = files
            .iter()
            .filter_map(|file| file.bounds_ns)
            .reduce(|(first, last), (start, end)| (first.min(start), last.max(end)));
        let (starting_time, duration) = span(bounds_ns);
        let (mut topics, mut places) = (Vec::<(&Topic, u64)>::new(), BTreeMap::new());
        for (topic, count) in files.iter().flat_map(|file| &file.topics) {
            let place = *places.entry(&topic.name).or_insert(topics.len());
            match topics.get_mut(place) {
                Some((_, sum)) => *sum += count,
                None => topics.push((topic, *count)),
            }
        }
        let files: Vec<_> = files.iter().map(Recorded::information).collect();
        Self {
            version: 9,
            storage_identifier: "mcap".into(),
            duration,
            starting_time,
            message_count: files.iter().map(|file| file.message_count).sum(),
            topics_with_message_count: topics
                .into_iter()
                .map(|(topic, count)| TopicCount::of(topic, count))
                .collect(),
            compression_format: String::new(),
            compression_mode: String::new(),
            relative_file_paths: files.iter().map(|file| file.path.clone()).collect(),
            files,
            custom_data: None,
            // No ROS distribution wrote the bag. The rosbags library writes its own name here, too.
            ros_distro: Some(env!("CARGO_PKG_NAME").into()),
        }
    }

    /// Reads the YAML of the `rosbag2` metadata record.
    pub(super) fn of_yaml(text: &str) -> Option<Self> {
        from_yaml(text).ok()
    }

    /// True if the messages are compressed one by one.
    pub(super) fn has_packed_messages(&self) -> bool {
        self.compression_mode.eq_ignore_ascii_case("message")
    }

    /// Returns the YAML of the `rosbag2` metadata record.
    pub(super) fn to_yaml(&self) -> Result<String, serde_saphyr::ser::Error> {
        serde_saphyr::to_string(self)
    }

    /// Returns the content of `metadata.yaml`.
    pub(super) fn into_file(self) -> Result<String, serde_saphyr::ser::Error> {
        serde_saphyr::to_string(&MetadataFile { rosbag2_bagfile_information: self })
    }
}

impl TopicCount {
    fn of(topic: &Topic, message_count: u64) -> Self {
        Self {
            topic_metadata: TopicMetadata {
                name: topic.name.clone(),
                type_name: topic.type_name.clone(),
                serialization_format: topic.message_encoding.clone(),
                offered_qos_profiles: OfferedQos::Profiles(
                    qos::parse(&topic.qos).unwrap_or_default(),
                ),
                type_description_hash: topic.type_hash.clone(),
            },
            message_count,
        }
    }
}
