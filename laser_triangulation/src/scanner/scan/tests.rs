use super::*;
use proptest::prelude::*;

use crate::scanner::{
    axis::{AxisTravel, RawPosition},
    motion::Position,
};

fn profile(width: usize, z_m: f32) -> Profile {
    let mut profile = Profile::default();
    profile.reset(width);
    if z_m.is_finite() {
        profile.x_m.fill(0.5);
        profile.z_m.fill(z_m);
        profile.valid_count = width as u32;
    }
    profile
}

fn scan(slice_profiles: u32, scan_profiles: u32) -> Scan {
    let limits = ScanLimits { slice_profiles, slice_points: usize::MAX, scan_profiles };
    Scan::new(limits, String::new())
}

fn entry(profile: &Profile, frame_number: u64, frames_missing: u32) -> ScanEntry<'_> {
    let index = FrameIndex { frame_number, frames_missing, frames_rejected: 0 };
    let position_m = frame_number as f64 * 0.001;
    let located = Located {
        position: Position::at(RawPosition(position_m)),
        part_from_laser: Isometry3::translation(0.0, position_m, 0.0),
        travelled: AxisTravel::Metres(position_m),
        stands: false,
    };
    ScanEntry {
        profile,
        image_px: (64, 32),
        stamp_ns: frame_number as i64,
        located: Some(located),
        index,
    }
}

#[test]
fn a_full_slice_leaves_with_the_next_profile_and_the_last_one_is_marked() {
    let mut scan = scan(2, 100);
    let one = profile(3, 0.25);
    assert!(scan.push(&entry(&one, 0, 0)).slice.is_none());
    assert!(scan.push(&entry(&one, 1, 0)).slice.is_none());
    let done = scan.push(&entry(&one, 2, 0));
    let slice = done.slice.unwrap();
    assert_eq!((slice.width, slice.height, slice.stamp_ns, slice.points.len()), (3, 2, 0, 6));
    assert_eq!(slice.points[3], [0.5, 0.001, 0.25, 0.0]);
    assert!(!slice.account.last_slice && done.height_map.is_none());
    let done = scan.finish(0, 0);
    let (slice, map) = (done.slice.unwrap(), done.height_map.unwrap());
    assert_eq!((slice.height, slice.account.slice_index, slice.account.last_slice), (1, 1, true));
    assert_eq!((map.width, map.height, map.z_m.as_slice()), (3, 3, &[0.25; 9][..]));
    assert!(scan.finish(0, 0).slice.is_none(), "a scan ends once");
}

#[test]
fn another_length_or_the_limit_starts_another_scan() {
    let mut scan = scan(10, 2);
    let (narrow, wide) = (profile(3, 0.0), profile(4, 0.0));
    assert!(scan.push(&entry(&narrow, 0, 0)).slice.is_none());
    let done = scan.push(&entry(&wide, 1, 0));
    let first = done.slice.unwrap().account;
    assert_eq!((done.slice.unwrap().width, done.height_map.unwrap().width), (3, 3));
    assert!(scan.push(&entry(&wide, 2, 0)).slice.is_none());
    let done = scan.push(&entry(&wide, 3, 0));
    let second = done.slice.unwrap().account;
    assert_eq!(done.height_map.unwrap().height, 2);
    assert!(first.last_slice && second.last_slice && first.scan_id != second.scan_id);
}

#[test]
fn no_parameters_make_a_message_too_large() {
    let scan = scan(10_000, 1_000_000);
    for width in [1, 640, 2592, 65_535] {
        let points = |profiles: u32| u64::from(profiles) * u64::from(width);
        assert!(points(scan.scan_limit(width)) * 4 <= 1 << 30, "heights of {width} points");
        assert!(points(scan.slice_limit(width)) * 16 <= 1 << 30, "a slice of {width} points");
    }
    assert_eq!((scan.scan_limit(640), scan.slice_limit(2592)), (419_430, 10_000));
    assert_eq!((scan.scan_limit(1), scan.slice_limit(0)), (1_000_000, 10_000));
}

#[test]
fn a_slice_is_no_longer_than_its_scan() {
    let mut scan = scan(100, 2);
    let one = profile(3, 0.25);
    for number in 0..2 {
        assert!(scan.push(&entry(&one, number, 0)).slice.is_none());
    }
    let done = scan.push(&entry(&one, 2, 0));
    assert_eq!((done.slice.unwrap().height, done.height_map.unwrap().height), (2, 2));
    assert!(done.slice.unwrap().account.last_slice);
}

#[test]
fn a_slice_has_no_more_points_than_allowed_but_one_profile() {
    let mut scan = scan(100, 100);
    for (slice_points, expected) in [(9, 3), (8, 2), (3, 1), (2, 1)] {
        scan.limits.slice_points = slice_points;
        let one = profile(3, 0.25);
        let heights: Vec<u32> = (0..7)
            .filter_map(|number| scan.push(&entry(&one, number, 0)).slice.map(|slice| slice.height))
            .collect();
        assert!(!heights.is_empty() && heights.iter().all(|height| *height == expected));
        scan.finish(0, 0);
    }
}

