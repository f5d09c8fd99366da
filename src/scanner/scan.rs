//! Step 10: profiles pushed along the motion into slices of a scan.

use super::{height_map::HeightMap, pipeline::FrameIndex, profile::Profile};
use sha2::{Digest, Sha256};

/// A point of the part: x along the stripe, y along the motion, z up, metres in the scan frame; then the grey level at
/// the centreline as a share of full scale, 0 to 1. NaN in all four: not measured.
pub type Point = [f32; 4];

/// Worst state in a slice, as in `SliceInfo.state`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord)]
#[repr(u8)]
pub enum SliceState {
    /// Every expected frame is in.
    #[default]
    Complete = 0,
    /// Frames are missing or were rejected; positions are still right.
    Gaps = 1,
    /// Positions are in doubt.
    Degraded = 2,
    /// The scan ended early.
    Aborted = 3,
}

/// What a slice covers and what is missing from it: `expected = accepted + missing + rejected`, always.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct SliceAccount {
    /// Identity of the scan, a UUID of version 8 made from the stream: the same frames give the same bytes.
    pub scan_id: [u8; 16],
    /// Number of this slice in its scan, from 0.
    pub slice_index: u32,
    /// Whether the scan ends with this slice.
    pub last_slice: bool,
    /// Number of the first frame in the slice.
    pub first_frame: u64,
    /// Number of the last frame in the slice, inclusive.
    pub last_frame: u64,
    /// Position of the first profile along the scan, metres.
    pub first_position_m: f64,
    /// Position of the last profile along the scan, metres.
    pub last_position_m: f64,
    /// Frames that the range should hold.
    pub frames_expected: u32,
    /// Frames whose profile is in the slice.
    pub frames_accepted: u32,
    /// Frames that never reached the scanner.
    pub frames_missing: u32,
    /// Frames that reached it and were not used.
    pub frames_rejected: u32,
    /// Accepted frames without a single valid point.
    pub profiles_empty: u32,
    /// Valid points in the slice.
    pub points: u64,
    /// Worst state in the slice.
    pub state: SliceState,
}

/// Some consecutive profiles of a scan as an organised cloud.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Slice {
    /// Stamp of the first profile, nanoseconds.
    pub stamp_ns: i64,
    /// Points of a profile (columns of the cloud).
    pub width: u32,
    /// Profiles (rows of the cloud), 1 or more.
    pub height: u32,
    /// `height * width` points, profile after profile.
    pub points: Vec<Point>,
    /// What it covers and what is missing.
    pub account: SliceAccount,
}

/// A profile and where it belongs.
#[derive(Clone, Copy, Debug)]
pub struct Placed<'a> {
    /// The profile.
    pub profile: &'a Profile,
    /// Acquisition time of its frame, nanoseconds.
    pub stamp_ns: i64,
    /// Position along the scan, metres.
    pub position_m: f64,
    /// Which frame it is and what is missing before it.
    pub index: FrameIndex,
}

/// Stacks profiles. A scan is a sequence of profiles of one length; it ends with its last slice and its height map.
///
/// A full slice is handed out when the next profile arrives or the scan ends: only then is it known whether it is the
/// last one. Buffers are kept; nothing is allocated once a scan of a length has begun.
#[derive(Debug)]
pub struct Scan {
    slice_profiles: u32,
    max_profiles: u32,
    /// Makes scan ids of different calibrations differ.
    seed: String,
    open: Slice,
    closed: Slice,
    growing: HeightMap,
    finished: HeightMap,
}

/// What a push or the end completed.
#[derive(Clone, Copy, Debug, Default)]
pub struct Completed<'a> {
    /// A slice.
    pub slice: Option<&'a Slice>,
    /// The height map of a scan that ended with that slice.
    pub height_map: Option<&'a HeightMap>,
}

impl Scan {
    /// An empty scan of slices of `slice_profiles` profiles, which ends at `max_profiles`.
    pub fn new(slice_profiles: u32, max_profiles: u32, seed: String) -> Self {
        Self {
            slice_profiles,
            max_profiles,
            seed,
            open: Slice::default(),
            closed: Slice::default(),
            growing: HeightMap::default(),
            finished: HeightMap::default(),
        }
    }

