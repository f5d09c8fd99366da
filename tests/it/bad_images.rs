//! Inconsistent images among good ones: each is counted and named, and the good ones are measured.

use laser_profiler::msg::sensor_msgs::Image;

use crate::{
    program::{end, limited, replay},
    recordings::{
        HEIGHT, WIDTH, centerline_stamps, good_images, image, image_of, record_images, stamp_ns,
    },
};

const NUM_FRAMES: usize = 5;
/// Place of the wrong one.
const WRONG: usize = 2;
/// Address space in KiB: an image as large as it claims would not fit.
const MEMORY: &str = "ulimit -v 1500000";

/// Replays good frames with `wrong` among them; it must be rejected with `reason`.
fn rejected(name: &str, wrong: Vec<u8>, reason: &str) {
    let directory = tempfile::tempdir().unwrap();
    let [input, output] = ["in", "out"].map(|name| directory.path().join(name));
    let mut images = good_images(NUM_FRAMES);
    images[WRONG] = wrong;
    record_images(&input, &images);
    let (summary, stderr) = replay(&input, &output, 3, &[]);
    assert_eq!(summary["frames"]["rejected"], 1, "{name}: {summary}");
    assert_eq!(summary["frames"]["processed"], NUM_FRAMES - 1, "{name}: {summary}");
    assert!(stderr.contains(reason), "{name}, expected {reason:?}: {stderr}");
    let good: Vec<_> = (0..NUM_FRAMES).filter(|&number| number != WRONG).map(stamp_ns).collect();
    assert_eq!(centerline_stamps(&output), good, "{name}");
}

#[test]
fn size_step_encoding_and_length_must_agree() {
    type Edit = fn(&mut Image<'_>);
    let cases: [(&str, Edit, &str); 9] = [
        ("step", |image| image.step = WIDTH - 1, "step"),
        ("step too large", |image| image.step = WIDTH + 1, "data"),
        ("no columns", |image| image.width = 0, "0 x 32"),
        ("no rows", |image| image.height = 0, "160 x 0"),
        ("no such encoding", |image| image.encoding = "mono7".into(), "mono7"),
        ("no encoding", |image| image.encoding = "".into(), "encoding"),
        ("wider samples", |image| image.encoding = "mono16".into(), "step"),
        ("2^31 columns", |image| image.width = 1 << 31, "2147483648"),
        ("2^31 rows", |image| image.height = 1 << 31, "2147483648"),
    ];
    for (name, edit, reason) in cases {
        rejected(name, image(WRONG, edit), reason);
    }
    let pixels = (WIDTH * HEIGHT) as usize;
    for (name, length) in
        [("one byte short", pixels - 1), ("one byte long", pixels + 1), ("none", 0)]
    {
        rejected(name, image_of(&vec![9; length], WRONG, |_| {}), "data");
    }
}

#[test]
fn bytes_that_are_no_image_are_rejected() {
    let good = image(WRONG, |_| {});
    let length_at = good.len() - (WIDTH * HEIGHT) as usize - 4;
    let with = |at: usize, bytes: &[u8]| {
        let mut wrong = good.clone();
        wrong[at..at + bytes.len()].copy_from_slice(bytes);
        wrong
    };
    for (name, wrong) in [
        ("nothing", vec![]),
        ("a header only", good[..4].to_vec()),
        ("half of it", good[..good.len() / 2].to_vec()),
        ("another encapsulation", with(0, &[0, 3])),
        ("4 GiB of data claimed", with(length_at, &u32::MAX.to_le_bytes())),
        ("4 GiB of text claimed", with(12, &u32::MAX.to_le_bytes())),
        ("text that is not UTF-8", with(16, &[0xff, 0xfe])),
        ("noise", (0..300_u32).map(|at| ((at * at) >> 3) as u8).collect()),
    ] {
        rejected(name, wrong, "sensor_msgs/msg/Image");
    }
}

#[test]
fn a_stamp_that_repeats_or_goes_back_is_rejected() {
    rejected("twice the same", image(WRONG - 1, |_| {}), "stamp");
    rejected("back", image(0, |_| {}), "stamp");
}

/// Consistent images that exceed the limit of 64 MiB: one is rejected after reading, one by its record length.
#[test]
fn a_frame_above_the_limit_costs_only_itself() {
    for (side, reason) in [(9000, "more than the limit of 67108864"), (11_000, "damaged at byte")] {
        let directory = tempfile::tempdir().unwrap();
        let [input, output] = ["in", "out"].map(|name| directory.path().join(name));
        let pixels = vec![7; (side * side) as usize];
        let mut images = good_images(NUM_FRAMES);
        images[WRONG] = image_of(&pixels, WRONG, |image| {
            (image.width, image.height, image.step) = (side, side, side);
        });
        record_images(&input, &images);
        let ended = end(limited(MEMORY, &["replay", "-o"]).arg(&output).arg(&input));
        assert_eq!(ended.code, Some(3), "{ended:?}");
        assert!(ended.stderr.contains(reason), "{ended:?}");
        let good = (0..NUM_FRAMES).filter(|&number| number != WRONG).map(stamp_ns);
        assert_eq!(centerline_stamps(&output), good.collect::<Vec<_>>());
    }
}

#[test]
fn a_recording_of_wrong_images_only_is_no_success() {
    let directory = tempfile::tempdir().unwrap();
    let [input, output] = ["in", "out"].map(|name| directory.path().join(name));
    let wrong: Vec<_> =
        (0..NUM_FRAMES).map(|number| image(number, |image| image.step = 1)).collect();
    record_images(&input, &wrong);
    let (summary, _) = replay(&input, &output, 3, &[]);
    assert_eq!(summary["frames"]["rejected"], NUM_FRAMES);
}
