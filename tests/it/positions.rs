//! Real recordings of a turntable: the position of each profile, and the scan in the table's frame.

use std::{collections::BTreeMap, fs, path::Path};

use laser_profiler::{
    bag::{BagReader, Filter, RawMessage, ReadOptions},
    msg::{
        cdr,
        laser_profiler_msgs::{FrameTrace, Profile, SliceInfo},
        sensor_msgs::PointCloud2,
    },
};

use crate::{program::replay, recordings::real};

/// The rig by an independent calibration, to some tenths of a millimetre; the table turns about the normal of
/// its disk.
const RIG: &str = "type: camera_and_plane
camera_name: camera
image_width: 640
image_height: 480
camera_matrix: {rows: 3, cols: 3, data: [627.5, 0.0, 316.1, 0.0, 625.8, 242.3, 0.0, 0.0, 1.0]}
distortion_model: plumb_bob
distortion_coefficients: {rows: 1, cols: 5, data: [0.1155, -0.2219, -0.0004, -0.0038, 0.0785]}
frame_id: laser_plane
laser_plane: {normal: [0.911, -0.139, 0.387], distance_m: 0.1667}
axis: {kind: revolute, point_m: [0.0185, 0.0551, 0.4263], direction: [0.032, -0.928, -0.371]}
";

/// The parameter file of the repository, and this calibration.
fn scanned(
    input: &Path,
    place: &Path,
    rig: &str,
    code: i32,
    more: &[&str],
) -> (serde_json::Value, String) {
    let calibration = place.join("rig.yaml");
    fs::write(&calibration, rig).unwrap();
    let chosen = format!("calibration_file:={}", calibration.display());
    let mut arguments = vec!["--force", "--params-file", "launch_configs/turntable.yaml"];
    arguments.extend(["--ros-args", "-p", &chosen]);
    arguments.extend(more.iter().flat_map(|value| ["-p", value]));
    replay(input, &place.join("results"), code, &arguments)
}

fn messages(place: &Path, topic: &str) -> Vec<RawMessage> {
    let bag = BagReader::open(&place.join("results"), &ReadOptions::default()).unwrap();
    bag.messages(&Filter::topics([topic])).map(Result::unwrap).collect()
}

fn traces(place: &Path) -> Vec<FrameTrace> {
    let trace = |message: &RawMessage| cdr::decode::<Profile<'_>>(&message.data).unwrap().trace;
    messages(place, "/laser_profiler/profile").iter().map(trace).collect()
}

/// Points of the scan and the number of their frame, metres.
fn points(place: &Path) -> Vec<([f32; 3], usize)> {
    let mut points = Vec::new();
    let mut frame = 0;
    for message in messages(place, "/laser_profiler/points") {
        let cloud: PointCloud2<'_> = cdr::decode(&message.data).unwrap();
        assert_eq!(cloud.header.frame_id, "part");
        for row in cloud.data.chunks_exact(cloud.row_step as usize) {
            for point in row.chunks_exact(16) {
                let value = |at: usize| f32::from_le_bytes(point[at..at + 4].try_into().unwrap());
                if value(8).is_finite() {
                    points.push(([value(0), value(4), value(8)], frame));
                }
            }
            frame += 1;
        }
    }
    points
}

fn median(mut values: Vec<f32>) -> f32 {
    values.sort_by(f32::total_cmp);
    values[values.len() / 2]
}

/// Between two passes over the same cells of 4 mm, an eighth of a turn or more apart: median of the difference in height,
/// metres, and the number of cells that were passed twice.
fn disagreement(points: &[([f32; 3], usize)]) -> (f32, usize) {
    let num_frames = points.iter().map(|(_, frame)| frame + 1).max().unwrap_or(1);
    let mut cells = BTreeMap::<(i32, i32), Vec<(f32, usize)>>::new();
    // The disk is a little larger; points farther out are the wall.
    for &([x_m, y_m, z_m], frame) in points.iter().filter(|([x, y, _], _)| x.hypot(*y) < 0.075) {
        let cell = ((x_m / 0.004).floor() as i32, (y_m / 0.004).floor() as i32);
        cells.entry(cell).or_default().push((z_m, frame));
    }
    let mut differences = Vec::new();
    for seen in cells.values() {
        let first = seen[0].1;
        let (mut once, mut again) = (Vec::new(), Vec::new());
        for &(z_m, frame) in seen {
            let turned = (frame + num_frames - first) % num_frames;
            let is_second = (num_frames / 8..num_frames * 7 / 8).contains(&turned);
            if is_second { again.push(z_m) } else { once.push(z_m) }
        }
        if once.len() >= 3 && again.len() >= 3 {
            differences.push((median(once) - median(again)).abs());
        }
    }
    let num = differences.len();
    (if num == 0 { f32::NAN } else { median(differences) }, num)
}

