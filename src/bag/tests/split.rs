//! Bags in several files: each file opens alone, and together they hold all messages.

use std::sync::Arc;

use super::*;
use crate::bag::metadata::{BagInformation, MetadataFile};
use crate::bag::{RecordError, SplitLimits, SplitRecorder};

const SECOND_NS: i64 = 1_000_000_000;

fn create(directory: &Path, limits: SplitLimits) -> SplitRecorder {
    let latched = Topic {
        qos: crate::bag::qos::to_yaml(&[QosProfile::latched(1)]),
        ..topic("/stream_status")
    };
    let topics = vec![topic("/profile"), latched];
    let mut bag = SplitRecorder::create(directory, Compression::None, limits, topics).unwrap();
    bag.describe(parameters(), Some(calibration())).unwrap();
    bag
}

fn write(bag: &mut SplitRecorder, topic: usize, log_ns: i64, data: &[u8]) {
    let times = Times { log_ns, publish_ns: (log_ns - 5).max(0), sequence: (log_ns / 1000) as u32 };
    bag.write(topic, times, &data.into()).unwrap();
}

fn information(directory: &Path) -> BagInformation {
    let text = fs::read_to_string(directory.join("metadata.yaml")).unwrap();
    serde_saphyr::from_str::<MetadataFile>(&text).unwrap().rosbag2_bagfile_information
}

/// Names and times of the messages of a file or a bag.
fn times(path: &Path) -> Vec<(String, i64, i64)> {
    let (messages, errors) = read_all(path, &ReadOptions::default()).unwrap();
    assert!(errors.is_empty(), "{errors:?}");
    messages
        .iter()
        .map(|message| (message.topic.name.clone(), message.log_time_ns, message.publish_time_ns))
        .collect()
}

#[test]
fn every_file_opens_alone_and_is_self_contained() {
    let place = tempfile::tempdir().unwrap();
    let directory = place.path().join("bag");
    let mut bag = create(&directory, SplitLimits { duration_ns: Some(10), bytes: None });
    for (topic, log_ns) in [(1, 1_000), (0, 1_005), (0, 1_010), (0, 1_015), (1, 1_030)] {
        write(&mut bag, topic, log_ns, b"x");
    }
    let summary = bag.finish().unwrap();
    assert_eq!((summary.files, summary.messages), (3, 6));

    let file = |number: usize| directory.join(format!("bag_{number}.mcap"));
    let lengths = [0, 1, 2].map(|number| fs::metadata(file(number)).unwrap().len());
    assert_eq!(summary.bytes, lengths.iter().sum::<u64>());
    let (profile, status) = ("/profile".to_owned(), "/stream_status".to_owned());
    let first = vec![(status.clone(), 1_000, 995), (profile.clone(), 1_005, 1_000)];
    // The status was sent before the second file began; that file repeats it with its publish time.
    let second = vec![
        (status.clone(), 1_010, 995),
        (profile.clone(), 1_010, 1_005),
        (profile, 1_015, 1_010),
    ];
    let third = vec![(status, 1_030, 1_025)];
    for (number, expected) in [&first, &second, &third].into_iter().enumerate() {
        let alone = BagReader::open(&file(number), &ReadOptions::default()).unwrap();
        assert!(alone.is_indexed() && alone.notes().is_empty());
        assert_eq!(alone.topics().len(), 2);
        assert_eq!(alone.metadata().next().unwrap().unwrap(), parameters());
        assert_eq!(alone.attachments().map(Result::unwrap).collect::<Vec<_>>(), [calibration()]);
        assert_eq!(times(&file(number)), *expected);
    }
    assert_eq!(times(&directory), [first, second, third].concat());

    let known = information(&directory);
    assert_eq!((known.version, known.message_count), (9, 6));
    assert_eq!(known.relative_file_paths, ["bag_0.mcap", "bag_1.mcap", "bag_2.mcap"]);
    assert_eq!(known.starting_time.nanoseconds_since_epoch, 1_000);
    assert_eq!(known.duration.nanoseconds, 30);
    let counts: Vec<_> = known.topics_with_message_count.iter().map(|t| t.message_count).collect();
    assert_eq!(counts, [3, 3]);
    let files: Vec<_> = known
        .files
        .iter()
        .map(|file| {
            (
                file.starting_time.nanoseconds_since_epoch,
                file.duration.nanoseconds,
                file.message_count,
            )
        })
        .collect();
    assert_eq!(files, [(1_000, 5, 2), (1_010, 5, 3), (1_030, 0, 1)]);
}

#[test]
fn a_file_exceeds_its_limit_by_no_more_than_its_description_and_index() {
    let place = tempfile::tempdir().unwrap();
    let directory = place.path().join("bag");
    let mut bag = create(&directory, SplitLimits { bytes: Some(100_000), duration_ns: None });
    for number in 0..100 {
        write(&mut bag, 0, number, &[7; 9_000]);
        if number % 7 == 0 {
            bag.flush().unwrap();
        }
    }
    let summary = bag.finish().unwrap();
    assert!((10..=13).contains(&summary.files), "{}", summary.files);
    for number in 0..summary.files {
        let bytes = fs::metadata(directory.join(format!("bag_{number}.mcap"))).unwrap().len();
        assert!(bytes < 100_000 + 8_000, "{number}: {bytes}");
    }
    assert_eq!(times(&directory).len(), 100);
}

