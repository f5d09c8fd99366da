//! Round trip: recorded content is read back, and equal input gives equal bytes.

use std::fs;

use proptest::prelude::*;

use super::*;
use crate::bag::metadata::MetadataFile;
use crate::bag::{Messages, RecordError};

#[test]
fn every_compression_preserves_topics_messages_attachments_and_metadata() {
    for compression in COMPRESSIONS {
        let directory = tempfile::tempdir().unwrap();
        let output = directory.path().join("bag");
        let summary = record(&output, compression, &small_entries(), 5);
        assert_eq!(summary.bytes, fs::metadata(&summary.file).unwrap().len());
        assert_eq!(
            summary.topics,
            [("/image_raw", 6), ("/profile", 6), ("/silent", 0)].map(|(t, n)| (t.into(), n))
        );

        let bag = BagReader::open(&output, &ReadOptions::default()).unwrap();
        assert!(bag.is_indexed() && bag.notes().is_empty(), "{:?}", bag.notes());
        let topics: Vec<_> = bag.topics().iter().map(|topic| (**topic).clone()).collect();
        assert_eq!(topics, ["/image_raw", "/profile", "/silent"].map(topic));
        assert_eq!(bag.message_counts().unwrap()["/profile"], 6);
        assert_eq!(bag.attachments().collect::<Result<Vec<_>, _>>().unwrap(), [calibration()]);
        let metadata: Vec<_> = bag.metadata().collect::<Result<_, _>>().unwrap();
        assert_eq!(metadata[0], parameters());
        assert_eq!(metadata[1].name, "rosbag2");
        let (messages, errors) = read_all(&output, &ReadOptions::default()).unwrap();
        assert!(errors.is_empty(), "{errors:?}");
        assert_eq!(essence(&messages), expected(&small_entries()));
    }
}

/// Some readers date a chunk without messages to 1970; others reject the file.
#[test]
fn every_chunk_has_messages() {
    let directory = tempfile::tempdir().unwrap();
    let output = directory.path().join("bag");
    let mut recorder = Recorder::create(&output, RecordOptions::default()).unwrap();
    let first = recorder.add_topic(&topic("/image_raw")).unwrap();
    recorder.metadata(&parameters()).unwrap();
    recorder.flush().unwrap();
    for time_ns in [1_000, 1_500, 1_600] {
        recorder.write(first, entry(0, time_ns, b"x").1, b"x").unwrap();
    }
    let second = recorder.add_topic(&topic("/profile")).unwrap();
    recorder.attach(&calibration()).unwrap();
    recorder.flush().unwrap();
    recorder.write(second, entry(1, 2_000, b"y").1, b"y").unwrap();
    let bytes = fs::read(recorder.finish().unwrap().file).unwrap();
    let summary = mcap::Summary::read(&bytes).unwrap().unwrap();
    let starts: Vec<_> =
        summary.chunk_indexes.iter().map(|chunk| chunk.message_start_time).collect();
    assert_eq!(starts, [1_000, 1_500, 2_000]);
}

#[test]
fn a_filter_takes_its_topics_only() {
    let directory = tempfile::tempdir().unwrap();
    record(&directory.path().join("bag"), Compression::Lz4, &small_entries(), 3);
    let bag = BagReader::open(&directory.path().join("bag"), &ReadOptions::default()).unwrap();
    let names: Vec<_> = bag
        .messages(&Filter::topics(["/profile", "/absent"]))
        .map(|message| message.unwrap().topic.name.clone())
        .collect();
    assert_eq!(names, ["/profile"; 6]);
}

#[test]
fn chunks_without_a_wanted_topic_are_not_opened() {
    let directory = tempfile::tempdir().unwrap();
    let output = directory.path().join("bag");
    let file =
        record(&output, Compression::None, &[entry(0, 10, &[1; 300]), entry(1, 20, b"x")], 1).file;
    let mut bytes = fs::read(&file).unwrap();
    let payload = bytes.windows(300).position(|window| window == [1; 300]).unwrap();
    bytes[payload] = 2;
    fs::write(&file, bytes).unwrap();
    let bag = BagReader::open(&output, &ReadOptions::default()).unwrap();
    assert!(bag.messages(&Filter::topics(["/profile"])).all(|item| item.is_ok()));
    assert!(bag.messages(&Filter::topics(["/image_raw"])).any(|item| item.is_err()));
}

#[test]
fn the_same_input_gives_the_same_bytes() {
    let directory = tempfile::tempdir().unwrap();
    for compression in COMPRESSIONS {
        let [first, second] = ["a", "b"].map(|place| {
            let output = directory.path().join(format!("{place}_{compression:?}")).join("bag");
            let file = record(&output, compression, &small_entries(), 4).file;
            (fs::read(file).unwrap(), fs::read(output.join("metadata.yaml")).unwrap())
        });
        assert!(first == second, "{compression:?}");
    }
}

#[test]
fn metadata_has_the_fields_of_rosbag2() {
    let directory = tempfile::tempdir().unwrap();
    let output = directory.path().join("bag");
    record(&output, Compression::Zstd, &small_entries(), 5);
    let text = fs::read_to_string(output.join("metadata.yaml")).unwrap();
    let information =
        serde_saphyr::from_str::<MetadataFile>(&text).unwrap().rosbag2_bagfile_information;
    assert_eq!((information.version, information.message_count), (9, 12));
    assert_eq!(information.starting_time.nanoseconds_since_epoch, 1_000);
    assert_eq!(information.duration.nanoseconds, 1_100);
    assert_eq!(information.relative_file_paths, ["bag_0.mcap"]);
    for line in ["  compression_format: \"\"", "  custom_data: null", "  storage_identifier: mcap"]
    {
        assert!(text.lines().any(|found| found == line), "{line} is not in\n{text}");
    }
    let bag = BagReader::open(&output, &ReadOptions::default()).unwrap();
    let own = bag.metadata().map(Result::unwrap).find(|record| record.name == "rosbag2").unwrap();
    assert!(own.entries["serialized_metadata"].starts_with("version: 9\n"));
}