    /// Adds a profile. A profile of another length ends the scan: geometries are never mixed.
    pub fn push(&mut self, placed: &Placed<'_>) -> Completed<'_> {
        let width = placed.profile.x_m.len() as u32;
        let ends = self.growing.height > 0
            && (self.growing.width != width || self.growing.height >= self.max_profiles);
        let full = self.open.height >= self.slice_profiles;
        if ends {
            self.end();
        } else if full {
            self.close_slice();
        }
        if self.growing.height == 0 {
            self.begin(width, placed);
        }
        self.add(placed);
        Completed {
            slice: (ends || full).then_some(&self.closed),
            height_map: ends.then_some(&self.finished),
        }
    }

    /// Ends the scan. `frames_rejected` arrived after the last profile and were refused.
    pub fn finish(&mut self, frames_rejected: u32) -> Completed<'_> {
        if self.growing.height == 0 {
            return Completed::default();
        }
        let account = &mut self.open.account;
        account.frames_rejected += frames_rejected;
        account.frames_expected += frames_rejected;
        self.end();
        Completed { slice: Some(&self.closed), height_map: Some(&self.finished) }
    }

    fn begin(&mut self, width: u32, placed: &Placed<'_>) {
        let profiles = self.max_profiles as usize;
        self.growing.width = width;
        self.growing.stamp_ns = placed.stamp_ns;
        self.growing.z_m.reserve_exact(profiles * width as usize);
        self.open
            .points
            .reserve_exact(self.slice_profiles.min(self.max_profiles) as usize * width as usize);
        self.open.account =
            SliceAccount { scan_id: self.scan_id(width, placed), ..SliceAccount::default() };
    }

    fn add(&mut self, placed: &Placed<'_>) {
        let Placed { profile, stamp_ns, position_m, index } = *placed;
        let slice = &mut self.open;
        let account = &mut slice.account;
        let lost = index.frames_missing + index.frames_rejected;
        if slice.height == 0 {
            slice.stamp_ns = stamp_ns;
            slice.width = profile.x_m.len() as u32;
            account.first_frame = index.frame_number.saturating_sub(lost.into());
            account.first_position_m = position_m;
        }
        slice.height += 1;
        account.last_frame = index.frame_number;
        account.last_position_m = position_m;
        account.frames_accepted += 1;
        account.frames_missing += index.frames_missing;
        account.frames_rejected += index.frames_rejected;
        account.frames_expected += 1 + lost;
        account.profiles_empty += u32::from(profile.valid_count == 0);
        account.points += u64::from(profile.valid_count);
        slice.points.extend((0..profile.x_m.len()).map(|i| {
            match (profile.x_m[i], profile.z_m[i]) {
                (x_m, z_m) if z_m.is_finite() => {
                    [x_m, position_m as f32, z_m, profile.intensity[i]]
                }
                _ => [f32::NAN; 4],
            }
        }));
        self.growing.height += 1;
        self.growing.z_m.extend_from_slice(&profile.z_m);
    }

    fn close_slice(&mut self) {
        let account = &mut self.open.account;
        if account.frames_missing + account.frames_rejected > 0 {
            account.state = account.state.max(SliceState::Gaps);
        }
        let next = SliceAccount {
            scan_id: account.scan_id,
            slice_index: account.slice_index + 1,
            ..SliceAccount::default()
        };
        std::mem::swap(&mut self.open, &mut self.closed);
        self.open.points.clear();
        self.open.points.reserve_exact(self.closed.points.capacity());
        self.open.height = 0;
        self.open.account = next;
    }

    fn end(&mut self) {
        self.open.account.last_slice = true;
        self.close_slice();
        std::mem::swap(&mut self.growing, &mut self.finished);
        self.growing.z_m.clear();
        self.growing.height = 0;
    }

    /// A UUID of version 8 (RFC 9562): a hash of where and when the scan began, so that a replay gives the same one.
    fn scan_id(&self, width: u32, placed: &Placed<'_>) -> [u8; 16] {
        let mut hash = Sha256::new();
        hash.update(self.seed.as_bytes());
        hash.update(placed.stamp_ns.to_le_bytes());
        hash.update(placed.index.frame_number.to_le_bytes());
        hash.update(width.to_le_bytes());
        let mut id = [0; 16];
        id.copy_from_slice(&hash.finalize()[..16]);
        id[6] = id[6] & 0x0f | 0x80;
        id[8] = id[8] & 0x3f | 0x80;
        id
    }
}

#[cfg(test)]
#[allow(clippy::float_cmp, reason = "the values are exact")]
mod tests {
    use super::*;
    use proptest::prelude::*;

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

