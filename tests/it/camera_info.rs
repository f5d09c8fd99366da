//! `camera_info` of a recording: a region of the sensor is measured correctly, another camera is rejected with a reason.

use std::path::{Path, PathBuf};

use laser_profiler::{
    bag::{BagReader, Filter, ReadOptions},
    msg::{
        cdr,
        laser_profiler_msgs::Profile,
        sensor_msgs::{CameraInfo, Image, RegionOfInterest},
    },
};
use tempfile::TempDir;

use crate::{
    program::{end, laser_profiler},
    recordings::{
        RENDERED_IMAGES as IMAGE_TOPIC, RENDERED_INFO as INFO_TOPIC, bytes, copy_edited,
        render_flat,
    },
};

const FRAMES: u64 = 4;

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
        render_flat(FRAMES, &directory.path().join("whole"));
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
        let path = self.path(name);
        copy_edited(&self.path("whole"), &path, &[INFO_TOPIC, IMAGE_TOPIC], |number, message| {
            if message.topic.name == IMAGE_TOPIC {
                let image = image(number, &cdr::decode(&message.data).unwrap());
                return Some((message.log_time_ns, image));
            }
            let info = info(number, cdr::decode(&message.data).unwrap())?;
            Some((message.log_time_ns + delay_ns, info))
        });
        path
    }

    /// Replays with the calibration of the full sensor; returns rejections, log lines and all profiles.
    fn measured(&self, bag: &Path) -> (u64, String, Vec<Vec<[f32; 2]>>) {
        self.measured_in_turn(&[bag])
    }

    /// Replays recordings one after another.
    fn measured_in_turn(&self, bags: &[&Path]) -> (u64, String, Vec<Vec<[f32; 2]>>) {
        let output = bags[0].with_extension("results");
        let file =
            format!("calibration_file:={}", self.path("whole").join("calibration.yaml").display());
        let area = "extraction.min_segment_area:=60";
        let arguments = ["--ros-args", "-p", &file, "-p", area];
        let mut command = laser_profiler(&["replay", "--json", "--force", "-o"]);
        let ended = end(command.arg(&output).args(bags).args(arguments));
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

/// The camera of the first recording says nothing about that of the second.
#[test]
fn every_recording_waits_for_its_own_description() {
    let bags = Bags::new();
    let whole = bags.path("whole");
    let (_, _, profiles) = bags.measured(&whole);
    let other = |_, mut info: CameraInfo<'_>| {
        info.k[0] *= 1.05;
        Some(bytes(&info))
    };
    let same = |_, info: CameraInfo<'_>| Some(bytes(&info));
    let part = |_, info: CameraInfo<'_>| Some(bytes(&CameraInfo { roi: PART, ..info }));
    // After the third of four images, 20 ms apart.
    let late_ns = 41_000_000;
    let other = bags.edited_late("other", late_ns, |_, image| bytes(image), other);
    let again = bags.edited_late("again", late_ns, |_, image| bytes(image), same);
    let part = bags.edited_late("part", late_ns, |_, image| cropped(image), part);
    let bare = bags.edited("bare", |_, image| bytes(image), |_, _| None);
    let many = profiles.len() as u64;

    let (rejected, stderr, found) = bags.measured_in_turn(&[&whole, &other]);
    assert_eq!((rejected, found), (many, profiles.clone()), "{stderr}");
    let (rejected, stderr, found) = bags.measured_in_turn(&[&other, &again]);
    assert_eq!((rejected, found), (many, profiles.clone()), "{stderr}");
    let (rejected, stderr, found) = bags.measured_in_turn(&[&again, &part]);
    assert_eq!((rejected, found.len() as u64), (0, 2 * many), "{stderr}");
    // Without a description of its own, a recording is of the whole sensor.
    let (rejected, stderr, found) = bags.measured_in_turn(&[&part, &bare]);
    // Both have the same times.
    let (of_bare, of_part): (Vec<_>, Vec<_>) =
        found.into_iter().partition(|profile| profile.len() == profiles[0].len());
    assert_eq!(
        (rejected, of_bare, of_part.len()),
        (0, profiles.clone(), profiles.len()),
        "{stderr}"
    );
}