#[test]
fn missing_points_are_nan_in_every_field() {
    let mut scan = scan(10, 10);
    scan.push(&entry(&profile(2, f32::NAN), 0, 0));
    let slice = scan.finish(0, 0).slice.unwrap();
    assert!(slice.points.iter().flatten().all(|value| value.is_nan()));
    assert_eq!((slice.account.profiles_empty, slice.account.points), (1, 0));
}

#[test]
fn a_slice_with_one_doubtful_position_is_degraded_and_the_next_is_not() {
    let mut scan = scan(2, 100);
    let one = profile(3, 0.25);
    let mut states = Vec::new();
    for number in 0..6 {
        let mut entry = entry(&one, number, u32::from(number == 3));
        entry.located.as_mut().unwrap().position.doubts = u8::from(number == 1);
        states.extend(scan.push(&entry).slice.map(|slice| slice.account.state));
    }
    states.extend(scan.finish(0, 0).slice.map(|slice| slice.account.state));
    assert_eq!(states, [SliceState::Degraded, SliceState::Gaps, SliceState::Complete]);
}

#[test]
fn points_and_heights_are_the_parts() {
    let quarter =
        nalgebra::UnitQuaternion::from_axis_angle(&Vector3::x_axis(), std::f64::consts::FRAC_PI_2);
    let part_from_laser = Isometry3::from_parts(Vector3::new(1.0, 2.0, 3.0).into(), quarter);
    let mut scan = scan(10, 10);
    let mut one = profile(2, 0.25);
    (one.x_m[1], one.z_m[1], one.valid_count) = (f32::NAN, f32::NAN, 1);
    let mut entry = entry(&one, 0, 0);
    entry.located.as_mut().unwrap().part_from_laser = part_from_laser;
    scan.push(&entry);
    let done = scan.finish(0, 0);
    let [x_m, y_m, z_m, _] = done.slice.unwrap().points[0];
    assert!((x_m - 1.5).abs() < 1e-6 && (y_m - 1.75).abs() < 1e-6 && (z_m - 3.0).abs() < 1e-6);
    let heights = &done.height_map.unwrap().z_m;
    assert!(heights[0] == z_m && heights[1].is_nan());
}

#[test]
fn counters_at_their_end_still_add_up() {
    let mut account = SliceAccount::default();
    for _ in 0..3 {
        account.count(1, u32::MAX - 5, 3);
        let SliceAccount { frames_accepted, frames_missing, frames_rejected, .. } = account;
        assert_eq!(account.frames_expected, frames_accepted + frames_missing + frames_rejected);
    }
    assert_eq!((account.frames_expected, account.frames_accepted), (u32::MAX, 2));
}

proptest! {
    /// Whatever is lost on the way, the accounts of the slices add up to what was sent.
    #[test]
    fn accounts_add_up(
        losses in prop::collection::vec((0..3_u32, 0..3_u32), 1..60),
        slice_profiles in 1..7_u32,
        (missing_at_the_end, rejected_at_the_end) in (0..3_u32, 0..3_u32),
    ) {
        let mut scan = scan(slice_profiles, 20);
        let one = profile(2, 0.0);
        let mut accounts: Vec<SliceAccount> = Vec::new();
        let mut number = 0;
        for &(missing, rejected) in &losses {
            number += u64::from(1 + missing + rejected);
            let mut entry = entry(&one, number, missing);
            entry.index.frames_rejected = rejected;
            accounts.extend(scan.push(&entry).slice.map(|slice| slice.account));
        }
        let end = scan.finish(missing_at_the_end, rejected_at_the_end);
        accounts.extend(end.slice.map(|slice| slice.account));
        for account in &accounts {
            prop_assert_eq!(
                account.frames_expected,
                account.frames_accepted + account.frames_missing + account.frames_rejected
            );
            prop_assert_eq!(
                u64::from(account.frames_expected),
                account.last_frame - account.first_frame + 1,
                "the range holds what is expected of it"
            );
            let complete = account.frames_missing + account.frames_rejected == 0;
            prop_assert_eq!(account.state == SliceState::Complete, complete);
        }
        let sum = |count: fn(&SliceAccount) -> u32| accounts.iter().map(count).sum::<u32>();
        prop_assert_eq!(sum(|a| a.frames_accepted), losses.len() as u32);
        let missing = losses.iter().map(|loss| loss.0).sum::<u32>() + missing_at_the_end;
        prop_assert_eq!(sum(|a| a.frames_missing), missing);
        let rejected = losses.iter().map(|loss| loss.1).sum::<u32>() + rejected_at_the_end;
        prop_assert_eq!(sum(|a| a.frames_rejected), rejected);
    }
}