    fn placed(profile: &Profile, frame_number: u64, frames_missing: u32) -> Placed<'_> {
        let index = FrameIndex { frame_number, frames_missing, frames_rejected: 0 };
        Placed {
            profile,
            stamp_ns: frame_number as i64,
            position_m: frame_number as f64 * 0.001,
            index,
        }
    }

    #[test]
    fn a_full_slice_leaves_with_the_next_profile_and_the_last_one_says_so() {
        let mut scan = Scan::new(2, 100, String::new());
        let one = profile(3, 0.25);
        assert!(scan.push(&placed(&one, 0, 0)).slice.is_none());
        assert!(scan.push(&placed(&one, 1, 0)).slice.is_none());
        let done = scan.push(&placed(&one, 2, 0));
        let slice = done.slice.unwrap();
        assert_eq!((slice.width, slice.height, slice.stamp_ns, slice.points.len()), (3, 2, 0, 6));
        assert_eq!(slice.points[3], [0.5, 0.001, 0.25, 0.0]);
        assert!(!slice.account.last_slice && done.height_map.is_none());
        let done = scan.finish(0);
        let (slice, map) = (done.slice.unwrap(), done.height_map.unwrap());
        assert_eq!(
            (slice.height, slice.account.slice_index, slice.account.last_slice),
            (1, 1, true)
        );
        assert_eq!((map.width, map.height, map.z_m.as_slice()), (3, 3, &[0.25; 9][..]));
        assert!(scan.finish(0).slice.is_none(), "a scan ends once");
    }

    #[test]
    fn another_length_or_the_limit_starts_another_scan() {
        let mut scan = Scan::new(10, 2, String::new());
        let (narrow, wide) = (profile(3, 0.0), profile(4, 0.0));
        assert!(scan.push(&placed(&narrow, 0, 0)).slice.is_none());
        let done = scan.push(&placed(&wide, 1, 0));
        let first = done.slice.unwrap().account;
        assert_eq!((done.slice.unwrap().width, done.height_map.unwrap().width), (3, 3));
        assert!(scan.push(&placed(&wide, 2, 0)).slice.is_none());
        let done = scan.push(&placed(&wide, 3, 0));
        let second = done.slice.unwrap().account;
        assert_eq!(done.height_map.unwrap().height, 2);
        assert!(first.last_slice && second.last_slice && first.scan_id != second.scan_id);
    }

    #[test]
    fn missing_points_are_nan_in_every_field() {
        let mut scan = Scan::new(10, 10, String::new());
        scan.push(&placed(&profile(2, f32::NAN), 0, 0));
        let slice = scan.finish(0).slice.unwrap();
        assert!(slice.points.iter().flatten().all(|value| value.is_nan()));
        assert_eq!((slice.account.profiles_empty, slice.account.points), (1, 0));
    }

    proptest! {
        /// Whatever is lost on the way, the accounts of the slices add up to what was sent.
        #[test]
        fn accounts_add_up(
            losses in prop::collection::vec((0..3_u32, 0..3_u32), 1..60),
            slice_profiles in 1..7_u32,
            rejected_at_the_end in 0..3_u32,
        ) {
            let mut scan = Scan::new(slice_profiles, 20, String::new());
            let one = profile(2, 0.0);
            let mut accounts: Vec<SliceAccount> = Vec::new();
            let mut number = 0;
            for &(missing, rejected) in &losses {
                number += u64::from(1 + missing + rejected);
                let mut placed = placed(&one, number, missing);
                placed.index.frames_rejected = rejected;
                accounts.extend(scan.push(&placed).slice.map(|slice| slice.account));
            }
            accounts.extend(scan.finish(rejected_at_the_end).slice.map(|slice| slice.account));
            for account in &accounts {
                prop_assert_eq!(
                    account.frames_expected,
                    account.frames_accepted + account.frames_missing + account.frames_rejected
                );
                let complete = account.frames_missing + account.frames_rejected == 0;
                prop_assert_eq!(account.state == SliceState::Complete, complete);
            }
            let sum = |count: fn(&SliceAccount) -> u32| accounts.iter().map(count).sum::<u32>();
            prop_assert_eq!(sum(|a| a.frames_accepted), losses.len() as u32);
            prop_assert_eq!(sum(|a| a.frames_missing), losses.iter().map(|loss| loss.0).sum::<u32>());
            let rejected = losses.iter().map(|loss| loss.1).sum::<u32>() + rejected_at_the_end;
            prop_assert_eq!(sum(|a| a.frames_rejected), rejected);
        }
    }
}