#[test]
fn one_turn_of_the_table_is_one_scan_with_all_positions_known() {
    let Some(recording) = real("turntable_object") else { return };
    let place = tempfile::tempdir().unwrap();
    let (summary, _) = scanned(&recording, place.path(), RIG, 0, &[]);
    assert_eq!(summary["frames"]["processed"], 320);
    let expected = serde_json::json!({"known": 320, "doubtful": 0, "unknown": 0, "refused": 0});
    assert_eq!(summary["positions"], expected);
    let infos = messages(place.path(), "/laser_profiler/slice_info");
    let infos: Vec<SliceInfo<'_>> = infos.iter().map(|m| cdr::decode(&m.data).unwrap()).collect();
    assert!(
        infos
            .iter()
            .all(|info| info.state == SliceInfo::COMPLETE && info.scan_id == infos[0].scan_id)
    );
    assert_eq!(infos.iter().map(|info| info.frames_accepted).sum::<u32>(), 320);
    assert!(infos.last().unwrap().last_slice);
    // The joint position of frame n, counted from 1, is n · 1.125°.
    for (trace, number) in traces(place.path()).iter().zip(1..) {
        let angle_rad = f64::from(number) * std::f64::consts::TAU / 320.0;
        assert!((trace.position - angle_rad).abs() < 1e-9, "{trace:?}");
        assert_eq!(trace.encoder_source, FrameTrace::SOURCE_DEVICE);
    }
}

/// The laser crosses the whole disk: half a turn later it sees the same places on the other side.
#[test]
fn two_passes_over_the_same_place_agree_and_with_the_axis_turned_round_they_do_not() {
    let Some(recording) = real("turntable_empty") else { return };
    let place = tempfile::tempdir().unwrap();
    // The room is bright, the line faint.
    let faint = [
        "extraction.background:=local",
        "extraction.threshold:=adaptive",
        "extraction.peak_selection:=continuity",
    ];
    scanned(&recording, place.path(), RIG, 0, &faint);
    let (right_m, num_cells) = disagreement(&points(place.path()));
    let [background, threshold, selection] = faint;
    let turned_round = [background, threshold, selection, "motion.scale:=-1.0"];
    scanned(&recording, place.path(), RIG, 0, &turned_round);
    let (wrong_m, _) = disagreement(&points(place.path()));
    assert!(num_cells >= 50, "{num_cells} cells");
    let found = format!("{right_m} m, turned round {wrong_m} m in {num_cells} cells");
    assert!(right_m < 0.001 && wrong_m > 5.0 * right_m, "{found}");
}

#[test]
fn positions_are_interpolated_linearly_between_two_samples() {
    let Some(recording) = real("turntable_object") else { return };
    let place = tempfile::tempdir().unwrap();
    // Not where its positions were taken, but at the stamps, 20 ms later: a fiftieth of a step further.
    let (summary, reported) =
        scanned(&recording, place.path(), RIG, 0, &["motion.exposure_offset:=0.0"]);
    assert_eq!(
        summary["positions"]["doubtful"], 1,
        "only behind the last frame there is no sample"
    );
    assert!(reported.contains("set motion.exposure_offset to -0.0200"), "{reported}");
    let traces = traces(place.path());
    for (trace, number) in traces.iter().zip(1..) {
        let angle_rad = (f64::from(number) + 0.02) * std::f64::consts::TAU / 320.0;
        assert!((trace.position - angle_rad).abs() < 1e-9, "{trace:?}");
        let status = if number == 320 { FrameTrace::ENCODER_EXTRAPOLATED } else { 0 };
        assert_eq!((trace.encoder_source, trace.encoder_status), (FrameTrace::SOURCE_HOST, status));
    }
}

#[test]
fn a_missing_joint_is_reported_and_nothing_is_scanned() {
    let Some(recording) = real("turntable_empty") else { return };
    let place = tempfile::tempdir().unwrap();
    let (summary, reported) = scanned(&recording, place.path(), RIG, 3, &["motion.joint:=spindle"]);
    assert_eq!((&summary["positions"]["unknown"], &summary["slices"]), (&40.into(), &0.into()));
    assert!(
        reported.contains("\"spindle\"") && reported.contains("received are turntable"),
        "{reported}"
    );
    let shift = RIG.replace("revolute, point_m: [0.0185, 0.0551, 0.4263]", "prismatic");
    let calibration = place.path().join("shift.yaml");
    fs::write(&calibration, shift).unwrap();
    let chosen = format!("calibration_file:={}", calibration.display());
    let arguments = ["--params-file", "launch_configs/turntable.yaml", "--ros-args", "-p", &chosen];
    let mut command = crate::program::laser_profiler(&["replay", "-o"]);
    let ended =
        crate::program::end(command.arg(place.path().join("none")).arg(&recording).args(arguments));
    assert_eq!(ended.code, Some(2), "{ended:?}");
    assert!(
        ended.stderr.contains("motion.axis is revolute, but the calibration's axis is prismatic"),
        "{ended:?}"
    );
}
