//! The results bag as a sink. It contains the parameters, the calibration and the program version.

use std::{collections::BTreeMap, path::Path};

use crate::bag::{
    Attachment, MetadataRecord, RecordError, RecordOptions, Recorder, Times, Topic, TopicId,
};

use super::sink::{Outgoing, Sink, SinkError};

/// Flush period in recording time, nanoseconds: older data stays readable even if this process is killed. Wall-clock
/// time would make chunk boundaries depend on the speed of the machine.
const FLUSH_PERIOD_NS: u64 = 1_000_000_000;

/// Metadata that documents a recording.
#[derive(Clone, Debug, Default)]
pub struct Description {
    /// The effective parameters as canonical YAML.
    pub(crate) parameters: String,
    /// SHA-256 of the parameters that affect the results, as in `Centerline.method`.
    pub(crate) parameters_sha256: String,
    /// Names of the input recordings without their directories, so that equal input gives equal bytes on any machine.
    pub(crate) inputs: Vec<String>,
    /// Input topic.
    pub(crate) input_topic: String,
    /// Text of the calibration, if there is one.
    pub(crate) calibration: Option<String>,
}

impl Description {
    /// Returns the metadata record that every bag contains.
    pub(super) fn record(&self) -> MetadataRecord {
        let entries = [
            ("version", env!("CARGO_PKG_VERSION")),
            ("parameters", &self.parameters),
            ("parameters_sha256", &self.parameters_sha256),
            ("input", &self.inputs.join("\n")),
            ("input_topic", &self.input_topic),
        ];
        let entries = entries.map(|(key, value)| (key.to_owned(), value.to_owned()));
        MetadataRecord { name: "laser_profiler".to_owned(), entries: BTreeMap::from(entries) }
    }

    /// Returns the calibration as an attachment of the bag.
    pub(super) fn calibration_file(&self, log_time_ns: i64) -> Option<Attachment> {
        let text = self.calibration.as_ref()?;
        Some(Attachment {
            name: "calibration.yaml".to_owned(),
            media_type: "application/yaml".to_owned(),
            log_time_ns,
            create_time_ns: 0,
            data: text.clone().into_bytes(),
        })
    }
}

/// A recorder of results.
pub(crate) struct ResultsBag {
    recorder: Option<Recorder>,
    ids: Vec<TopicId>,
    /// The calibration is removed once it is stored.
    description: Description,
    last_flush_ns: Option<i64>,
}

impl ResultsBag {
    /// Creates the bag, registers the topics and writes the description.
    ///
    /// # Errors
    /// The output exists already or cannot be written.
    pub(crate) fn create(
        directory: &Path,
        options: RecordOptions,
        topics: &[Topic],
        description: Description,
    ) -> Result<Self, RecordError> {
        let mut recorder = Recorder::create(directory, options)?;
        let ids = topics.iter().map(|topic| recorder.add_topic(topic)).collect::<Result<_, _>>()?;
        recorder.metadata(&description.record())?;
        // The description is readable even if the run ends within its first second.
        recorder.flush()?;
        Ok(Self { recorder: Some(recorder), ids, description, last_flush_ns: None })
    }

    fn record(&mut self, message: &Outgoing) -> Result<(), RecordError> {
        let Some(recorder) = &mut self.recorder else { return Ok(()) };
        attach(recorder, &mut self.description, message.log_time_ns)?;
        recorder.write(self.ids[message.topic], message.into(), &message.data)?;
        let last_flush_ns = *self.last_flush_ns.get_or_insert(message.log_time_ns);
        if message.log_time_ns.abs_diff(last_flush_ns) >= FLUSH_PERIOD_NS {
            self.last_flush_ns = Some(message.log_time_ns);
            recorder.flush()?;
        }
        Ok(())
    }

    fn close(&mut self) -> Result<(), RecordError> {
        let Some(mut recorder) = self.recorder.take() else { return Ok(()) };
        attach(&mut recorder, &mut self.description, 0)?;
        recorder.finish().map(drop)
    }
}

impl From<&Outgoing> for Times {
    fn from(message: &Outgoing) -> Self {
        Self {
            log_ns: message.log_time_ns,
            publish_ns: message.publish_time_ns,
            sequence: message.sequence,
        }
    }
}

/// Wraps an error of the recorder, which names the file itself.
fn sink_error(error: RecordError) -> SinkError {
    SinkError { sink: "recording".to_owned(), source: Box::new(error) }
}

/// Stores the calibration once, with the time of the first message.
fn attach(
    recorder: &mut Recorder,
    description: &mut Description,
    log_time_ns: i64,
) -> Result<(), RecordError> {
    let Some(attachment) = description.calibration_file(log_time_ns) else { return Ok(()) };
    description.calibration = None;
    recorder.attach(&attachment)
}

impl Sink for ResultsBag {
    fn write(&mut self, message: &Outgoing) -> Result<(), SinkError> {
        self.record(message).map_err(sink_error)
    }

    fn finish(&mut self) -> Result<(), SinkError> {
        self.close().map_err(sink_error)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::bag::{BagReader, Filter, ReadOptions};

    fn create(directory: &Path) -> ResultsBag {
        let topic = Topic {
            name: "/a".into(),
            type_name: "a/msg/A".into(),
            message_encoding: "cdr".into(),
            schema_encoding: "ros2msg".into(),
            schema: Vec::new(),
            type_hash: String::new(),
            qos: String::new(),
        };
        let description = Description {
            calibration: Some("type: of_laser".to_owned()),
            ..Description::default()
        };
        ResultsBag::create(directory, RecordOptions::default(), &[topic], description).unwrap()
    }

    fn open(directory: &Path) -> BagReader {
        BagReader::open(directory, &ReadOptions::default()).unwrap()
    }

    #[test]
    fn an_unfinished_recording_is_readable_up_to_the_last_flush() {
        let place = tempfile::tempdir().unwrap();
        let directory = place.path().join("results");
        let mut bag = create(&directory);
        assert_eq!(
            open(&directory).metadata().flatten().count(),
            1,
            "the description, immediately"
        );
        let mut write_at = |log_time_ns| {
            let data = [7; 8].into();
            let publish_time_ns = log_time_ns;
            bag.write(&Outgoing { topic: 0, log_time_ns, publish_time_ns, sequence: 1, data })
                .unwrap();
            open(&directory).messages(&Filter::all()).flatten().count()
        };
        assert_eq!([0, 500_000_000, 1_000_000_000, 1_500_000_000].map(&mut write_at), [1, 1, 3, 3]);
        assert_eq!(write_at(0), 5, "also if time steps back by a second");
    }

    #[test]
    fn a_recording_without_messages_has_its_calibration() {
        let place = tempfile::tempdir().unwrap();
        let directory = place.path().join("results");
        create(&directory).finish().unwrap();
        let attached = open(&directory).attachments().next().unwrap().unwrap();
        assert_eq!(&*attached.data, b"type: of_laser");
    }
}
