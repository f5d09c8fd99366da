//! Recordings to replay: bundled ones, real ones, small ones made here whose centrelines are known, rendered ones, and
//! edited copies.

use std::path::{Path, PathBuf};

use laser_profiler::{
    bag::{
        BagReader, Compression, Filter, RawMessage, ReadOptions, RecordOptions, Recorder, Times,
        Topic,
    },
    msg::{
        builtin_interfaces::Time,
        cdr,
        laser_profiler_msgs::Centerline,
        qos::QosProfile,
        schema::{Message, MessageType},
        sensor_msgs::Image,
        std_msgs::Header,
    },
};

use crate::program::{end, laser_profiler, skip};

pub(crate) const WIDTH: u32 = 160;
pub(crate) const HEIGHT: u32 = 32;
/// The stripe is symmetrical about this row, so its centre is there whatever the estimator.
pub(crate) const CENTER_ROW: u32 = 10;
/// Between frames, nanoseconds.
pub(crate) const PERIOD_NS: i64 = 10_000_000;
/// 2026-01-01, so that times have their real size.
const START_NS: i64 = 1_767_225_600_000_000_000;

/// A recording that the project ships.
pub(crate) fn bundled(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("bags").join(name)
}

/// Returns a recording from a real camera, stored beside the repository because no licence allows shipping it. Reports
/// the skip if it is missing.
pub(crate) fn real(name: &str) -> Option<PathBuf> {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../shared/data").join(name);
    if path.exists() {
        return Some(path);
    }
    skip(name, &format!("{} is missing", path.display()));
    None
}

/// Topics of a rendered recording.
pub(crate) const RENDERED_IMAGES: &str = "/camera/image_raw";
pub(crate) const RENDERED_INFO: &str = "/camera/camera_info";

/// Renders a recording of a sloping flat, 320 x 200 pixels at 50 Hz, with its `calibration.yaml`.
pub(crate) fn render_flat(frames: u64, bag: &Path) {
    let scenario = format!(
        "
frames: {frames}
frame_rate_hz: 50.0
start_time_ns: {START_NS}
seed: 7
laser: {{amplitude: 180.0, sigma_px: 2.0}}
rig:
  width_px: 320
  height_px: 200
  lens: {{focal_px: [600.0, 602.0], center_px: [161.0, 98.0], distortion: [-0.2, 0.1, 0, 0, 0, 0, 0, 0]}}
  laser_normal: [0.05, -0.5, 0.85]
  laser_distance_m: 0.25
gauge: {{reflectance: 0.9, slope: [0.05, 0.0], shape: {{flat: {{}}}}}}
"
    );
    let file = bag.with_extension("scenario.yaml");
    std::fs::write(&file, scenario).unwrap();
    let ended = end(laser_profiler(&["simulate", "-o"]).arg(bag).arg(&file));
    assert_eq!(ended.code, Some(0), "{ended:?}");
}

/// Copies topics of a recording with other log times and contents; `None` leaves a message out.
pub(crate) fn copy_edited(
    from: &Path,
    to: &Path,
    topics: &[&str],
    edit: impl Fn(usize, &RawMessage) -> Option<(i64, Vec<u8>)>,
) {
    let reader = BagReader::open(from, &ReadOptions::default()).unwrap();
    let options = RecordOptions { compression: Compression::None, force: false };
    let mut recorder = Recorder::create(to, options).unwrap();
    for &name in topics {
        let topic = reader.topics().iter().find(|topic| topic.name == name).unwrap();
        let id = recorder.add_topic(topic).unwrap();
        for (number, message) in reader.messages(&Filter::topics([name])).enumerate() {
            let message = message.unwrap();
            if let Some((log_ns, bytes)) = edit(number, &message) {
                let times = Times { log_ns, publish_ns: log_ns, sequence: message.sequence };
                recorder.write(id, times, &bytes).unwrap();
            }
        }
    }
    recorder.finish().unwrap();
}

/// CDR bytes of a message.
pub(crate) fn bytes<M: Message>(message: &M) -> Vec<u8> {
    let mut bytes = Vec::new();
    cdr::encode(message, &mut bytes).unwrap();
    bytes
}

