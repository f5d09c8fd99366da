//! `camera_info` of a recording: a region of the sensor is measured correctly, another camera is rejected with a reason.

use std::path::{Path, PathBuf};

use laser_profiler::{
    bag::{
        BagReader, Compression, Filter, RawMessage, ReadOptions, RecordOptions, Recorder, Times,
    },
    msg::{
        cdr,
        laser_profiler_msgs::Profile,
        sensor_msgs::{CameraInfo, Image, RegionOfInterest},
    },
};
use tempfile::TempDir;

use crate::program::{end, laser_profiler};

const IMAGE_TOPIC: &str = "/camera/image_raw";
const INFO_TOPIC: &str = "/camera/camera_info";
const FRAMES: u64 = 4;

const SCENARIO: &str = "
frames: 4
frame_rate_hz: 50.0
start_time_ns: 1767225600000000000
seed: 7
laser: {amplitude: 180.0, sigma_px: 2.0}
rig:
  width_px: 320
  height_px: 200
  lens: {focal_px: [600.0, 602.0], center_px: [161.0, 98.0], distortion: [-0.2, 0.1, 0, 0, 0, 0, 0, 0]}
  laser_normal: [0.05, -0.5, 0.85]
  laser_distance_m: 0.25
gauge: {reflectance: 0.9, slope: [0.05, 0.0], shape: {flat: {}}}
";

/// Part of the sensor: first column and row, columns and rows.
const PART: RegionOfInterest =
    RegionOfInterest { x_offset: 40, y_offset: 60, width: 200, height: 80, do_rectify: false };

/// A rendered recording, and edited copies of it.
struct Bags {
    directory: TempDir,
}

impl Bags {
    fn new() -> Self {
        let directory = tempfile::tempdir().unwrap();
        let scenario = directory.path().join("scenario.yaml");
        std::fs::write(&scenario, SCENARIO).unwrap();
        let bag = directory.path().join("whole");
        let ended = end(laser_profiler(&["simulate", "-o"]).arg(&bag).arg(&scenario));
        assert_eq!(ended.code, Some(0), "{ended:?}");
        Self { directory }
    }

    fn path(&self, name: &str) -> PathBuf {
        self.directory.path().join(name)
    }