#[test]
fn a_message_longer_than_the_limit_gets_its_own_file_and_is_repeated_once_per_file() {
    let place = tempfile::tempdir().unwrap();
    let directory = place.path().join("bag");
    let mut bag = create(&directory, SplitLimits { bytes: Some(1_000), duration_ns: None });
    write(&mut bag, 1, 0, &[7; 5_000]);
    for number in 1..=9 {
        write(&mut bag, 0, number, &[7; 280]);
    }
    let summary = bag.finish().unwrap();
    // The long message alone, then three messages per file; the repeated long message does not count toward the limit.
    assert_eq!((summary.files, summary.messages), (4, 1 + 9 + 3));
}

#[test]
fn a_clock_set_back_starts_a_new_file_and_loses_nothing() {
    let place = tempfile::tempdir().unwrap();
    let directory = place.path().join("bag");
    let limits = SplitLimits { duration_ns: Some(60 * SECOND_NS as u64), bytes: None };
    let mut bag = create(&directory, limits);
    for second in [7200, 7201, 3600, 3601] {
        write(&mut bag, 0, second * SECOND_NS, b"x");
    }
    assert_eq!(bag.finish().unwrap().files, 2);
    assert_eq!(times(&directory).len(), 4);
    assert_eq!(information(&directory).duration.nanoseconds, 3601 * SECOND_NS);
}

#[test]
fn an_unfinished_bag_holds_all_flushed_messages() {
    let place = tempfile::tempdir().unwrap();
    let directory = place.path().join("bag");
    let mut bag = create(&directory, SplitLimits { duration_ns: Some(10), bytes: None });
    for log_ns in [0, 5, 10, 15, 20] {
        write(&mut bag, 0, log_ns, b"x");
    }
    bag.flush().unwrap();
    // As after kill -9: no destructor runs.
    std::mem::forget(bag);
    assert!(!directory.join("metadata.yaml").exists());
    assert_eq!(read_all(&directory, &ReadOptions::default()).unwrap().0.len(), 5);
}

#[test]
fn if_the_next_file_cannot_be_created_the_earlier_ones_form_a_complete_bag() {
    let place = tempfile::tempdir().unwrap();
    let directory = place.path().join("bag");
    let mut bag = create(&directory, SplitLimits { duration_ns: Some(10), bytes: None });
    fs::create_dir(directory.join("bag_1.mcap")).unwrap();
    write(&mut bag, 0, 0, b"x");
    let error = bag.write(0, Times { log_ns: 10, ..Times::default() }, &Arc::from(*b"x"));
    assert!(error.unwrap_err().to_string().contains("bag_1.mcap"));
    assert!(matches!(bag.flush(), Err(RecordError::Stopped(_))));
    assert_eq!(bag.finish().unwrap().messages, 1);
    assert_eq!(information(&directory).relative_file_paths, ["bag_0.mcap"]);
    assert_eq!(times(&directory).len(), 1);
}

#[test]
fn wrong_calls_are_refused_and_harm_nothing() {
    let place = tempfile::tempdir().unwrap();
    let directory = place.path().join("bag");
    let mut bag = create(&directory, SplitLimits::default());
    let again =
        SplitRecorder::create(&directory, Compression::None, SplitLimits::default(), vec![]);
    assert!(matches!(again, Err(RecordError::Exists(_))));
    let data = Arc::from(*b"x");
    let unknown = bag.write(2, Times::default(), &data);
    assert!(matches!(unknown, Err(RecordError::Format { .. })));
    let early = bag.write(0, Times { log_ns: -1, ..Times::default() }, &data);
    assert!(matches!(early, Err(RecordError::NegativeTime { .. })));
    write(&mut bag, 0, 1, b"x");
    assert_eq!(bag.finish().unwrap().messages, 1);
}

#[test]
fn the_description_can_change_and_the_last_one_is_valid() {
    let place = tempfile::tempdir().unwrap();
    let directory = place.path().join("bag");
    let mut bag = create(&directory, SplitLimits { duration_ns: Some(10), bytes: None });
    write(&mut bag, 0, 0, b"x");
    let changed = MetadataRecord { entries: [("a".into(), "2".into())].into(), ..parameters() };
    bag.describe(changed.clone(), None).unwrap();
    write(&mut bag, 0, 10, b"x");
    bag.finish().unwrap();
    let descriptions = |number: usize| {
        let path = directory.join(format!("bag_{number}.mcap"));
        let bag = BagReader::open(&path, &ReadOptions::default()).unwrap();
        let own = bag.metadata().map(Result::unwrap).filter(|record| record.name != "rosbag2");
        (own.collect::<Vec<_>>(), bag.attachments().count())
    };
    assert_eq!(descriptions(0), (vec![parameters(), changed.clone()], 1));
    assert_eq!(descriptions(1), (vec![changed], 0));
}