#[test]
fn files_of_a_bag_follow_one_another_in_the_listed_order() {
    let directory = tempfile::tempdir().unwrap();
    let later =
        record(&directory.path().join("x"), Compression::None, &[entry(0, 90, b"later")], 1);
    let early =
        record(&directory.path().join("y"), Compression::None, &[entry(0, 10, b"early")], 1);
    let output = directory.path().join("whole");
    fs::create_dir(&output).unwrap();
    fs::rename(early.file, output.join("whole_2.mcap")).unwrap();
    fs::rename(later.file, output.join("whole_10.mcap")).unwrap();
    let (messages, errors) = read_all(&output, &ReadOptions::default()).unwrap();
    assert!(errors.is_empty());
    assert_eq!(
        messages.iter().map(|message| message.data.as_slice()).collect::<Vec<_>>(),
        [b"early", b"later"]
    );
}

#[test]
fn an_existing_output_is_replaced_only_when_forced_and_only_when_a_bag() {
    let directory = tempfile::tempdir().unwrap();
    let output = directory.path().join("bag");
    record(&output, Compression::None, &small_entries(), 5);
    fs::write(output.join("notes.txt"), "mine").unwrap();
    let force = RecordOptions { force: true, ..RecordOptions::default() };
    assert!(matches!(
        Recorder::create(&output, RecordOptions::default()),
        Err(RecordError::Exists(_))
    ));
    let summary = Recorder::create(&output, force).unwrap().finish().unwrap();
    assert_eq!(summary.messages, 0);
    assert_eq!(fs::read_to_string(output.join("notes.txt")).unwrap(), "mine");
    assert!(read_all(&output, &ReadOptions::default()).unwrap().0.is_empty());

    let foreign = directory.path().join("thesis");
    fs::create_dir(&foreign).unwrap();
    fs::write(foreign.join("thesis.tex"), "years").unwrap();
    for output in [foreign.clone(), foreign.join("thesis.tex")] {
        assert!(
            matches!(Recorder::create(&output, force), Err(RecordError::NotABag(_))),
            "{output:?}"
        );
    }
    assert_eq!(fs::read_to_string(foreign.join("thesis.tex")).unwrap(), "years");
}

#[test]
fn a_wrong_call_is_refused_and_harms_nothing() {
    let directory = tempfile::tempdir().unwrap();
    let mut recorder =
        Recorder::create(&directory.path().join("bag"), RecordOptions::default()).unwrap();
    let id = recorder.add_topic(&topic("/a")).unwrap();
    assert_eq!(recorder.add_topic(&topic("/a")).unwrap(), id);
    let other = Topic { type_name: "std_msgs/msg/Empty".into(), ..topic("/a") };
    assert!(matches!(recorder.add_topic(&other), Err(RecordError::TopicConflict { .. })));
    let before = Times { log_ns: -1, ..Times::default() };
    assert!(matches!(recorder.write(id, before, b""), Err(RecordError::NegativeTime { .. })));
    let reserved = MetadataRecord { name: "rosbag2".into(), entries: [].into() };
    assert!(recorder.metadata(&reserved).is_err());
    recorder.write(id, Times::default(), b"x").unwrap();
    assert_eq!(recorder.finish().unwrap().messages, 1);
}

#[test]
fn the_iterator_may_go_to_another_thread() {
    fn sendable<T: Send + 'static>() {}
    sendable::<Messages>();
    sendable::<Recorder>();
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(48))]

    #[test]
    fn any_messages_are_read_back_in_time_order(
        entries in prop::collection::vec(
            (0..2_usize, 0..5_000_i64, prop::collection::vec(any::<u8>(), 0..300)), 0..60),
        flush_every in 1..20_usize,
        compression in prop::sample::select(COMPRESSIONS.to_vec()),
        use_index: bool,
    ) {
        let entries: Vec<_> =
            entries.into_iter().map(|(topic, time_ns, data)| entry(topic, 10 + time_ns, &data)).collect();
        let directory = tempfile::tempdir().unwrap();
        record(&directory.path().join("bag"), compression, &entries, flush_every);
        let options = ReadOptions { use_index, ..ReadOptions::default() };
        let (messages, errors) = read_all(&directory.path().join("bag"), &options).unwrap();
        prop_assert!(errors.is_empty(), "{:?}", errors);
        prop_assert_eq!(essence(&messages), expected(&entries));
    }
}

#[test]
fn more_topics_than_the_format_holds_are_refused() {
    let directory = tempfile::tempdir().unwrap();
    let mut recorder =
        Recorder::create(&directory.path().join("bag"), RecordOptions::default()).unwrap();
    // Without a schema: only their number matters.
    let topic = |number: usize| Topic {
        type_name: String::new(),
        schema: Vec::new(),
        qos: String::new(),
        ..topic(&format!("/t{number}"))
    };
    for number in 0..65_534 {
        recorder.add_topic(&topic(number)).unwrap();
    }
    let error = recorder.add_topic(&topic(65_534)).unwrap_err();
    assert!(matches!(error, RecordError::Format { .. }), "{error}");
    let last = recorder.add_topic(&topic(65_533)).unwrap();
    recorder.write(last, Times::default(), b"x").unwrap();
    let summary = recorder.finish().unwrap();
    assert_eq!((summary.topics.len(), summary.messages), (65_534, 1));
}