    /// A copy of images and descriptions, edited; `None` leaves a message out.
    fn edited(
        &self,
        name: &str,
        image: impl Fn(usize, &Image<'_>) -> Vec<u8>,
        info: impl Fn(usize, CameraInfo<'_>) -> Option<Vec<u8>>,
    ) -> PathBuf {
        self.edited_late(name, 0, image, info)
    }

    /// Like `edited`, with the descriptions recorded later than they were, by this time in nanoseconds.
    fn edited_late(
        &self,
        name: &str,
        delay_ns: i64,
        image: impl Fn(usize, &Image<'_>) -> Vec<u8>,
        info: impl Fn(usize, CameraInfo<'_>) -> Option<Vec<u8>>,
    ) -> PathBuf {
        let reader = BagReader::open(&self.path("whole"), &ReadOptions::default()).unwrap();
        let path = self.path(name);
        let options = RecordOptions { compression: Compression::None, ..RecordOptions::default() };
        let mut recorder = Recorder::create(&path, options).unwrap();
        for topic_name in [INFO_TOPIC, IMAGE_TOPIC] {
            let topic = reader.topics().iter().find(|topic| topic.name == topic_name).unwrap();
            let id = recorder.add_topic(topic).unwrap();
            let messages: Vec<RawMessage> =
                reader.messages(&Filter::topics([topic_name])).map(Result::unwrap).collect();
            for (number, message) in messages.iter().enumerate() {
                let bytes = if topic_name == IMAGE_TOPIC {
                    Some(image(number, &cdr::decode(&message.data).unwrap()))
                } else {
                    info(number, cdr::decode(&message.data).unwrap())
                };
                let delay_ns = if topic_name == INFO_TOPIC { delay_ns } else { 0 };
                let log_ns = message.log_time_ns + delay_ns;
                let times = Times { log_ns, publish_ns: log_ns, sequence: message.sequence };
                if let Some(bytes) = bytes {
                    recorder.write(id, times, &bytes).unwrap();
                }
            }
        }
        recorder.finish().unwrap();
        path
    }

    /// Replays with the calibration of the full sensor; returns rejections, log lines and all profiles.
    fn measured(&self, bag: &Path) -> (u64, String, Vec<Vec<[f32; 2]>>) {
        let output = bag.with_extension("results");
        let file =
            format!("calibration_file:={}", self.path("whole").join("calibration.yaml").display());
        let area = "extraction.min_segment_area:=60";
        let arguments = ["--ros-args", "-p", &file, "-p", area];
        let mut command = laser_profiler(&["replay", "--json", "-o"]);
        let ended = end(command.arg(&output).arg(bag).args(arguments));
        let summary: serde_json::Value = serde_json::from_str(&ended.stdout).unwrap();
        let rejected = summary["frames"]["rejected"].as_u64().unwrap();
        assert_eq!(ended.code, Some(if rejected == 0 { 0 } else { 3 }), "{ended:?}");
        let reader = BagReader::open(&output, &ReadOptions::default()).unwrap();
        let profiles =
            reader.messages(&Filter::topics(["/laser_profiler/profile"])).map(|message| {
                let message = message.unwrap();
                let profile: Profile<'_> = cdr::decode(&message.data).unwrap();
                profile.x.iter().zip(profile.z.iter()).map(|(x, z)| [*x, *z]).collect()
            });
        (rejected, ended.stderr, profiles.collect())
    }
}

fn bytes<M: laser_profiler::msg::schema::Message>(message: &M) -> Vec<u8> {
    let mut bytes = Vec::new();
    cdr::encode(message, &mut bytes).unwrap();
    bytes
}

/// The part of an image.
fn cropped(image: &Image<'_>) -> Vec<u8> {
    let RegionOfInterest { x_offset, y_offset, width, height, .. } = PART;
    let rows = y_offset..y_offset + height;
    let data: Vec<u8> = rows
        .flat_map(|row| {
            let first = (row * image.step + x_offset) as usize;
            image.data[first..first + width as usize].to_vec()
        })
        .collect();
    bytes(&Image { width, height, step: width, data: &data, ..image.clone() })
}

#[test]
fn a_region_of_interest_is_measured_like_the_full_sensor() {
    let bags = Bags::new();
    let (rejected, _, whole) = bags.measured(&bags.path("whole"));
    assert_eq!((rejected, whole.len() as u64), (0, FRAMES));
    let part = bags.edited(
        "part",
        |_, image| cropped(image),
        |_, info| Some(bytes(&CameraInfo { roi: PART, ..info })),
    );
    let (rejected, stderr, part) = bags.measured(&part);
    assert_eq!((rejected, part.len()), (0, whole.len()), "{stderr}");
    for (whole, part) in whole.iter().zip(&part) {
        let first = PART.x_offset as usize;
        let mut compared = 0;
        // Away from the borders, where the blur sees other pixels.
        for (column, [x_m, z_m]) in part.iter().enumerate().skip(8).take(part.len() - 16) {
            let [true_x_m, true_z_m] = whole[first + column];
            assert!((x_m - true_x_m).abs() < 1e-6 && (z_m - true_z_m).abs() < 1e-6);
            compared += 1;
        }
        assert!(compared > 150);
    }
}

#[test]
fn without_its_description_a_part_is_refused() {
    let bags = Bags::new();
    let part = bags.edited("part", |_, image| cropped(image), |_, _| None);
    let (rejected, stderr, profiles) = bags.measured(&part);
    assert_eq!((rejected, profiles.len()), (FRAMES, 0), "{stderr}");
    assert!(stderr.contains("200 x 80") && stderr.contains("320 x 200"), "{stderr}");
}

#[test]
fn another_camera_is_refused_with_its_reason() {
    type Edit = fn(&mut CameraInfo<'_>);
    let bags = Bags::new();
    let cases: [(&str, Edit, &str); 4] = [
        ("focal", |info| info.k[0] *= 1.05, "px from where the calibration does"),
        ("distortion", |info| info.d = vec![0.0; 5], "rectified"),
        ("size", |info| info.width = 640, "640 x 200"),
        ("model", |info| info.distortion_model = "fov".into(), "fov"),
    ];
    for (name, edit, reason) in cases {
        let bag = bags.edited(
            name,
            |_, image| bytes(image),
            |_, mut info| {
                edit(&mut info);
                Some(bytes(&info))
            },
        );
        let (rejected, stderr, profiles) = bags.measured(&bag);
        assert_eq!((rejected, profiles.len()), (FRAMES, 0), "{name}: {stderr}");
        assert!(stderr.contains(reason), "{name}, expected {reason:?}: {stderr}");
    }
}

#[test]
fn another_calibration_of_the_same_camera_is_logged_and_not_used() {
    let bags = Bags::new();
    let (_, _, whole) = bags.measured(&bags.path("whole"));
    let bag = bags.edited(
        "older",
        |_, image| bytes(image),
        |_, mut info| {
            info.k[0] *= 1.003;
            Some(bytes(&info))
        },
    );
    let (rejected, stderr, profiles) = bags.measured(&bag);
    assert_eq!(rejected, 0, "{stderr}");
    assert!(
        stderr.contains("px from where the calibration does: the calibration is used"),
        "{stderr}"
    );
    let same = |a: &Vec<[f32; 2]>, b: &Vec<[f32; 2]>| {
        a.iter()
            .flatten()
            .map(|value| value.to_bits())
            .eq(b.iter().flatten().map(|value| value.to_bits()))
    };
    assert!(whole.iter().zip(&profiles).all(|(a, b)| same(a, b)) && whole.len() == profiles.len());
}

#[test]
fn where_the_description_changes_a_new_scan_begins() {
    let bags = Bags::new();
    let bag = bags.edited(
        "change",
        |number, image| if number < 2 { bytes(image) } else { cropped(image) },
        |number, info| {
            let roi = if number < 2 { RegionOfInterest::default() } else { PART };
            Some(bytes(&CameraInfo { roi, ..info }))
        },
    );
    let (rejected, stderr, profiles) = bags.measured(&bag);
    assert_eq!((rejected, profiles.len() as u64), (0, FRAMES), "{stderr}");
    assert!(stderr.contains("camera_info changes within the stream: now 200 x 80"), "{stderr}");
}

#[test]
fn the_verdict_does_not_depend_on_which_message_comes_first() {
    let bags = Bags::new();
    let other = |_, mut info: CameraInfo<'_>| {
        info.k[0] *= 1.05;
        Some(bytes(&info))
    };
    // After the first, the second and the last of four images, 20 ms apart.
    for delay_ns in [1, 21_000_000, 61_000_000] {
        let name = format!("late_{delay_ns}");
        let bag = bags.edited_late(&name, delay_ns, |_, image| bytes(image), other);
        let (rejected, stderr, profiles) = bags.measured(&bag);
        assert_eq!((rejected, profiles.len()), (FRAMES, 0), "{delay_ns}: {stderr}");
        assert!(stderr.contains("px from where the calibration does"), "{delay_ns}: {stderr}");
    }
    // The right camera loses nothing by it.
    let bag =
        bags.edited_late("late", 61_000_000, |_, image| bytes(image), |_, info| Some(bytes(&info)));
    let (_, _, whole) = bags.measured(&bags.path("whole"));
    let (rejected, stderr, profiles) = bags.measured(&bag);
    assert_eq!((rejected, profiles), (0, whole), "{stderr}");
}

#[test]
fn a_description_of_zeros_means_that_nothing_is_known() {
    type Edit = fn(&mut CameraInfo<'_>);
    let bags = Bags::new();
    let (_, _, whole) = bags.measured(&bags.path("whole"));
    let cases: [(&str, Edit); 3] = [
        ("all", |info| {
            let header = info.header.clone();
            *info = CameraInfo { header, ..CameraInfo::default() };
        }),
        ("matrix", |info| (info.k, info.d) = ([0.0; 9], Vec::new())),
        ("size", |info| (info.width, info.height) = (0, 0)),
    ];
    for (name, edit) in cases {
        let bag = bags.edited(
            name,
            |_, image| bytes(image),
            |_, mut info| {
                edit(&mut info);
                Some(bytes(&info))
            },
        );
        let (rejected, stderr, profiles) = bags.measured(&bag);
        assert_eq!((rejected, &profiles), (0, &whole), "{name}: {stderr}");
    }
}
