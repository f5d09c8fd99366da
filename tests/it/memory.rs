//! The memory of a replay does not grow with the recording, nor that of the commands that read pictures with their number.

use std::{
    fs,
    path::Path,
    process::{Command, Stdio},
    thread,
    time::Duration,
};

use image::{GrayImage, Luma};

use crate::{
    program::laser_profiler,
    recordings::{image_of, record_images},
};

const WIDTH: u32 = 640;
const HEIGHT: u32 = 96;
/// Allowance for the index of the longer files; the long recording is 80 MB larger than the short one.
const SLACK_KIB: u64 = 8 * 1024;

/// Largest resident memory of a command, KiB, as Linux counts it. Polled, because it is
/// lost when the process ends; polling detects growth with the recording nevertheless.
fn peak_kib(command: &mut Command) -> u64 {
    let (peak, code) = peak_kib_and_code(command);
    assert_eq!(code, Some(0));
    peak
}

/// Like [`peak_kib`], of a command that may fail; with its exit code.
pub(crate) fn peak_kib_and_code(command: &mut Command) -> (u64, Option<i32>) {
    let mut child = command.stdout(Stdio::null()).stderr(Stdio::null()).spawn().unwrap();
    let peak = resident_peak_kib(child.id());
    (peak, child.wait().unwrap().code())
}

/// Largest resident memory of a process, KiB, followed until it has ended.
pub(crate) fn resident_peak_kib(process: u32) -> u64 {
    let mut peak = 0;
    // A process that has ended, but that nobody has waited for, has no memory.
    while let Some(kib) = resident_kib(process) {
        peak = peak.max(kib);
        thread::sleep(Duration::from_millis(2));
    }
    assert!(peak > 0, "measured");
    peak
}

fn resident_kib(process: u32) -> Option<u64> {
    let status = fs::read_to_string(format!("/proc/{process}/status")).ok()?;
    let resident = status.lines().find_map(|line| line.strip_prefix("VmHWM:"))?;
    resident.trim().strip_suffix(" kB")?.parse().ok()
}

#[test]
fn a_long_recording_takes_no_more_than_a_short_one() {
    let directory = tempfile::tempdir().unwrap();
    let pixels: Vec<u8> = (0..HEIGHT)
        .flat_map(|row| vec![if row.abs_diff(40) < 3 { 200 } else { 5 }; WIDTH as usize])
        .collect();
    let peaks = [100, 1500].map(|num| {
        let (input, output) =
            (directory.path().join(format!("in{num}")), directory.path().join(format!("out{num}")));
        let frames: Vec<_> = (0..num)
            .map(|number| {
                image_of(&pixels, number, |image| {
                    (image.width, image.height, image.step) = (WIDTH, HEIGHT, WIDTH);
                })
            })
            .collect();
        record_images(&input, &frames);
        peak_kib(laser_profiler(&["replay", "-o"]).arg(&output).arg(&input))
    });
    eprintln!("peak of 100 frames {} KiB, of 1500 frames {} KiB", peaks[0], peaks[1]);
    assert!(peaks[1] < peaks[0] + SLACK_KIB, "{peaks:?} KiB");
}

/// Writes pictures of a line that hardly compress, 19 KB each.
fn write_pictures(folder: &Path, num: usize) {
    const WIDTH: u32 = 160;
    const HEIGHT: u32 = 120;
    fs::create_dir(folder).unwrap();
    let mut state = 1_u32;
    let picture = GrayImage::from_fn(WIDTH, HEIGHT, |_, row| {
        state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        Luma([if row.abs_diff(50) < 3 { 200 } else { (state >> 24) as u8 / 8 }])
    });
    let first = folder.join("1.png");
    picture.save(&first).unwrap();
    for number in 2..=num {
        fs::hard_link(&first, folder.join(format!("{number}.png"))).unwrap();
    }
}

#[test]
fn many_pictures_take_no_more_than_a_few() {
    let directory = tempfile::tempdir().unwrap();
    let folders = [100, 3000].map(|num| {
        let folder = directory.path().join(num.to_string());
        write_pictures(&folder, num);
        folder
    });
    let verbs: [&[&str]; 4] =
        [&["info"], &["suggest"], &["import", "-o", "bag"], &["replay", "-o", "results"]];
    for verb in verbs {
        let peaks = folders.each_ref().map(|folder| {
            let place = tempfile::tempdir().unwrap();
            peak_kib(laser_profiler(verb).arg(folder).current_dir(place.path()))
        });
        eprintln!("{verb:?}: peak of 100 pictures {} KiB, of 3000 {} KiB", peaks[0], peaks[1]);
        assert!(peaks[1] < peaks[0] + SLACK_KIB, "{verb:?}: {peaks:?} KiB");
    }
}