/// A level stripe, `mono8`.
pub(crate) fn picture() -> Vec<u8> {
    let level = |row: u32| match row.abs_diff(CENTER_ROW) {
        0 => 200,
        1 => 160,
        2 => 90,
        _ => 5,
    };
    (0..HEIGHT).flat_map(|row| vec![level(row); WIDTH as usize]).collect()
}

pub(crate) fn stamp_ns(number: usize) -> i64 {
    START_NS + number as i64 * PERIOD_NS
}

/// CDR bytes of the picture as frame `number`, after `edit`.
pub(crate) fn image(number: usize, edit: impl FnOnce(&mut Image<'_>)) -> Vec<u8> {
    image_of(&picture(), number, edit)
}

/// The same with other pixels.
pub(crate) fn image_of(data: &[u8], number: usize, edit: impl FnOnce(&mut Image<'_>)) -> Vec<u8> {
    let stamp = Time::from_ns(stamp_ns(number));
    let mut image = Image {
        header: Header { stamp, frame_id: "camera".into() },
        height: HEIGHT,
        width: WIDTH,
        encoding: "mono8".into(),
        is_bigendian: 0,
        step: WIDTH,
        data,
    };
    edit(&mut image);
    bytes(&image)
}

/// CDR bytes of a picture in colour as frame `number`.
pub(crate) fn image_of_file(path: &Path, number: usize) -> Vec<u8> {
    let picture = image::open(path).unwrap().to_rgb8();
    image_of(picture.as_raw(), number, |image| {
        (image.width, image.height) = picture.dimensions();
        image.step = 3 * image.width;
        image.encoding = "rgb8".into();
    })
}

pub(crate) fn good_images(num: usize) -> Vec<Vec<u8>> {
    (0..num).map(|number| image(number, |_| {})).collect()
}

pub(crate) fn topic(name: &str, kind: &MessageType) -> Topic {
    Topic::new(name, kind, QosProfile::reliable(10))
}

/// Records messages on every one of the topics, uncompressed, each in a chunk of its own, and returns at what length of
/// the file each was complete.
pub(crate) fn record(directory: &Path, topics: &[Topic], messages: &[Vec<u8>]) -> Vec<u64> {
    let options = RecordOptions { compression: Compression::None, force: false };
    let mut recorder = Recorder::create(directory, options).unwrap();
    let ids: Vec<_> = topics.iter().map(|topic| recorder.add_topic(topic).unwrap()).collect();
    let mut ends = Vec::new();
    for (number, message) in messages.iter().enumerate() {
        let (log_ns, sequence) = (stamp_ns(number), number as u32 + 1);
        for &id in &ids {
            let times = Times { log_ns, publish_ns: log_ns, sequence };
            recorder.write(id, times, message).unwrap();
        }
        recorder.flush().unwrap();
        ends.push(recorder.written_bytes());
    }
    recorder.finish().unwrap();
    ends
}

/// Records messages as `/image_raw`.
pub(crate) fn record_images(directory: &Path, messages: &[Vec<u8>]) -> Vec<u64> {
    record(directory, &[topic("/image_raw", Image::TYPE)], messages)
}

/// Stamps of the centrelines in a results' bag; each must be that of the picture.
pub(crate) fn centerline_stamps(results: &Path) -> Vec<i64> {
    let reader = BagReader::open(results, &ReadOptions::default()).unwrap();
    let messages = reader.messages(&Filter::topics(["/laser_profiler/centerline"]));
    let stamp = |message: RawMessage| {
        let centerline: Centerline<'_> = cdr::decode(&message.data).unwrap();
        assert_eq!(centerline.u.len(), WIDTH as usize, "a point in every column");
        let is_right = |v: &f32| (v - CENTER_ROW as f32).abs() < 1e-4;
        assert!(centerline.v.iter().all(is_right), "{:?}", centerline.v);
        centerline.header.stamp.to_ns()
    };
    messages.map(|message| stamp(message.unwrap())).collect()
}
