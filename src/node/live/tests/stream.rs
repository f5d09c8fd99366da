//! Tests the processing of a camera's frames.

use super::{
    driver::{MS, Picture, START_NS},
    rig::Rig,
};
use crate::{
    msg::{
        diagnostic_msgs::DiagnosticArray,
        foxglove_msgs::ImageAnnotations,
        laser_profiler_msgs::{Centerline, FrameTrace, Profile, SliceInfo, StreamStatus},
        sensor_msgs::{Image, PointCloud2},
    },
    node::{live::session::CameraSummary, statistics::Counts},
    ros::transport::{Arrival, Fault},
};

pub(super) fn counts(summaries: Vec<CameraSummary>) -> Counts {
    let [CameraSummary { summary, .. }] = <[_; 1]>::try_from(summaries).ok().unwrap();
    let counts = summary.unwrap().counts;
    assert_eq!(counts.received, counts.processed + counts.rejected() + counts.dropped_overload);
    counts
}

fn traces(rig: &Rig, num: usize) -> Vec<FrameTrace> {
    let lines = rig.results("centerline", num);
    lines.iter().map(|line| line.decode::<Centerline<'_>>().trace).collect()
}

#[test]
fn a_recording_in_a_loop_gives_a_session_for_each_round_and_rejects_nothing() {
    let rig = Rig::start();
    let mut camera = rig.camera();
    let mut number = 0;
    for round in 0..3 {
        camera.at_ms = 0;
        for _ in 0..12 {
            // 10 Hz: a round is longer than a second.
            camera.at_ms += 90;
            camera.shoot();
            number += 1;
            rig.results("centerline", number);
        }
        // Each round begins with the end of the scan of the one before.
        rig.results("height_map", round);
    }
    let listener = rig.listener.clone();
    let counts = counts(rig.end());
    assert_eq!((counts.processed, counts.rejected(), counts.begun_again), (36, 0, 2));
    // The stamps of the pictures are of 2020.
    assert_eq!(counts.not_of_now, 36);
    let statuses = listener.received("/laser_profiler/stream_status");
    let last: StreamStatus<'_> = statuses.last().unwrap().decode();
    assert!(last.latency_p50.is_nan() && last.latency_max.is_nan(), "{last:?}");
    let reports = listener.received("/diagnostics");
    let report: DiagnosticArray<'_> = reports.last().unwrap().decode();
    let value = |key: &str| report.status[0].values.iter().find(|it| it.key == key).unwrap();
    assert_eq!(value("stamps begun again").value, "2");
    assert_eq!(value("frames with stamps that are not of now").value, "36");
    let sessions: std::collections::BTreeSet<_> =
        statuses.iter().map(|status| status.decode::<StreamStatus<'_>>().session_id.uuid).collect();
    assert!(sessions.len() <= 3 && sessions.contains(&last.session_id.uuid), "{sessions:?}");
}

#[test]
fn an_image_becomes_every_result() {
    let rig = Rig::start();
    let mut camera = rig.camera();
    for number in 1..=5 {
        camera.shoot();
        rig.results("centerline", number);
    }
    let slice = rig.results("slice_info", 1);
    let listener = rig.listener.clone();
    assert_eq!(counts(rig.end()).processed, 5);
    let of = |name: &str| listener.received(&format!("/laser_profiler/{name}"));

    let lines = of("centerline");
    let line: Centerline<'_> = lines[1].decode();
    assert_eq!(
        (line.header.stamp.to_ns(), &*line.header.frame_id),
        (START_NS + 20 * MS, "optical")
    );
    assert_eq!(line.trace.receive_stamp.to_ns(), START_NS + 20 * MS + 1, "when it arrived");
    assert_eq!((line.trace.frame_number, line.trace.frames_missing_valid), (1, true));
    assert_eq!(line.trace.frame_number_source, FrameTrace::SOURCE_TRANSPORT);
    assert!(line.v.len() == 64 && line.v.iter().all(|v| (v - 10.0).abs() < 1e-3));
    assert_eq!(of("annotations")[0].decode::<ImageAnnotations<'_>>().points.len(), 1);
    let profiles = of("profile");
    let profile: Profile<'_> = profiles[0].decode();
    assert_eq!((profile.valid_count, &*profile.header.frame_id), (64, "laser"));
    let info: SliceInfo<'_> = slice[0].decode();
    assert_eq!(
        (info.frames_accepted, info.last_slice, info.state),
        (4, false, SliceInfo::COMPLETE)
    );
    let (clouds, infos, maps) = (of("points"), of("slice_info"), of("height_map"));
    assert_eq!([clouds.len(), of("points_dense").len(), infos.len(), maps.len()], [2, 2, 2, 1]);
    let cloud: PointCloud2<'_> = clouds[0].decode();
    assert_eq!((cloud.width, cloud.height), (64, 4));
    assert!(infos[1].decode::<SliceInfo<'_>>().last_slice);
    let map: Image<'_> = maps[0].decode();
    assert_eq!((map.width, map.height, &*map.encoding), (64, 5, "32FC1"));
}

#[test]
fn gaps_are_distinguished_from_frames_of_another_publisher() {
    let rig = Rig::start();
    let mut camera = rig.camera();
    for (number, (publisher, sequence)) in
        [([1; 16], 1), ([1; 16], 4), ([2; 16], 90), ([2; 16], 91)].into_iter().enumerate()
    {
        (camera.publisher, camera.sequence) = (publisher, sequence - 1);
        camera.shoot();
        rig.results("centerline", number + 1);
    }
    let traces = traces(&rig, 4);
    let gaps: Vec<_> =
        traces.iter().map(|trace| (trace.frames_missing_valid, trace.frames_missing)).collect();
    assert_eq!(gaps, [(false, 0), (true, 2), (false, 0), (true, 0)]);
    assert_eq!(counts(rig.end()).lost(), 2);
}

#[test]
fn faulty_frames_are_counted_by_kind_and_the_stream_continues() {
    let rig = Rig::start();
    let mut camera = rig.camera();
    let stamped = |ms: i64| Ok(Picture::default().message(START_NS + ms * MS));
    // A driver without a clock stamps with 0.
    let unstamped = || Ok(Picture::default().message(0));
    let foreign = "an attachment of 17 bytes";
    // The queue is short, so the test waits for a good frame after every few faulty ones.
    let groups: [Vec<Result<Vec<u8>, Fault>>; 7] = [
        vec![stamped(10)],
        // A duplicate, one from the past, and one from far ahead,
        vec![stamped(10), stamped(5), stamped(1_000_000_000)],
        // which makes three late before the clock counts as set back.
        vec![stamped(20), stamped(30), stamped(40), stamped(50)],
        vec![unstamped(), unstamped()],
        vec![Ok(vec![]), Ok(vec![0, 1, 0, 0, 9, 9]), Ok(vec![0xff; 200]), unstamped()],
        vec![
            Err(Fault::TooLarge { bytes: 1 << 40, limit_bytes: 1 << 26 }),
            stamped(70).map(|data| data[..900].to_vec()),
            Err(Fault::Foreign(foreign.into())),
            stamped(80),
        ],
        vec![stamped(90)],
    ];
    for (group, num_measured) in groups.into_iter().zip([1, 2, 3, 5, 6, 7, 8]) {
        for message in group {
            camera.sequence += 1;
            match message {
                Ok(data) => camera.send(data),
                Err(fault) => camera.deliver(&Err(fault)),
            }
        }
        rig.results("centerline", num_measured);
    }
    rig.listener.wait("the last rejection in the diagnostics", |messages| {
        let mut diagnostics = messages.iter().filter(|message| message.topic == "/diagnostics");
        diagnostics.any(|message| String::from_utf8_lossy(&message.data).contains(foreign))
    });
    let counts = counts(rig.end());
    assert_eq!((counts.received, counts.processed), (19, 8));
    assert_eq!((counts.duplicate, counts.out_of_order, counts.malformed), (1, 4, 6));
    assert_eq!(counts.lost(), 0, "faulty frames that arrived are not lost");
}

#[test]
fn a_camera_that_returns_with_another_size_starts_a_new_scan() {
    let rig = Rig::start();
    let mut camera = rig.camera();
    let pictures = [
        Picture::default(),
        Picture { height: 40, ..Picture::default() },
        Picture { width: 80, ..Picture::default() },
        Picture { width: 80, encoding: "rgb8", ..Picture::default() },
    ];
    let mut num = 0;
    for picture in pictures {
        camera.picture = picture;
        for _ in 0..3 {
            camera.shoot();
            num += 1;
            rig.results("centerline", num);
        }
    }
    let listener = rig.listener.clone();
    assert_eq!(counts(rig.end()).processed, 12);
    let infos = listener.received("/laser_profiler/slice_info");
    let infos: Vec<SliceInfo<'_>> = infos.iter().map(super::Received::decode).collect();
    let slices: Vec<_> =
        infos.iter().map(|info| (info.first_frame, info.last_frame, info.last_slice)).collect();
    // The size determines the pixel positions; the encoding does not.
    assert_eq!(slices, [(0, 2, true), (3, 5, true), (6, 9, false), (10, 11, true)]);
    assert!(infos[0].scan_id != infos[1].scan_id && infos[1].scan_id != infos[2].scan_id);
}

#[test]
fn an_overload_is_counted_to_the_last_frame_and_reported_within_a_second() {
    let rig = Rig::start();
    let mut camera = rig.camera();
    camera.picture = Picture { width: 1024, height: 768, row: 300, encoding: "mono8" };
    let data = camera.picture.message(START_NS);
    let mut num_sent = 0;
    let started = std::time::Instant::now();
    // Frames with stamps of zero are all good.
    while started.elapsed() < std::time::Duration::from_millis(1500) {
        camera.sequence += 1;
        num_sent += 1;
        camera.deliver(&Ok(Arrival {
            data: {
                let mut data = data.clone();
                data[4..12].fill(0);
                data
            },
            publisher: [1; 16],
            sequence: Some(num_sent),
            source_time_ns: START_NS + num_sent * MS,
            receive_time_ns: START_NS + num_sent * MS,
        }));
    }
    let statuses = rig.listener.received("/laser_profiler/stream_status");
    let statuses = statuses.iter().map(super::Received::decode::<StreamStatus<'_>>);
    assert!(statuses.clone().any(|status| status.dropped_overload > 0), "within a second");
    assert!(
        statuses.clone().count() <= 8,
        "four times a second while frames are dropped: {}",
        statuses.count()
    );
    let listener = rig.listener.clone();
    let counts = counts(rig.end());
    assert_eq!(counts.received, num_sent as u64);
    assert!(counts.dropped_overload > 0, "{counts:?}");
    assert_eq!((counts.lost(), counts.rejected()), (0, 0), "dropped, not lost");
    let lines = listener.received("/laser_profiler/centerline");
    assert_eq!(lines.len() as u64, counts.processed);
    let last: Centerline<'_> = lines.last().unwrap().decode();
    assert_eq!(last.trace.frame_number, num_sent as u64 - 1, "every frame has its number");
    let last = listener.received("/laser_profiler/stream_status").pop().unwrap();
    let last: StreamStatus<'_> = last.decode();
    assert_eq!(
        (last.frames_received, last.frames_processed, last.dropped_overload),
        (counts.received, counts.processed, counts.dropped_overload)
    );
}
