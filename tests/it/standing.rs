//! Scans whose profiles lie at one place: reported by `replay`, refused as surfaces.

use std::path::{Path, PathBuf};

use laser_profiler::{
    bag::{BagReader, Filter, ReadOptions},
    msg::{builtin_interfaces::Time, cdr, laser_profiler_msgs::SliceInfo, sensor_msgs::Image},
};
use serde_json::Value as Json;
use tempfile::TempDir;

use crate::{
    program::{Ended, end, laser_profiler, replay},
    recordings::{RENDERED_IMAGES, bytes, copy_edited, render_flat},
};

const FRAMES: u64 = 24;

/// A rendered recording.
struct Recording {
    directory: TempDir,
    bag: PathBuf,
}

impl Recording {
    fn new(frames: u64) -> Self {
        let directory = tempfile::tempdir().unwrap();
        let bag = directory.path().join("bag");
        render_flat(frames, &bag);
        Self { directory, bag }
    }

    /// A copy whose frames carry these stamps.
    fn stamped(&self, stamp_ns: impl Fn(i64) -> i64) -> PathBuf {
        let path = self.directory.path().join("stamped");
        copy_edited(&self.bag, &path, &[RENDERED_IMAGES], |number, message| {
            let mut image: Image<'_> = cdr::decode(&message.data).unwrap();
            image.header.stamp = Time::from_ns(stamp_ns(number as i64));
            Some((message.log_time_ns, bytes(&image)))
        });
        path
    }

    fn results(&self) -> PathBuf {
        self.directory.path().join("results")
    }

    fn replayed(&self, bag: &Path, parameters: &[&str]) -> (Json, String) {
        let file = format!("calibration_file:={}", self.bag.join("calibration.yaml").display());
        let mut arguments =
            vec!["--force", "--ros-args", "-p", &file, "-p", "extraction.min_segment_area:=60"];
        arguments.extend(parameters.iter().flat_map(|value| ["-p", value]));
        replay(bag, &self.results(), 0, &arguments)
    }

    /// State of each slice: 0 COMPLETE, 2 DEGRADED.
    fn states(&self) -> Vec<u8> {
        let reader = BagReader::open(&self.results(), &ReadOptions::default()).unwrap();
        let messages = reader.messages(&Filter::topics(["/laser_profiler/slice_info"]));
        let state = |data: &[u8]| cdr::decode::<SliceInfo<'_>>(data).unwrap().state;
        messages.map(|message| state(&message.unwrap().data)).collect()
    }

    fn run(&self, verb: &[&str], more: &[&str]) -> Ended {
        end(laser_profiler(verb).arg(self.results()).args(more))
    }

    /// Every tool for areas fails with this reason; those for profiles and points do not.
    fn is_refused(&self, reason: &str) {
        let map = self.directory.path().join("map.tif").display().to_string();
        let cloud = self.directory.path().join("cloud.ply").display().to_string();
        let tools: [(&[&str], &[&str]); 5] = [
            (&["measure", "plane"], &[]),
            (&["measure", "sphere"], &[]),
            (&["measure", "volume"], &[]),
            (&["export"], &["-o", &map, "--cell", "1mm"]),
            (&["export"], &["-o", &cloud, "--level", "--force"]),
        ];
        for (verb, more) in tools {
            let ended = self.run(verb, more);
            assert_eq!(ended.code, Some(1), "{verb:?}: {ended:?}");
            assert!(ended.stderr.contains(reason), "{verb:?}: {}", ended.stderr);
        }
        let ended = self.run(&["export"], &["-o", &cloud, "--force"]);
        assert_eq!(ended.code, Some(0), "{ended:?}");
        assert!(ended.stderr.contains("no surface") && ended.stderr.contains(reason), "{ended:?}");
    }
}

#[test]
fn profiles_at_one_place_are_reported_and_refused_with_the_parameter() {
    let recording = Recording::new(FRAMES);
    let zero = recording.stamped(|_| 0);
    let velocity = ["motion.source:=constant", "motion.velocity:=0.1"];
    let cases: [(&Path, &[&str], &str); 3] = [
        (&recording.bag, &[], "motion.source is none"),
        (&zero, &velocity, "set motion.step in its place"),
        (&zero, &["slice.profiles:=5"], "motion.source is none"),
    ];
    for (bag, parameters, remedy) in cases {
        let (summary, stderr) = recording.replayed(bag, parameters);
        assert_eq!(summary["standing"], FRAMES - 1, "{summary}");
        assert!(stderr.contains(remedy), "{stderr}");
        let states = recording.states();
        assert!(!states.is_empty() && states.iter().all(|state| *state == 2), "{states:?}");
        recording.is_refused(remedy);
    }
}

#[test]
fn a_single_profile_is_no_surface() {
    let recording = Recording::new(1);
    recording.replayed(&recording.bag, &["motion.source:=constant", "motion.step:=0.001"]);
    recording.is_refused("only one profile");
}

#[test]
fn a_scan_that_stood_still_in_part_is_counted_and_measured() {
    let recording = Recording::new(FRAMES);
    // The stamps advance in the second half only.
    let half = FRAMES as i64 / 2;
    let bag = recording.stamped(|number| (number - half + 1).max(0) * 20_000_000);
    let (summary, _) = recording
        .replayed(&bag, &["motion.source:=constant", "motion.velocity:=0.1", "slice.profiles:=6"]);
    assert_eq!(summary["standing"], FRAMES / 2 - 1, "{summary}");
    let states = recording.states();
    assert_eq!(states, [2, 2, 0, 0]);
    let ended = recording.run(&["measure", "plane"], &[]);
    assert_eq!(ended.code, Some(0), "{ended:?}");
    assert!(ended.stderr.contains("2 of 4 slices are DEGRADED"), "{}", ended.stderr);
}

#[test]
fn a_moving_scan_is_complete_and_has_no_standing_profiles() {
    let recording = Recording::new(FRAMES);
    let (summary, _) =
        recording.replayed(&recording.bag, &["motion.source:=constant", "motion.step:=0.001"]);
    assert!(summary["standing"].is_null(), "{summary}");
    assert!(recording.states().iter().all(|state| *state == 0));
    let ended = recording.run(&["measure", "plane"], &[]);
    assert_eq!(ended.code, Some(0), "{ended:?}");
}
